"""Tracks that scenewright never made: CSV, TrajNet++ ndjson, files of simulators and datasets.

Reading is strict, because an event found in misread tracks is worse than none: whatever is not
clear is refused with the line of the file and what to mend. Nothing is invented: a gap in a track
is not bridged, the agent is taken for two road users instead, who share a name.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import PurePath
from typing import NoReturn

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
from scenewright.tools.formats.registry import read_scenarios
from scenewright.tools.formats.sample_table import crop, find_fault
from scenewright.tools.formats.sampled_recording import AgentSamples, describe_rides
from scenewright.tools.relation_checker.external_events import ExternalTracks
from scenewright.tools.relation_checker.trajectory import RoadUser
from scenewright.tools.track_io.passengers import leave_out_passengers
from scenewright.tools.track_io.unit_checks import find_unit_doubts

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
FAR_FROM_ZERO = 1e5
"""Times further from 0 than a day or so [s] are clock times and counted from the first row."""
COURSE = {"vehicle": 0.5, "pedestrian": 0.2, "cyclist": 0.5, "scooter": 0.5}
"""Way over which the course is measured, and within 1 s the least that counts as motion [m]."""


_SHAPES = {each: get_vehicle_shape(each) for each in ("car", "truck", "bus", "motorcycle")}
_SHAPES |= {"bicycle": get_rider_shape("cyclist"), "pedestrian": PEDESTRIAN}
"""Footprints by subtype (SEMANTICS sections 1 and 8)."""


@dataclass(eq=False)
class _Table:
    """All samples of a scenario by agent.

    Attributes:
        name: of the file and the scenario; clock: what the file calls its time, `t` or `f`.
        gapped: agents with a gap; jumps: where ids were switched, in words; rides: who rides in
            which vehicle.
    """

    name: str
    clock: str
    agents: dict[str, AgentSamples] = field(default_factory=dict)
    gapped: list[str] = field(default_factory=list)
    jumps: list[str] = field(default_factory=list)
    rides: dict[str, str] = field(default_factory=dict)

    def refuse(self, agent: AgentSamples, k: int, reason: str) -> NoReturn:
        where = f"sample {k}" if agent.lines is None else f"line {agent.lines[k]}"
        raise InputError(f"{self.name}, {where}: {reason}")

    def add(self, agent: AgentSamples) -> None:
        """Add an agent.

        Raises:
            InputError: a value that is none, a second agent of its id, or times that do not rise.
        """
        values = {"t": agent.t, "x": agent.xy[:, 0], "y": agent.xy[:, 1], "heading": agent.heading,
                  "length": agent.length, "width": agent.width}  # fmt: skip
        for column, given in values.items() if agent.lines is None else ():
            for k, value in enumerate(np.atleast_1d(given).tolist() if given is not None else ()):
                if reason := find_fault(column, value):
                    self.refuse(agent, k, reason)
        if agent.name in self.agents:
            kinds = f"a {agent.subtype} here and a {self.agents[agent.name].subtype} elsewhere"
            self.refuse(agent, 0, f"id {crop(agent.name)} is {kinds}; give each agent its own")
        late = np.flatnonzero(np.diff(agent.t) <= 0)
        if len(late):
            k = int(late[0])
            who, (before, time) = crop(agent.name), agent.t[k : k + 2].tolist()
            at = f"{self.clock} = {time:.13g}"
            if time == before:
                first = k if agent.lines is None else agent.lines[k]
                self.refuse(agent, k + 1, f"a second row of id {who} at {at}, the first is line "
                            f"{first}; keep one")  # fmt: skip
            self.refuse(agent, k + 1, f"{at} of id {who} comes after {self.clock} = "
                        f"{before:.13g}; sort the rows by time, and give each agent an id of "
                        "its own")  # fmt: skip
        self.agents[agent.name] = agent


def read_tracks(data: bytes, *, name: str) -> ExternalTracks:
    """The tracks in the bytes of a file of one scenario; its name says which format it has.

    Args:
        data: the content; name: such as `tracks.csv` or `zara.ndjson`, also for messages.

    Raises:
        InputError: names the line and what to mend.
    """
    if PurePath(name).suffix.lower() not in (".csv", ".ndjson"):
        raise InputError(f"{name}: tracks are read from .csv and .ndjson files")
    return read_external_recordings(data, name=name)[""]


def read_external_recordings(data: bytes, *, name: str) -> dict[str, ExternalTracks]:
    """The tracks of every scenario in the bytes of a file, by the scenario's name.

    A CSV, TrajNet++ ndjson or any file with one scenario has one entry, named "".

    Raises:
        InputError: names the line or the agent and what to mend.
    """
    external_recordings = {}
    for scenario in read_scenarios(data, name=name):
        table = _Table(f"{name} {scenario.name}".strip(), scenario.clock)
        for agent in scenario.agents:
            table.add(agent)
        if table.agents:
            tracks = _build_tracks(table, unit=scenario.unit)
            left_out = ", ".join(
                f"{n} {crop(word) or '?'}" for word, n in scenario.left_out.items()
            )
            notes = (f"left out, as no road users: {left_out}",) if left_out else ()
            external_recordings[scenario.name] = replace(
                tracks, notes=(*tracks.notes, *scenario.notes, *notes)
            )
    return external_recordings


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
    steps = [np.diff(rows.t) * unit for rows in table.agents.values() if len(rows.t) > 1]
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


def _split(who: str, rows: AgentSamples, table: _Table, clock: _TimeUnit) -> list[slice]:
    """The parts of a track between its gaps and jumps; of one sample none that a jump leaves.

    Raises:
        InputError: a time between two samples, or nothing but jumps.
    """
    steps = np.diff(rows.t) * clock.unit
    count = np.rint(steps / clock.step)
    off = np.flatnonzero((np.abs(steps - count * clock.step) > JITTER * clock.step) | (count < 1))
    if len(off):
        k = int(off[0])
        table.refuse(
            rows,
            k + 1,
            f"{table.clock} = {rows.t[k + 1]:.13g} of id {crop(who)} is {steps[k]:.4g} s after "
            f"its last row, but the file has a step of {clock.step:.4g} s; resample it evenly",
        )
    cuts = [0, *(np.flatnonzero(count > 1) + 1).tolist(), len(rows.t)]
    table.gapped += [who] if len(cuts) > 2 else []
    parts: list[slice] = []
    for a, b in pairwise(cuts):
        t = rows.t[a:b] * clock.unit
        drift = np.abs(t - t[0] - clock.step * np.arange(len(t)))
        late = np.flatnonzero(drift > JITTER * clock.step + 1e-6)
        if len(late):
            table.refuse(
                rows,
                a + int(late[0]),
                f"the rows of id {crop(who)} do not keep the file's step of {clock.step:.4g} s; "
                "resample it evenly",
            )
        jumps = _find_jumps(who, rows, slice(a, b), table, clock)
        ends = [a, *(a + k + 1 for k in jumps), b]
        parts += [slice(i, j) for i, j in pairwise(ends) if not jumps or j - i > 1]
    return parts


def _find_jumps(
    who: str, rows: AgentSamples, part: slice, table: _Table, clock: _TimeUnit
) -> list[int]:
    """Steps of a part that lead to another agent, whose id was switched, or that a glitch made.

    Such a step is faster than anything of its class, or so much longer than both the two before
    and the two after it that neither braking nor noise explains it.

    Raises:
        InputError: half of the steps are, so that units or ids are wrong.
    """
    way = np.hypot(*np.diff(rows.xy[part], axis=0).T)
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
            rows,
            part.start + jumps[0] + 1,
            f"id {crop(who)} jumps {way[jumps[0]]:.4g} m in {clock.step:.4g} s; positions must be "
            "metres, times seconds, and each agent needs an id of its own",
        )
    for k in jumps:
        time = rows.t[part.start + k + 1] * clock.unit - clock.origin
        table.jumps.append(
            f"id {crop(who)} jumps {way[k]:.3g} m at {time:.1f} s ({speed[k]:.3g} m/s)"
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


def _build_user(rows: AgentSamples, part: slice, clock: _TimeUnit) -> RoadUser:
    """A road user without a number."""
    # Size by the file, else by class; a pedestrian is a disc of its longer side.
    usual = _SHAPES[rows.subtype]
    shape = Shape(usual.type, rows.length or usual.length, rows.width or usual.width)
    if usual.type == "pedestrian":
        size = max(rows.length or 0.0, rows.width or 0.0) or usual.width
        shape = Shape("pedestrian", size, size)
    xy = rows.xy[part]
    course = compute_headings(xy, step=clock.step, least=COURSE[shape.type])
    given = np.full(len(course), np.nan) if rows.heading is None else rows.heading[part]
    heading = np.where(np.isnan(given), course, given)
    start = float(rows.t[part.start]) * clock.unit - clock.origin
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
        moving = ~known & (np.hypot(chord[:, 0], chord[:, 1]) >= least)
        result[moving] = np.arctan2(chord[moving, 1], chord[moving, 0])
        known |= moving
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
        who
        for who, rows in table.agents.items()
        if rows.heading is not None and not np.isnan(rows.heading).all()
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
    return f"id {', '.join(crop(name) for name in names[:5])}{more}"
