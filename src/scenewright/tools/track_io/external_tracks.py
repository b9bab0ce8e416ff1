"""Tracks that scenewright never made: CSV, TrajNet++ ndjson, files of simulators and datasets.

Reading is strict, because an event found in misread tracks is worse than none: whatever is not
clear is refused with the line of the file and what to mend. Nothing is invented: a gap in a track
is not bridged, the agent is taken for two road users instead, who share a name.
"""

from __future__ import annotations

import csv
import io
import json
import math
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import PurePath
from typing import Any, NoReturn

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.track import (
    PEDESTRIAN,
    STEP,
    Shape,
    Track,
    get_rider_shape,
    get_vehicle_shape,
)
from scenewright.tools.formats.registry import find_reader, read_simulator_file
from scenewright.tools.formats.sampled_recording import describe_rides, find_subtype
from scenewright.tools.formats.trajnet import iterate_trajnet_rows
from scenewright.tools.relation_checker.external_events import ExternalTracks
from scenewright.tools.relation_checker.trajectory import FARTHEST, RoadUser
from scenewright.tools.track_io.decimals import SEPARATE, DecimalReader
from scenewright.tools.track_io.passengers import leave_out_passengers
from scenewright.tools.track_io.unit_checks import find_unit_doubts

MOST_BYTES = 200_000_000
"""Larger files are refused; a part of them can be checked."""
LONGEST_STEP, SHORTEST_STEP = 2.0, 0.001
"""Time between two rows of one agent [s]; beyond this, t is not in seconds."""
JITTER = 0.25
"""How far a row may lie from its even time, as a share of the step."""
JUMPS = {
    "vehicle": (90.0, 15.0, 2.0),
    "pedestrian": (14.0, 5.0, 1.0),
    "cyclist": (40.0, 10.0, 1.0),
    "scooter": (30.0, 10.0, 1.0),
}
"""Speed [m/s], acceleration [m/s^2] and noise of positions [m] that are possible; a step beyond
them leads to another agent, whose id was switched."""
LATEST = 1e10
FAR_FROM_ZERO = 1e5
"""Times further from 0 than a day or so [s] are clock times and counted from the first row."""
MOST_HEADING = 20.0
"""Headings beyond this are degrees [rad]."""
COURSE = {"vehicle": 0.5, "pedestrian": 0.2, "cyclist": 0.5, "scooter": 0.5}
"""Way over which the course is measured, and within 1 s the least that counts as motion [m]."""
TRAJNET_FPS = 2.5


_SHAPES = {each: get_vehicle_shape(each) for each in ("car", "truck", "bus", "motorcycle")}
_SHAPES |= {"bicycle": get_rider_shape("cyclist"), "pedestrian": PEDESTRIAN}
"""Footprints by subtype (SEMANTICS sections 1 and 8)."""
_REQUIRED = ("t", "id", "class", "x", "y")
_OPTIONAL = ("heading", "length", "width")


@dataclass(eq=False)
class _AgentRows:
    """One agent's rows as they stand in the file; what an optional cell lacks is NaN."""

    subtype: str
    lines: array[int] = field(default_factory=lambda: array("q"))
    columns: dict[str, array[float]] = field(
        default_factory=lambda: {name: array("d") for name in ("t", "x", "y", *_OPTIONAL)}
    )

    @property
    def t(self) -> array[float]:
        return self.columns["t"]

    def get_column(self, name: str) -> FloatArray:
        return np.array(self.columns[name], dtype=np.float64)


