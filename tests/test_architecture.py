"""The floors hold, importing is cheap, and the public surface is the one we promised."""

from __future__ import annotations

import importlib
import subprocess
import sys
import tomllib
from graphlib import TopologicalSorter
from pathlib import Path

import grimp

import scenewright

ROOT = Path(__file__).parents[1]
PACKAGE = Path(scenewright.__file__).parent
HEAVY = {"torch", "sklearn", "rerun", "matplotlib", "openai", "anthropic", "httpx"}


def test_floors_hold() -> None:
    checked = subprocess.run(
        [str(Path(sys.executable).parent / "lint-imports"), "--no-cache"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_the_checker_knows_only_the_vocabulary() -> None:
    graph = grimp.build_graph("scenewright", cache_dir=None)
    checker = "scenewright.tools.relation_checker"
    modules = {checker, *graph.find_descendants(checker)}
    imported = set().union(*map(graph.find_modules_directly_imported_by, modules)) - modules
    assert {name.split(".")[1] for name in imported} <= {"scene", "errors", "compiled"}


def test_packages_hold_what_they_list_as_public() -> None:
    names = [f"scenewright.{path.parent.name}" for path in PACKAGE.glob("*/__init__.py")]
    names += [
        ".".join(path.parent.relative_to(PACKAGE.parent).parts)
        for path in PACKAGE.glob("*/*/__init__.py")
    ]
    for module in map(importlib.import_module, names):
        assert [each for each in getattr(module, "__all__", ()) if not hasattr(module, each)] == []


def count_lines(folder: Path) -> int:
    return sum(len(file.read_text("utf-8").splitlines()) for file in folder.rglob("*.py"))


def test_no_room_outgrows_its_lines() -> None:
    """A change that needs more raises the number in `room_lines.toml`, and says why."""
    allowed = tomllib.loads(Path(__file__).with_name("room_lines.toml").read_text("utf-8"))
    folders = [PACKAGE, *PACKAGE.glob("*/"), *PACKAGE.glob("*/*/")]
    rooms = {
        folder.relative_to(PACKAGE).as_posix(): lines
        for folder in folders
        if "__pycache__" not in folder.parts and (lines := count_lines(folder))
    }
    assert rooms.keys() == allowed.keys()
    assert {room: lines for room, lines in rooms.items() if lines > allowed[room]} == {}


def test_no_module_imports_one_that_imports_it() -> None:
    """Faces of packages aside, which name what their modules hold."""
    graph = grimp.build_graph("scenewright", cache_dir=None)
    modules = {module for module in graph.modules if not graph.find_children(module)}
    imports = {
        module: graph.find_modules_directly_imported_by(module) & modules for module in modules
    }
    TopologicalSorter(imports).prepare()  # raises CycleError with the modules of a cycle


def test_the_lab_stays_small_and_outside() -> None:
    assert count_lines(ROOT / "lab") <= 8000
    importing = "import lab", "from lab"
    assert [
        file.name
        for file in PACKAGE.rglob("*.py")
        if any(line.lstrip().startswith(importing) for line in file.read_text("utf-8").splitlines())
    ] == []


def test_import_loads_nothing_heavy() -> None:
    script = "import sys, scenewright; print(*{name.split('.')[0] for name in sys.modules})"
    loaded = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert not HEAVY & set(loaded.stdout.split())


def test_public_surface() -> None:
    assert sorted(scenewright.__all__) == [
        "IntersectionMap",
        "Scene",
        "SocialGraph",
        "__version__",
        "drive",
        "drive_many",
        "export",
        "load_backend",
        "load_intersection",
        "load_tracks",
        "plan",
        "synthesize",
        "verify",
        "verify_tracks",
    ]
    assert all(getattr(scenewright, name) is not None for name in scenewright.__all__)
