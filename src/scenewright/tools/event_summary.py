"""Event summary (paper 3.4): anchors and times of the selected priors, as evidence to reason on."""

from __future__ import annotations

from typing import Any

from scenewright.geometry.driving_profile import Motion, compute_motion
from scenewright.geometry.landmarks import find_landmarks
from scenewright.geometry.map_areas import MapAreas
from scenewright.scene.behavior import AgentSummary, Anchor, EventSummary, Stay
from scenewright.scene.candidates import Candidate
from scenewright.scene.selection import SelectedAgent, Selection, Stop
from scenewright.scene.track import STEP
from scenewright.tools.segment_editor import get_motion_edits


def summarise(selection: Selection, *, map_areas: MapAreas) -> EventSummary:
    """What the selected tracks pass and when, and the stays that the solver found to work."""
    agents = tuple(
        _summarize_agent(agent, selection.duration, map_areas)
        for agent in selection.agents.values()
    )
    evidence = tuple(
        {"clause": e.clause, "agents": list(e.agents), "time": e.time, "location": list(e.location)}
        for e in selection.events
    )
    return EventSummary(duration=selection.duration, agents=agents, evidence=evidence)


def name_anchor(stop: Stop, candidate: Candidate, *, map_areas: MapAreas) -> str:
    """The map entity of a stop, by name."""
    route = candidate.route
    if stop.anchor == "stop_line":
        movement = map_areas.intersection_map.find_movement(route)
        return movement.stop_line if movement else "stop_line"
    if stop.anchor == "kerb":
        return f"{route.crosswalk}:kerb:{route.entry}"
    return f"{stop.anchor}@{stop.s:.1f}"


def _summarize_agent(agent: SelectedAgent, duration: float, map_areas: MapAreas) -> AgentSummary:
    editing = get_motion_edits(agent)
    motion = compute_motion(agent.candidate, holds=editing.holds, slowings=editing.slowings)
    leaves = min(agent.enters + STEP * (len(motion.s) - 1), duration)
    leaves = leaves if agent.contact is None else min(leaves, agent.contact)
    stays = tuple(
        Stay(
            anchor=name_anchor(stop, agent.candidate, map_areas=map_areas),
            start=round(stop.start, 3),
            until=round(stop.until, 3),
            reason=stop.reason,
        )
        for stop in agent.stops
    )
    return AgentSummary(
        agent=agent.name,
        enters=agent.enters,
        leaves=round(leaves, 3),
        anchors=_list_anchors(agent, compute_motion(agent.candidate), duration, map_areas),
        stays=stays,
        # 14.330000000000002 would be later than it leaves.
        contact=None if agent.contact is None else round(agent.contact, 9),
    )


def _list_anchors(
    agent: SelectedAgent, prior: Motion, duration: float, map_areas: MapAreas
) -> tuple[Anchor, ...]:
    """List every anchor on the path by arc length, timed by the unedited prior."""
    landmarks = find_landmarks(agent.candidate, map_areas=map_areas)
    places: list[tuple[str, float]] = [
        (name_anchor(stop, agent.candidate, map_areas=map_areas), stop.s) for stop in agent.stops
    ]
    if landmarks.line is not None:
        walker = agent.candidate.route.type == "pedestrian"
        line = Stop("kerb" if walker else "stop_line", landmarks.line, 0.0, 0.0, "")
        name = name_anchor(line, agent.candidate, map_areas=map_areas)
        places += [] if any(name == place[0] for place in places) else [(name, landmarks.line)]
    for crosswalk, enters, leaves in landmarks.crosswalks:
        places += [(f"{crosswalk}:entry", enters), (f"{crosswalk}:exit", leaves)]
    places.append(("goal", agent.candidate.path.length))
    return tuple(
        Anchor(id=name, s=round(s, 3), time=_find_time(agent, prior, s, duration))
        for name, s in sorted(places, key=lambda place: place[1])
    )


def _find_time(agent: SelectedAgent, prior: Motion, s: float, duration: float) -> float | None:
    time = agent.enters + prior.find_time_at(s)
    return round(time, 3) if 0.0 <= time <= duration else None


def to_facts(summary: EventSummary) -> dict[str, Any]:
    """Return the summary as plain JSON values, for the event reasoner."""
    return summary.model_dump(mode="json")
