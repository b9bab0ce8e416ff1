"""Compares the agent that brakes late on the tracks with the one of the plan."""

from __future__ import annotations

from collections.abc import Mapping

from scenewright.scene.events import Proof
from scenewright.scene.record import RelationRecord, SceneRecord
from scenewright.scene.rejection import Rejection
from scenewright.scene.social import RelationEdge, SocialGraph


def find_wrong_braker(graph: SocialGraph, scene: SceneRecord, proof: Proof) -> Rejection | None:
    """`wrong_braker`, if the plan has another agent brake than the tracks or its own account.

    Only another plan can mend that: the solver and the reasoner do as the plan says.
    """
    names = {agent.id: agent.name for agent in scene.agents}
    for edge, relation in zip(graph.relations, scene.relations, strict=True):
        detail = _find_wrong_braker_on_tracks(
            edge, relation, proof, names
        ) or _find_wrong_braker_in_account(edge, relation, proof, names)
        if detail is not None:
            return Rejection(
                stage="scene_verifier",
                code="wrong_braker",
                agents=(edge.from_, edge.to),
                detail=f"{edge.type} of {edge.from_} and {edge.to}: {detail}",
                repairable=False,
            )
    return None


def _find_wrong_braker_on_tracks(
    edge: RelationEdge, relation: RelationRecord, proof: Proof, names: Mapping[int, str]
) -> str | None:
    meant = relation.cause_agent
    if relation.cause != "late_brake" or meant is None:
        return None
    for event in proof.events:
        seen = event.evidence.get("late_brake")
        same = event.type == relation.type and {event.from_, event.to} == _get_pair(relation)
        if same and seen not in (None, meant):
            return (
                f"{names[seen]} brakes in the scene, the plan has {names[meant]} do so; write as "
                f"braker who brakes in the request{_HINTS.get(edge.type, '')}"
            )
    return None


_HINTS = {"collide_at": ", in a collision the one that strikes (from), or leave out late_brake"}


def _find_wrong_braker_in_account(
    edge: RelationEdge, relation: RelationRecord, proof: Proof, names: Mapping[int, str]
) -> str | None:
    """Where `said` has another agent brake than the relation."""
    if edge.type not in ("collide_at", "near_miss"):
        return None
    for entry in proof.said:
        brakes = _get_pair(relation).intersection(entry.agents)
        denied = entry.became == "cause" and entry.status == "claimed"
        late = entry.value in (None, "late_brake")
        if denied and late and brakes and relation.cause_agent not in brakes:
            name = names[min(brakes)]
            return (
                f"said has '{entry.words}' of {name}, but the relation does not; if {name} is the "
                f"one who brakes, write cause late_brake and braker {name}"
            )
    return None


def _get_pair(relation: RelationRecord) -> set[int]:
    return {relation.from_, relation.to}
