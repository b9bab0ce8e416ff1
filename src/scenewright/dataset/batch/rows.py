"""The rows of a batch: read as a stream, refused by line number, given safe folder names."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError

from scenewright.errors import InputError
from scenewright.scene.base import Model, is_left_out
from scenewright.scene.plan_file import PlanFile, compute_digest, read_plan
from scenewright.scene.social import Background, Density, TimeOfDay

MOST_LINE = 1 << 20
"""Longest line of an input [bytes]: an instruction, not a book."""
_LONGEST_QUOTE = 60
_SLUG = 40
_PLAIN = re.compile(r"[A-Za-z0-9](?:[A-Za-z0-9._-]{0,78}[A-Za-z0-9_-])?")
_HASHED = re.compile(r"-[0-9a-f]{16}$", re.IGNORECASE)
_RESERVED = frozenset(
    ["con", "prn", "aux", "nul", *(f"{name}{k}" for name in ("com", "lpt") for k in range(10))]
)
"""Names that some system keeps for devices, whatever follows the first dot."""
_OURS = frozenset(
    ("tables", "figures", "journal", "manifest", "readme", "rows", "order", "report",
     "evaluation", "croissant", "joined")
)  # fmt: skip
"""First parts of the names that stand beside the scenes' folders."""
_FORMS = 'a line is an object such as {"id": "a-1", "text": "A car yields"}, or all are sentences'


class Overrides(Model):
    """What a row sets, whatever its text and the run's options say; None leaves it.

    Attributes:
        intersection, selection, refiner: as the options of those names.
        density, time_of_day, background: the scene's context.
    """

    intersection: str | None = Field(default=None, max_length=80)
    selection: Literal["draw", "map"] | None = None
    refiner: str | None = Field(default=None, max_length=40)
    density: Density | None = None
    time_of_day: TimeOfDay | None = None
    background: Background | None = None

    @property
    def context(self) -> dict[str, Any]:
        """Those of the scene's context that are set."""
        return self.model_dump(
            mode="json", include={"density", "time_of_day", "background"}, exclude_none=True
        )


class DatasetRow(Model):
    """One line of the input; `voice` names the manner or author of the text, if its author does.

    Attributes:
        plan: in place of `text`: a plan, or the name of its file, from the input's folder on.
    """

    id: str = Field(min_length=1, max_length=2000)
    text: str = ""
    plan: str | dict[str, Any] | None = Field(default=None, exclude_if=is_left_out)
    voice: str | None = Field(default=None, min_length=1, max_length=80)
    seed: int | None = Field(default=None, ge=0, le=2**63 - 1, strict=True)
    overrides: Overrides = Overrides()


@dataclass(frozen=True)
class Named:
    """A row with its place: `number` counts rows from 0, `line` lines of the file from 1.

    Attributes:
        plan: what the row has in place of a text.
    """

    row: DatasetRow
    plan: PlanFile | None
    number: int
    line: int
    folder: str


@dataclass(frozen=True)
class RowSource:
    """An input that was read once from end to end and is in order.

    Attributes:
        path: of the file; sha256: of its bytes and those of the plans that it names; rows: how
            many there are.
        clashing: names in lower case that more than one row's id has.
    """

    path: Path
    sha256: str
    rows: int
    clashing: frozenset[str]

    def __iter__(self) -> Iterator[Named]:
        for number, (line, row) in enumerate(_read(self.path)):
            folder = choose_folder(row.id, clashing=self.clashing)
            yield Named(row, read_row_plan(row, self.path), number, line, folder)


def choose_folder(identity: str, *, clashing: frozenset[str] = frozenset()) -> str:
    """The folder of a row: its id where that is a plain file name anywhere, else one made from it.

    Names differ by more than case, stay below 81 characters and never leave the folder they are in.
    """
    low = identity.lower()
    if _PLAIN.fullmatch(identity) and not _HASHED.search(identity) and low not in clashing:
        first = low.split(".")[0]
        if first not in _RESERVED | _OURS and not first.startswith("journal-"):
            return identity
    slug = re.sub(r"[^a-z0-9]+", "-", low)[:_SLUG].strip("-") or "row"
    digest = hashlib.sha256(identity.encode("utf-8", "surrogatepass")).hexdigest()[:16]
    return f"{slug}-{digest}"


def choose_seed(row: DatasetRow, *, seed: int) -> int:
    """The row's seed: its own, else one that the run's seed and the row's id decide."""
    if row.seed is not None:
        return row.seed
    text = f"{seed}\n{row.id}".encode("utf-8", "surrogatepass")
    return int.from_bytes(hashlib.sha256(text).digest()[:6], "big")