@dataclass(eq=False)
class _Table:
    """All rows of a file by agent.

    Attributes:
        name: of the file; clock: what the file calls its time, `t` or `f`.
        unit: what an agent's rows are counted in.
        gapped: agents with a gap; jumps: where ids were switched, in words; rides: who rides in
            which vehicle.
    """

    name: str
    clock: str = "t"
    unit: str = "line"
    agents: dict[str, _AgentRows] = field(default_factory=dict)
    decimals: DecimalReader = field(default_factory=DecimalReader)
    gapped: list[str] = field(default_factory=list)
    jumps: list[str] = field(default_factory=list)
    rides: dict[str, str] = field(default_factory=dict)

    def refuse(self, line: int, reason: str) -> NoReturn:
        raise InputError(f"{self.name}, {self.unit} {line}: {reason}")

    def add(self, line: int, who: str, subtype: str, values: Mapping[str, float]) -> None:
        """Appends a row.

        Raises:
            InputError: the agent is of another class, the time is not later than the last one.
        """
        rows = self.agents.get(who)
        if rows is None:
            rows = self.agents[who] = _AgentRows(subtype)
        if rows.subtype != subtype:
            self.refuse(line, f"id {_crop(who)} is a {subtype} here and a {rows.subtype} in line "
                        f"{rows.lines[0]}; give each agent an id of its own")  # fmt: skip
        if rows.t and values["t"] <= rows.t[-1]:
            time = values["t"]
            at = f"{self.clock} = {time:.13g}"
            if time == rows.t[-1]:
                self.refuse(line, f"a second row of id {_crop(who)} at {at}, the first is line "
                            f"{rows.lines[-1]}; keep one")  # fmt: skip
            self.refuse(line, f"{at} of id {_crop(who)} comes after {self.clock} = "
                        f"{rows.t[-1]:.13g}; sort the rows by time, and give each agent an id of "
                        "its own")  # fmt: skip
        rows.lines.append(line)
        for name, column in rows.columns.items():
            column.append(values.get(name, math.nan))


def read_tracks(data: bytes, *, name: str) -> ExternalTracks:
    """The tracks in the bytes of a file; its name says which format it has.

    Args:
        data: the content; name: such as `tracks.csv` or `zara.ndjson`, also for messages.

    Raises:
        InputError: names the line and what to mend.
    """
    suffix = PurePath(name).suffix.lower()
    if suffix not in (".csv", ".ndjson"):
        raise InputError(f"{name}: tracks are read from .csv and .ndjson files")
    text = decode_text(data, name=name)
    return read_csv(text, name=name) if suffix == ".csv" else read_trajnet(text, name=name)


def read_external_recordings(data: bytes, *, name: str) -> dict[str, ExternalTracks]:
    """The tracks of every scenario in the bytes of a file, by the scenario's name.

    A CSV, TrajNet++ ndjson or any file with one scenario has one entry, named "".

    Raises:
        InputError: names the line or the agent and what to mend.
    """
    if find_reader(name) is None:
        return {"": read_tracks(data, name=name)}
    found = {}
    for each in (
        recording for recording in read_simulator_file(data, name=name) if recording.agents
    ):
        table = _Table(f"{name} {each.name}".strip(), unit="sample")
        for agent in each.agents:
            own = {"length": agent.length, "width": agent.width}
            sizes = {key: size for key, size in own.items() if size is not None}
            for k, (t, (x, y)) in enumerate(zip(agent.t.tolist(), agent.xy.tolist(), strict=True)):
                values = {"t": t, "x": x, "y": y}
                if agent.heading is not None:
                    values["heading"] = float(agent.heading[k])
                values |= sizes
                checked = {key: _check_value(key, value, k, table) for key, value in values.items()}
                table.add(k, agent.name, agent.subtype, checked)
        tracks = _build_tracks(table, unit=1.0)
        left_out = ", ".join(f"{n} {_crop(word) or '?'}" for word, n in each.left_out.items())
        notes = (f"left out, as no road users: {left_out}",) if left_out else ()
        found[each.name] = replace(tracks, notes=(*tracks.notes, *each.notes, *notes))
    return found


def decode_text(data: bytes, *, name: str) -> str:
    """The text of a file: UTF-8, with or without a byte order mark.

    Raises:
        InputError: too large, empty or in another encoding.
    """
    if len(data) > MOST_BYTES:
        raise InputError(describe_too_large(name, len(data)))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(f"{name}, line {line}: this is not UTF-8; save it as UTF-8") from error
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise InputError(f"{name}, line {line}: this is not text in UTF-8; save it as UTF-8")
    if not text.strip():
        raise InputError(f"{name} is empty; it must hold tracks")
    return text


def describe_too_large(name: str, size: int) -> str:
    """What to say about a file of too many bytes."""
    return f"{name} has {size / 1e6:.0f} MB; at most {MOST_BYTES / 1e6:.0f}: check it in parts"


