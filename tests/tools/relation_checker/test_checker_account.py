"""The account of words is held against the tracks."""

from __future__ import annotations

import pytest

from checker_tracks import crossing_walker, plus_map, scene, yielding_car
from scenewright.scene.account import SaidRecord
from scenewright.scene.events import Proof
from scenewright.scene.record import SceneRecord
from scenewright.tools.relation_checker import check

MAP = plus_map()


def proof_of(*said: SaidRecord, background: tuple[int, ...] = ()) -> Proof:
    record: SceneRecord = scene(
        [yielding_car(), crossing_walker()],
        *(() if background else (("yielding", 1, 2),)),
        background=background,
    )
    return check(record.model_copy(update={"said": said}), MAP)


def entry(became: str, *agents: int, value: str | None = None) -> SaidRecord:
    return SaidRecord.model_validate(
        {"start": 0, "end": 4, "words": "said", "became": became, "agents": agents, "value": value}
    )


@pytest.mark.parametrize(
    "said",
    [
        entry("agent", 1, value="vehicle"),
        entry("agent", 2, value="pedestrian"),
        entry("relation", 1, 2, value="yield_to"),
        entry("denied", 1, 2, value="collide_at"),
        entry("retracted"),
    ],
)
def test_what_the_tracks_bear_out_is_realised_with_evidence(said: SaidRecord) -> None:
    proof = proof_of(said)
    assert proof.verified
    assert proof.said[0].status == "realised"
    assert proof.said[0].evidence


@pytest.mark.parametrize(
    "said",
    [
        entry("agent", 1, value="truck"),
        entry("agent", 9),
        entry("relation", 1, 2, value="collide_at"),
        entry("entry", 1, value="nowhere"),
        entry("denied", 1, 2, value="yield_to"),
        entry("time_of_day", value="03:00"),
        entry("density", value="high"),
        entry("cause", 1, value="late_brake"),
    ],
)
def test_a_claim_that_the_tracks_do_not_bear_out_breaks_the_proof(said: SaidRecord) -> None:
    proof = proof_of(said)
    assert not proof.verified
    assert [each.rule for each in proof.missing] == ["said_not_realised"]
    assert proof.said[0].status == "claimed"


def test_words_without_effect_and_words_left_out_are_told_apart() -> None:
    proof = proof_of(entry("manner", 1), entry("nothing"))
    assert proof.verified
    assert [each.status for each in proof.said] == ["manner", "unrealised"]
