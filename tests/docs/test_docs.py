"""What the pages tell a reader to type works, and what they link to is there."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from inline_jobs import run_jobs_inline
from scenewright.cli.main import main

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]
PAGES += sorted((ROOT / "docs").rglob("*.md"))
PAGES += sorted((ROOT / "skills").rglob("*.md"))
BIN = Path(sys.executable).parent
LONGEST = 120.0
"""A documented command may take this long on a busy machine [s]."""

_BLOCK = re.compile(r"^```(?:console|bash)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_FENCED = re.compile(r"^```.*?^```$", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
_TRACKS = re.compile(r"^```csv\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_PLANS = re.compile(r"^```yaml\n# (\w+\.yaml)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_MODULE = re.compile(
    r"`((?:authoring|backends|cli|dataset|driving|evals|geometry|graph|intersections|memory|nodes|scene|tools"
    r"|viz)/[\w/.-]+)`"
)
_LAB = re.compile(r"python -m\s+(lab(?:\.\w+)+)")
_VARIABLES_FOR_MODELS = ("API_KEY", "BASE_URL", "TOKEN")


def commands(page: Path, program: str) -> list[str]:
    """The lines of a page's shell blocks that call the program, `\\`-continued ones joined."""
    lines = "".join(_BLOCK.findall(page.read_text("utf-8"))).replace("\\\n", " ").splitlines()
    typed = (line.strip().removeprefix("$ ") for line in lines)
    return [line for line in typed if line.startswith(f"{program} ")]


def links(page: Path) -> list[str]:
    prose = _FENCED.sub("", page.read_text("utf-8"))
    targets = (target.split("#")[0] for target in _LINK.findall(prose))
    return [target for target in targets if target and "://" not in target]


def test_every_extra_that_is_named_exists() -> None:
    known = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    files = [*PAGES, *(ROOT / "src").rglob("*.py"), ROOT / "Makefile"]
    text = "\n".join(each.read_text("utf-8") for each in files)
    named = {
        *re.findall(r"scenewright\[(\w+)\]", text),
        *re.findall(r"require_extra\(\s*\"(\w+)\"", text),
        *re.findall(r"\(extras? `(\w+)`\)", text),
    }
    assert {"learn", "maps", "page", "exports"} <= named
    assert named <= known["optional-dependencies"].keys()


def example_tracks() -> str:
    """The example of a CSV of tracks, which the pages call tracks.csv."""
    (example,) = _TRACKS.findall((ROOT / "docs" / "formats.md").read_text("utf-8"))
    return str(example)


def offline() -> dict[str, str]:
    """The environment without keys, and with a proxy that nobody listens at."""
    kept = {k: v for k, v in os.environ.items() if not k.endswith(_VARIABLES_FOR_MODELS)}
    nowhere = dict.fromkeys(("http_proxy", "https_proxy", "all_proxy"), "http://127.0.0.1:9")
    return kept | nowhere


def run_process(words: list[str], folder: Path) -> int:
    """The exit code of a command in a process of its own that has nothing to read."""
    (folder / "data").mkdir(exist_ok=True)
    done = subprocess.run(
        [str(BIN / "scenewright"), *words],
        cwd=folder,
        env=offline() | {"SCENEWRIGHT_DATA": str(folder / "data")},
        stdin=subprocess.DEVNULL,
        timeout=LONGEST,
        check=False,
    )
    return done.returncode


def pages_with(program: str) -> list[Path]:
    return [page for page in PAGES if page.parent.name != "tutorials" and commands(page, program)]


@pytest.mark.parametrize("page", pages_with("scenewright"), ids=lambda page: page.name)
def test_documented_commands_run(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "tracks.csv").write_text(example_tracks())
    for name, plan in _PLANS.findall(page.read_text("utf-8")):
        (tmp_path / name).write_text(plan)
    monkeypatch.chdir(tmp_path)
    run_jobs_inline(monkeypatch)
    (tmp_path / "data").mkdir(exist_ok=True)
    monkeypatch.setenv("SCENEWRIGHT_DATA", str(tmp_path / "data"))
    for name in os.environ.keys() - offline().keys():
        monkeypatch.delenv(name)
    for command in commands(page, "scenewright"):
        words = shlex.split(command, comments=True)[1:]
        with open(os.devnull, encoding="utf-8") as nothing:
            monkeypatch.setattr(sys, "stdin", nothing)
            # A start for each command would cost more than all that they do.
            code = run_process(words, tmp_path) if words[0] == "mcp" else main(words)
        assert code == 0, command


@pytest.mark.parametrize("page", pages_with("make"), ids=lambda page: page.name)
def test_documented_targets_exist(page: Path) -> None:
    targets = set(
        re.findall(r"^([a-z][a-z-]*):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
    )
    for command in commands(page, "make"):
        words = [word for word in shlex.split(command, comments=True)[1:] if "=" not in word]
        assert set(words) <= targets, command


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files(page: Path) -> None:
    assert [target for target in links(page) if not (page.parent / target).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_modules_that_are_named_exist(page: Path) -> None:
    text = page.read_text("utf-8")
    files = [ROOT / "src" / "scenewright" / name for name in _MODULE.findall(text)]
    files += [ROOT / f"{name.replace('.', '/')}.py" for name in _LAB.findall(text)]
    assert [file for file in files if not file.exists()] == []