def read_csv(text: str, *, name: str) -> ExternalTracks:
    """Tracks from a table with the columns t, id, class, x, y and perhaps heading, length, width.

    Seconds, metres, radians, with a decimal point or comma. Columns may stand in any order, further
    ones are ignored; they are separated by commas, semicolons or tabs. The rows of one agent are in
    order of time.

    Raises:
        InputError: names the line and what to mend.
    """
    rows = _iterate_csv_rows(text, name)
    first, header = next(rows, (1, [""]))
    table = _Table(name)
    names = [cell.strip().lower() for cell in header]
    missing = [column for column in _REQUIRED if column not in names]
    if missing:
        given = _crop(", ".join(name for name in names if name), limit=120)
        table.refuse(first, f"no column {', '.join(missing)}; the header must name "
                     f"{', '.join(_REQUIRED)} and may name {', '.join(_OPTIONAL)}, "
                     f"it names {given or 'none'}")  # fmt: skip
    known = [column for column in (*_REQUIRED, *_OPTIONAL) if column in names]
    twice = [column for column in known if names.count(column) > 1]
    if twice:
        table.refuse(first, f"column {twice[0]} is there twice; keep one")
    columns = {column: names.index(column) for column in known}
    for line, cells in rows:
        if len(cells) != len(header):
            hint = f"; {SEPARATE}" if len(cells) > len(header) else ""
            table.refuse(line, f"{len(cells)} cells under {len(header)} columns{hint}")
        row = {column: cells[k].strip() for column, k in columns.items()}
        if not row["id"]:
            table.refuse(line, "no id; give each agent one")
        subtype = _check_subtype(row["class"], line, table)
        # Empty optional cells are left out.
        wanted = [c for c in ("t", "x", "y", *_OPTIONAL) if c in row and (row[c] or c in _REQUIRED)]
        numbers = {
            c: _check_value(c, _parse_number(row[c], c, line, table), line, table) for c in wanted
        }
        table.add(line, row["id"], subtype, numbers)
    return _build_tracks(table, unit=1.0)


def _iterate_csv_rows(text: str, name: str) -> Iterator[tuple[int, list[str]]]:
    """Line numbers and cells; blank lines are skipped."""
    header = next(line for line in io.StringIO(text) if line.strip())
    delimiter = max(",;\t", key=header.count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells):
                yield reader.line_num, cells
    except csv.Error as error:
        raise InputError(f"{name}, line {reader.line_num}: {error}; mend the quotes") from error


def _check_subtype(cell: object, line: int, table: _Table) -> str:
    cell = str(cell)
    subtype = find_subtype(cell)
    if subtype is None:
        table.refuse(line, f"class {_crop(cell)!r} is unknown; use vehicle or pedestrian, or one "
                     "of car, truck, bus, motorcycle, bicycle")  # fmt: skip
    return subtype


def _parse_number(cell: str, column: str, line: int, table: _Table) -> float:
    try:
        return table.decimals.parse(cell)
    except ValueError as reason:
        what = f"{_crop(cell)!r}, {reason}" if cell else "empty; it needs a number"
        table.refuse(line, f"{column} is {what}")


def _check_value(column: str, value: float, line: int, table: _Table) -> float:
    """A number that can be what its column says it is."""
    if not math.isfinite(value):
        mend = "leave out the row" if column not in _OPTIONAL else "leave the cell empty"
        table.refuse(line, f"{column} is {value}; {mend} where it is unknown")
    if column in ("x", "y") and abs(value) > FARTHEST:
        table.refuse(line, f"{column} = {value:g} is too far off; positions are metres")
    if column in ("t", "f") and abs(value) > LATEST:
        table.refuse(line, f"{column} = {value:g} is too large; times are seconds")
    if column == "heading" and abs(value) > MOST_HEADING:
        table.refuse(line, f"heading = {value:g} looks like degrees; headings are radians")
    if column in ("length", "width") and not 0 < value < 100:
        table.refuse(line, f"{column} = {value:g} m is no size; leave the cell empty if unknown")
    return value


