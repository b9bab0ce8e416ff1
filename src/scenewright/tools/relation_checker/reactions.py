"""Who reacts to a threat, when, how and how strongly, or why not (SEMANTICS section 8).

A conflict is perceptible to a road user while the other is in sight, not behind it, and the path
TTC of the two is below 3 s. What it does from then on is compared with what it did at that moment.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.scene.events import Event, Finding
from scenewright.scene.objects import ObjectRecord
from scenewright.scene.record import SceneRecord
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.contact import estimate_velocity_before, find_common_times
from scenewright.tools.relation_checker.events import NEAR_MISS_PET
from scenewright.tools.relation_checker.footprints import (
    BoolArray,
    Box,
    compute_angle_between,
    compute_gap,
    compute_offsets,
    make_pose,
)
from scenewright.tools.relation_checker.line_of_sight import find_blocked_views
from scenewright.tools.relation_checker.pushes import list_pushed
from scenewright.tools.relation_checker.surrogates import compute_path_ttc
from scenewright.tools.relation_checker.trajectory import Trajectory, find_first_lasting
from scenewright.tools.relation_checker.yielding import compute_free_speed_profile

NEAR = 3.0
"""Path TTC [s] below which a conflict is perceptible."""
LASTS = 0.3
"""How long it must stay perceptible to count [s]."""
LATEST = 1.8
"""Within this time [s] 95 % of people react; with less a reaction may be too late."""
LOOK_BACK = 6.0
"""How long before an event a threat is looked for [s]."""
SOONEST = 0.25
"""Shortest reaction time [s]."""
BEHIND = np.deg2rad(110.0)
"""An agent from further round than this is not seen from a seat or saddle [rad]."""
STANDING = 0.3
"""Below this speed there is nothing to brake [m/s]."""
HARSH = 3.4
"""A yield with more braking is one of necessity [m/s^2]."""


THRESHOLDS = {
    "vehicle": (0.8, 0.5), "cyclist": (0.8, 0.4), "scooter": (0.8, 0.4), "pedestrian": (0.5, 0.2),
}  # fmt: skip
"""From what on a change counts as a reaction: of acceleration [m/s^2] and of speed [m/s]."""
ASIDE, ASIDE_ACCELERATION = 0.4, 0.7
"""Offset to a side [m] and lateral acceleration [m/s^2] from which a vehicle swerves."""
BACK, JUMPS = 0.25, 1.0
"""How far a pedestrian goes backwards who steps back [m], and how fast who jumps [m/s]."""
TURNS = np.deg2rad(2.0)
"""Who swerves within its lane turns by more than this, and has turned back in the end [rad]."""


def find_reactions(
    scene: SceneRecord, events: Sequence[Event], sights: Sights
) -> list[dict[str, Any]]:
    """One row for every party of a collision, a near miss, or a yield that came late.

    Returns:
        Rows with `agent`, `of` (the other), `event`, `time` [s] and either `perceptible_from`,
        `reacted_at` [s], `how` and `strength` [m/s^2], or `why_not`.
    """
    tracks = {track.id: track for track in sights.tracks}
    pushed = list_pushed(scene.relations)
    excluded = {agent.id for agent in scene.agents if agent.reaction == "none"}
    rows = []
    for event in events:
        both = [(event.from_, event.to), (event.to, event.from_)]
        if event.type == "yielding":  # the yielding agent is threatened, if late or by a red run
            late = float(event.evidence.get("braking", 0.0)) > HARSH
            both = both[:1] if late or event.evidence.get("cause_agent") == event.to else []
        for agent, other in both if event.type != "follow" else ():
            row = _measure(sights.perceive(tracks[agent], tracks[other], event.time), event)
            if agent in pushed and event.from_ == agent:
                row = {"why_not": "is pushed into it"}
            if agent in excluded and "reacted_at" not in row and "perceptible_from" in row:
                row["why_not"] = "the text says that it does not"
            rows.append(
                {"agent": agent, "of": other, "event": event.type, "time": event.time} | row
            )
    return rows


@dataclass(frozen=True, eq=False)
class Perception:
    """What an agent can perceive of another in the 6 s before an event.

    Attributes:
        times: [T] at which both are there [s].
        near: [T] whether their path TTC is below 3 s; seen: [T] whether the line of sight is free;
            ahead: [T] whether the other is not behind the agent's seat.
    """

    agent: Trajectory
    times: FloatArray
    near: BoolArray
    seen: BoolArray
    ahead: BoolArray

    def find_begin(self, threat: BoolArray) -> tuple[int | None, str]:
        """The first sample from which a threat [T] can be seen, or why it cannot."""
        begin = find_first_lasting(threat & self.seen & self.ahead, least=LASTS)
        if begin is not None or find_first_lasting(threat & self.seen, least=LASTS) is not None:
            return begin, "comes from behind"
        hidden = find_first_lasting(threat, least=LASTS) is not None
        return None, "no line of sight" if hidden else "too late"


@dataclass(frozen=True, eq=False)
class Sights:
    """Lines of sight between agents, past standing objects and other vehicles."""

    objects: Sequence[ObjectRecord]
    tracks: Sequence[Trajectory]
    left_hand: bool = False

    @cached_property
    def _vehicles(self) -> tuple[Trajectory, ...]:
        return tuple(track for track in self.tracks if track.type == "vehicle")

    @cached_property
    def perceive(self) -> Callable[[Trajectory, Trajectory, float], Perception]:
        """What an agent can perceive of another up to a time [s]; movers are known by identity."""
        return cache(self._perceive)

    def _perceive(self, agent: Trajectory, other: Trajectory, until: float) -> Perception:
        common = find_common_times(agent, other)
        times = common[(common >= until - LOOK_BACK) & (common <= until + 1e-6)]
        blocked = find_blocked_views(
            agent, other, times, objects=self.objects, vehicles=self._vehicles,
            left_hand=self.left_hand,
        )  # fmt: skip
        near = np.asarray(compute_path_ttc(agent, other, times=times, horizon=NEAR) < NEAR)
        (xy, heading), (place, _) = agent.at(times), other.at(times)
        away = place - xy
        behind = compute_angle_between(np.arctan2(away[:, 1], away[:, 0]), heading) > BEHIND
        # Pedestrians look all around.
        return Perception(agent, times, near, ~blocked, ~(behind & agent.is_vehicle))


def _measure(view: Perception, event: Event) -> dict[str, Any]:
    """The part of a row that says what was perceptible and what was done."""
    agent, times, near = view.agent, view.times, view.near
    if not len(times):
        return {"why_not": "not there"}
    if not near.any():
        return {"why_not": "no conflict on present courses"}
    begin, why_not = view.find_begin(near)
    if begin is None:
        return {"why_not": why_not}
    known = {"perceptible_from": round(float(times[begin]), 3)}
    if event.type == "yielding":  # it may have begun to give way before it was urgent
        since, braking = event.evidence["begins_to_slow"], event.evidence["braking"]
        return known | {"reacted_at": since, "how": "gives_way", "strength": braking}
    ends = int(np.flatnonzero(near & view.seen & view.ahead)[-1])
    lasts = float(times[min(ends + 1, len(times) - 1)] - times[begin])
    found = _find_reaction(agent, float(times[begin]), event)
    if found is not None:
        return known | found
    why_not = "too late" if event.time - times[begin] < LATEST else "none seen"
    if agent.speed[agent.index(float(times[begin]))] <= STANDING:
        why_not = "stands already"
    elif lasts < LATEST and times[begin] + lasts < event.time - 2 * STEP:
        why_not = "over before it could react"
    return known | {"why_not": why_not}


def _find_reaction(agent: Trajectory, begin: float, event: Event) -> dict[str, Any] | None:
    """When and how it departs from what it did when the conflict became perceptible."""
    first, last = agent.index(begin), agent.index(event.time)
    window = slice(first + round(SOONEST / STEP), last + 1)
    if not len(agent.acceleration[window]):
        return None
    # How it would have braked anyway: as it does, or for the bends of its way.
    speed, usual = float(agent.speed[first]), min(float(agent.acceleration[first]), 0.0)
    expected = np.full(len(agent.speed[window]), usual)
    if agent.is_vehicle and speed > STANDING:
        free = compute_free_speed_profile(agent, begin=first)
        along = np.gradient(free.speed**2, free.s) / 2.0 if len(free.s) > 1 else np.zeros(1)
        expected = np.minimum(usual, np.interp(agent.s[window], free.s, along))
    found = _find_change(agent, window, expected, slows=True)
    if agent.type == "pedestrian":
        # Whether it steps or jumps back, against the way that it went at first.
        ahead = agent.velocity[first] / max(speed, STANDING)
        went = (agent.xy[first : window.stop] - agent.xy[first]) @ ahead
        back = float((np.maximum.accumulate(went) - went).max())
        if found is not None and speed > STANDING and back >= BACK:
            backwards = -float((agent.velocity[window] @ ahead).min())
            return found | {"how": "jumps_back" if backwards > JUMPS else "steps_back"}
        usual = max(float(agent.acceleration[first]), 0.0)
        hurry = _find_change(agent, window, usual, slows=False)
        # After running it slows down again, after stopping it walks on: what came first counts.
        known = [each for each in (found, hurry) if each is not None]
        found = min(known, key=lambda each: float(each["reacted_at"]), default=None)
    return _find_swerve(agent, first, window) or found


def _find_change(
    agent: Trajectory, window: slice, usual: FloatArray | float, *, slows: bool
) -> dict[str, Any] | None:
    """Where it brakes, or hurries, by more than is usual [m/s^2] and so that its speed shows it."""
    (least, least_speed), sign = THRESHOLDS[agent.type], -1.0 if slows else 1.0
    change, speed = sign * agent.acceleration[window], sign * agent.speed
    beyond = np.flatnonzero(change > sign * usual + least)
    if not len(beyond):
        return None
    onset = window.start + int(beyond[0])
    after = speed[onset : window.start + len(change)]
    if float(after.max() - speed[onset - 2 : onset + 1].min()) < least_speed:
        return None
    how = "runs" if not slows else "stops" if agent.type == "pedestrian" else "brakes"
    return _build_row(agent, onset, how, float(change[beyond[0] :].max()))


def _find_swerve(agent: Trajectory, first: int, window: slice) -> dict[str, Any] | None:
    """To a side of a straight way and back along it, as a curve shows nothing."""
    aside = np.abs(compute_offsets(agent.xy[window], agent.xy[first], agent.heading[first])[1])
    turned = np.abs(agent.heading[window] - agent.heading[first])
    pushed = agent.lateral_acceleration[window] > ASIDE_ACCELERATION
    goes_on = turned.max(initial=0.0) < TURNS or not len(turned) or turned[-1] > TURNS
    if agent.type == "pedestrian" or goes_on or not pushed.any():
        return None
    if aside.max(initial=0.0) < ASIDE or agent.lateral_acceleration[first] > ASIDE_ACCELERATION:
        return None
    onset = window.start + int(np.argmax(pushed))
    return _build_row(agent, onset, "swerves", float(agent.lateral_acceleration[window].max()))


def _build_row(agent: Trajectory, onset: int, how: str, strength: float) -> dict[str, Any]:
    time = round(float(agent.times[onset]), 3)
    return {"reacted_at": time, "how": how, "strength": round(strength, 3)}


def find_false_reactions(
    scene: SceneRecord, rows: Sequence[Mapping[str, Any]]
) -> tuple[Finding, ...]:
    """Agents that do not react as the text says."""
    found = []
    for agent in scene.agents:
        own = [row for row in rows if row["agent"] == agent.id]
        if agent.reaction == "none":
            seen = bool(own) and not any("reacted_at" in row for row in own)
        else:
            seen = any(row.get("how") == agent.reaction for row in own)
        if agent.reaction is not None and not seen:
            detail = f"agent {agent.id} was to react as {agent.reaction}"
            found.append(Finding(rule="reaction_not_seen", agents=(agent.id,), detail=detail))
    return tuple(found)


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
