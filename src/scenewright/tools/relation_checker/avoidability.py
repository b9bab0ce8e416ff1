"""What a threatened party would have needed to avoid a collision or a near miss (SEMANTICS 9).

Asked is the constant braking along the party's own path, from the moment at which it could see the
threat and at the speed of that moment, with which it stops short of the other or passes behind it:
in a near miss behind its PET of 1.5 s. The other does what it did; after a contact, and after the
end of its track, it goes on straight ahead at its speed.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.scene.events import Event
from scenewright.tools.relation_checker.contact import estimate_velocity_before
from scenewright.tools.relation_checker.events import NEAR_MISS_PET
from scenewright.tools.relation_checker.footprints import Box, compute_gap, make_pose
from scenewright.tools.relation_checker.reactions import NEAR, Sights
from scenewright.tools.relation_checker.trajectory import Trajectory

HARDEST = {"vehicle": 8.0, "pedestrian": 3.0, "cyclist": 3.5, "scooter": 3.5}
"""Braking that counts as possible [m/s^2] (SEMANTICS sections 5 and 8)."""
REACTION = 1.0
"""How long a party drives on as it did before it brakes [s]."""
AFTER = 6.0
"""How long after the event the other may be in the way [s]."""
SPACING, RESOLUTION = 0.05, 0.02
"""Steps along the party's path [m] and of time [s]."""


def find_avoidability(
    events: Sequence[Event], sights: Sights, *, pushed: Collection[int] = ()
) -> list[dict[str, Any]]:
    """Two rows for each collision and near miss, one for each party.

    Returns:
        Rows with `agent`, `other`, `event`, `time` [s], `visible_from` [s], the braking needed from
        then, `needed_braking`, and 1 s later, `after_reaction` [m/s^2]; None where no braking
        helps; `avoidable` (after the reaction) and, where it is not, `why_not`.
    """
    tracks = {track.id: track for track in sights.tracks}
    rows = []
    for event in events:
        if event.type not in ("collision", "near_miss"):
            continue
        for number, by in ((event.from_, event.to), (event.to, event.from_)):
            view = sights.perceive(tracks[number], tracks[by], event.time)
            # From when on it could see the threat: the conflict is perceptible; or, where their
            # courses never conflict, as in a near miss by a hair, the other is in sight at last.
            threat = view.near if view.near.any() else view.times >= event.time - NEAR - 1e-6
            k, reason = view.find_begin(threat)
            begin = None if k is None else round(float(view.times[k]), 3)
            why_not = None if k is not None else reason if threat.any() else "not there"
            needed = after = None
            if begin is not None:
                needed, after = _compute_needed_braking(tracks[number], tracks[by], event, begin)
                if needed is None:
                    why_not = "braking does not help"
                elif after is None:
                    why_not = "no time"
                elif after > HARDEST[tracks[number].type]:
                    why_not = f"braking at {after:.1f} m/s² needed"
            if number in pushed and event.from_ == number:
                why_not = "is pushed into it"
            row = {
                "agent": number, "other": by, "event": event.type, "time": event.time,
                "visible_from": begin, "needed_braking": needed, "after_reaction": after,
                "avoidable": why_not is None,
            }  # fmt: skip
            rows.append(row if why_not is None else row | {"why_not": why_not})
    return rows