def read_trajnet(text: str, *, name: str) -> ExternalTracks:
    """Pedestrians from TrajNet++ lines: {"scene": {…, fps}} and {"track": {f, p, x, y}}.

    A track with a key `class`, as our exporter writes it, is of that class.
    The scenes only say how fast the clock runs (2.5 frames/s unless they do): all tracks are taken
    for one recording. Frames keep the numbers of the video, so that the commonest step from frame
    to frame is one sample: t = f / (step in frames x fps).

    Raises:
        InputError: names the line and what to mend.
    """
    table, fps = _Table(name, clock="f"), {}
    rows = iterate_trajnet_rows(text.split("\n"), predictions="refuse", refuse=table.refuse)
    for line, kind, values in rows:
        if kind == "scene":
            rate = _check_json_number(values.get("fps", TRAJNET_FPS), "fps", line, table)
            if not 1 / LONGEST_STEP <= rate <= 1 / SHORTEST_STEP:
                table.refuse(line, f"fps = {rate:g} must be frames per second of the samples")
            fps[rate] = line
            continue
        missing = [key for key in ("f", "p", "x", "y") if values.get(key) is None]
        if missing:
            table.refuse(line, f"the track has no {', '.join(missing)}; it needs f, p, x and y")
        who = values["p"]
        if isinstance(who, bool) or not isinstance(who, int | str) or who == "":
            table.refuse(line, "p must be the number of an agent")
        subtype = _check_subtype(values.get("class", "pedestrian"), line, table)
        numbers = {key: _check_json_number(values[key], key, line, table) for key in "fxy"}
        if numbers["f"] != int(numbers["f"]):
            table.refuse(line, f"f = {numbers['f']:g} must be the whole number of a frame")
        place = {"t": numbers["f"], "x": numbers["x"], "y": numbers["y"]}
        table.add(line, str(who), subtype, place)
    if len(fps) > 1:
        (one, _), (other, line) = list(fps.items())[:2]
        table.refuse(line, f"fps {other:g} here and {one:g} elsewhere; split the file by fps")
    # The commonest step from one row of an agent to the next [frames]; 1 if there is none.
    steps = [np.diff(rows.get_column("t")) for rows in table.agents.values()]
    found, counts = np.unique(np.concatenate([*steps, np.zeros(0)]), return_counts=True)
    stride = float(found[np.argmax(counts)]) if len(found) else 1.0
    return _build_tracks(table, unit=1 / (next(iter(fps), TRAJNET_FPS) * stride))


def _check_json_number(value: Any, key: str, line: int, table: _Table) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        table.refuse(line, f"{key} is {_crop(json.dumps(value))}, not a number")
    try:
        return _check_value(key, float(value), line, table)
    except OverflowError:
        table.refuse(line, f"{key} is too large")


@dataclass(frozen=True)
class _TimeUnit:
    """How the file's times become seconds: unit and step between samples [s], and where 0 is."""

    unit: float
    step: float
    origin: float = 0.0


def _build_tracks(table: _Table, *, unit: float) -> ExternalTracks:
    """The road users of all rows.

    Args:
        unit: seconds per unit of the file's clock.
    """
    if not table.agents:
        raise InputError(f"{table.name} holds no tracks")
    # Where the times of the users begin: far from 0, too little of a number is left for them.
    first = min(rows.t[0] for rows in table.agents.values()) * unit
    origin = math.floor(first) if abs(first) > FAR_FROM_ZERO else 0.0
    clock = _TimeUnit(unit, _find_step(table, unit), origin)
    stretches, table.rides = leave_out_passengers(
        [
            (who, _build_user(rows, part, clock))
            for who, rows in table.agents.items()
            for part in _split(who, rows, table, clock)
        ]
    )
    if not stretches:
        raise InputError(f"{table.name} holds no tracks of road users, only of passengers")
    ids = _assign_ids([who for who, _ in stretches])
    users = tuple(replace(user, id=n) for n, (_, user) in zip(ids, stretches, strict=True))
    names = dict(zip(ids, (who for who, _ in stretches), strict=True))
    subtypes = {n: table.agents[who].subtype for n, who in names.items()}
    notes = _collect_notes(table, names, users, clock.origin)
    return ExternalTracks(users, names, subtypes, clock.step, clock.origin, notes)


