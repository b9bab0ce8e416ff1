"""Clauses and standstills that words of the instruction ask for, measured on the final tracks.

They stand in the account as the text form of a clause, or as "vehicle-1 stands 12.0-13.5 s".
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from scenewright.scene.events import Event
from scenewright.scene.map import IntersectionMap
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.events import SceneObservation
from scenewright.tools.relation_checker.ground_raster import get_ground_raster
from scenewright.tools.relation_checker.legs import BESIDE
from scenewright.tools.relation_checker.passing_order import find_crossing_order
from scenewright.tools.relation_checker.planar import geos
from scenewright.tools.relation_checker.trajectory import Trajectory
from scenewright.tools.relation_checker.yielding import STANDING

KEPT = 1.0
"""How long a speed is to be kept for the agent to drive or walk at it [s]."""
JUNCTION = 6.0
"""Radius of the inner area of the intersection [m]."""
LEAST_STAND = 0.5
"""A shorter standstill is none [s]."""
SLACK = {"speed": 0.02, "time_gap": 0.05, "headway": 0.15, "near": 0.1, "stands": 0.15}
"""How far beside its bounds a figure may be measured [m/s, s, s, m, s]."""
SPELT = {"once": 1, "twice": 2, "two times": 2, "three times": 3, "thrice": 3, "four times": 4}

_NAME = r"((?:vehicle|pedestrian)-\d+)"
_NUMBER = r"(-?[0-9]+(?:\.[0-9]*)?(?:e[+-]?[0-9]{1,3})?)"
_RANGE = rf"in \[{_NUMBER}, {_NUMBER}\] (?:m/s|s)"
_SPEED = re.compile(rf"speed\({_NAME}\) {_RANGE}")
_PASSES = re.compile(rf"passes_through\({_NAME}, (crosswalk|leg|junction) ?(\w*)\)")
_BEFORE = re.compile(rf"before\({_NAME}, {_NAME}\)")
_GAP = re.compile(rf"(time_gap|headway)\({_NAME}, {_NAME}\) {_RANGE}")
_NEAR = re.compile(rf"near\({_NAME}, {_NAME}\) <= {_NUMBER} m")
_STANDS = re.compile(rf"{_NAME} stands {_NUMBER}-{_NUMBER} s")
_TIMES = re.compile(rf"\b({'|'.join(SPELT)})\b", re.IGNORECASE)


class AskedFor:
    """What the tracks show of clauses and standstills.

    Args:
        numbers: of the agents, by their names in the account.
    """

    def __init__(
        self,
        numbers: Mapping[str, int],
        events: Sequence[Event],
        observed: SceneObservation,
        intersection_map: IntersectionMap | None,
    ) -> None:
        self._numbers, self._events, self._observed = numbers, events, observed
        self._map = intersection_map
        self._tracks = {track.id: track for track in observed.tracks}
        self._rules: tuple[tuple[re.Pattern[str], Callable[[re.Match[str]], str | None]], ...] = (
            (_SPEED, self._check_speed),
            (_PASSES, self._check_passage),
            (_BEFORE, self._check_order),
            (_GAP, self._check_gap),
            (_NEAR, self._check_nearness),
            (_STANDS, self._check_standstill),
        )

    def find(self, value: str | None, words: str) -> str | None:
        """Evidence for all that words became; None if the tracks lack any of it.

        Args:
            value: clauses or standstills, with "; " between them.
        """
        found = [self._find_one(each) for each in (value or "").split("; ")]
        found += self._count_standstills(value or "", words)
        evidence = [each for each in found if each is not None]
        return "; ".join(evidence) if len(evidence) == len(found) else None

    def _find_one(self, text: str) -> str | None:
        for pattern, rule in self._rules:
            match = pattern.fullmatch(text)
            if match is not None:
                names = [each for each in match.groups() if each and re.fullmatch(_NAME, each)]
                return rule(match) if all(name in self._numbers for name in names) else None
        return None

    def _get_track(self, name: str) -> Trajectory:
        return self._tracks[self._numbers[name]]

    def _check_speed(self, match: re.Match[str]) -> str | None:
        """The highest speed that is kept for a second lies in the range."""
        track, low, high = self._get_track(match[1]), float(match[2]), float(match[3])
        window = round(KEPT / STEP)
        if len(track.speed) <= window:
            return None
        kept = np.lib.stride_tricks.sliding_window_view(track.speed, window).min(axis=1).max()
        if not low - SLACK["speed"] <= kept <= high + SLACK["speed"]:
            return None
        return f"agent {track.id} goes at {kept:.1f} m/s"

    def _check_passage(self, match: re.Match[str]) -> str | None:
        if self._map is None:
            return None
        track, ground = self._get_track(match[1]), get_ground_raster(self._map)
        path = geos.LineString(track.xy)
        if match[2] == "junction":
            passes = float(np.hypot(*track.xy.T).min()) < JUNCTION
        elif match[2] == "crosswalk":
            walks = [each for each in ground.crosswalks if each.crosswalk.leg == match[3]]
            passes = any(geos.intersects(each.area, path) for each in walks)
        else:
            lanes = [each.centreline for each in self._map.lanelets if each.leg == match[3]]
            passes = any(path.distance(geos.LineString(each)) <= BESIDE for each in lanes)
        return f"agent {track.id} passes there" if passes else None

    def _check_order(self, match: re.Match[str]) -> str | None:
        first, second = self._get_track(match[1]).id, self._get_track(match[2]).id
        order = find_crossing_order(self._observed, {first, second})
        ahead = order is not None and order.first == first
        return f"agent {first} passes before agent {second}" if ahead else None

    def _check_gap(self, match: re.Match[str]) -> str | None:
        pair = self._get_track(match[2]).id, self._get_track(match[3]).id
        gap = self._observed.pet(pair) if match[1] == "time_gap" else self._find_headway(pair)
        low, high, slack = float(match[4]), float(match[5]), SLACK[match[1]]
        if gap is None or not low - slack <= gap <= high + slack:
            return None
        return f"{match[1].replace('_', ' ')} of {pair[0]} and {pair[1]} is {gap:.2f} s"

    def _find_headway(self, pair: tuple[int, int]) -> float | None:
        follows = [e for e in self._events if e.type == "follow" and (e.from_, e.to) == pair]
        found = [e.evidence.get("least_headway") for e in follows]
        return min((float(each) for each in found if each is not None), default=None)

    def _check_nearness(self, match: re.Match[str]) -> str | None:
        first, second = self._get_track(match[1]), self._get_track(match[2])
        apart = float(geos.LineString(first.xy).distance(geos.LineString(second.xy)))
        if apart > float(match[3]) + SLACK["near"]:
            return None
        return f"the ways of {first.id} and {second.id} come within {apart:.1f} m"

    def _check_standstill(self, match: re.Match[str]) -> str | None:
        """It stands in the middle of the time, and as long."""
        track, start, end = self._get_track(match[1]), float(match[2]), float(match[3])
        for begins, ends in find_standstills(track):
            if begins <= (start + end) / 2 <= ends:
                long = ends - begins >= end - start - SLACK["stands"]
                return f"agent {track.id} stands {begins:.1f}-{ends:.1f} s" if long else None
        return None

    def _count_standstills(self, value: str, words: str) -> list[str | None]:
        """ "Stops twice": every agent of these words stands so often in all."""
        times = _TIMES.search(words)
        if times is None:
            return []
        wanted = SPELT[times[1].lower()]
        found: list[str | None] = []
        for name in dict.fromkeys(match[1] for match in _STANDS.finditer(value)):
            count = len(find_standstills(self._get_track(name))) if name in self._numbers else 0
            found.append(f"{count} standstills" if count == wanted else None)
        return found


def find_standstills(track: Trajectory) -> list[tuple[float, float]]:
    """From when to when an agent stands [s], in order."""
    slow = np.concatenate(([False], track.speed <= STANDING, [False]))
    edges = np.flatnonzero(slow[1:] != slow[:-1])
    spans = [
        (float(track.times[begin]), float(track.times[end - 1]))
        for begin, end in edges.reshape(-1, 2)
    ]
    return [each for each in spans if each[1] - each[0] >= LEAST_STAND - 1e-6]
