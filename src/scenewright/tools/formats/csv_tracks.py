"""CSV of tracks: one row per agent and sample, in columns of our names or of others."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable, Mapping
from itertools import chain

from scenewright.errors import InputError
from scenewright.tools.formats.exported_scene import ExportedScene
from scenewright.tools.formats.sample_table import OPTIONAL, SampleTable, crop, decode_text
from scenewright.tools.formats.sampled_recording import SampledRecording

REQUIRED = ("t", "id", "class", "x", "y")
COLUMNS = (*REQUIRED, *OPTIONAL)
_WITH_COMMA = re.compile(r"[+-]?\d+,\d+(e[+-]?\d+)?", re.IGNORECASE)
_SEPARATE = "numbers with a decimal comma need another separator, such as a semicolon"


def write(scene: ExportedScene) -> dict[str, bytes]:
    """The rows in order of agents and times; metres, seconds, radians."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for agent in scene.agents:
        size = (agent.length, agent.width)
        for t, (x, y), heading in zip(
            agent.times.tolist(), agent.xy.tolist(), agent.heading.tolist(), strict=True
        ):
            writer.writerow((t, agent.id, agent.names.tracks, x, y, round(heading, 6), *size))
    return {f"{scene.name}.csv": text.getvalue().encode()}


def read(data: bytes, *, name: str) -> list[SampledRecording]:
    """Tracks from a table with the columns t, id, class, x, y and perhaps heading, length, width.

    Seconds, metres, radians, with a decimal point or comma. Columns may stand in any order, further
    ones are ignored; they are separated by commas, semicolons or tabs.

    Raises:
        InputError: names the line and what to mend.
    """
    lines = io.StringIO(decode_text(data, name=name), newline="")
    return [read_columns(lines, name=name)]


def read_columns(
    lines: Iterable[str], *, name: str, columns: Mapping[str, str] | None = None
) -> SampledRecording:
    """Tracks from the lines of a table.

    Args:
        columns: its columns by our names, of which `class` may be missing; `name/25` divides,
            `=word` is a constant. None: they are called as ours.

    Raises:
        InputError: names the line and what to mend.
    """
    table = SampleTable(name, one_class=columns is None)
    rest, head = iter(lines), [""]
    while not head[-1].strip() and (line := next(rest, "")):
        head.append(line)
    separator = max(",;\t", key=head[-1].count)
    rows = csv.reader(chain(head[1:], rest), delimiter=separator, strict=True)
    try:
        found = (cells for cells in rows if any(cell.strip() for cell in cells))
        titles = [cell.strip() for cell in next(found, [])]
        if columns is None:
            titles = [title.lower() for title in titles]
            columns = {c: c for c in COLUMNS if c in REQUIRED or c in titles}
        wanted = {key: _parse_column(text) for key, text in columns.items()}
        places = _find_places(table, titles, {key: own for key, (own, _) in wanted.items()})
        decimals = DecimalReader()
        for cells in found:
            number = rows.line_num
            if len(cells) != len(titles):
                hint = f"; {_SEPARATE}" if len(cells) > len(titles) else ""
                table.refuse(number, f"{len(cells)} cells under {len(titles)} columns{hint}")
            row = {key: cells[k].strip() for key, k in places.items()}
            if not row["id"]:
                table.refuse(number, "no id; give each agent one")
            values = {}
            for key in ("t", "x", "y", *OPTIONAL):
                cell = row.get(key, "")
                if not cell and key in OPTIONAL:
                    continue
                try:
                    values[key] = decimals.parse(cell) / wanted[key][1]
                except ValueError as reason:
                    what = f"{crop(cell)!r}, {reason}" if cell else "empty; it needs a number"
                    table.refuse(number, f"{key} is {what}")
            word = row.get("class", wanted.get("class", ("=car",))[0].removeprefix("="))
            table.add(number, row["id"], word, values)
    except csv.Error as error:
        raise InputError(f"{name}, line {rows.line_num}: {error}; mend the quotes") from error
    return SampledRecording("", table.list_agents())


def _find_places(
    table: SampleTable, titles: list[str], wanted: Mapping[str, str]
) -> dict[str, int]:
    """By our name the place of every column that is no constant."""
    named = {key: own for key, own in wanted.items() if not own.startswith("=")}
    if missing := [own for own in named.values() if own not in titles]:
        given = crop(", ".join(filter(None, titles)), limit=120)
        table.refuse(1, f"no column {', '.join(missing)}; the header must name "
                     f"{', '.join(wanted[c] for c in REQUIRED if c in wanted)} and may name "
                     f"{', '.join(OPTIONAL)}, it names {given or 'none'}")  # fmt: skip
    if twice := [own for own in named.values() if titles.count(own) > 1]:
        table.refuse(1, f"column {twice[0]} is there twice; keep one")
    return {key: titles.index(own) for key, own in named.items()}


def _parse_column(text: str) -> tuple[str, float]:
    """The column's name, or `=word`, and by what its values are divided."""
    name, _, divisor = text.rpartition("/")
    if text.startswith("=") or not name:
        return text, 1.0
    try:
        value = float(divisor)
    except ValueError:
        return text, 1.0
    if not (math.isfinite(value) and value != 0.0):
        raise InputError(f"a column cannot be divided by {divisor[:20]!r}")
    return name, value


class DecimalReader:
    """Reads the numbers of one file, which has one decimal sign, a point or a comma.

    In a file with both, 1,234 might be a thousand as well.
    """

    def __init__(self) -> None:
        self._sign = ""

    def parse(self, cell: str) -> float:
        """The number in a cell.

        Raises:
            ValueError: there is none; says why, to go on after the cell.
        """
        sign = "," if _WITH_COMMA.fullmatch(cell) else "." if "." in cell else ""
        try:
            if "_" in cell:
                raise ValueError
            value = float(cell.replace(",", ".") if sign == "," else cell)
        except ValueError:
            raise ValueError("not a number") from None
        if sign and self._sign and sign != self._sign:
            raise ValueError(f"although others have a decimal {self._sign!r}; keep one sign")
        self._sign = sign or self._sign
        return value
