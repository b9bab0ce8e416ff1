"""Compares the agent that brakes late on the tracks with the one of the plan."""

from __future__ import annotations

from scenewright.scene.events import Proof
from scenewright.scene.kinds import has_trait
from scenewright.scene.record import SceneRecord
from scenewright.scene.rejection import Rejection
from scenewright.scene.social import SocialGraph


def find_wrong_braker(graph: SocialGraph, scene: SceneRecord, proof: Proof) -> Rejection | None:
    """`wrong_braker`, if the plan has another agent brake than the tracks, or the hints do.

    Only another plan can mend that: the solver and the reasoner do as the plan says.
    """
    names = {agent.id: agent.name for agent in scene.agents}
    for edge, relation in zip(graph.relations, scene.relations, strict=True):
        if not has_trait("cause", relation.cause, "late"):
            continue
        pair = {relation.from_, relation.to}
        hinted = (
            min(pair.intersection(each.agents))
            for each in scene.said
            if each.became == "cause" and len(pair.intersection(each.agents)) == 1
        )
        meant = next(hinted, relation.cause_agent)
        for event in proof.events:
            seen = event.evidence.get("late_brake")
            same = event.type == relation.type and {event.from_, event.to} == pair
            if same and seen is not None and meant is not None and seen != meant:
                return Rejection(
                    stage="scene_verifier",
                    code="wrong_braker",
                    agents=(edge.from_, edge.to),
                    detail=f"{edge.type} of {edge.from_} and {edge.to}: {names[seen]} brakes in "
                    f"the scene, the plan has {names[meant]} do so; write cause {relation.cause} "
                    f"and as braker who brakes{_HINTS.get(edge.type, '')}",
                    repairable=False,
                )
    return None


_HINTS = {"collide_at": ", in a collision the one that strikes (from), or leave out late_brake"}
