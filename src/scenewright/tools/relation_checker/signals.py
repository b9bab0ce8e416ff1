"""Who meets which light when: stop lines, crosswalks, red crossings, waiting at red."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenewright.scene.base import Colour
from scenewright.scene.events import Finding
from scenewright.scene.map import Crosswalk, IntersectionMap, SignalProgram, StopLine
from scenewright.scene.record import SignalRecord
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.motion import Mover, extended
from scenewright.tools.relation_checker.planar import geos

CROSSING = 2.0
"""Who walks less than this across the street in a crosswalk [m] only rounds its corner."""
RED_TOLERANCE = 0.1
"""A crossing this shortly after the light turned red [s] is one sample's doubt, no violation."""


@dataclass(frozen=True)
class Crossing:
    """A vehicle's front bumper over a stop line, or a pedestrian's step into a crosswalk.

    Attributes:
        time: [s]; light: id of the stop line or crosswalk; colour: shown then, None if unknown.
    """

    time: float
    light: str
    colour: Colour | None


class Lights:
    """The signal plan of a scene, by stop line and crosswalk."""

    def __init__(self, records: Sequence[SignalRecord], ground: IntersectionMap | None) -> None:
        self._spans: dict[str, list[SignalRecord]] = {}
        for record in records:
            for name in (record.stop_line, record.crosswalk):
                if name is not None:
                    self._spans.setdefault(name, []).append(record)
        self._ground = ground
        self._bearing = {leg.name: leg.bearing for leg in ground.legs} if ground else {}

    def colour(self, light: str, *, time: float) -> Colour | None:
        """What a light shows at a time [s]; None where the plan does not say."""
        for span in self._spans.get(light, ()):
            if span.start <= time < span.end:
                return span.colour
        return None

    def crossings(self, mover: Mover) -> tuple[Crossing, ...]:
        """Every signalised line or crosswalk that the mover meets, in order of time."""
        if self._ground is None or not self._spans:
            return ()
        found = (
            [(t, line.id) for line in self._ground.stop_lines for t in self._line(mover, line)]
            if mover.is_vehicle
            else [(t, walk.id) for walk in self._ground.crosswalks for t in _entries(mover, walk)]
        )
        return tuple(
            Crossing(t, name, self.colour(name, time=t))
            for t, name in sorted(found)
            if name in self._spans
        )

    def ran_red(self, mover: Mover) -> tuple[Crossing, ...]:
        """Crossings on red."""
        return tuple(
            c
            for c in self.crossings(mover)
            if c.colour == "red"
            and self.colour(c.light, time=c.time - RED_TOLERANCE) in ("red", None)
        )

    def held(self, mover: Mover, *, since: float, until: float) -> bool:
        """Whether, at some time in a span [s], the light ahead of the mover is not green.

        The light ahead is the first that it meets after the span; tracks that end before one are
        continued straight on for 25 m.
        """
        if self._ground is None or not self._spans:
            return False
        further = extended(mover, distance=25.0, speed=5.0 if mover.is_vehicle else 1.0)
        ahead = next((c.light for c in self.crossings(further) if c.time > until), None)
        times = np.arange(since, until + STEP / 2, STEP)
        return ahead is not None and any(
            self.colour(ahead, time=float(t)) in ("red", "yellow") for t in times
        )

    def _line(self, mover: Mover, line: StopLine) -> list[float]:
        """Times at which the middle of the front bumper passes the line, towards the junction."""
        facing = np.stack((np.cos(mover.heading), np.sin(mover.heading)), axis=1)
        front = mover.xy + mover.half_length * facing
        p, q = np.array(line.line[0]), np.array(line.line[1])
        along = (q - p) / max(float(np.hypot(*(q - p))), 1e-9)
        offset = front - p
        side = along[0] * offset[:, 1] - along[1] * offset[:, 0]
        place = offset @ along
        length = float(np.hypot(*(q - p)))
        hits = np.flatnonzero((side[:-1] * side[1:] <= 0) & (side[:-1] != side[1:]))
        hits = hits[(place[hits] > -0.5) & (place[hits] < length + 0.5)]
        outward = self._bearing.get(line.leg)
        inward = [k for k in hits if outward is None or _towards(front[k + 1] - front[k], outward)]
        return [float(mover.times[k] + STEP * side[k] / (side[k] - side[k + 1])) for k in inward]