def _compute_needed_braking(
    agent: Trajectory, other: Trajectory, event: Event, begin: float
) -> tuple[float | None, float | None]:
    """The braking needed from a moment on, and after the reaction [m/s^2]."""
    k = agent.index(begin)
    speed, contact = float(agent.speed[k]), event.type == "collision"
    # What follows a contact is no course that a party has chosen.
    until = event.time if contact else np.inf
    lag = 0.0 if contact or event.evidence.get("pet", np.inf) > NEAR_MISS_PET else NEAR_MISS_PET
    times = np.arange(max(begin - lag, other.start), event.time + AFTER, RESOLUTION)
    known, xy, heading = _cut(other, until)
    last_speed = float(np.hypot(*estimate_velocity_before(other, time=float(known[-1]))))
    course = _go_straight_on(known, xy, heading, times, speed=last_speed)
    ahead = np.arange(0.0, speed * (event.time + AFTER + lag - begin) + 1.0, SPACING)
    _, xy, heading = _cut(agent, until)
    way = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))))
    path = _go_straight_on(way, xy, heading, float(agent.s[k]) + ahead)
    room = _find_room(*path, agent.box, *course, other.box)
    # How far it may have come, `due` seconds later; with a millimetre of slack: an agent that just
    # clears the other does not need to brake.
    due = times + lag - begin
    bound = (due >= 0.0) & ((room <= 0.0) | (speed * due > room + 1e-3))
    needed: list[float | None] = []
    for delay in (0.0, REACTION):
        left, time = room[bound] - speed * delay, due[bound] - delay
        if (left <= 0.0).any() or (time <= 0.0).any():
            needed.append(None)
            continue
        slowing, stopping = 2.0 * (speed * time - left) / time**2, speed**2 / (2.0 * left)
        least = np.where(slowing * time <= speed, slowing, stopping)
        needed.append(round(float(least.max(initial=0.0)), 3))
    return needed[0], needed[1]


def _cut(track: Trajectory, until: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times [s], positions [m] and headings [rad] of a track up to a time."""
    count = int(np.searchsorted(track.times, until - 1e-6))
    if count == len(track):
        return track.times, track.xy, track.heading
    xy, heading = track.at(np.array([until]))
    return (
        np.append(track.times[:count], until),
        np.concatenate((track.xy[:count], xy)),
        np.append(track.heading[:count], heading),
    )


def _go_straight_on(
    known: FloatArray, xy: FloatArray, heading: FloatArray, at: FloatArray, *, speed: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """[T, 2] positions [m] and [T] headings [rad] at times or arc lengths, past the last known."""
    ahead = np.array((np.cos(heading[-1]), np.sin(heading[-1])))
    beyond = speed * np.maximum(at - known[-1], 0.0)[:, None] * ahead
    there = np.stack([np.interp(at, known, xy[:, axis]) for axis in (0, 1)], axis=1)
    return there + beyond, np.interp(at, known, heading)


@compiled
def _find_room(
    xy: FloatArray,
    heading: FloatArray,
    size: Box,
    other_xy: FloatArray,
    other_heading: FloatArray,
    other_size: Box,
) -> FloatArray:
    """[T] how far along its way [S] an agent can go before it touches the other [m]; inf if never.

    Of the way is left out what the gap to the other cannot let it touch.
    """
    reach = np.hypot(size[0], size[1]) + size[2]
    swept = np.zeros(len(heading))
    for k in range(1, len(heading)):
        moved = np.hypot(xy[k, 0] - xy[k - 1, 0], xy[k, 1] - xy[k - 1, 1])
        swept[k] = swept[k - 1] + moved + reach * abs(heading[k] - heading[k - 1])
    room = np.full(len(other_heading), np.inf)
    for n in range(len(room)):
        other = make_pose(other_xy[n, 0], other_xy[n, 1], other_heading[n])
        k = 0
        while k < len(heading):
            own = make_pose(xy[k, 0], xy[k, 1], heading[k])
            gap = compute_gap(own, size, other, other_size)
            if gap <= 0.0:
                if k > 0:
                    own = make_pose(xy[k - 1, 0], xy[k - 1, 1], heading[k - 1])
                    before = max(compute_gap(own, size, other, other_size), 0.0)
                    room[n] = SPACING * (k - 1 + before / max(before - gap, 1e-9))
                else:
                    room[n] = 0.0
                break
            k = max(k + 1, np.searchsorted(swept, swept[k] + gap))
    return room
