"""Who meets which light when: stop lines, crosswalks, red crossings, waiting at red."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from math import isfinite

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import Colour, FloatArray
from scenewright.scene.events import Finding
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import SignalProgram
from scenewright.scene.record import SignalRecord
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.footprints import BoolArray
from scenewright.tools.relation_checker.ground_raster import get_ground_raster
from scenewright.tools.relation_checker.planar import geos
from scenewright.tools.relation_checker.trajectory import (
    Trajectory,
    extend_straight,
)

CROSSING = 2.0
"""A pedestrian that walks less than this across the street [m] only rounds the corner."""
RED_TOLERANCE = 0.1
"""A crossing this shortly after the light turned red [s] is one sample's doubt, no violation."""
WRONG_WAY = np.cos(np.deg2rad(40.0))
"""A vehicle passing the line's other half must head for the junction within 40 degrees."""
SEAM = 2e-3
"""Stretches of a plan may part or overlap by this [s]: times are kept to 1 ms."""


@dataclass(frozen=True)
class LightCrossing:
    """A vehicle's front over a stop line, or the entry of a pedestrian or rider into a crosswalk.

    Attributes:
        time: [s]; light: id of the stop line or crosswalk; colour: shown then, None if unknown.
    """

    time: float
    light: str
    colour: Colour | None


