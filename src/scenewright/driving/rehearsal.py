"""Rehearsed drives: the policy drives the scene until the asked encounters come about for it.

Where re-timing on the way does not bring an encounter about, the same policy drives the same scene
again, and the other agent is planned to be at the place of the conflict at a time of its own: with
the recorded lag after the ego came there with the other taken out, then somewhat before or after
it. Where all of this fails, another agent of the same kind on the same way takes its part. A drive
is kept where one more encounter comes about and the others do not collide.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from scenewright.driving.policies import Policy
from scenewright.driving.reachability import find_arrival_alone, find_obstacles
from scenewright.driving.report import report_drive
from scenewright.driving.resolve import EgoConflict, Plan, Resolve, list_meetings
from scenewright.driving.run_drive import DEFAULT_STEP_LIMIT, Drive, run_drive
from scenewright.driving.scenario import Scenario

TRIES = (
    (0.0, False), (0.0, True), (-0.7, False), (0.7, True), (-0.7, True), (0.7, False),
    (-1.4, True), (1.4, True), (-1.4, False), (-2.2, False), (2.2, True), (-3.0, True),
)  # fmt: skip
"""Of the planned time from the recorded lag after the ego [s], and whether the other comes late."""
STAND_IN_TRIES = 5
"""Of these for each stand-in."""
NEAR = 1.0
"""So near to the place the way of a stand-in leads [m]."""


@dataclass(frozen=True, eq=False)
class Rehearsed:
    """A drive with others that were re-timed for its ego.

    Attributes:
        drive: the one that was kept; tries: how many times the policy drove.
        obstacles: by name of each agent to meet, why physics does not allow it; None: it does.
    """

    drive: Drive
    obstacles: Mapping[str, str | None]
    tries: int


def rehearse_drive(
    scenario: Scenario,
    policy: Policy,
    *,
    name: str = "policy",
    seed: int = 0,
    step_limit: float = DEFAULT_STEP_LIMIT,
) -> Rehearsed:
    """Drive a scenario with others re-timed, again where an encounter did not come about.

    Raises:
        InputError: as `run_drive`.
    """
    rehearsal = _Rehearsal(scenario, policy, name, seed, step_limit)
    drive = rehearsal.run({})
    if drive.fault is not None:
        return Rehearsed(drive, {}, 1)
    obstacles = find_obstacles(drive, policy)
    for meeting in list_meetings(scenario):
        if obstacles[scenario.names[meeting.agent]] is None:
            rehearsal.bring_about(meeting)
    return Rehearsed(rehearsal.best, obstacles, rehearsal.tries)


class _Rehearsal:
    """The best drive so far and the plans that it was driven with."""

    def __init__(
        self, scenario: Scenario, policy: Policy, name: str, seed: int, step_limit: float
    ) -> None:
        self._scenario, self._policy, self._name = scenario, policy, name
        self._seed, self._limit = seed, step_limit
        self._plans: Mapping[int, Plan] = {}
        self.tries = 0

    def run(self, plans: Mapping[int, Plan]) -> Drive:
        """One drive; the first is the best until there is a better one."""
        self.tries += 1
        drive = run_drive(
            self._scenario, self._policy, name=self._name, others="resolve", seed=self._seed,
            step_limit=self._limit, traffic=Resolve(plans),
        )  # fmt: skip
        if self.tries == 1:
            self.best, self._met = drive, _list_met(drive)
        return drive

    def bring_about(self, meeting: EgoConflict) -> None:
        """Try plans for an agent until it meets the ego, and all others do that did before."""
        name = self._scenario.names[meeting.agent]
        if name in self._met:
            return
        arrival, _ = find_arrival_alone(self._scenario, meeting, self._policy, self._seed)
        for plan in _list_plans(self._scenario, meeting, arrival + meeting.lag):
            plans = {**self._plans, meeting.asked: plan}
            drive = self.run(plans)
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
