"""What stands in a text, from its marks to the plan."""

from __future__ import annotations

import pytest

from lab.planner.plain_sentences import build_reading
from scenewright.backends.builtin.draft import Site
from scenewright.backends.builtin.reader.annotation import parse_annotation
from scenewright.backends.builtin.reader.learned_plan import plan_reading
from scenewright.scene.phrasing import describe_graph
from scenewright.scene.social import Plan, Refusal, SocialGraph


def plan_marks(line: str) -> Plan:
    """The plan of an annotated instruction, as if the encoder had read it without doubt."""
    annotated = parse_annotation(line)
    return plan_reading(build_reading(annotated), Site(), annotated.text).plan


def make_graph(line: str) -> SocialGraph:
    made = plan_marks(line)
    assert isinstance(made, SocialGraph)
    return made


def test_object_hides_the_pedestrian_from_the_driver_who_hits_her() -> None:
    graph = make_graph(
        "[ped:1 A woman], [sight:1>2 hidden by] [obj=parked:2 a van] [from:2 on the south leg] "
        "[seen:1 until 1.5 s before], is [hit:3>1 hit by] [veh:3 a taxi]."
    )
    (van,) = graph.objects
    assert (van.kind, van.subtype, van.leg, van.side) == ("parked", "van", "south", None)
    assert (van.hides, van.hidden_from, van.lead) == ("pedestrian-1", "vehicle-1", (1.35, 1.65))
    became = {each.words: each.became for each in graph.said}
    assert became["a van"] == became["on the south leg"] == "object"
    assert became["hidden by"] == became["until 1.5 s before"] == "sight"


def test_pedestrian_between_two_parked_vehicles_crosses_off_the_crosswalk() -> None:
    graph = make_graph(
        "[ped:1 A boy] comes [sight:1>2,3 from between] [obj=parked:2,3 two parked cars] and "
        "[veh:4 a bus] [near:4>1 nearly hits] [ref:1 him]."
    )
    first, second = graph.objects
    assert (first.hides, second.hides, second.beyond) == ("pedestrian-1", None, first.id)
    assert graph.agents[0].movement == "jaywalking"


@pytest.mark.parametrize(
    ("line", "encounter", "kind", "figure"),
    [
        (
            "[veh:1 A car] [meet=around:1>2 goes round] [obj=stalled:2 a dead truck].",
            "goes_round", "stalled", None,
        ),
        (
            "[veh:1 A car] [hit=rear:1>2 runs into] [obj=double:2 a van] [impact:1 at 20 km/h].",
            "hits", "double_parked", (5.056, 6.056),
        ),
        (
            "[veh:1 A car] [meet=wait:1>2 waits behind] [obj=stalled:2 a bus] for "
            "[wait:1 4 s], then [meet=around:1>2 passes it].",
            "waits_then_passes", "stalled", (3.85, 4.15),
        ),
        (
            "[cyc:1 A cyclist] is [door:1>2 doored by] [obj=parked:2 a parked taxi].",
            "doored", "parked", None,
        ),
    ],
)  # fmt: skip
def test_agent_meets_what_stands_in_its_way(
    line: str, encounter: str, kind: str, figure: tuple[float, float] | None
) -> None:
    (thing,) = make_graph(line).objects
    assert (thing.encounter, thing.kind) == (encounter, kind)
    assert thing.met_by in ("vehicle-1", "cyclist-1")
    assert thing.figure == pytest.approx(figure, abs=1e-3)


def test_hidden_rider_comes_over_the_crosswalk_and_hidden_vehicles_are_refused() -> None:
    line = "[cyc:1 A {}] [sight:1>2 behind] [obj=thing:2 a kiosk] is [hit:3>1 hit by] [veh:3 a car]"
    graph = make_graph(line.format("cyclist"))
    assert graph.objects[0].hides == "cyclist-1"
    assert graph.agents[0].movement == "crossing"
    made = plan_marks(line.replace("cyc:1", "veh:1").format("van"))
    assert isinstance(made, Refusal)
    assert "only a pedestrian or rider" in made.reason


def test_cut_in_tailgating_and_push_are_manoeuvres_of_the_two() -> None:
    (cut_in,) = make_graph("[veh:1 A van] [lane=cutin:1>2 cuts in on] [veh:2 a bus].").relations
    assert (cut_in.type, cut_in.from_, cut_in.manoeuvre) == ("near_miss", "vehicle-1", "cuts_in")
    (close,) = make_graph(
        "[veh:1 A car] [lane=tailgate:1>2 hangs on the bumper of] [veh:2 a truck]."
    ).relations
    assert (close.type, close.manoeuvre) == ("follow", "tailgates")
    hits = make_graph(
        "[veh:1 A truck] [hit=rear:1>2 shunts] [veh:2 a car] "
        "[push:2>3 that slides into] [veh:3 a taxi]."
    ).relations
    assert [(e.from_, e.to, e.kind) for e in hits] == [
        ("vehicle-1", "vehicle-2", "rear_end"),
        ("vehicle-2", "vehicle-3", "rear_end"),
    ]


def test_motion_that_the_class_cannot_show_becomes_nothing() -> None:
    graph = make_graph(
        "[veh:1 A car] [motion=back:1 turns back] and [yield:1>2 lets] [ped:2 a man] go."
    )
    assert [each.words for each in graph.said if each.became == "nothing"] == ["turns back"]


@pytest.mark.parametrize(
    ("words", "kind"),
    [
        ("Skip", "container"),
        ("a box truck", "stalled"),
        ("the kiosk", "box"),
        ("A lorry", "stalled"),
    ],
)
def test_words_for_things_are_no_vehicles(words: str, kind: str) -> None:
    graph = make_graph(
        f"[obj=stalled:1 {words}] [from:1 on the north leg], [ped:2 a kid] [sight:2>1 behind it], "
        "[veh:3 a taxi] [near:3>2 nearly hits] [ref:2 him]"
    )
    assert graph.objects[0].kind == kind


@pytest.mark.parametrize(
    ("mark", "asked", "words"),
    [
        ("[react=back:1 steps back]", "steps_back", "steps back"),
        ("[react=run:1 runs out of the way]", "runs", "runs out of the way"),
        ("[react=none:1 does not react]", "none", "does not react"),
    ],
)
def test_sentences_name_the_reaction_that_is_asked_for(mark: str, asked: str, words: str) -> None:
    graph = make_graph(f"[veh:2 A car] [near:2>1 nearly hits] [ped:1 a man] who {mark}.")
    assert graph.agents[1].reaction == asked
    assert f"pedestrian {words}" in describe_graph(graph)


def test_pedestrian_named_with_the_corner_takes_part() -> None:
    graph = make_graph("[ped:1 A man at the corner] and [ped:2 a woman] [hit:1>2 collide].")
    assert len(graph.agents) == 2


@pytest.mark.parametrize(
    "line",
    [
        "[veh:1 A car] [motion=box:1 blocks the box].",
        "[veh:2 A car] [yield:2>1 stops for] [ped:1 a man] who [motion=back:1 turns back] halfway.",
    ],
)
def test_words_of_a_motion_are_not_said_to_be_without_effect(line: str) -> None:
    became = [each.became for each in make_graph(line).said]
    assert became.count("motion") == 1
    assert "manner" not in became
