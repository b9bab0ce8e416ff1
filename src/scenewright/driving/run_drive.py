"""A drive of a policy, rehearsed until the asked encounters come about where others are re-timed.

Where re-timing on the way does not bring an encounter about, the same policy drives the same scene
again, and the other agent is planned to be at the place of the conflict at a time of its own: with
the recorded lag after the ego came there with the other taken out, then somewhat before or after
it. Where all of this fails, another agent of the same kind on the same way takes its part. A drive
is kept where one more encounter comes about and the others do not collide.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from scenewright.driving.policies import Policy
from scenewright.driving.reachability import find_arrival_alone, find_obstacles
from scenewright.driving.reactive import Temper
from scenewright.driving.report import report_drive
from scenewright.driving.resolve import EgoConflict, Plan, Resolve, list_meetings
from scenewright.driving.scenario import Scenario
from scenewright.driving.single_drive import DEFAULT_STEP_LIMIT, Drive, drive_once
from scenewright.driving.traffic import OthersMode

TRIES = (
    (0.0, False), (0.0, True), (-0.7, False), (0.7, True), (-0.7, True), (0.7, False),
    (-1.4, True), (1.4, True), (-1.4, False), (-2.2, False), (2.2, True), (-3.0, True),
)  # fmt: skip
"""Of the planned time from the recorded lag after the ego [s], and whether the other comes late."""
STAND_IN_TRIES = 5
"""Of these for each stand-in."""
NEAR = 1.0
"""So near to the place the way of a stand-in leads [m]."""


def run_drive(
    scenario: Scenario,
    policy: Policy,
    *,
    name: str = "policy",
    others: OthersMode = "replay",
    temperament: Temper = "obedient",
    seed: int = 0,
    step_limit: float = DEFAULT_STEP_LIMIT,
) -> Drive:
    """Drive a scenario with a policy; with re-timed others the drive is rehearsed.

    Args:
        others, temperament: see `drive`.
        step_limit: longest that the policy may take for one answer [s].

    Returns:
        The drive. Where the policy fails it ends there, and `fault` says how in one line.

    Raises:
        InputError: the policy gives no such actions, or others move in no such way.
    """
    once = partial(
        drive_once, scenario, policy, name=name, others=others, temperament=temperament,
        seed=seed, step_limit=step_limit,
    )  # fmt: skip
    first = once()
    if others != "resolve" or first.fault is not None or scenario.record is None:
        return first
    obstacles = find_obstacles(first, policy)
    rehearsal = _Rehearsal(first, policy, once)
    for meeting in list_meetings(scenario):
        if obstacles[scenario.names[meeting.agent]] is None:
            rehearsal.bring_about(meeting)
    return replace(rehearsal.best, obstacles=obstacles, tries=rehearsal.tries)


class _Rehearsal:
    """The best drive so far and the plans that it was driven with."""

    def __init__(self, first: Drive, policy: Policy, once: Callable[..., Drive]) -> None:
        self.best, self._policy, self._once = first, policy, once
        self._met, self._plans = _list_met(first), dict[int, Plan]()
        self.tries = 1

    def bring_about(self, meeting: EgoConflict) -> None:
        """Try plans for an agent until it meets the ego, and all others do that did before."""
        one = self.best.scenario
        name = one.names[meeting.agent]
        if name in self._met:
            return
        arrival, _ = find_arrival_alone(one, meeting, self._policy, self.best.seed)
        for plan in _list_plans(one, meeting, arrival + meeting.lag):
            plans = {**self._plans, meeting.asked: plan}
            drive = self._once(traffic=Resolve(plans))
            self.tries += 1
            met = _list_met(drive)
            if drive.fault is None and met >= self._met | {name}:
                self.best, self._plans, self._met = drive, plans, met
                return


def _list_plans(one: Scenario, meeting: EgoConflict, time: float) -> Iterator[Plan]:
    """What to try: other times, then stand-ins that go the same way."""
    for offset, late in TRIES:
        yield Plan(time + offset, late)
    for stand_in in find_stand_ins(one, meeting, time):
        for offset, late in TRIES[:STAND_IN_TRIES]:
            yield Plan(time + offset, late, stand_in)


def find_stand_ins(one: Scenario, meeting: EgoConflict, time: float) -> list[tuple[int, float]]:
    """Agents of the same kind and way, and where the place is on their ways [m].

    Those come first that were recorded there nearest to a time [s]; two at most.
    """
    if one.record is None:
        return []
    agents, met = one.record.agents, {each.asked for each in list_meetings(one)}
    asked = agents[meeting.asked]
    place = one.paths[meeting.asked].get_poses(np.array([meeting.agent_at]))[0][0]
    found = []
    for k, agent in enumerate(agents):
        same = (agent.type, agent.subtype, agent.route) == (asked.type, asked.subtype, asked.route)
        if not same or k == one.ego or k in met or one.violators[k]:
            continue
        path = one.paths[k]
        apart = np.hypot(*(path.xy - place).T)
        at = int(np.argmin(apart))
        if apart[at] < NEAR and path.progress[max(one.start, path.first)] < path.arc[at]:
            found.append((abs(float(path.arrival[at]) * one.step - time), k, float(path.arc[at])))
    return [(k, at) for _, k, at in sorted(found)[:2]]


def _list_met(drive: Drive) -> frozenset[str]:
    """Names of those whose encounter came about; of none if two others collided."""
    report = report_drive(drive).to_json()
    if report["background_collisions"]:
        return frozenset()
    return frozenset(row["with"] for row in report["resolved"] if row["came_about"])