def _towards(step: np.ndarray[tuple[int], np.dtype[np.float64]], outward: float) -> bool:
    return bool(step[0] * np.cos(outward) + step[1] * np.sin(outward) < 0)


def plan_contradictions(
    records: Sequence[SignalRecord], ground: IntersectionMap
) -> tuple[Finding, ...]:
    """A plan that is missing, or that is the map's programme at no offset whatever."""
    if ground.signals is None:
        return ()
    if not records:
        detail = "the map has signals, but the scene has no signal plan"
        return (Finding(rule="no_signal_plan", agents=(), detail=detail),)
    shown = _shown(records, _groups(ground))
    if any(_fits(shown, ground.signals, k) for k in _offsets(records, ground.signals)):
        return ()
    detail = "the signal plan is the programme of the map at no offset"
    return (Finding(rule="signal_plan", agents=(), detail=detail),)


def _offsets(records: Sequence[SignalRecord], program: SignalProgram) -> list[float]:
    """Offsets at which a change of the plan falls on a change of the programme; else all."""
    change = next((r.start for r in records if r.start > 0.1), None)
    if change is None:
        return [0.1 * k for k in range(round(program.cycle * 10))]
    ends = np.cumsum([phase.duration for phase in program.phases])
    return [float(end - change) for end in ends]


def _groups(ground: IntersectionMap) -> dict[str, str]:
    """Signal group of every stop line and crosswalk that belongs to exactly one."""
    owners: dict[str, set[str]] = {}
    for group in ground.signals.groups if ground.signals else ():
        lines = (m.stop_line for m in ground.movements if m.id in group.movements)
        for light in (*lines, *group.crosswalks):
            owners.setdefault(light, set()).add(group.id)
    return {light: next(iter(ids)) for light, ids in owners.items() if len(ids) == 1}


def _shown(
    records: Sequence[SignalRecord], groups: dict[str, str]
) -> set[tuple[str, float, Colour]]:
    """Group, time and colour in the middle, and near both ends, of every stretch of the plan."""
    return {
        (groups[light], round(time, 3), r.colour)
        for r in records
        for light in (r.stop_line, r.crosswalk)
        if light in groups and light is not None and r.end - r.start > 0.4
        for time in (r.start + 0.2, (r.start + r.end) / 2, r.end - 0.2)
    }


def _fits(shown: set[tuple[str, float, Colour]], program: SignalProgram, offset: float) -> bool:
    ends = np.cumsum([phase.duration for phase in program.phases])
    for group, time, colour in shown:
        k = int(np.searchsorted(ends, (time + offset) % program.cycle, side="right"))
        if program.phases[min(k, len(ends) - 1)].colours.get(group, colour) != colour:
            return False
    return True


def _entries(mover: Mover, walk: Crosswalk) -> list[float]:
    """Times at which a pedestrian steps into the crosswalk and walks at least 2 m across."""
    ring = np.array(walk.polygon)
    low, high = mover.xy.min(axis=0), mover.xy.max(axis=0)
    if (low > ring.max(axis=0)).any() or (high < ring.min(axis=0)).any():
        return []
    inside = geos.contains_xy(geos.Polygon(ring), mover.xy[:, 0], mover.xy[:, 1])
    edges = np.flatnonzero(np.diff(np.concatenate(([False], inside, [False])).astype(np.int8)))
    across = np.subtract(*np.array(walk.centreline)[::-1])
    along = mover.xy @ (across / max(float(np.hypot(*across)), 1e-9))
    return [
        float(mover.times[i])
        for i, j in edges.reshape(-1, 2)
        if i > 0 and float(np.ptp(along[i:j])) >= CROSSING
    ]
