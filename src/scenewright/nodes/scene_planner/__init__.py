"""Stage 1, scene planner: instruction -> social graph, grounded on the map (paper 3.1)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial
from typing import TypedDict

from scenewright.backends import Backend, Question, get_backend_of_task
from scenewright.errors import Rejected
from scenewright.nodes.ask import ask, list_stage_faults
from scenewright.nodes.context import RunContext, Runtime
from scenewright.nodes.remaining import refuse_unrealised, refuse_words
from scenewright.nodes.scene_planner.hints import locate_hints, mark_names
from scenewright.nodes.scene_planner.prompts import render_plan_prompt
from scenewright.nodes.scene_planner.reply import PlanReply, complete_plan
from scenewright.scene.account import SaidSpan
from scenewright.scene.candidates import Grounding
from scenewright.scene.frozen_agents import FrozenAgents
from scenewright.scene.rejection import Rejection
from scenewright.scene.relations import load_patterns
from scenewright.scene.remaining import Unserved
from scenewright.scene.route_table import FOUR_LEGS, RouteDescription, describe_routes
from scenewright.scene.social import Plan, Refusal, RelationEdge, SocialGraph
from scenewright.tools.account.vocabulary import read_tokens
from scenewright.tools.gmm_sampler.frozen_agents import restrict_grounding
from scenewright.tools.map_grounding.grounding import can_ground, ground_graph
from scenewright.tools.map_grounding.relation_faults import keeps_striker

_STRIKES = re.compile(
    r"\b(?:hit(?:s|ting)?|str(?:ikes?|uck|iking)|ram(?:s|med|ming)?|clip(?:s|ped|ping)?|"
    r"t[- ]?bon(?:es?|ed|ing)|broadsid(?:es?|ed|ing)|side[- ]?swip(?:es?|ed|ing)|mow(?:s|ed)? down|"
    r"knock(?:s|ed|ing)?|r[au]n(?:s|ning)? (?:over|into|down)|sweeps away|\w+(?:s|ing) into)\b",
    re.IGNORECASE,
)

_MUTUAL = re.compile(
    r".*\b(?:each other|one another)\b|(?:an? )?\S+ (?:between|of|involving)\b", re.IGNORECASE
)
"""Words that leave open which of the two it is."""


def name_strikers(plan: SocialGraph, text: str) -> SocialGraph:
    """The plan in which the agent strikes that the words of a collision say.

    With a pedestrian it is always the vehicle; with its side or rear no agent strikes.
    """
    said = [(edge, _find_words(edge, plan, text)) for edge in plan.relations]
    edges = [edge if words is None else _let_strike(edge, plan) for edge, words in said]
    added = [
        words.model_copy(
            update={"became": "striker", "agents": (edge.from_, edge.to), "value": None}
        )
        for edge, words in said
        if words is not None
    ]
    if not added:
        return plan
    account = sorted((*plan.said, *added), key=lambda each: each.start)
    return plan.model_copy(update={"relations": tuple(edges), "said": tuple(account)})


def _let_strike(edge: RelationEdge, plan: SocialGraph) -> RelationEdge:
    """The edge whose `from` strikes; without its pattern where in that the other one does."""
    strikes = edge.model_copy(update={"strikes": edge.from_})
    pattern = next((each for each in load_patterns() if each.id == edge.pattern), None)
    if pattern is None:
        return strikes
    kinds = {name: plan.agent(name).type for name in edge.pair}
    orders = ((edge.from_, edge.to), (edge.to, edge.from_))
    played = (
        o for o in orders if pattern.from_.admits(kinds[o[0]]) and pattern.to.admits(kinds[o[1]])
    )
    if any(keeps_striker(strikes, pattern, order) for order in played):
        return strikes
    return strikes.model_copy(update={"pattern": None, "kind": None})


def _find_words(edge: RelationEdge, plan: SocialGraph, text: str) -> SaidSpan | None:
    """The words that say who strikes in the collision; None where none do."""
    walks = any(plan.agent(name).type == "pedestrian" for name in edge.pair)
    with_front = edge.point_from is None or edge.point_from.startswith("front")
    if edge.type != "collide_at" or edge.strikes is not None or walks or not with_front:
        return None
    said = (each for each in plan.said if each.became == "relation")
    words = (each for each in said if edge.pair == set(each.agents))
    for word in words:
        mutual = _MUTUAL.match(text[word.start : word.end + len(" involving")])
        mended = " ".join(token.text for token in read_tokens(word.words))
        if (_STRIKES.search(word.words) or _STRIKES.search(mended)) and not mutual:
            return word
    return None


class PlannerReads(TypedDict):
    """Channels read."""

    instruction: str
    previous: str | None
    planned: SocialGraph | None
    pinned: FrozenAgents | None
    rejections: list[Rejection]


class PlannerWrites(TypedDict):
    """Channels written."""

    social_graph: SocialGraph
    grounding: Grounding


__all__ = [
    "FOUR_LEGS",
    "PlanReply",
    "RouteDescription",
    "ask_for_plan",
    "describe_routes",
    "plan_scene",
]


def plan_scene(state: PlannerReads, *, runtime: Runtime) -> PlannerWrites:
    """Asks for the social graph, unless it is settled, and binds it to the map."""
    context = runtime.context
    plan = state.get("planned") or _get_plan(state, context)
    edges = [f"{edge.from_} {edge.type} {edge.to}" for edge in plan.relations]
    told = f"{len(plan.agents)} agents; {', '.join(edges) or 'normal traffic'}"
    context.log("scene_planner", told)
    grounding, pins = ground_graph(plan, intersection_map=context.intersection), state.get("pinned")
    if pins is not None:
        grounding = restrict_grounding(plan, grounding, pins, intersection_map=context.intersection)
    return {"social_graph": plan, "grounding": grounding}


def _get_plan(state: PlannerReads, context: RunContext) -> SocialGraph:
    # Loads the checker, which the command `plan` does not need.
    from scenewright.tools.account import blank_standing_facts, list_unknown_words

    instruction = state["instruction"]
    rejections = list_stage_faults(state.get("rejections", []), "scene_planner")
    ways = describe_routes(context.intersection)
    question = Question(
        task="plan",
        facts={
            "instruction": blank_standing_facts(instruction),
            "previous": state.get("previous"),
            "legs": [leg.name for leg in context.intersection.legs],
            "left_hand": context.intersection.left_hand_traffic,
            "roads": {leg.name: leg.road for leg in context.intersection.legs},
        },
        rejections=rejections,
        seed=context.seed,
        prompt=lambda: render_plan_prompt(
            instruction,
            state.get("previous"),
            ways,
            left_hand=context.intersection.left_hand_traffic,
            rejections=rejections,
            roads=tuple((leg.name, leg.road) for leg in context.intersection.legs),
            examples=context.recall("plan", instruction),
        ),
        account=context.account,
        can_serve=partial(can_ground, intersection_map=context.intersection),
    )
    plan = ask_for_plan(context.backend, question, ways)
    if isinstance(plan, Refusal):
        raise Rejected(Rejection(stage="scene_planner", code=plan.code, detail=plan.reason))
    if not context.lenient:
        # What the builtin planner takes for unrealisable is a hint: the account judges the words.
        hints = get_backend_of_task(context.backend, "plan").deterministic
        left_out = [
            Unserved(entry=n, note=each.note or "not modelled")
            for n, each in enumerate(plan.said)
            if each.became == "nothing" and not hints
        ]
        refuse_unrealised(plan, left_out, "scene_planner")
        unknown = list_unknown_words(instruction, context.intersection)
        if unknown:  # no plan can show them: nothing need be solved to know
            raise Rejected(refuse_words(unknown, plan, "scene_planner"))
    return plan


def ask_for_plan(backend: Backend, question: Question, ways: Sequence[RouteDescription]) -> Plan:
    """The backend's plan, with what it entails on the map filled in.

    Raises:
        Rejected: `malformed_reply`, or `unknown_direction` for a side that the map has not.
        BackendFault: the backend cannot answer.
    """
    plan = ask(backend, question, PlanReply, stage="scene_planner").root
    # The builtin planner has filled in what follows, by rules of its own.
    if isinstance(plan, Refusal):
        return plan
    text = str(question.facts["instruction"])
    if get_backend_of_task(backend, "plan").deterministic:
        return mark_names(name_strikers(plan, text))
    known = dict.fromkeys(side for way in ways for side in (way.entry, way.exit))
    for agent in plan.agents:
        for field in ("entry", "exit", "crosswalk"):
            side = getattr(agent, field)
            if side is not None and side not in known:
                raise Rejected(
                    Rejection(
                        stage="scene_planner",
                        code="unknown_direction",
                        agents=(agent.id,),
                        detail=f"{agent.id}: {field} {side} is none of {', '.join(known)}",
                    )
                )
    plan = complete_plan(plan, ways)
    plan = plan.model_copy(update={"said": tuple(locate_hints(plan, text))})
    return name_strikers(plan, text)
