"""Compares the agent that brakes late on the tracks with the one of the plan."""

from __future__ import annotations

from scenewright.scene.events import Proof
from scenewright.scene.kinds import has_trait
from scenewright.scene.record import RelationRecord, SceneRecord
from scenewright.scene.rejection import Rejection
from scenewright.scene.social import RelationEdge, SocialGraph


def find_wrong_braker(graph: SocialGraph, scene: SceneRecord, proof: Proof) -> Rejection | None:
    """`wrong_braker`, if the plan has another agent brake than the tracks.

    Only another plan can mend that: the solver and the reasoner do as the plan says.
    """
    for edge, relation in zip(graph.relations, scene.relations, strict=True):
        detail = _find_other_braker(edge, relation, scene, proof)
        if detail is not None:
            return Rejection(
                stage="scene_verifier",
                code="wrong_braker",
                agents=(edge.from_, edge.to),
                detail=f"{edge.type} of {edge.from_} and {edge.to}: {detail}",
                repairable=False,
            )
    return None


def _find_other_braker(
    edge: RelationEdge, relation: RelationRecord, scene: SceneRecord, proof: Proof
) -> str | None:
    """What is wrong where the tracks have another one brake than the relation, or the hints."""
    if not has_trait("cause", relation.cause, "late"):
        return None
    pair = {relation.from_, relation.to}
    hinted = (
        min(pair.intersection(each.agents))
        for each in scene.said
        if each.became == "cause" and len(pair.intersection(each.agents)) == 1
    )
    meant = next(hinted, relation.cause_agent)
    names = {agent.id: agent.name for agent in scene.agents}
    for event in proof.events:
        seen = event.evidence.get("late_brake")
        same = event.type == relation.type and {event.from_, event.to} == pair
        if same and seen is not None and meant is not None and seen != meant:
            return (
                f"{names[seen]} brakes in the scene, the plan has {names[meant]} do so; write "
                f"cause {relation.cause} and as braker who brakes{_HINTS.get(edge.type, '')}"
            )
    return None


_HINTS = {"collide_at": ", in a collision the one that strikes (from), or leave out late_brake"}
