"""Figures whose answers are known by hand."""

from __future__ import annotations

import pytest

from scenewright.evals.understanding.cases import Labels, PairRelation
from scenewright.evals.understanding.scoring import (
    ScenePrediction,
    WindowScores,
    count_scene,
    summarise,
)

FOUR = ("a", "b", "c", "d")


def labels(*relations: PairRelation, late: tuple[str, ...] = ()) -> Labels:
    return Labels(
        exits=dict.fromkeys(FOUR, "north"),
        types={"a": "vehicle", "b": "pedestrian", "c": "vehicle", "d": "vehicle"},
        starts={agent: 9.0 if agent in late else 0.0 for agent in FOUR},
        relations=relations,
    )


def row(truth: Labels, *given: PairRelation, window: float = 2.0) -> WindowScores:
    exits = {"a": "north", "b": "south", "c": "north", "d": "west"}
    said = ScenePrediction({k: v for k, v in exits.items() if truth.starts[k] <= window}, given)
    return summarise([count_scene(truth, said, window=window)], window=window, seconds=None)


def f1(found: WindowScores, kind: str) -> float | None:
    return found.relations[kind].value


def test_exits_are_counted_by_class_and_pooled() -> None:
    found = row(labels())
    assert found.intent["vehicle"].value == pytest.approx(66.67, abs=0.01)
    assert found.intent["pedestrian"].value == 0.0
    assert (found.intent["overall"].value, found.intent["overall"].n) == (50.0, 4)


def test_the_relation_and_both_agents_must_be_right() -> None:
    truth = labels(PairRelation("collision", "a", "b", 6.0))
    assert f1(row(truth, PairRelation("collision", "b", "a")), "collision") == 100.0
    wrong_partner = row(truth, PairRelation("collision", "a", "c"))
    assert f1(wrong_partner, "collision") == 0.0
    assert f1(row(truth, PairRelation("near_miss", "a", "b")), "collision") == 0.0
    # Of c and d, who are in nothing, c was told to be in something; so were a, rightly, and not b.
    assert f1(wrong_partner, "normal") == 50.0


def test_the_yielding_agent_must_be_right() -> None:
    truth = labels(PairRelation("yielding", "a", "b", 6.0))
    assert f1(row(truth, PairRelation("yielding", "a", "b")), "yielding") == 100.0
    turned = row(truth, PairRelation("yielding", "b", "a"))
    assert (f1(turned, "yielding"), f1(turned, "normal")) == (0.0, 100.0)


def test_macro_is_the_mean_of_the_papers_three_and_micro_pools_items() -> None:
    truth = labels(
        PairRelation("collision", "a", "b", 6.0), PairRelation("yielding", "c", "d", 6.0)
    )
    found = row(truth, PairRelation("collision", "a", "b"), PairRelation("near_miss", "c", "d"))
    # normal: nobody is, nobody was told to be; so it has no F1, and neither has the mean.
    assert (f1(found, "normal"), f1(found, "macro")) == (None, None)
    assert f1(found, "micro") == pytest.approx(100 * 4 / (4 + 2 + 2), abs=0.01)
    both = summarise(
        [
            count_scene(
                truth, ScenePrediction(None, (PairRelation("collision", "a", "b"),)), window=2.0
            ),
            count_scene(labels(), ScenePrediction(None, ()), window=2.0),
        ],
        window=2.0,
        seconds=None,
    )
    normal = 100 * 2 * 4 / (2 * 4 + 2)
    assert both.relations["macro"].value == pytest.approx((normal + 100 + 0) / 3, abs=0.01)
    assert both.intent == {}


def test_events_with_agents_still_to_come_are_listed_and_count_when_strict() -> None:
    truth = labels(PairRelation("collision", "a", "b", 12.0), late=("b",))
    found = row(truth)
    assert (found.later, found.unseen, found.agents) == (1, 1, 3)
    assert found.relations["collision"].n == 0
    # a is in an event that cannot be told yet: left out; c and d are normal and told to be.
    assert (f1(found, "normal"), found.relations["normal"].n) == (100.0, 2)
    assert found.strict["collision"].value == 0.0
    assert found.strict["normal"].value == pytest.approx(80.0)


def test_intervals_come_from_scenes_and_hold_the_value() -> None:
    truth = labels(PairRelation("collision", "a", "b", 6.0))
    right = count_scene(
        truth, ScenePrediction(None, (PairRelation("collision", "a", "b"),)), window=2.0
    )
    wrong = count_scene(truth, ScenePrediction(None, ()), window=2.0)
    found = summarise([right, wrong] * 40, window=2.0, seconds=None)
    figure = found.relations["collision"]
    assert figure.value == pytest.approx(66.67, abs=0.01)
    assert figure.low is not None
    assert figure.high is not None
    assert 50.0 < figure.low < 66.67 < figure.high < 82.0
    again = summarise([right, wrong] * 40, window=2.0, seconds=None)
    assert again.to_json() == found.to_json()


def test_found_by_lead_time() -> None:
    truth = labels(
        PairRelation("collision", "a", "b", 3.0), PairRelation("yielding", "c", "d", 9.0)
    )
    found = row(truth, PairRelation("collision", "a", "b"))
    assert found.leads["collision"][0] == (1, 1)
    assert found.leads["yielding"][3] == (0, 1)
