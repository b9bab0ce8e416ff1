"""The scene's signal plan: colours over time, what agents demand of it, and a feasible offset."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled
from scenewright.scene.base import Colour, FloatArray
from scenewright.scene.cache import RecentCache
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import SignalProgram
from scenewright.scene.record import SignalRecord

_RESOLUTION = 0.5
"""Grid on which offsets of the programme are tried [s]."""


Greens = tuple[FloatArray, NDArray[np.bool_], float, float]
"""When the phases of a light end [s], which are green, offset and cycle [s]; no phases: no
light."""


@dataclass(frozen=True)
class SignalDemand:
    """During [start, end] [s] the light of `group` must show one of `colours`."""

    group: str
    start: float
    end: float
    colours: tuple[Colour, ...]


@dataclass(frozen=True)
class SignalClock:
    """The programme running with an offset: at scene time t it is at (t + offset) mod cycle."""

    program: SignalProgram
    offset: float

    def get_colour(self, group: str, time: float) -> Colour:
        """What `group` shows at scene time [s]."""
        left = (time + self.offset) % self.program.cycle
        for phase in self.program.phases:
            if left < phase.duration:
                return phase.colours[group]
            left -= phase.duration
        return self.program.phases[-1].colours[group]

    def get_greens(self, group: str) -> Greens:
        """When the light of `group` is green."""
        edges, green = get_phases(self.program, group, ("green",))
        return edges, green, float(self.offset), float(self.program.cycle)


def find_feasible_offsets(program: SignalProgram, demands: tuple[SignalDemand, ...]) -> FloatArray:
    """All offsets [s] of the programme, on a 0.5 s grid, under which every demand is met."""
    offsets = np.arange(0.0, program.cycle, _RESOLUTION)
    good = np.ones(len(offsets), dtype=bool)
    for demand in demands:
        count = max(2, int((demand.end - demand.start) / _RESOLUTION) + 2)
        times = np.linspace(demand.start, demand.end, count)
        shown = is_showing(program, demand.group, offsets[:, None] + times, demand.colours)
        good &= shown.all(axis=1)
    return offsets[good]


def get_red_duration(program: SignalProgram, group: str, offsets: FloatArray) -> FloatArray:
    """[N] how long the group has not been green when the programme is at `offsets` [s].

    A whole cycle where it never is. Offsets count on the grid of `find_feasible_offsets`.
    """

    def make() -> FloatArray:
        grid = np.arange(0.0, program.cycle, _RESOLUTION)
        green = is_showing(program, group, grid[:, None] - grid, ("green",))
        return np.where(green.any(axis=1), grid[green.argmax(axis=1)], program.cycle)

    known = _RED_FOR.get((id(program), group), program, make=make)
    return known[np.round(offsets / _RESOLUTION).astype(np.int64) % len(known)]


_RED_FOR: RecentCache[tuple[int, str], FloatArray] = RecentCache(most=64)
"""By programme and group, for every offset of the grid."""


def is_showing(
    program: SignalProgram, group: str, times: FloatArray, colours: tuple[Colour, ...]
) -> NDArray[np.bool_]:
    """Whether `group` shows one of `colours` at times [s] of the programme (any shape)."""
    edges, fits = get_phases(program, group, colours)
    return _is_shown(times.ravel(), edges, fits, program.cycle).reshape(times.shape)


@compiled
def _is_shown(
    times: FloatArray, edges: FloatArray, fits: NDArray[np.bool_], cycle: float
) -> NDArray[np.bool_]:
    shown = np.empty(len(times), np.bool_)
    for n in range(len(times)):
        shown[n] = is_showing_at(times[n], edges, fits, cycle)
    return shown


@compiled
def is_showing_at(time: float, edges: FloatArray, fits: NDArray[np.bool_], cycle: float) -> bool:
    """Whether the programme is at `time` [s] in a phase that fits (`get_phases`)."""
    left, phase = time % cycle, 0
    while phase < len(edges) - 1 and not edges[phase] > left:  # never (infinity) is the last
        phase += 1
    return bool(fits[phase])


@compiled
def is_green(time: float, greens: Greens) -> bool:
    """Return whether the light is green at a scene time [s]."""
    edges, green, offset, cycle = greens
    return is_showing_at(time + offset, edges, green, cycle)


@compiled
def find_green(time: float, greens: Greens) -> float:
    """Find the first scene time [s] from `time` on at which the light turns, or is, green."""
    edges, green, offset, cycle = greens
    if is_green(time, greens):
        return time
    at = (time + offset) % cycle
    for lap in range(2):
        for k in range(len(edges)):
            begins = lap * cycle + (edges[k - 1] if k else 0.0)
            if begins >= at and green[k]:
                return time + begins - at
    return np.inf


def get_phases(
    program: SignalProgram, group: str, colours: tuple[Colour, ...]
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """When every phase ends [s], and whether the group shows one of the colours in it."""

    def make() -> tuple[FloatArray, NDArray[np.bool_]]:
        edges = np.add.accumulate([phase.duration for phase in program.phases])
        return edges, np.array([phase.colours[group] in colours for phase in program.phases])

    return _PHASES.get((id(program), group, colours), program, make=make)


_PHASES: RecentCache[tuple[int, str, tuple[Colour, ...]], tuple[FloatArray, NDArray[np.bool_]]] = (
    RecentCache(most=256)
)
"""By programme, group and colours."""


def build_signal_records(
    clock: SignalClock, *, intersection_map: IntersectionMap, until: float
) -> tuple[SignalRecord, ...]:
    """The plan of scene.json: every stop line's and crosswalk's colours over [0, until]."""
    if intersection_map.signals is None:
        return ()
    stop_line = {movement.id: movement.stop_line for movement in intersection_map.movements}
    records: list[SignalRecord] = []
    for group in intersection_map.signals.groups:
        lines = dict.fromkeys(stop_line[movement] for movement in group.movements)
        heads = [("stop_line", line) for line in lines]
        heads += [("crosswalk", crosswalk) for crosswalk in group.crosswalks]
        for start, end, colour in _list_stretches(clock, group.id, until):
            for key, head in heads:
                records.append(
                    SignalRecord.model_validate(
                        {key: head, "start": start, "end": end, "colour": colour}
                    )
                )
    return tuple(records)


def _list_stretches(
    clock: SignalClock, group: str, until: float
) -> list[tuple[float, float, Colour]]:
    """(start, end, colour) over [0, until], neighbouring stretches of one colour joined."""
    stretches: list[tuple[float, float, Colour]] = []
    start = -(clock.offset % clock.program.cycle)
    while start < until:
        for phase in clock.program.phases:
            low, high = max(start, 0.0), min(start + phase.duration, until)
            colour = phase.colours[group]
            if high > low:
                if stretches and stretches[-1][2] == colour:
                    stretches[-1] = (stretches[-1][0], round(high, 3), colour)
                else:
                    stretches.append((round(low, 3), round(high, 3), colour))
            start += phase.duration
    return stretches
