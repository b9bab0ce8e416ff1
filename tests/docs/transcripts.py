"""Conversations that the pages show. `python tests/docs/transcripts.py` writes them anew."""

from __future__ import annotations

import io
import os
import re
import shlex
import tempfile
from contextlib import chdir, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

from scenewright.cli.main import main

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
_SHOWN = re.compile(
    r"^```bash\n(?P<command>scenewright chat [^\n]*)\n```$(?:(?!^```).)*?"
    r"^```text\n(?P<talk>(?P<name>\S+)> .*?)^```$",
    re.DOTALL | re.MULTILINE,
)


@dataclass(frozen=True)
class Talk:
    """A command, what is typed then, and what is answered to each line; to the last, if shown."""

    page: Path
    command: str
    prompt: str
    typed: list[str]
    told: list[list[str]]
    text: str


def shown(page: Path) -> list[Talk]:
    """The conversations of a page."""
    found = []
    for each in _SHOWN.finditer(page.read_text("utf-8")):
        prompt, typed, told = f"{each['name']}> ", list[str](), list[list[str]]()
        for line in each["talk"].splitlines():
            if line.startswith(prompt):
                typed.append(line.removeprefix(prompt))
                told.append([])
            else:
                told[-1].append(line)
        found.append(Talk(page, each["command"], prompt, typed, told, each["talk"]))
    return found


def said(command: str, typed: list[str], folder: Path) -> list[str]:
    """What the command answers to these lines, told in that folder."""
    hidden = ("API_KEY", "BASE_URL", "TOKEN", "SCENEWRIGHT_REFINER", "SCENEWRIGHT_MAX_AGENTS")
    (folder / "data").mkdir(exist_ok=True)
    given = io.BytesIO("".join(f"{line}\n" for line in typed).encode())
    lines = io.TextIOWrapper(given, encoding="utf-8")
    told = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True)
    with chdir(folder), redirect_stdout(told), patch("sys.stdin", lines), patch.dict(os.environ):
        for key in [each for each in os.environ if each.endswith(hidden)]:
            del os.environ[key]
        os.environ["SCENEWRIGHT_DATA"] = str(folder / "data")
        assert main(shlex.split(command)[1:]) == 0
    told.seek(0)
    return told.read().splitlines()


def anew(talk: Talk) -> str:
    """The conversation as it is today; each line is a run of its own in the same thread."""
    lines = []
    with tempfile.TemporaryDirectory() as folder:
        for words, told in zip(talk.typed, talk.told, strict=True):
            lines.append(f"{talk.prompt}{words}")
            lines += said(talk.command, [words], Path(folder)) if told else []
    return "".join(f"{line}\n" for line in lines)


if __name__ == "__main__":
    for page in PAGES:
        text = page.read_text("utf-8")
        for talk in shown(page):
            text = text.replace(talk.text, anew(talk))
        page.write_text(text, encoding="utf-8")
