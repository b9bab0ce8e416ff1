"""Words -> what they amount to: by the grammar, or by the language model that plans."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from scenewright.backends import Account, Backend, get_backend_of_task, ignore_account
from scenewright.errors import BackendFault
from scenewright.scene.edits import (
    AgentView,
    Choice,
    Clarification,
    DeclinedTurn,
    Reading,
    Situation,
)
from scenewright.scene.frozen_agents import PreviousVersion
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import SceneRecord
from scenewright.scene.social import Refusal, SocialGraph


def build_situation(graph: SocialGraph, record: SceneRecord, earlier: PreviousVersion) -> Situation:
    """The situation that words are read against: the social graph and the agents."""
    present = []
    for each in record.agents:
        agent = earlier.agents[each.name].agent
        present.append(
            AgentView(
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
                stops=bool(agent.stands),
                slows_to=min((stop.speed for stop in agent.stops if stop.rolls), default=None),
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
    intersection_map: IntersectionMap,
    seed: int,
    account: Account = ignore_account,
) -> Reading:
    """What the words amount to: as the planner reads them, by rule where it is the grammar.

    What the session itself does, such as undoing, and words that say they begin a new scene are
    read by rule whoever plans; so is what the planner said nothing of use about.

    Args:
        before: what was said so far.
        chosen: answers to questions about the words: phrase -> agent id.
        account: called with what every answer of a model has cost.
    """
    from scenewright.backends.offline import begins_anew, read, site_of

    by_rule = read(words, situation, chosen=chosen, site=site_of(intersection_map))
    asked = not get_backend_of_task(backend, "edits").deterministic
    if situation is None or begins_anew(words) or not asked:
        return by_rule
    from scenewright.nodes.revision import Turn, read_by_model
    from scenewright.nodes.scene_planner import describe_routes

    turn = Turn(
        words,
        situation,
        before or "",
        describe_routes(intersection_map),
        chosen,
        left_hand=intersection_map.left_hand_traffic,
    )
    try:
        reading = read_by_model(turn, backend=backend, seed=seed, account=account)
    except BackendFault as fault:
        return DeclinedTurn(code="backend_failed", reason=str(fault))
    return by_rule if reading is None else reading


SENTENCE = "sentence"
"""Marker of a choice between sentences, in place of a phrase."""


def ask_what_is_meant(words: str, intersection_map: IntersectionMap) -> Clarification | None:
    """A question with the sentences that the offline planner takes doubtful words to mean."""
    from scenewright.backends.offline import plan, site_of
    from scenewright.tools.map_grounding.grounding import can_ground

    serves = partial(can_ground, intersection_map=intersection_map)
    found = plan(words, site=replace(site_of(intersection_map), can_serve=serves))
    if not isinstance(found, Refusal) or not found.did_you_mean:
        return None
    offered = enumerate(found.did_you_mean, start=1)
    choices = [Choice(answer=str(k), means=f"{SENTENCE}={each}") for k, each in offered]
    listed = " ".join(f"{k}: {each}" for k, each in enumerate(found.did_you_mean, start=1))
    reason = found.reason.partition(" Did you mean")[0]
    return Clarification(
        question=f"{reason} Do you mean {listed} 0: none of these",
        choices=(*choices, Choice(answer="0", means=f"{SENTENCE}=")),
    )
