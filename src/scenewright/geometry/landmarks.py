"""Where along its path an agent meets the map: stop line, kerbs, crosswalks, goal."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from operator import itemgetter

import numpy as np

from scenewright.compiled import compiled
from scenewright.geometry.map_areas import MapAreas
from scenewright.scene.base import FloatArray, Point
from scenewright.scene.candidates import Candidate
from scenewright.scene.map import IntersectionMap

_CROSSWALK_GAP, _CORNER = 0.6, 0.3
"""How far before a crosswalk a vehicle stands that must not block it; how far beyond its middle a
turning one's corners may reach into one [m]."""

STOP_GAP = 0.6
"""How far before a stop line or kerb an agent comes to rest [m]."""


@dataclass(frozen=True)
class Landmarks:
    """Arc lengths [m] of the agent's centre.

    Attributes:
        line: a vehicle's front bumper is on its stop line, a pedestrian steps off the kerb.
        crosswalks: (id, where its front first touches it, where its rear has left it).
        group: the signal group that rules `line`; None where nothing does.
        own_crosswalk: the crosswalk that a pedestrian's route leads over.
        steps_on: how often its path comes onto that crosswalk.
        left_hand: people drive on the left here.
    """

    line: float | None
    crosswalks: tuple[tuple[str, float, float], ...]
    group: str | None
    own_crosswalk: str | None = None
    steps_on: int = 1
    left_hand: bool = False

    def move_off_crosswalks(self, s: float, *, own: str | None = None) -> float:
        """The last place up to `s` [m] to stand at and block no crosswalk.

        Args:
            own: the crosswalk that does not count, as the agent yields there.
        """
        for name, begins, ends in reversed(self.crosswalks):
            if begins - _CORNER < s < ends + _CORNER and name != own:
                s = begins - _CROSSWALK_GAP
        return s


@lru_cache(maxsize=512)
def find_landmarks(candidate: Candidate, *, map_areas: MapAreas) -> Landmarks:
    """The landmarks on a candidate's path; candidates are known by identity."""
    route, intersection_map = candidate.route, map_areas.intersection_map
    visits = map_areas.find_crosswalk_visits(candidate.path.xy)
    s, half = candidate.path.s, candidate.shape.length / 2
    found = [(v.crosswalk, float(s[v.first]) - half, float(s[v.last]) + half) for v in visits]
    crossed, group = (
        tuple(sorted(found, key=itemgetter(1))),
        intersection_map.find_signal_group(route),
    )
    if route.type == "vehicle":
        line = _stop_line(candidate, intersection_map)
        return Landmarks(line, crossed, group, left_hand=intersection_map.left_hand_traffic)
    if route.movement == "jaywalking":
        return Landmarks(_find_kerb(candidate, intersection_map), crossed, group)
    own = f"{route.crosswalk}:crosswalk"
    line = next((begins for name, begins, _ in crossed if name == own), None)
    steps_on = sum(visit.steps_on for visit in visits if visit.crosswalk == own)
    return Landmarks(line, crossed, group, None if line is None else own, steps_on)


def _stop_line(candidate: Candidate, intersection_map: IntersectionMap) -> float | None:
    movement = intersection_map.find_movement(candidate.route)
    stop = next(
        (s for s in intersection_map.stop_lines if movement and s.id == movement.stop_line), None
    )
    if stop is None:
        return None
    # Where the path crosses the line, nearest to the segment itself.
    node, share = _find_crossed_segment(candidate.path.xy, *stop.line)
    if node < 0:
        return None
    before, after = candidate.path.s[node : node + 2].tolist()
    return float(before + share * (after - before)) - candidate.shape.length / 2


@compiled
def _find_crossed_segment(xy: FloatArray, a: Point, b: Point) -> tuple[int, float]:
    """Find the point [N, 2] before the crossing, and the share of the step; -1 if nowhere."""
    length = np.hypot(b[0] - a[0], b[1] - a[1])
    ex, ey = (b[0] - a[0]) / length, (b[1] - a[1]) / length
    node, share, least = -1, 0.0, np.inf
    for n in range(len(xy) - 1):
        dx, dy = xy[n, 0] - a[0], xy[n, 1] - a[1]
        side = dx * ey - dy * ex
        beyond = (xy[n + 1, 0] - a[0]) * ey - (xy[n + 1, 1] - a[1]) * ex
        from_middle = abs(dx * ex + dy * ey - length / 2)
        if (beyond > 0.0) != (side > 0.0) and from_middle < least:
            node, share, least = n, side / (side - beyond), from_middle
    return node, share


def _find_kerb(candidate: Candidate, intersection_map: IntersectionMap) -> float | None:
    """Find where a jaywalker steps onto the roadway: the leg's kerb line at its crosswalk."""
    leg = candidate.route.crosswalk
    crosswalk = next((each for each in intersection_map.crosswalks if each.leg == leg), None)
    if crosswalk is None:
        return None
    a, b = np.array(crosswalk.centreline[0]), np.array(crosswalk.centreline[1])
    length = float(np.hypot(*(b - a)))
    forward = (candidate.path.xy - a) @ ((b - a) / length)
    inside = np.nonzero((forward >= 0) & (forward <= length))[0]
    if not len(inside):
        return None
    return float(candidate.path.s[inside[0]]) - candidate.shape.length / 2
