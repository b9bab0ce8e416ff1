"""Which differences of entry times keep two agents from interacting (SEMANTICS 4, certificate)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenewright.scene.candidates import Candidate, Path
from scenewright.scene.track import STEP
from scenewright.tools.dsl_validator.actor import Actor
from scenewright.tools.encounter import Encounter, Intervals, encounter, meeting_offsets, meetings
from scenewright.tools.time_law import Motion

_NODE = {"vehicle": 0.6, "pedestrian": 0.25}
"""Distance of path nodes [m]: small beside the clearance that they must not miss."""


@dataclass(frozen=True)
class Separation:
    """How far apart in space [m] and time [s] two agents must stay."""

    clearance: float
    gap: float


FOREGROUND = Separation(clearance=0.8, gap=1.75)
BACKGROUND = Separation(clearance=0.8, gap=1.25)
WALKERS = Separation(clearance=0.15, gap=0.0)
AFTER_YIELD = Separation(clearance=0.0, gap=2.4)
"""Around where a yielding agent would have been unheld: no second cause for its stop."""

WALKER_AHEAD = 8.4
"""Nobody else crosses so shortly [s] before a vehicle that waits for one pedestrian."""


class Geometry:
    """Encounters of paths, computed once per pair of paths."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, int], Encounter | None] = {}
        self._alive: list[Path] = []

    def between(self, a: Actor, b: Actor) -> Encounter | None:
        """Where the two come within the widest clearance; None if they never do."""
        first, second = a.candidate, b.candidate
        key = (id(first.path), id(second.path))
        if key not in self._known:
            self._alive += [first.path, second.path]
            self._known[key] = None if _apart(a, b) else _encounter(first, second)
        return self._known[key]


def _encounter(a: Candidate, b: Candidate) -> Encounter | None:
    shapes = (a.shape, b.shape)
    spacing = (_NODE[a.route.type], _NODE[b.route.type])
    both_walk = a.route.type == b.route.type == "pedestrian"
    reach = (WALKERS if both_walk else FOREGROUND).clearance
    pair = encounter(a.path, b.path, shapes=shapes, reach=reach, spacing=spacing)
    return pair if len(pair.i) else None


def forbidden_offsets(
    a: Actor, b: Actor, *, strict: bool, geometry: Geometry | None = None
) -> list[tuple[int, int]]:
    """Open intervals (low, high) [steps] that o_b - o_a must avoid for the pair not to interact."""
    pair = (geometry or Geometry()).between(a, b)
    if pair is None:
        return []
    zones = [_widened(pair, a.motion, b.motion, _separation(a, b, strict))]
    if any(stop.reason == "gives_way" for stop in a.stops):
        zones.append(_widened(pair, a.free, b.motion, AFTER_YIELD))
        if a.candidate.route.type == "vehicle" and b.candidate.route.type == "pedestrian":
            touch = meeting_offsets(pair, a.motion, b.motion, c=0.0)
            zones.append(touch - [[WALKER_AHEAD, 0.0]])
    return _steps(np.concatenate(zones))


def _separation(a: Actor, b: Actor, strict: bool) -> Separation:
    if a.candidate.route.type == b.candidate.route.type == "pedestrian":
        return WALKERS
    return FOREGROUND if strict else BACKGROUND


def _apart(a: Actor, b: Actor) -> bool:
    """Whether the two paths never come near one another (bounding boxes)."""
    shapes = (a.candidate.shape, b.candidate.shape)
    reach = sum(np.hypot(each.length, each.width) / 2 for each in shapes) + FOREGROUND.clearance
    low_a, high_a = a.candidate.path.xy.min(axis=0), a.candidate.path.xy.max(axis=0)
    low_b, high_b = b.candidate.path.xy.min(axis=0), b.candidate.path.xy.max(axis=0)
    return bool((low_a > high_b + reach).any() or (low_b > high_a + reach).any())


def _widened(pair: Encounter, a: Motion, b: Motion, separation: Separation) -> Intervals:
    """C(clearance) and C(0) widened by the time gap."""
    found = meetings(pair, a, b)
    gap = np.array([[-separation.gap, separation.gap]])
    return np.concatenate([found.within(separation.clearance), found.within(0.0) + gap])


def _steps(intervals: Intervals) -> list[tuple[int, int]]:
    if not len(intervals):
        return []
    ordered = intervals[np.argsort(intervals[:, 0])]
    joined = [list(ordered[0])]
    for low, high in ordered[1:]:
        if low <= joined[-1][1]:
            joined[-1][1] = max(joined[-1][1], high)
        else:
            joined.append([low, high])
    return [(int(np.floor(low / STEP)) - 1, int(np.ceil(high / STEP)) + 1) for low, high in joined]
