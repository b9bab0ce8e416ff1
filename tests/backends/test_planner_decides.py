"""When a reading is sure, what stands though it is not, and what is offered otherwise."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest
from threadpoolctl import threadpool_limits

from lab.planner.plain_sentences import build_reading
from scenewright.backends.builtin import planner
from scenewright.backends.builtin.draft import Site
from scenewright.backends.builtin.planner import is_same_plan, is_sure, plan
from scenewright.backends.builtin.reader.annotation import parse_annotation
from scenewright.backends.builtin.reader.learned_plan import (
    OPENERS,
    LearnedPlan,
    plan_reading,
    read_again,
)
from scenewright.scene.phrasing import describe_graph
from scenewright.scene.social import Refusal, SocialGraph

HITS = "[veh:1 A car] from the [from:1 north] [hit:1>2 hits] [ped:2 a man]"
MISSES = "[veh:1 A car] from the [from:1 north] [near:1>2 just misses] [ped:2 a man]"


def learned(line: str, confidence: float) -> LearnedPlan:
    row = parse_annotation(line)
    found = plan_reading(build_reading(row), Site(), row.text)
    return replace(found, confidence=confidence)


def graph_of(line: str) -> SocialGraph:
    found = learned(line, 1.0).plan
    assert isinstance(found, SocialGraph)
    return found


@pytest.mark.parametrize(
    "text",
    [
        "A car hits a jaywalking pedestrian",
        "A van hits a jaywalking pedestrian at 8 am",
        "A speeding car hits a jaywalking woman at night",
    ],
)
def test_an_article_before_an_adjective_is_no_road_user(text: str) -> None:
    found = plan(text)
    assert isinstance(found, SocialGraph)
    assert [agent.movement for agent in found.agents] == [None, "jaywalking"]


def test_a_sure_reading_stands_by_itself() -> None:
    assert is_sure(learned(HITS, 0.999), Site())


def test_an_unsure_reading_stands_if_it_comes_out_whatever_words_stand_around_it() -> None:
    assert is_sure(learned(HITS, 0.3), Site())
    assert is_sure(learned(HITS, 0.0), Site())


def test_an_unsure_reading_that_does_not_come_out_again_is_asked_about() -> None:
    text = parse_annotation(HITS).text
    misread = replace(
        learned(MISSES, 0.3), reading=replace(learned(MISSES, 0.3).reading, text=text)
    )
    assert not is_sure(misread, Site())


def test_every_sentence_offered_is_understood_as_it_is_meant() -> None:
    refused = plan("Some idiot made a U-turn right in front of the 42 and I clipped his bumper.")
    assert isinstance(refused, Refusal)
    assert refused.did_you_mean
    for sentence in refused.did_you_mean:
        again = plan(sentence)
        assert isinstance(again, SocialGraph)
        assert describe_graph(again) == sentence


def test_spans_after_an_opener_lie_where_the_text_has_them() -> None:
    text = "A van from the north turning left waits for an oncoming bus."
    for opener in OPENERS:
        spans = read_again(text, opener).reading.spans
        assert {span.tag for span in spans} >= {"veh", "from", "left", "yield"}
        assert all(text[span.start : span.end] == span.words for span in spans)


@pytest.mark.parametrize(
    ("previous", "change", "relation"),
    [
        ("A car from the north hits a truck from the west.", "flip it: let the truck give way to "
         "the car", ("yield_to", "vehicle-2", "vehicle-1")),
        ("A car from the west yields to a pedestrian.", "no, he should hit him",
         ("collide_at", "vehicle-1", "pedestrian-1")),
    ],
)  # fmt: skip
def test_a_change_of_those_who_are_there_keeps_where_they_come_from(
    previous: str, change: str, relation: tuple[str, str, str]
) -> None:
    found = plan(change, previous=previous)
    assert isinstance(found, SocialGraph)
    assert [(e.type, e.from_, e.to) for e in found.relations] == [relation]
    assert found.agent("vehicle-1").entry is not None


@pytest.mark.parametrize(
    "text",
    [
        "Without slowing down, a car hits a pedestrian who is not on a crosswalk.",
        "I blame the left-turner. Sunny afternoon, a southbound pickup hits a northbound car as "
        "that car's turning left.",
        "I was cycling home and someone opened their car door; I couldn't stop and rode right "
        "into it.",
    ],
)
def test_words_that_no_mark_takes_account_of_are_left_to_the_account(text: str) -> None:
    assert isinstance(plan(text), SocialGraph)


def test_a_change_in_which_nothing_is_read_is_not_planned_as_it_was() -> None:
    before = "A pedestrian waits for a bus from the west."
    found = plan("zip zap the zoop", previous=before)
    assert isinstance(found, Refusal)


def test_agents_to_whom_nothing_happens_are_not_a_scene_by_confidence() -> None:
    bare = "[veh:1 A car] from the [from:1 north] and [veh:2 a bus] from the [from:2 east]"
    assert not is_sure(learned(bare, 0.999), Site())


def test_the_order_of_agents_and_of_a_crash_does_not_matter() -> None:
    one = graph_of("[veh:1 A car] from the [from:1 north] [hit:1>2 hits] [veh:2 a bus]")
    other = graph_of("[veh:1 A bus] [hit:1>2 hits] [veh:2 a car] from the [from:2 north]")
    assert is_same_plan(one, other)
    assert not is_same_plan(one, graph_of(HITS))


@pytest.mark.parametrize(
    "text",
    ["A car from the north hits a pedestrian at 8 am", "Ein Auto hält für einen Fußgänger",
     "write me a poem", "a\u202eb", " ", "x" * 3000],
)  # fmt: skip
def test_any_text_is_planned_or_refused(text: str) -> None:
    assert isinstance(plan(text), SocialGraph | Refusal)


FIFTY = [
    f"A {who} from the {side} {does}"
    for who in ("car", "bus")
    for side in ("north", "west", "south", "east", "north at 8 am")
    for does in (
        "hits a bus", "follows a truck", "narrowly misses a pedestrian", "yields to a pedestrian",
        "rear-ends a truck",
    )
]  # fmt: skip


def test_threads_plan_the_same_bytes_as_one_thread() -> None:
    def plan_all(_: int) -> list[str]:
        return [planner._plan(text, None, Site()).model_dump_json() for text in FIFTY]

    alone = plan_all(0)
    assert len(set(alone)) == len(FIFTY) == 50
    # Threads with as many threads of BLAS each would wait for one another.
    with threadpool_limits(1), ThreadPoolExecutor(3) as threads:
        assert all(found == alone for found in threads.map(plan_all, range(3)))
