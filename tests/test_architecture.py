"""The floors hold, importing is cheap, and the public surface is the one we promised."""

from __future__ import annotations

import importlib
import subprocess
import sys
from pathlib import Path

import grimp

import scenewright

ROOT = Path(__file__).parents[1]
PACKAGE = Path(scenewright.__file__).parent
HEAVY = {"torch", "sklearn", "ortools", "rerun", "matplotlib", "openai", "anthropic", "httpx"}


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
        "plan",
        "synthesize",
        "verify",
    ]
    assert all(getattr(scenewright, name) is not None for name in scenewright.__all__)
