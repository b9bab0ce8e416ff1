"""Files of annotated instructions: those of the package, and a check for any."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.resources import files
from pathlib import Path

from scenewright.backends.builtin.reader.annotation import (
    MENTIONS,
    PAIRS,
    AnnotatedText,
    AnnotationError,
    parse_annotation,
)
from scenewright.backends.builtin.reader.labels import label_of
from scenewright.errors import InputError

_NEEDS_SUBJECT = frozenset(("from", "to", "heading", "cw", "left", "right", "straight", "uturn"))


def list_package_files() -> list[Path]:
    """The package's own files of annotated instructions, in order."""
    folder = Path(str(files("scenewright.backends.builtin.training"))) / "instructions"
    return sorted(folder.glob("*.txt"))


def read_corpus(paths: Sequence[Path]) -> list[AnnotatedText]:
    """The annotated rows of some files; blank lines and lines that begin with # are left out.

    Raises:
        InputError: a file cannot be read, or holds a line that is no annotation.
    """
    rows = []
    for path in paths:
        for number, line in _lines(path):
            try:
                rows.append(parse_annotation(line))
            except AnnotationError as error:
                raise InputError(f"{path}, line {number}: {error}") from error
    return rows


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    try:
        text = path.read_text("utf-8")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot read {path}: {reason}") from error
    for number, line in enumerate(text.split("\n"), start=1):
        if line.strip() and not line.startswith("#"):
            yield number, line.strip()


def find_faults(path: Path) -> Iterator[str]:
    """What is wrong with the lines of a file, each with its number.

    Raises:
        InputError: the file cannot be read.
    """
    for number, line in _lines(path):
        try:
            row = parse_annotation(line)
        except AnnotationError as error:
            yield f"line {number}: {error}"
            continue
        for fault in find_row_faults(row):
            yield f"line {number}: {fault}"


def find_row_faults(row: AnnotatedText) -> Iterator[str]:
    """What is wrong with the marks of a row."""
    known: list[int] = []
    for span in row.spans:
        words = row.text[span.start : span.end]
        try:
            label_of(span)
        except KeyError:
            yield f"[{span.tag} {words}] has no value that this tag can have"
        if span.tag in MENTIONS:
            known += span.subjects
            if not span.subjects:
                yield f"[{span.tag} {words}] needs a number"
        elif span.tag in _NEEDS_SUBJECT and not span.subjects and not span.negated:
            yield f"[{span.tag} {words}] needs who, as in [{span.tag}:1 {words}]"
        elif span.tag in PAIRS and not span.negated and not (span.subjects and span.objects):
            yield f"[{span.tag} {words}] needs who>whom, as in [{span.tag}:1>2 {words}]"
    said = {number for span in row.spans for number in (*span.subjects, *span.objects)}
    if unknown := sorted(said - set(known)):
        yield f"no mention introduces {', '.join(map(str, unknown))}; tag its first mention"
    if len(set(known)) < len(known):
        yield "a number is introduced twice; later mentions are [ref:1 ...]"
