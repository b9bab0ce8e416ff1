"""The account of words is held against the tracks."""

from __future__ import annotations

import numpy as np
import pytest

from checker_tracks import crossing_walker, plus_map, scene, yielding_car
from scenewright.scene.account import SaidRecord
from scenewright.scene.events import Proof
from scenewright.scene.record import SceneRecord
from scenewright.tools.relation_checker import check
from scenewright.tools.relation_checker.legs import is_crossed

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
        {"start": 0, "end": 0, "words": "said", "became": became, "agents": agents, "value": value}
    )


@pytest.mark.parametrize(
    "said",
    [
        entry("agent", 1, value="vehicle"),
        entry("agent", 2, value="pedestrian"),
        entry("relation", 1, 2, value="yield_to"),
        entry("denied", 1, 2, value="collide_at"),
        entry("retracted"),
        entry("background", value="0 vehicles, 0 pedestrians"),
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
        entry("background", value="3 vehicles"),
    ],
)
def test_a_claim_that_the_tracks_do_not_bear_out_breaks_the_proof(said: SaidRecord) -> None:
    proof = proof_of(said)
    assert not proof.verified
    assert proof.missing[0].rule == "said_not_realised"
    assert proof.said[0].status == "claimed"


def test_words_without_effect_and_words_left_out_are_told_apart() -> None:
    proof = proof_of(entry("manner", 1), entry("nothing"))
    assert proof.verified
    assert [each.status for each in proof.said] == ["manner", "unrealised"]


def proof_of_asked(became: str, value: str, words: str = "said") -> Proof:
    """A car of 10 m/s that stands from 5.4 to 9.0 s for a walker of 1.4 m/s."""
    record = scene([yielding_car(), crossing_walker()], ("yielding", 1, 2))
    named = [each.model_copy(update={"name": f"{each.type}-1"}) for each in record.agents]
    said = entry(became, 1, value=value).model_copy(update={"words": words})
    return check(record.model_copy(update={"agents": tuple(named), "said": (said,)}), MAP)


@pytest.mark.parametrize(
    ("became", "value", "words"),
    [
        ("constraint", "speed(vehicle-1) in [9.5, 10.5] m/s", "at 10 m/s"),
        ("constraint", "speed(pedestrian-1) in [1.3, 1.5] m/s", "at 1.4 m/s"),
        ("constraint", "before(pedestrian-1, vehicle-1)", "first"),
        ("constraint", "near(vehicle-1, pedestrian-1) <= 0.5 m", "close"),
        ("constraint", "passes_through(vehicle-1, junction)", "through the middle"),
        ("behavior", "vehicle-1 stands 5.4-9.0 s", "waits"),
        ("behavior", "vehicle-1 stands 5.4-9.0 s", "stops once"),
    ],
)
def test_clauses_and_standstills_are_measured(became: str, value: str, words: str) -> None:
    proof = proof_of_asked(became, value, words)
    assert proof.verified
    assert proof.said[0].status == "realised"


@pytest.mark.parametrize(
    ("became", "value", "words"),
    [
        ("constraint", "speed(vehicle-1) in [7.5, 8.5] m/s", "at 8 m/s"),
        ("constraint", "speed(vehicle-2) in [1, 19] m/s", "somebody else"),
        ("constraint", "before(vehicle-1, pedestrian-1)", "first"),
        ("constraint", "time_gap(vehicle-1, pedestrian-1) in [0.1, 0.2] s", "just behind"),
        ("constraint", "headway(vehicle-1, pedestrian-1) in [1, 2] s", "behind"),
        ("constraint", "speed(vehicle-1) in [9.5, 10.5] m/s; nonsense", "at 10 m/s"),
        ("behavior", "vehicle-1 stands 1.0-2.5 s", "hesitates"),
        ("behavior", "vehicle-1 stands 5.4-9.6 s", "waits for 4.2 s"),
        ("behavior", "vehicle-1 stands 5.4-9.0 s", "stops twice"),
        ("behavior", "pedestrian-1 stands 5.4-9.0 s", "stands"),
    ],
)
def test_those_that_the_tracks_lack_break_the_proof(became: str, value: str, words: str) -> None:
    proof = proof_of_asked(became, value, words)
    assert not proof.verified
    assert proof.missing[0].rule == "said_not_realised"


def test_clauses_that_say_nothing_are_not_realised() -> None:
    assert not proof_of(entry("constraint", 1), entry("behavior", 1)).verified


def test_a_walk_that_ends_before_the_middle_is_no_crossing() -> None:
    place = plus_map()
    crosswalk = place.crosswalks[0]
    a, b = (np.array(end) for end in crosswalk.centreline)
    walked = np.linspace(a - 0.5 * (b - a), b, 40)
    assert is_crossed(walked, crosswalk.leg, place)
    assert is_crossed(walked[::-1], crosswalk.leg, place)
    assert not is_crossed(walked[:20], crosswalk.leg, place)
