"""Places and agents in words."""

from __future__ import annotations

from typing import Any

import pytest

from scenewright.cli.console import format_one_line
from scenewright.cli.output_folder import choose_folder_name
from scenewright.cli.scene_summary import (
    _describe_worst,
    choose_style,
    format_verdict,
    list_choices,
    list_unseen_words,
    place,
)
from scenewright.intersections import load_map
from scenewright.scene.account import SaidRecord
from scenewright.scene.events import Event, Proof

ON = load_map("amsterdam_120")


WORDS = {
    "car": "seen", "dog": "not_shown", "honks": "not_shown", "bus": "contradicted",
    "daylight": "stands_anyway", "carelessly": "manner", "x\x1b": "not_shown",
}  # fmt: skip


def prove(*words: str, verified: bool = True, **fields: Any) -> Proof:
    """A proof with these words in the account."""
    entries = [
        {"start": 0, "end": 1, "words": each, "state": WORDS[each], "evidence": f"why {each}"}
        for each in words
    ]
    return Proof.model_validate({"verified": verified, "events": (), "account": entries, **fields})


RUN = {"unasked_red_light_runs": [{"agent": 1, "time": 2.0}]}


@pytest.mark.parametrize(
    ("proof", "words", "style"),
    [
        (prove("car", "daylight", "carelessly"), "verified", "green"),
        (prove("car", "dog", "honks"), "partly: 'dog', 'honks' not shown", "yellow"),
        (prove("car", figures=RUN), "verified, 1 red light run unasked", "yellow"),
        (prove("dog", figures=RUN), "partly: 'dog' not shown, 1 red light run unasked", "yellow"),
        (prove(), "verified, no account of words", "yellow"),
        (prove("bus", verified=False), "not verified (0 findings)", "red"),
        (
            prove("x\x1b", verified=False),
            "not verified, 'x\\x1b' not shown (0 findings)",
            "red",
        ),
    ],
)
def test_the_verdict_has_beside_it_what_it_does_not_cover(
    proof: Proof, words: str, style: str
) -> None:
    assert format_verdict(proof) == words
    assert choose_style(verified=proof.verified, caveat=proof.caveat) == style


def test_every_word_that_was_not_seen_is_listed_by_its_state() -> None:
    assert list_unseen_words(prove(*list(WORDS)[:-1])) == [
        "not shown: 'dog' (why dog), 'honks' (why honks)",
        "contradicted: 'bus' (why bus)",
        "stands anyway: 'daylight'",
        "without effect on tracks: 'carelessly'",
    ]
    assert list_unseen_words(prove("car")) == []


def test_what_the_planner_took_words_for_is_no_part_of_the_summary() -> None:
    hint = SaidRecord(start=0, end=3, words="dog", became="nothing")
    assert list_choices([hint]) == []


@pytest.mark.parametrize("crosswalk", ON.crosswalks, ids=lambda each: each.leg)
def test_the_middle_of_a_crosswalk_is_on_it(crosswalk: object) -> None:
    (ax, ay), (bx, by) = crosswalk.centreline  # type: ignore[attr-defined]
    spot = ((ax + bx) / 2, (ay + by) / 2)
    assert place(spot, ON) == f"on the {crosswalk.leg} crosswalk"  # type: ignore[attr-defined]


def test_the_origin_is_in_the_junction_and_far_away_is_a_leg() -> None:
    assert place((0.0, 0.0), ON) == "in the junction"
    assert place((3.0, 55.0), ON) == "on the north leg"
    assert place((-55.0, 2.0), ON) == "on the west leg"


@pytest.mark.parametrize(
    ("scene_id", "name"),
    [("0a1b", "0a1b"), ("../../etc/passwd", "etc-passwd"), ("..", "scene"), ("Ä\0/ b", "b")],
)
def test_a_scene_id_is_never_a_path(scene_id: str, name: str) -> None:
    assert choose_folder_name(scene_id) == name


def test_one_line_cannot_steer_a_terminal() -> None:
    assert format_one_line("a\x1b[31mb\nc\u202ed\udcff") == "a [31mb c d"
    assert len(format_one_line("x" * 10_000)) == 600


def test_what_is_worse_at_another_moment_is_said_with_time_and_place() -> None:
    moment = {"value": 0.4, "time": 25.1, "location": (0.0, 0.0)}
    event = Event.model_validate({
        "type": "near_miss", "from": 1, "to": 2, "time": 20.2, "location": (0.0, 0.0),
        "evidence": {"pet": 0.9, "clearance": 0.8, "drac": 3.0},
        "worst": {"path_ttc": moment, "clearance": moment | {"value": 0.8}, "drac": moment},
    })  # fmt: skip
    (line,) = _describe_worst(event, ON)
    where = place((0.0, 0.0), ON)
    assert line == f"worse at another moment: path TTC 0.4 s at 25.1 s {where}"