def _find_step(table: _Table, unit: float) -> float:
    """The time between samples [s]: of the means over whole tracks the middle one.

    Raises:
        InputError: the times cannot be seconds.
    """
    steps = [
        np.diff(rows.get_column("t")) * unit for rows in table.agents.values() if len(rows.t) > 1
    ]
    if not steps:
        return STEP
    usual = float(np.median(np.concatenate(steps)))
    # Times rounded to a few digits are uneven one by one, but not over a whole track.
    means = [each.sum() / max(np.rint(each / usual).sum(), 1.0) for each in steps]
    step = float(np.median(np.repeat(means, [len(each) for each in steps])))
    if not SHORTEST_STEP <= step <= LONGEST_STEP:
        raise InputError(
            f"{table.name}: the rows of an agent are {step:g} s apart, which no recording is; "
            f"{table.clock} must be seconds"
        )
    even = round(step, 4)
    return even if abs(step - even) < 1e-6 else step


def _split(who: str, rows: _AgentRows, table: _Table, clock: _TimeUnit) -> list[slice]:
    """The parts of a track between its gaps and jumps; of one sample none that a jump leaves.

    Raises:
        InputError: a time between two samples, or nothing but jumps.
    """
    steps = np.diff(rows.get_column("t")) * clock.unit
    count = np.rint(steps / clock.step)
    off = np.flatnonzero((np.abs(steps - count * clock.step) > JITTER * clock.step) | (count < 1))
    if len(off):
        k = int(off[0])
        table.refuse(
            rows.lines[k + 1],
            f"{table.clock} = {rows.t[k + 1]:.13g} of id {_crop(who)} is {steps[k]:.4g} s after "
            f"its last row, but the file has a step of {clock.step:.4g} s; resample it evenly",
        )
    cuts = [0, *(np.flatnonzero(count > 1) + 1).tolist(), len(rows.t)]
    table.gapped += [who] if len(cuts) > 2 else []
    parts: list[slice] = []
    for a, b in pairwise(cuts):
        t = rows.get_column("t")[a:b] * clock.unit
        drift = np.abs(t - t[0] - clock.step * np.arange(len(t)))
        late = np.flatnonzero(drift > JITTER * clock.step + 1e-6)
        if len(late):
            table.refuse(
                rows.lines[a + int(late[0])],
                f"the rows of id {_crop(who)} do not keep the file's step of {clock.step:.4g} s; "
                "resample it evenly",
            )
        jumps = _find_jumps(who, rows, slice(a, b), table, clock)
        ends = [a, *(a + k + 1 for k in jumps), b]
        parts += [slice(i, j) for i, j in pairwise(ends) if not jumps or j - i > 1]
    return parts


def _find_jumps(
    who: str, rows: _AgentRows, part: slice, table: _Table, clock: _TimeUnit
) -> list[int]:
    """Steps of a part that lead to another agent, whose id was switched, or that a glitch made.

    Such a step is faster than anything of its class, or so much longer than both the two before
    and the two after it that neither braking nor noise explains it.

    Raises:
        InputError: half of the steps are, so that units or ids are wrong.
    """
    way = np.hypot(np.diff(rows.get_column("x")[part]), np.diff(rows.get_column("y")[part]))
    fastest, acceleration, noise = JUMPS[_SHAPES[rows.subtype].type]
    speed = way / clock.step
    padded = np.concatenate((np.full(2, np.inf), speed, np.full(2, np.inf)))
    before = np.minimum(padded[:-4], padded[1:-3])
    after = np.minimum(padded[3:-1], padded[4:])
    beside = np.maximum(*(np.where(np.isinf(v), fastest / 2, v) for v in (before, after)))
    possible = beside + acceleration * 2 * clock.step + noise / clock.step
    jumps = np.flatnonzero(speed > np.minimum(possible, fastest)).tolist()
    if 2 * len(jumps) > len(way):
        table.refuse(
            rows.lines[part.start + jumps[0] + 1],
            f"id {_crop(who)} jumps {way[jumps[0]]:.4g} m in {clock.step:.4g} s; positions must be "
            "metres, times seconds, and each agent needs an id of its own",
        )
    for k in jumps:
        time = rows.t[part.start + k + 1] * clock.unit - clock.origin
        table.jumps.append(
            f"id {_crop(who)} jumps {way[k]:.3g} m at {time:.1f} s ({speed[k]:.3g} m/s)"
        )
    return jumps


