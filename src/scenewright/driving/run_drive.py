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
from scenewright.driving.reactive import Temper
from scenewright.driving.report import report_drive
from scenewright.driving.resolve import (
    FASTEST,
    GAIN,
    LATERAL,
    EgoConflict,
    Plan,
    Resolve,
    list_meetings,
)
from scenewright.driving.scenario import COLOURS, AgentPath, Scenario
from scenewright.driving.single_drive import DEFAULT_STEP_LIMIT, Drive, drive_once
from scenewright.driving.traffic import OthersMode

LATEST = 1.5
"""After the ego at which the other may come for an encounter [s]: the PET of a near miss."""
REST = 1.0
"""Of the scene that must be left when the ego is at the place [s]."""


def find_obstacles(drive: Drive, policy: Policy) -> dict[str, str | None]:
    """By name of each agent that the ego is to meet, why physics does not allow it; None: it does.

    Args:
        policy: the one that drove; it is driven again, once for each agent.
    """
    scenario = drive.scenario
    return {
        scenario.names[meeting.agent]: _find_obstacle(scenario, meeting, policy, drive.seed)
        for meeting in list_meetings(scenario)
    }


def _find_obstacle(
    scenario: Scenario, meeting: EgoConflict, policy: Policy, seed: int
) -> str | None:
    name = scenario.names[meeting.agent]
    ego_time, short = find_arrival_alone(scenario, meeting, policy, seed)
    if ego_time > (scenario.steps - 1) * scenario.step - REST:
        return f"without {name} too, the ego is {short:.0f} m short of the place when it ends"
    path = scenario.paths[meeting.agent]
    if path.progress[max(scenario.start, path.first)] >= meeting.agent_at:
        return f"{name} is past the place when the ego enters"
    earliest = find_earliest_arrival(scenario, meeting.agent, meeting.agent_at)
    if earliest > ego_time + LATEST:
        return (
            f"{name} can be at the place at {earliest:.1f} s at the earliest, "
            f"the ego is there at {ego_time:.1f} s"
        )
    return None


def find_arrival_alone(
    scenario: Scenario, meeting: EgoConflict, policy: Policy, seed: int
) -> tuple[float, float]:
    """When the ego is at the place with the other taken out [s], and how far short it ends [m].

    Inf where it does not come there.
    """
    alone = drive_once(
        remove_agent(scenario, meeting.agent), policy, others="reactive", seed=seed
    ).world.history
    progress = np.array([each.progress for each in alone])
    there = np.flatnonzero(progress >= meeting.ego_at)
    time = (scenario.start + float(there[0])) * scenario.step if len(there) else np.inf
    return time, max(meeting.ego_at - float(progress.max()), 0.0)


def remove_agent(scenario: Scenario, agent: int) -> Scenario:
    """The scenario in which an agent has left before anything begins."""
    paths = list(scenario.paths)
    paths[agent] = replace(paths[agent], first=-1, last=-1)
    present = scenario.present.copy()
    present[agent] = False
    return replace(scenario, paths=tuple(paths), present=present)


def find_earliest_arrival(scenario: Scenario, agent: int, at: float) -> float:
    """When an agent can be at a place on its way [m] if it hurries but heeds its lights [s].

    From where it is when the ego enters, or where it enters later, it speeds up as its kind can,
    to what its kind and its curves allow, and stops for no other agent.
    """
    path, kind = scenario.paths[agent], int(scenario.kinds[agent])
    step = max(scenario.start, path.first)
    s = float(path.progress[step])
    speed = float(path.progress[min(step + 1, scenario.steps - 1)] - s) / scenario.step
    while s < at and step < scenario.steps - 1:
        reach = _find_reach(scenario, path, agent, s, step)
        speed = min(speed + GAIN[kind] * scenario.step, float(FASTEST[kind]), reach)
        s, step = s + speed * scenario.step, step + 1
    return step * scenario.step if s >= at else float(np.inf)


def _find_reach(scenario: Scenario, path: AgentPath, agent: int, s: float, step: int) -> float:
    """The speed at which the agent can still keep its curves and stop at its red lights [m/s]."""
    ahead = path.arc >= s
    away, bend = path.arc[ahead] - s, np.maximum(np.abs(path.curvature[ahead]), 1e-3)
    curves = float(np.sqrt(LATERAL / bend + 2 * 3.0 * away).min(initial=np.inf))
    if scenario.violators[agent]:
        return curves
    red = [
        at - s for light, at in path.stops
        if at > s - 0.3 and scenario.get_colour(light, step) == COLOURS.index("red")
    ]  # fmt: skip
    return min([curves, *(float(np.sqrt(2 * 3.0 * max(each, 0.0))) for each in red)])


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
        scenario = self.best.scenario
        name = scenario.names[meeting.agent]
        if name in self._met:
            return
        arrival, _ = find_arrival_alone(scenario, meeting, self._policy, self.best.seed)
        for plan in _list_plans(scenario, meeting, arrival + meeting.lag):
            plans = {**self._plans, meeting.asked: plan}
            drive = self._once(traffic=Resolve(plans))
            self.tries += 1
            met = _list_met(drive)
            if drive.fault is None and met >= self._met | {name}:
                self.best, self._plans, self._met = drive, plans, met
                return


def _list_plans(scenario: Scenario, meeting: EgoConflict, time: float) -> Iterator[Plan]:
    """What to try: other times, then stand-ins that go the same way."""
    for offset, late in TRIES:
        yield Plan(time + offset, late)
    for stand_in in find_stand_ins(scenario, meeting, time):
        for offset, late in TRIES[:STAND_IN_TRIES]:
            yield Plan(time + offset, late, stand_in)


def find_stand_ins(
    scenario: Scenario, meeting: EgoConflict, time: float
) -> list[tuple[int, float]]:
    """Agents of the same kind and way, and where the place is on their ways [m].

    Those come first that were recorded there nearest to a time [s]; two at most.
    """
    if scenario.record is None:
        return []
    agents, met = scenario.record.agents, {each.asked for each in list_meetings(scenario)}
    asked = agents[meeting.asked]
    place = scenario.paths[meeting.asked].get_poses(np.array([meeting.agent_at]))[0][0]
    stand_ins = []
    for k, agent in enumerate(agents):
        same = (agent.type, agent.subtype, agent.route) == (asked.type, asked.subtype, asked.route)
        if not same or k == scenario.ego or k in met or scenario.violators[k]:
            continue
        path = scenario.paths[k]
        apart = np.hypot(*(path.xy - place).T)
        at = int(np.argmin(apart))
        if apart[at] < NEAR and path.progress[max(scenario.start, path.first)] < path.arc[at]:
            stand_ins.append(
                (abs(float(path.arrival[at]) * scenario.step - time), k, float(path.arc[at]))
            )
    return [(k, at) for _, k, at in sorted(stand_ins)[:2]]


def _list_met(drive: Drive) -> frozenset[str]:
    """Names of those whose encounter came about; of none if two others collided."""
    report = report_drive(drive).to_json()
    if report["background_collisions"]:
        return frozenset()
    return frozenset(row["with"] for row in report["resolved"] if row["came_about"])
