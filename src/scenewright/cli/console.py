"""What goes to the terminal: results to stdout, everything said to people to stderr."""

from __future__ import annotations

import json
import os
import sys
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TextIO

from scenewright.cli.interrupts import stop_if_asked

ProgressCallback = Callable[[str, str], None]
LONGEST_LINE = 600
_STAGES = {
    "scene_planner": "planning",
    "agent_generator": "drawing agents",
    "waypoint_filter": "solving",
    "event_reasoner": "reasoning",
    "trajectory_refiner": "refining",
    "scene_verifier": "checking",
}


class ReaderGoneError(Exception):
    """The reader of stdout has closed it."""


def format_one_line(text: str, *, limit: int = LONGEST_LINE) -> str:
    """The text on one line that cannot steer a terminal, at most `limit` long."""
    kept = "".join(c if unicodedata.category(c)[0] != "C" else " " for c in text[: 4 * limit])
    line = " ".join(kept.split())
    return line if len(line) <= limit else line[: limit - 1] + "…"


def count(number: int, noun: str) -> str:
    """`1 file`, `2 files`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def shorten(lines: Sequence[str], most: int) -> list[str]:
    """The first lines, and how many more there are."""
    more = len(lines) - most
    return [*lines[:most], f"and {more} more"] if more > 0 else list(lines)


def log_line(line: str) -> None:
    """Writes one line to stderr; a closed or full stderr is ignored."""
    if sys.stderr is None:
        return
    try:
        print(line, file=sys.stderr, flush=True)
    except (OSError, ValueError):
        return


def write_stdout(text: str) -> None:
    """Text to stdout, at once, as UTF-8 whatever the locale; paths keep their bytes.

    Raises:
        ReaderGoneError: stdout is closed.
        OSError: stdout cannot be written.
    """
    if sys.stdout is None:
        return
    try:
        sys.stdout.flush()
        sys.stdout.buffer.write(text.encode("utf-8", "surrogateescape"))
        sys.stdout.buffer.flush()
    except BrokenPipeError as error:
        abandon_stdout()
        raise ReaderGoneError from error
    except OSError:
        abandon_stdout()
        raise


def write_json(value: Mapping[str, Any]) -> None:
    """One JSON object on one line to stdout."""
    write_stdout(json.dumps(value, allow_nan=False) + "\n")


@dataclass(frozen=True, eq=False)
class Result:
    """What came of a command.

    Attributes:
        facts: the object of `--json`, with `ok` unless it says else; text: stdout without.
        summary: lines for people on stderr, but with --quiet; notes: lines that are always said.
        code: of the process.
    """

    facts: Mapping[str, Any]
    text: str | Callable[[], str]
    summary: Iterable[str] = ()
    notes: Iterable[str] = ()
    code: int = 0


def show_result(result: Result, *, quiet: bool, as_json: bool) -> None:
    """To stdout either the facts as one object or the text; to stderr what is said to people."""
    if as_json:
        write_json({"ok": True, **result.facts})
    else:
        write_stdout(result.text if isinstance(result.text, str) else result.text())
    tell([*(() if quiet else result.summary), *result.notes])


def tell(lines: Iterable[str]) -> None:
    """Lines to stderr, each on one line; one that is indented stays so."""
    for line in lines:
        log_line(("  " if line.startswith(" ") else "") + format_one_line(line))


def abandon_stdout() -> None:
    """Keeps the interpreter from flushing the rest into a stdout that takes nothing."""
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
    except (OSError, ValueError):
        return


_COLOURS = {"red": 31, "green": 32, "yellow": 33, "dim": 2}


def paint(line: str, style: str) -> str:
    """A line of stdout in a colour, or dim, where a terminal shows it; a style of "" is plain."""
    if not style or not is_terminal(sys.stdout) or os.environ.get("NO_COLOR"):
        return line
    return f"\x1b[{_COLOURS[style]}m{line}\x1b[0m"


def format_columns(titles: Sequence[str], rows: Sequence[Sequence[str]], *, right: Set[str]) -> str:
    """Plain text in columns, of any width: what reads a pipe can cut lines, but cannot mend them.

    Args:
        right: titles of the columns whose cells end, not begin, at one place.
    """
    widths = [max(map(len, column)) for column in zip(titles, *rows, strict=True)]
    pads = [str.rjust if title in right else str.ljust for title in titles]
    lines = [
        "   ".join(pad(cell, width) for pad, cell, width in zip(pads, row, widths, strict=True))
        for row in (titles, *rows)
    ]
    lines.insert(1, "─" * len(lines[0]))
    return "\n" + "".join(f" {line}".rstrip() + "\n" for line in lines) + "\n"


def is_terminal(stream: TextIO | None) -> bool:
    """Whether a person looks at the stream."""
    try:
        return stream is not None and stream.isatty()
    except ValueError:
        return False


@contextmanager
def show_progress(*, quiet: bool) -> Iterator[ProgressCallback]:
    """Shows the progress of a run: a changing line on a terminal, plain lines elsewhere.

    Every line is also a moment at which a run that shall stop does.
    """
    if quiet:
        yield _stop_on_interrupt(lambda *_: None)
    elif is_terminal(sys.stderr):
        say_if_new()
        with _show_spinner() as log:
            yield _stop_on_interrupt(log)
    else:
        yield _stop_on_interrupt(_ProgressLines())


def say_if_new() -> None:
    """Say why the first scene takes longer, where nothing is compiled yet."""
    from scenewright.compiled import has_cache

    if not has_cache():
        log_line("compiling the innermost loops, once after an installation: about a minute")


def _stop_on_interrupt(log: ProgressCallback) -> ProgressCallback:
    def log_or_stop(stage: str, line: str) -> None:
        stop_if_asked()
        log(stage, line)

    return log_or_stop


class _ProgressLines:
    """Says what happens, a refusal only if the run goes on: the last one is the run's answer."""

    def __init__(self) -> None:
        self._held: str | None = None

    def __call__(self, stage: str, line: str) -> None:
        words = _format_stage(stage, format_one_line(line))
        if self._held is not None:
            log_line(self._held)
        self._held = words if line.startswith("refused") else None
        if self._held is None:
            log_line(words)


@contextmanager
def _show_spinner() -> Iterator[ProgressCallback]:
    from rich.console import Console
    from rich.text import Text

    with Console(stderr=True).status(Text("starting")) as status:
        yield lambda stage, line: status.update(
            Text(_format_stage(stage, format_one_line(line, limit=100)))
        )


def _format_stage(stage: str, line: str) -> str:
    return f"{_STAGES.get(stage, stage)}: {line}" if stage else line
