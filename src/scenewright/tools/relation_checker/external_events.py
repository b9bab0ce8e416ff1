"""Events in recordings of any length: whole if they are small, else in overlapping windows.

Everything that the checker measures is between pairs, and a table of all pairs at all times does
not fit the memory for an hour of a busy place. A window looks at its own span and at `CONTEXT`
seconds on both sides, far more than any definition in SEMANTICS section 4 reaches, and answers for
the events whose time lies in the span.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.events import Event, Finding
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import SignalRecord
from scenewright.scene.track import STEP, Track
from scenewright.tools.relation_checker.certificate import find_contacts
from scenewright.tools.relation_checker.contact import find_near_pairs
from scenewright.tools.relation_checker.events import SceneObservation, observe
from scenewright.tools.relation_checker.plausibility import check_ground
from scenewright.tools.relation_checker.reactions import Sights, find_avoidability
from scenewright.tools.relation_checker.trajectory import RoadUser, build_trajectories

CONTEXT = 30.0
SHORTEST = 5.0
"""Windows are not cut below this [s]."""
MOST_PAIR_SAMPLES = 15_000_000
"""Pairs times samples that are looked at in one go, some 70 bytes each."""
MOST_FORCED = 10 * MOST_PAIR_SAMPLES
NOISE = 10.0
"""What no agent does by itself: more acceleration than this before a contact [m/s^2]."""
UNTOUCHED = 0.25
"""Share of the speed of a contact that at least one of the two must gain or lose by it."""
MOST_AVOIDED = 200
"""Of so many events in one look it is measured what would have avoided them."""


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


@dataclass(frozen=True, eq=False)
class RecordedEvents:
    """What happens in a recording.

    Attributes:
        events: in order of time.
        contacts: footprints that touch or overlap without a collision.
        implausible: collisions among the events that the tracks themselves deny.
        avoidability: of the collisions and near misses, see `find_avoidability`; without those of
            a look at more than `MOST_AVOIDED` events.
    """

    events: tuple[Event, ...] = ()
    contacts: tuple[Finding, ...] = ()
    implausible: tuple[Finding, ...] = ()
    avoidability: tuple[dict[str, Any], ...] = ()

    @property
    def plausible(self) -> list[Event]:
        """The events without the collisions that the tracks themselves deny."""
        denied = {("collision", each.time, *each.agents) for each in self.implausible}
        return [e for e in self.events if (e.type, e.time, e.from_, e.to) not in denied]


def examine_recording(
    tracks: ExternalTracks, *, intersection_map: IntersectionMap | None = None
) -> RecordedEvents:
    """Everything that happens in a recording; nothing between two stretches of one track.

    A follow that goes on for more than `CONTEXT` seconds after its window ends is cut there.

    Raises:
        InputError: too many agents at once.
    """
    left_hand = intersection_map is not None and intersection_map.left_hand_traffic
    found, avoided = list[Event](), list[dict[str, Any]]()
    contacts, implausible = list[Finding](), list[Finding]()
    for observed, begin, end in observe_recording(tracks, intersection_map=intersection_map):
        events = [e for e in observed.events if begin <= e.time < end]
        found += events
        implausible += find_implausible_collisions(events, observed)
        contacts += [
            contact
            for contact in find_contacts(observed)
            if begin <= (contact.time or 0.0) < end
            and len({tracks.names[n] for n in contact.agents}) > 1
        ]
        harmful = [e for e in events if e.type in ("collision", "near_miss")]
        if len(harmful) <= MOST_AVOIDED:
            avoided += find_avoidability(harmful, Sights((), observed.tracks, left_hand))
    return RecordedEvents(tuple(found), tuple(contacts), tuple(implausible), tuple(avoided))


def find_implausible_collisions(
    events: Sequence[Event], observed: SceneObservation
) -> Iterator[Finding]:
    """Collisions of noisy tracks, and those after which both go on as if there had been none."""
    for event in (each for each in events if each.type == "collision"):
        pair = [observed.by_id[n] for n in (event.from_, event.to)]
        before, after = event.time - 0.3, event.time + 2.0
        hardest, changes = 0.0, list[float]()
        for track in pair:
            ahead = (track.times >= event.time - 1.0) & (track.times <= event.time)
            pull = np.hypot(track.acceleration[ahead], track.lateral_acceleration[ahead])
            hardest = max(hardest, float(pull.max(initial=0.0)))
            k = track.find_indices(np.array([before, after]))
            changes.append(float(np.hypot(*(track.velocity[k[1]] - track.velocity[k[0]]))))
        seen = all(track.start <= before and track.end >= after for track in pair)
        scraped = event.kind == "sideswipe"  # which may leave both at their speed
        most = UNTOUCHED * float(event.evidence["relative_speed"])
        if hardest > NOISE:
            why = f"one moves with {hardest:.0f} m/s² before it"
        elif seen and not scraped and max(changes) < most:
            why = "both go on as if there had been none"
        else:
            continue
        yield Finding(
            rule="implausible_collision", agents=(event.from_, event.to), time=event.time,
            detail=f"{event.from_} and {event.to} at {event.time:.1f} s ({why})",
        )  # fmt: skip


def observe_recording(
    tracks: ExternalTracks,
    *,
    intersection_map: IntersectionMap | None = None,
    signals: Sequence[SignalRecord] = (),
) -> Iterator[tuple[SceneObservation, float, float]]:
    """What the checker measures in a recording: whole if it is small, else window by window.

    Returns:
        What is measured around each span, and begin and end of that [s]: it answers for what begins
        there. There are no events between two stretches of one track.

    Raises:
        InputError: too many agents at once.
    """
    begin = min((u.track.start for u in tracks.users), default=0.0)
    end = max((u.track.end for u in tracks.users), default=0.0)
    windows: Iterable[Window] = _cut_windows(tracks.users, begin, end + 1.0)
    until: float | None = end
    if tracks.users and count_pair_samples(tracks.users) <= MOST_PAIR_SAMPLES:
        windows, until = [(tracks.users, -math.inf, math.inf)], None
    latest, names = tuple[RoadUser, ...](), tracks.names
    for users, since, before in windows:
        if users != latest:  # of a short recording, every window holds the same
            latest, seen = users, observe(
                users, intersection_map=intersection_map, signals=signals, until=until,
                near_only=True,
            )  # fmt: skip
            events = tuple(e for e in seen.events if names[e.from_] != names[e.to])
            seen = replace(seen, events=events)
        yield seen, since, before


def find_off_map(tracks: ExternalTracks, intersection_map: IntersectionMap) -> tuple[Finding, ...]:
    """Agents that spend more than 2 % of their time where their class does not belong."""
    return check_ground(build_trajectories(tracks.users), intersection_map, jaywalkers=frozenset())


def count_pair_samples(users: Sequence[RoadUser]) -> float:
    """Pairs times samples from the first start to the last end."""
    if len(users) < 2:
        return 0.0
    span = max(u.track.end for u in users) - min(u.track.start for u in users)
    return len(users) * (len(users) - 1) / 2 * (span / STEP + 1)


@lru_cache(maxsize=1)
def _count_near_pair_samples(users: tuple[RoadUser, ...]) -> float:
    """Those of the pairs that may have to do with one another, while both are there."""
    spans = np.array([(u.track.start, u.track.end) for u in users])
    bounds = np.array([(*u.track.xy.min(axis=0), *u.track.xy.max(axis=0)) for u in users])
    first, second = find_near_pairs(spans, bounds).T
    (start, end), (other_start, other_end) = spans[first].T, spans[second].T
    together = np.minimum(end, other_end) - np.maximum(start, other_start)
    return float((np.maximum(together / STEP, 0.0) + 1.0).sum())


Window = tuple[tuple[RoadUser, ...], float, float]
"""The users of a span of time, with its begin and end [s]."""


def _cut_windows(users: Sequence[RoadUser], begin: float, end: float) -> Iterator[Window]:
    """The users of each window from begin to end [s], by halves until they fit."""
    present = _clip_tracks(users, begin - CONTEXT, end + CONTEXT)
    if len(present) < 2:
        return
    size = _count_near_pair_samples(present)
    if size <= MOST_PAIR_SAMPLES or (end - begin <= 2 * SHORTEST and size <= MOST_FORCED):
        yield present, begin, end
        return
    if end - begin <= 2 * SHORTEST:
        raise InputError(
            f"{len(present)} agents around {begin:.0f} s are too many at once; "
            "check the tracks of a smaller area"
        )
    middle = STEP * round((begin + end) / 2 / STEP)
    yield from _cut_windows(users, begin, middle)
    yield from _cut_windows(users, middle, end)


def _clip_tracks(users: Sequence[RoadUser], begin: float, end: float) -> tuple[RoadUser, ...]:
    """What of each track lies between two times [s]."""
    found = []
    for user in users:
        track = user.track
        if track.end < begin or track.start > end:
            continue
        # Cut at a multiple of 0.2 s, following is sampled at the same times.
        spans = ((n, n * track.step / 0.2) for n in (1, 2, 3, 4, 5, 6, 8, 10, 12, 20, 30))
        period = next((n for n, span in spans if abs(span - round(span)) < 1e-6), 1)
        first = max(math.ceil((begin - track.start) / track.step), 0) // period * period
        last = min(math.floor((end - track.start) / track.step), len(track.xy) - 1)
        if (first, last) == (0, len(track.xy) - 1):
            found.append(user)
        elif first <= last:
            part = Track(
                track.xy[first : last + 1], track.heading[first : last + 1],
                track.start + first * track.step, track.step,
            )  # fmt: skip
            found.append(RoadUser(user.id, part, user.shape))
    return tuple(found)
