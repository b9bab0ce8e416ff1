"""Guides of the refiner: the edited prior of each agent, and where it must stay as it is.

Agents that stand keep standing; agents of a relation keep the times that the solver found.
Between these the network moves, from one goal of the segments to the next.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from scenewright.geometry.driving_profile import Motion
from scenewright.scene.base import RIDERS
from scenewright.scene.behavior import BehaviorProgram
from scenewright.scene.selection import PlannedEvent, SelectedAgent, Selection
from scenewright.scene.track import STEP

if TYPE_CHECKING:
    from scenewright.tools.trajnet_refiner.guided import Guide

STANDING = 0.3
"""At most this speed [m/s] is standing (SEMANTICS section 4)."""
BEFORE, AFTER = 3.0, 2.0
"""How long around a contact or a near miss the prior is kept [s]."""
STEADY = 1.0
"""How long before it speeds do not even ripple [s]."""
REACTING = 5.0
"""The same before an event to which one of the two reacts [s]."""
YIELDING = ("gives_way(", "headway(")
"""Clauses whose events last: these leave more room, as waiting itself is kept anyway."""
BEFORE_YIELDING, AFTER_YIELDING = 1.0, 0.5
FIRST = 0.8
"""How much of every track is the prior's [s]: it says how fast the agent came."""


def build_guides(
    motions: dict[str, Motion], selection: Selection, behavior: BehaviorProgram
) -> dict[str, Guide]:
    """One guide per agent, by name."""
    from scenewright.tools.trajnet_refiner.guided import Guide

    bound = {name for event in selection.events for name in event.agents}
    return {
        name: Guide(
            kind=motion.candidate.route.type,
            path=motion.path,
            s=motion.s,
            enters=selection.agents[name].enters,
            kept=_mask_kept_samples(motion, selection.agents[name], selection),
            steady=_mask_kept_samples(motion, selection.agents[name], selection, most=STEADY),
            goals=tuple(segment.end for segment in behavior.segments[name]),
            bound=name in bound or selection.agents[name].violates,
        )
        for name, motion in motions.items()
    }


def _mask_kept_samples(
    motion: Motion, agent: SelectedAgent, selection: Selection, *, most: float = np.inf
) -> NDArray[np.bool_]:
    """[T] samples at which the prior stays as it is; all of them of a class the network lacks.

    Args:
        most: how long before an event the prior is kept at the longest [s].
    """
    if agent.candidate.shape.type in RIDERS:
        return np.ones(len(motion.s), dtype=np.bool_)
    times = agent.enters + STEP * np.arange(len(motion.s))
    kept = np.asarray(motion.speed <= STANDING)
    for event in selection.events:
        if agent.name in event.agents:
            begin, end = _get_event_window(event, selection)
            kept |= (times >= max(begin, event.time - most)) & (times <= end)
    if agent.group or any(each.group == agent.name for each in selection.agents.values()):
        kept[:] = True  # apart from one another they would be no group
    kept[: round(FIRST / STEP)] = True
    kept |= agent.exact
    if motion.ended:
        kept[-1] = True
    return kept


def _get_event_window(event: PlannedEvent, selection: Selection) -> tuple[float, float]:
    """The time window of a relation; an agent that gives way does so until it starts.

    An agent that does not stand has the same window as one that passes narrowly.
    """
    rolls = any(stop.rolls for name in event.agents for stop in selection.agents[name].stops)
    lasts = event.clause.startswith(YIELDING) and not rolls
    before, after = (BEFORE_YIELDING, AFTER_YIELDING) if lasts else (BEFORE, AFTER)
    if any(selection.agents[name].slowings for name in event.agents):
        before = REACTING
    waits = [
        stop.until
        for name in event.agents
        for stop in selection.agents[name].stops
        if stop.reason == "gives_way"
    ]
    return event.time - before, max([event.time, *waits]) + after