class SignalPlan:
    """The signal plan of a scene, by stop line and crosswalk."""

    def __init__(
        self, records: Sequence[SignalRecord], intersection_map: IntersectionMap | None
    ) -> None:
        self._spans: dict[str, list[SignalRecord]] = {}
        for record in records:
            for name in (record.stop_line, record.crosswalk):
                if name is not None:
                    self._spans.setdefault(name, []).append(record)
        self._map = intersection_map
        self._met: dict[Trajectory, tuple[LightCrossing, ...]] = {}
        self._further: dict[Trajectory, Trajectory] = {}

    def get_colour(self, light: str, *, time: float) -> Colour | None:
        """What a light shows at a time [s]; None where the plan does not say."""
        for span in self._spans.get(light, ()):
            if span.start <= time < span.end:
                return span.colour
        return None

    def find_crossings(self, track: Trajectory) -> tuple[LightCrossing, ...]:
        """Every signalised line or crosswalk that the mover meets, in order of time."""
        if track not in self._met:
            found = [*self._list_passages(track), *self._list_entries(track)]
            self._met[track] = tuple(
                LightCrossing(time, name, self.get_colour(name, time=time))
                for time, name in sorted(found)
            )
        return self._met[track]

    def _list_passages(self, track: Trajectory) -> Iterator[tuple[float, str]]:
        """When the middle of a vehicle's front bumper passes a line, towards the junction."""
        names, *lines = self._lines
        if track.is_vehicle and names:
            for line, k, part in _find_passages(track.xy, track.heading, track.half_length, *lines):
                yield float(track.times[k]) + STEP * part, names[line]

    def _list_entries(self, track: Trajectory) -> Iterator[tuple[float, str]]:
        """When a pedestrian or rider enters a crosswalk in which it goes at least 2 m across.

        Who begins inside steps into it then: on red it cannot be known to have come on green.
        """
        drives = track.is_vehicle and not track.is_rider
        if self._map is None or not self._spans or drives:
            return
        west, south, east, north = track.bounds
        for walk in get_ground_raster(self._map).crosswalks:
            low_x, low_y, high_x, high_y = walk.bounds
            near = west <= high_x and south <= high_y and east >= low_x and north >= low_y
            if near and walk.crosswalk.id in self._spans:
                inside = geos.contains_xy(walk.area, track.xy[:, 0], track.xy[:, 1])
                for k in _find_entries(inside, track.xy, walk.across):
                    yield float(track.times[k]), walk.crosswalk.id

    @cached_property
    def _lines(
        self,
    ) -> tuple[tuple[str, ...], FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Ids of the stop lines, and what `_find_passages` asks of them."""
        lines = [e for e in (self._map.stop_lines if self._map else ()) if e.id in self._spans]
        bearing = {leg.name: leg.bearing for leg in (self._map.legs if self._map else ())}
        ends = np.array([line.line for line in lines]).reshape(-1, 2, 2)
        way = ends[:, 1] - ends[:, 0]
        length = np.hypot(way[:, 0], way[:, 1])
        outward = np.array([bearing.get(line.leg, np.nan) for line in lines], dtype=np.float64)
        left = np.sign(way[:, 0] * np.sin(outward) - way[:, 1] * np.cos(outward))
        left_hand = self._map is not None and self._map.left_hand_traffic
        along = way / np.maximum(length, 1e-9)[:, None]
        left = np.nan_to_num(-left if left_hand else left)
        return tuple(line.id for line in lines), ends[:, 0], along, length, left, outward

    def find_red_crossings(self, track: Trajectory) -> tuple[LightCrossing, ...]:
        """Crossings on red."""
        return tuple(
            c
            for c in self.find_crossings(track)
            if c.colour == "red"
            and self.get_colour(c.light, time=c.time - RED_TOLERANCE) in ("red", None)
        )

    def is_any_line_green(self, *, time: float) -> bool:
        """Whether the light of any stop line is green at a time [s]."""
        named = {each.stop_line for spans in self._spans.values() for each in spans} - {None}
        return any(self.get_colour(str(name), time=time) == "green" for name in named)

    def is_held(self, track: Trajectory, since: float, until: float) -> bool:
        """Whether, at some time in a span [s], the light ahead of the mover is not green.

        The light ahead is the first that it meets after the span; tracks that end before one are
        continued straight on for 25 m.
        """
        ahead, _ = self.find_light_after(track, until)
        times = np.arange(since, until + STEP / 2, STEP)
        return ahead is not None and any(
            self.get_colour(ahead, time=float(t)) in ("red", "yellow") for t in times
        )

    def find_light_after(self, track: Trajectory, time: float) -> tuple[str | None, float]:
        """The light that a mover meets first after a time [s], and how far ahead it is then [m].

        Tracks that end before one are continued straight on for 25 m.
        """
        if self._map is None or not self._spans:
            return None, np.inf
        if track not in self._further:
            speed = 5.0 if track.is_vehicle else 1.0
            self._further[track] = extend_straight(track, distance=25.0, speed=speed)
        further = self._further[track]
        for crossing in self.find_crossings(further):
            if crossing.time > time:
                there, here = np.interp((crossing.time, time), further.times, further.s).tolist()
                return crossing.light, there - here
        return None, np.inf

    def list_green_spans(self, light: str) -> list[tuple[float, float]]:
        """From when to when a light is green [s]."""
        return [(e.start, e.end) for e in self._spans.get(light, ()) if e.colour == "green"]


@compiled
def _find_passages(
    xy: FloatArray,
    heading: FloatArray,
    nose: float,
    start: FloatArray,
    along: FloatArray,
    length: FloatArray,
    left: FloatArray,
    outward: FloatArray,
) -> list[tuple[int, int, float]]:
    """Line, sample before and the part of the step at which the front of a mover passes.

    Args:
        nose: how far the front is from the centre [m].
        start: [L, 2] one end of each line [m]; along: [L, 2] unit vector to the other end.
        length: [L] [m]; left: [L] 1 where the other half of the road, as wide as the line is long,
            lies past the end, -1 before the start, 0 if unknown.
        outward: [L] bearing of each leg [rad], NaN if the map lacks the leg.
    """
    front = np.empty(xy.shape)
    for k in range(len(xy)):
        front[k, 0] = xy[k, 0] + nose * np.cos(heading[k])
        front[k, 1] = xy[k, 1] + nose * np.sin(heading[k])
    found = [(0, 0, 0.0) for _ in range(0)]
    for line in range(len(start)):
        reach, after = length[line] + 0.5, 0.0
        for k in range(len(front)):
            east, north = front[k, 0] - start[line, 0], front[k, 1] - start[line, 1]
            before, after = after, along[line, 0] * north - along[line, 1] * east
            if k == 0 or not before * after <= 0 or before == after:
                continue
            east, north = front[k - 1, 0] - start[line, 0], front[k - 1, 1] - start[line, 1]
            place = along[line, 0] * east + along[line, 1] * north
            own = -0.5 < place < reach
            low = -reach if left[line] < 0 else -0.5
            high = length[line] + (reach if left[line] > 0 else 0.5)
            if not low < place < high:
                continue
            # More than a share of the step leads to the junction; without a bearing, any does.
            dx, dy = front[k, 0] - front[k - 1, 0], front[k, 1] - front[k - 1, 1]
            inwards = -(dx * np.cos(outward[line]) + dy * np.sin(outward[line]))
            least = 0.0 if own else WRONG_WAY
            if np.isnan(outward[line]) or inwards > least * np.hypot(dx, dy):
                found.append((line, k - 1, before / (before - after)))
    return found


def check_signal_plan(
    records: Sequence[SignalRecord], intersection_map: IntersectionMap, *, until: float
) -> tuple[Finding, ...]:
    """A plan that is missing, incomplete, or that is the map's programme at no offset whatever.

    Args:
        until: end of the scene [s]; every light of the programme must be shown from 0 up to it.
    """
    if intersection_map.signals is None:
        return ()
    if not records:
        detail = "the map has signals, but the scene has no signal plan"
        return (Finding(rule="no_signal_plan", agents=(), detail=detail),)
    owners: dict[str, set[str]] = {}  # signal groups of every stop line and crosswalk
    for group in intersection_map.signals.groups:
        lines = (m.stop_line for m in intersection_map.movements if m.id in group.movements)
        for light in (*lines, *group.crosswalks):
            owners.setdefault(light, set()).add(group.id)
    reason = _find_bad_record(records, owners, until)
    if reason is None:
        # Group, time and colour in the middle, and near both ends, of every stretch of the plan.
        groups = {light: next(iter(of)) for light, of in owners.items() if len(of) == 1}
        shown = {
            (groups[light], round(time, 4), each.colour)
            for each in records
            for light in (each.stop_line, each.crosswalk)
            if light in groups and light is not None
            for within in (min(0.2, (each.end - each.start) / 2),)
            for time in (each.start + within, (each.start + each.end) / 2, each.end - within)
        }
        offsets = _list_offsets(records, intersection_map.signals)
        fits = any(_fits(shown, intersection_map.signals, k) for k in offsets)
        reason = None if fits else "is the programme of the map at no offset"
    if reason is None:
        return ()
    return (Finding(rule="signal_plan", agents=(), detail=f"the signal plan {reason}"),)


def _find_bad_record(
    records: Sequence[SignalRecord], owners: Mapping[str, set[str]], until: float
) -> str | None:
    """A record that is wrong in itself, or a light whose records leave a gap or overlap.

    They must reach from 0 to the end of the scene. Of a light of several groups, each of which may
    show its own colour, only gaps are reported.
    """
    for record in records:
        names = [n for n in (record.stop_line, record.crosswalk) if n is not None]
        if len(names) != 1:
            return "has a record that names no light, or two"
        if names[0] not in owners:
            return f"names the light {names[0]}, which the programme of the map lacks"
        if not (isfinite(record.start) and isfinite(record.end) and record.start < record.end):
            return f"has a record of {names[0]} that ends before it begins, or at no time"
    spans: dict[str, list[tuple[float, float]]] = {name: [] for name in owners}
    for record in records:
        spans[record.stop_line or record.crosswalk or ""].append((record.start, record.end))
    for name, found in spans.items():
        shown = 0.0
        for start, end in sorted(found):
            if start > shown + SEAM:
                return f"says nothing of {name} at {shown:.1f} s"
            if start < shown - SEAM and len(owners[name]) == 1 and shown > 0:
                return f"says two things of {name} at {start:.1f} s"
            shown = max(shown, end)
        if shown < until - SEAM:
            return f"says nothing of {name} at {shown:.1f} s"
    return None


def _list_offsets(records: Sequence[SignalRecord], program: SignalProgram) -> list[float]:
    """Offsets at which a change of the plan falls on a change of the programme; else all."""
    change = next((r.start for r in records if r.start > 1e-6), None)
    if change is None:
        return [0.1 * k for k in range(round(program.cycle * 10))]
    ends = np.cumsum([phase.duration for phase in program.phases])
    return [float(end - change) for end in ends]


def _fits(shown: set[tuple[str, float, Colour]], program: SignalProgram, offset: float) -> bool:
    ends = list(accumulate(phase.duration for phase in program.phases))
    for group, time, colour in shown:
        k = bisect_right(ends, (time + offset) % program.cycle)
        if program.phases[min(k, len(ends) - 1)].colours.get(group, colour) != colour:
            return False
    return True


@compiled
def _find_entries(inside: BoolArray, xy: FloatArray, across: FloatArray) -> list[int]:
    """First samples of the stretches inside a crosswalk that lead over enough of it."""
    found = [0 for _ in range(0)]
    for k in range(len(inside)):
        if not inside[k] or (k > 0 and inside[k - 1]):
            continue
        low = high = xy[k, 0] * across[0] + xy[k, 1] * across[1]
        for end in range(k + 1, len(inside)):
            if not inside[end]:
                break
            along = xy[end, 0] * across[0] + xy[end, 1] * across[1]
            low, high = min(low, along), max(high, along)
        if high - low >= CROSSING:
            found.append(k)
    return found
