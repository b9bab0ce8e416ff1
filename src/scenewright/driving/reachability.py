"""Whether physics allows an asked encounter, found without looking at whether it came about.

The ego is driven once more by the same policy in the same scene, with the agent that it is to meet
taken out and all others reacting. If it does not come to the place of the conflict before the
drive ends, no agent can meet it there. Nor can an agent that is past the place when the drive
begins, or that could not be there in time even if it went as fast as its kind may.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenewright.driving.policies import Policy
from scenewright.driving.resolve import FASTEST, GAIN, LATERAL, EgoConflict, list_meetings
from scenewright.driving.scenario import COLOURS, AgentPath, Scenario
from scenewright.driving.single_drive import Drive, drive_once

LATEST = 1.5
"""After the ego at which the other may come for an encounter [s]: the PET of a near miss."""
REST = 1.0
"""Of the scene that must be left when the ego is at the place [s]."""


def find_obstacles(drive: Drive, policy: Policy) -> dict[str, str | None]:
    """By name of each agent that the ego is to meet, why physics does not allow it; None: it does.

    Args:
        policy: the one that drove; it is driven again, once for each agent.
    """
    one = drive.scenario
    return {
        one.names[meeting.agent]: _find_obstacle(one, meeting, policy, drive.seed)
        for meeting in list_meetings(one)
    }


def _find_obstacle(one: Scenario, meeting: EgoConflict, policy: Policy, seed: int) -> str | None:
    name = one.names[meeting.agent]
    ego_time, short = find_arrival_alone(one, meeting, policy, seed)
    if ego_time > (one.steps - 1) * one.step - REST:
        return f"without {name} too, the ego is {short:.0f} m short of the place when it ends"
    path = one.paths[meeting.agent]
    if path.progress[max(one.start, path.first)] >= meeting.agent_at:
        return f"{name} is past the place when the ego enters"
    earliest = find_earliest_arrival(one, meeting.agent, meeting.agent_at)
    if earliest > ego_time + LATEST:
        return (
            f"{name} can be at the place at {earliest:.1f} s at the earliest, "
            f"the ego is there at {ego_time:.1f} s"
        )
    return None


def find_arrival_alone(
    one: Scenario, meeting: EgoConflict, policy: Policy, seed: int
) -> tuple[float, float]:
    """When the ego is at the place with the other taken out [s], and how far short it ends [m].

    Inf where it does not come there.
    """
    alone = drive_once(
        remove_agent(one, meeting.agent), policy, others="reactive", seed=seed
    ).world.history
    progress = np.array([each.progress for each in alone])
    there = np.flatnonzero(progress >= meeting.ego_at)
    time = (one.start + float(there[0])) * one.step if len(there) else np.inf
    return time, max(meeting.ego_at - float(progress.max()), 0.0)


def remove_agent(one: Scenario, agent: int) -> Scenario:
    """The scenario in which an agent has left before anything begins."""
    paths = list(one.paths)
    paths[agent] = replace(paths[agent], first=-1, last=-1)
    present = one.present.copy()
    present[agent] = False
    return replace(one, paths=tuple(paths), present=present)


def find_earliest_arrival(one: Scenario, agent: int, at: float) -> float:
    """When an agent can be at a place on its way [m] if it hurries but heeds its lights [s].

    From where it is when the ego enters, or where it enters later, it speeds up as its kind can,
    to what its kind and its curves allow, and stops for no other agent.
    """
    path, kind = one.paths[agent], int(one.kinds[agent])
    step = max(one.start, path.first)
    s = float(path.progress[step])
    speed = float(path.progress[min(step + 1, one.steps - 1)] - s) / one.step
    while s < at and step < one.steps - 1:
        reach = _find_reach(one, path, agent, s, step)
        speed = min(speed + GAIN[kind] * one.step, float(FASTEST[kind]), reach)
        s, step = s + speed * one.step, step + 1
    return step * one.step if s >= at else float(np.inf)


def _find_reach(one: Scenario, path: AgentPath, agent: int, s: float, step: int) -> float:
    """The speed at which the agent can still keep its curves and stop at its red lights [m/s]."""
    ahead = path.arc >= s
    away, bend = path.arc[ahead] - s, np.maximum(np.abs(path.curvature[ahead]), 1e-3)
    curves = float(np.sqrt(LATERAL / bend + 2 * 3.0 * away).min(initial=np.inf))
    if one.violators[agent]:
        return curves
    red = [
        at - s for light, at in path.stops
        if at > s - 0.3 and one.get_colour(light, step) == COLOURS.index("red")
    ]  # fmt: skip
    return min([curves, *(float(np.sqrt(2 * 3.0 * max(each, 0.0))) for each in red)])
