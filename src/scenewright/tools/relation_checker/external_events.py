"""Events in recordings of any length: whole if they are small, else in overlapping windows.

Everything that the checker measures is between pairs, and a table of all pairs at all times does
not fit the memory for an hour of a busy place. A window looks at its own span and at `CONTEXT`
seconds on both sides, far more than any definition in SEMANTICS section 4 reaches, and answers for
the events whose time lies in the span.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.events import Event, Finding
from scenewright.scene.map import IntersectionMap
from scenewright.scene.track import STEP, Track
from scenewright.tools.relation_checker.contact import find_near_pairs
from scenewright.tools.relation_checker.events import find_events
from scenewright.tools.relation_checker.plausibility import check_ground
from scenewright.tools.relation_checker.trajectory import RoadUser, build_trajectories

CONTEXT = 30.0
SHORTEST = 5.0
"""Windows are not cut below this [s]."""
MOST_PAIR_SAMPLES = 15_000_000
"""Pairs times samples that are looked at in one go, some 70 bytes each."""
MOST_FORCED = 10 * MOST_PAIR_SAMPLES


@dataclass(frozen=True, eq=False)
class ExternalTracks:
    """Tracks from a file, ready for the checker.

    Attributes:
        users: one for each stretch of a track without a gap; ids are numbers of this object.
        names: id in the file, by id of the user; the stretches of one track share it.
        subtypes: car, truck, bus, motorcycle, bicycle or pedestrian, by id of the user.
        step: time between samples [s].
        origin: time in the file at which the times of the users are 0 [s]; 0 but for clock times.
        notes: what was assumed, one sentence each.
    """

    users: tuple[RoadUser, ...]
    names: Mapping[int, str]
    subtypes: Mapping[int, str]
    step: float
    origin: float = 0.0
    notes: tuple[str, ...] = ()

    @property
    def renamed(self) -> frozenset[int]:
        """Users whose id is not the one in the file."""
        return frozenset(n for n, name in self.names.items() if str(n) != name)


def find_recorded_events(
    tracks: ExternalTracks, *, intersection_map: IntersectionMap | None = None
) -> tuple[Event, ...]:
    """Every event in a recording, in order of time; none between two stretches of one track.

    A follow that goes on for more than `CONTEXT` seconds after its window ends is cut there.

    Raises:
        InputError: too many agents at once.
    """
    users, names = tracks.users, tracks.names
    begin = min((u.track.start for u in users), default=0.0)
    end = max((u.track.end for u in users), default=0.0) + 1.0
    if _fits(users):
        found: Sequence[Event] = find_events(users, intersection_map=intersection_map)
    else:
        found = _search_windows(users, begin, end, intersection_map, until=end - 1.0)
    return tuple(e for e in found if names[e.from_] != names[e.to])


def find_off_map(tracks: ExternalTracks, intersection_map: IntersectionMap) -> tuple[Finding, ...]:
    """Agents that spend more than 2 % of their time where their class does not belong."""
    return check_ground(build_trajectories(tracks.users), intersection_map, jaywalkers=frozenset())


def count_pair_samples(users: Sequence[RoadUser]) -> float:
    """Pairs times samples from the first start to the last end."""
    if len(users) < 2:
        return 0.0
    span = max(u.track.end for u in users) - min(u.track.start for u in users)
    return len(users) * (len(users) - 1) / 2 * (span / STEP + 1)


def _fits(users: Sequence[RoadUser]) -> bool:
    return count_pair_samples(users) <= MOST_PAIR_SAMPLES


def _count_near_pair_samples(users: Sequence[RoadUser]) -> float:
    """Those of the pairs that may have to do with one another, while both are there."""
    spans = np.array([(u.track.start, u.track.end) for u in users])
    bounds = np.array([(*u.track.xy.min(axis=0), *u.track.xy.max(axis=0)) for u in users])
    first, second = find_near_pairs(spans, bounds).T
    (start, end), (other_start, other_end) = spans[first].T, spans[second].T
    together = np.minimum(end, other_end) - np.maximum(start, other_start)
    return float((np.maximum(together / STEP, 0.0) + 1.0).sum())


def _search_windows(
    users: Sequence[RoadUser],
    begin: float,
    end: float,
    intersection_map: IntersectionMap | None,
    *,
    until: float,
) -> list[Event]:
    """Events from begin to end [s], by halves until they fit; the recording ends at `until`."""
    present = _clip_tracks(users, begin - CONTEXT, end + CONTEXT)
    if len(present) < 2:
        return []
    if _count_near_pair_samples(present) <= MOST_PAIR_SAMPLES:
        seen = find_events(present, intersection_map=intersection_map, until=until)
        return [e for e in seen if begin <= e.time < end]
    if end - begin <= 2 * SHORTEST:
        return _search_shortest_window(present, begin, end, intersection_map, until=until)
    middle = STEP * round((begin + end) / 2 / STEP)
    return [
        event
        for a, b in ((begin, middle), (middle, end))
        for event in _search_windows(users, a, b, intersection_map, until=until)
    ]


def _search_shortest_window(
    users: Sequence[RoadUser],
    begin: float,
    end: float,
    intersection_map: IntersectionMap | None,
    *,
    until: float,
) -> list[Event]:
    if _count_near_pair_samples(users) > MOST_FORCED:
        raise InputError(
            f"{len(users)} agents around {begin:.0f} s are too many at once; "
            "check the tracks of a smaller area"
        )
    seen = find_events(users, intersection_map=intersection_map, until=until)
    return [e for e in seen if begin <= e.time < end]


def _clip_tracks(users: Sequence[RoadUser], begin: float, end: float) -> list[RoadUser]:
    """What of each track lies between two times [s]."""
    parts = (_clip_track(user, begin, end) for user in users)
    return [part for part in parts if part is not None]


def _clip_track(user: RoadUser, begin: float, end: float) -> RoadUser | None:
    track = user.track
    if track.end < begin or track.start > end:
        return None
    first = max(math.ceil((begin - track.start) / track.step), 0)
    first -= first % _find_period(track.step)
    last = min(math.floor((end - track.start) / track.step), len(track.xy) - 1)
    if last < first:
        return None
    part = Track(
        track.xy[first : last + 1], track.heading[first : last + 1],
        track.start + first * track.step, track.step,
    )  # fmt: skip
    return RoadUser(user.id, part, user.shape)


def _find_period(step: float) -> int:
    """Samples in a multiple of 0.2 s: cut there, following is sampled at the same times."""
    for count in (1, 2, 3, 4, 5, 6, 8, 10, 12, 20, 30):
        if abs(count * step / 0.2 - round(count * step / 0.2)) < 1e-6:
            return count
    return 1