def _assign_ids(names: list[str]) -> list[int]:
    """Ids for stretches of tracks: the file's own where all are numbers, else 1, 2, 3, …

    Later stretches of a track get numbers above all others.
    """
    first = dict.fromkeys(names)
    own = all(
        len(name) < 19 and name.isascii() and name.isdigit() and str(int(name)) == name
        for name in first
    )
    ids = {name: int(name) if own else k for k, name in enumerate(first, start=1)}
    free = max(ids.values()) + 1
    result = []
    for name in names:
        number = ids.pop(name, None)
        result.append(free if number is None else number)
        free += number is None
    return result


def _build_user(rows: _AgentRows, part: slice, clock: _TimeUnit) -> RoadUser:
    """A road user without a number."""
    # Size by the rows (their median), else by class; a pedestrian is a disc of its longer side.
    usual = _SHAPES[rows.subtype]
    known = {name: rows.get_column(name) for name in ("length", "width")}
    sizes = {name: float(np.nanmedian(v)) for name, v in known.items() if not np.isnan(v).all()}
    shape = Shape(usual.type, sizes.get("length", usual.length), sizes.get("width", usual.width))
    if usual.type == "pedestrian":
        size = max(sizes.values(), default=usual.width)
        shape = Shape("pedestrian", size, size)
    xy = np.stack((rows.get_column("x")[part], rows.get_column("y")[part]), axis=1)
    course = compute_headings(xy, step=clock.step, least=COURSE[shape.type])
    given = rows.get_column("heading")[part]
    heading = np.where(np.isnan(given), course, given)
    start = rows.t[part.start] * clock.unit - clock.origin
    return RoadUser(0, Track(xy, heading, start, clock.step), shape)


def compute_headings(xy: FloatArray, *, step: float, least: float) -> FloatArray:
    """Compute the headings [T] of an agent that moves forwards along positions [T, 2] [rad].

    At each sample the direction between the nearest samples before and after it that lie `least`
    metres apart. Where there are none within half a second either way, it stands: the heading is
    held, before the first motion that of the first motion; 0 for one that never moves.
    """
    n = len(xy)
    result, known = np.zeros(n), np.zeros(n, dtype=np.bool_)
    k = np.arange(n)
    for w in range(1, max(round(0.5 / step), 1) + 1):
        low, high = np.maximum(k - w, 0), np.minimum(k + w, n - 1)
        chord = xy[high] - xy[low]
        found = ~known & (np.hypot(chord[:, 0], chord[:, 1]) >= least)
        result[found] = np.arctan2(chord[found, 1], chord[found, 0])
        known |= found
    if not known.any():
        return np.zeros(n)
    last = np.maximum.accumulate(np.where(known, k, -1))
    return np.asarray(np.unwrap(result[np.where(last < 0, int(np.argmax(known)), last)]))


def _collect_notes(
    table: _Table, names: Mapping[int, str], users: tuple[RoadUser, ...], origin: float
) -> tuple[str, ...]:
    """What was assumed about the tracks."""
    notes = [f"times are counted from t = {origin:.0f} s"] if origin else []
    if table.gapped:
        notes.append(f"{_list_ids(table.gapped)} with gaps: each stretch is an agent of its own")
    if table.jumps:
        more = f" and {len(table.jumps) - 5} more" if len(table.jumps) > 5 else ""
        notes.append(f"tracks are cut where {', '.join(table.jumps[:5])}{more}")
    notes += describe_rides(table.rides)
    own = {
        who for who, rows in table.agents.items() if not np.isnan(rows.get_column("heading")).all()
    }
    # Nothing says where these vehicles face.
    blind = [
        names[user.id]
        for user in users
        if user.shape.type != "pedestrian"
        and not user.track.heading.any()
        and float(np.ptp(user.track.xy, axis=0).max()) < COURSE["vehicle"]
        and names[user.id] not in own
    ]
    if blind:
        notes.append(f"{_list_ids(blind)} without heading or motion: taken to face east")
    headed = {number for number, who in names.items() if who in own}
    return (*notes, *find_unit_doubts(users, headed=headed))


def _list_ids(names: list[str]) -> str:
    """Ids for a sentence."""
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    return f"id {', '.join(_crop(name) for name in names[:5])}{more}"


def _crop(text: str, *, limit: int = 40) -> str:
    """A piece of the file short enough for a message."""
    return text if len(text) <= limit else text[: limit - 1] + "…"