def read_source(path: str | Path) -> RowSource:
    """Reads a whole input once, keeping the ids of its rows.

    Raises:
        InputError: unreadable, no rows, a line that is no row, or an id twice; names the line.
    """
    file = Path(path)
    if file.exists() and not file.is_file():
        raise InputError(f"cannot read {file}: rows are read more than once, so from a plain file")
    lines: dict[str, int] = {}
    clashing, lowered, plans = set[str](), set[str](), list[str]()
    for line, row in _read(file):
        if (first := lines.setdefault(row.id, line)) != line:
            raise InputError(
                f"{file}, line {line}: the id {_quote(row.id)} is that of "
                f"line {first}; every row needs an id of its own"
            )
        if (low := row.id.lower()) in lowered:
            clashing.add(low)
        lowered.add(low)
        try:
            given = read_row_plan(row, file)
        except InputError as error:
            raise InputError(f"{file}, line {line}: {error}") from error
        if given is not None and isinstance(row.plan, str):
            plans.append(compute_digest(given.plan, f"{given.as_read} {given.text}"))
    if not lines:
        raise InputError(f"{file} holds no rows; {_FORMS}")
    with file.open("rb") as stream:
        sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
    if plans:
        named = hashlib.sha256("".join(plans).encode()).hexdigest()
        sha256 = hashlib.sha256(f"{sha256} {named}".encode()).hexdigest()
    return RowSource(file, sha256, len(lines), frozenset(clashing))


def read_row_plan(row: DatasetRow, file: Path) -> PlanFile | None:
    """The plan of a row; None where it has a text.

    Raises:
        InputError: it is no plan; names the line and field of its file, or the field.
    """
    if row.plan is None or isinstance(row.plan, dict):
        return None if row.plan is None else read_plan(row.plan)
    return read_plan(file.parent / row.plan)


def _read(file: Path) -> Iterator[tuple[int, DatasetRow]]:
    """(line, row), blank lines left out; a file that does not begin as JSON lists sentences."""
    try:
        with file.open("rb") as stream:
            line, first = 0, b""
            while data := stream.readline(MOST_LINE + 1):
                line += 1
                if len(data) > MOST_LINE:
                    raise InputError(f"{file}, line {line}: longer than {MOST_LINE} bytes")
                text = data.removeprefix(b"\xef\xbb\xbf") if line == 1 else data
                if text.strip():
                    first = first or text.lstrip()[:1]
                    if first not in b'{["':  # what is no text is refused as such
                        said = text.decode("utf-8", "surrogateescape").strip()
                        text = json.dumps({"id": f"line-{line:04}", "text": said}).encode()
                    yield line, _parse_row(text, f"{file}, line {line}")
    except OSError as error:
        raise InputError(f"cannot read {file}: {error.strerror or error}") from error


def _parse_row(data: bytes, where: str) -> DatasetRow:
    try:
        value = json.loads(data.decode("utf-8"), object_pairs_hook=_check_unique_keys)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: not JSON: {_cut(str(error))}; {_FORMS}") from error
    if not isinstance(value, dict):
        raise InputError(f"{where}: a row is an object with 'id' and 'text', not {_quote(value)}")
    try:
        row = DatasetRow.model_validate(value)
    except ValidationError as error:
        raise InputError(f"{where}: {_describe_fault(error)}") from None
    if ("text" in value) == (row.plan is not None):
        raise InputError(f"{where}: the row needs 'text' or 'plan', not both")
    if row.plan is not None and row.overrides.context:
        names = ", ".join(row.overrides.context)
        raise InputError(f"{where}: overrides: {names}: say it in the plan")
    if any("\ud800" <= char <= "\udfff" for char in row.id + row.text + (row.voice or "")):
        raise InputError(f"{where}: half a surrogate pair in 'id', 'text' or 'voice'")
    return row


def _check_unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a key twice")
    return found


def _describe_fault(error: ValidationError) -> str:
    first = error.errors(include_url=False)[0]
    field = ".".join(str(part) for part in first["loc"])
    if first["type"] == "missing":
        return f"the row needs {field!r}"
    if first["type"] == "extra_forbidden":
        fields = Overrides.model_fields if "." in field else DatasetRow.model_fields
        return f"no field {_cut(field)!r}; there are {', '.join(fields)}"
    return f"{field}: {first['msg']}, got {_quote(first['input'])}"


def _quote(value: Any) -> str:
    return _cut(repr(value))


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST_QUOTE else f"{text[:_LONGEST_QUOTE]}..."
