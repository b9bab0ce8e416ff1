"""Words -> what they amount to: by the grammar, else by the backend's planner."""

from __future__ import annotations

from collections.abc import Mapping

from scenewright.backends import Backend, speaker
from scenewright.errors import BackendFault
from scenewright.scene.edits import Decline, Present, Reading, Situation
from scenewright.scene.map import IntersectionMap
from scenewright.scene.pins import Earlier
from scenewright.scene.record import SceneRecord
from scenewright.scene.social import SocialGraph


def situation_of(graph: SocialGraph, record: SceneRecord, earlier: Earlier) -> Situation:
    """What words are read against: the social graph, and who is there."""
    present = []
    for each in record.agents:
        agent = earlier.agents[each.name].agent
        present.append(
            Present(
                id=each.name,
                number=each.id,
                type=each.type,
                subtype=each.subtype,
                entry=each.entry,
                exit=each.exit,
                movement=each.movement,
                crosswalk=each.crosswalk,
                role=each.role,
                speed=agent.candidate.time_law.speed,
                stops=bool(agent.stops),
            )
        )
    return Situation(graph=graph, present=tuple(present))


def read_words(
    words: str,
    situation: Situation | None,
    *,
    backend: Backend,
    before: str | None,
    chosen: Mapping[str, str],
    on: IntersectionMap,
    seed: int,
) -> Reading:
    """What the words amount to.

    Args:
        before: what was said so far.
        chosen: answers to questions about the words: phrase -> agent id.
    """
    from scenewright.backends.builtin.revising import read

    reading = read(words, situation, chosen=chosen)
    lost = isinstance(reading, Decline) and reading.code in ("out_of_scope", "no_change")
    grammar = speaker(backend, "plan").name == "builtin"
    if not lost or situation is None or before is None or grammar:
        return reading
    from scenewright.nodes.revision import replan

    try:
        made = replan(words, situation, before=before, backend=backend, on=on, seed=seed)
    except BackendFault as fault:
        return Decline(code="backend_failed", reason=str(fault))
    return made or reading
