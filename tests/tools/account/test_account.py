"""The account of scenes: the right text is seen, and the opposite of every claim is not."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple, get_args

import numpy as np
import pytest

from scenewright.graph.run import synthesize
from scenewright.intersections import load_map
from scenewright.scene.events import Proof
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import NEXT_TEXT, SceneRecord
from scenewright.tools.account import blank_standing_facts, list_unknown_words, prove, write_account
from scenewright.tools.account.claims import ClaimType
from scenewright.tools.account.mentions import find_mentions
from scenewright.tools.account.sense_readers import read_claims
from scenewright.tools.account.vocabulary import read_tokens

Made = tuple[SceneRecord, Proof]
"""A scene and its proof."""

YIELD = "A bus from the north turns left and yields to a pedestrian on the east crosswalk at noon"
CRASH = "A car from the west runs a red light and hits a van from the south at 30 km/h"
FOLLOW = "A taxi follows a truck going straight from the east with heavy traffic"
ROUND = "A cyclist goes round a double-parked van"
UTURN = "A car from the north makes a U-turn and yields to a bus"
TWO = "A car yields to a bus, and then a truck hits a van"
TEXTS = (YIELD, CRASH, FOLLOW, ROUND, UTURN, TWO)


@pytest.fixture(scope="module")
def place() -> IntersectionMap:
    return load_map("amsterdam_120")


@pytest.fixture(scope="module")
def made() -> Mapping[str, Made]:
    scenes = {text: synthesize(text, seed=1, refiner="none") for text in TEXTS}
    return {text: (scene.record, scene.proof) for text, scene in scenes.items()}


def account(made: Made, place: IntersectionMap, *texts: str) -> Proof:
    """The account of other texts for a scene."""
    scene, proof = made
    meta = scene.meta.model_copy(update={"user_prompt": NEXT_TEXT.join(texts)})
    return write_account(scene.model_copy(update={"meta": meta}), proof, place)


def list_states(proof: Proof) -> dict[str, str]:
    return {entry.words: entry.state for entry in proof.account}


@pytest.mark.parametrize("text", TEXTS)
def test_every_word_of_the_right_text_is_seen(
    made: Mapping[str, Made], place: IntersectionMap, text: str
) -> None:
    scene, proof = made[text]
    again = write_account(scene, proof.model_copy(update={"account": ()}), place)
    assert again.verified
    assert again.account == proof.account
    assert set(list_states(again).values()) == {"seen"}


def test_entries_name_their_claim_and_agents(
    made: Mapping[str, Made], place: IntersectionMap
) -> None:
    entries = account(made[YIELD], place, YIELD).account
    assert [(e.words, e.claim, e.agents) for e in entries] == [
        ("bus", "class bus", (1,)),
        ("north", "side north", (1,)),
        ("turns", "movement left/right/uturn", (1,)),
        ("left", "movement left", (1,)),
        ("yields to", "event yielding", (1, 2)),
        ("pedestrian", "class pedestrian", (2,)),
        ("east", "side east", (2,)),
        ("crosswalk", "crosswalk a crosswalk", ()),
        ("noon", "time noon", ()),
    ]
    assert all(YIELD[e.start : e.end] == e.words for e in entries)


def test_one_in_the_morning_is_night_and_not_morning(
    made: Mapping[str, Made], place: IntersectionMap
) -> None:
    scene, proof = made[YIELD]
    meta = scene.meta.model_copy(update={"time_of_day": "01:00"})
    text = "A bus yields to a pedestrian at 1 o'clock in the morning"
    found = account((scene.model_copy(update={"meta": meta}), proof), place, text).account
    assert {each.state for each in found} == {"seen"}


@pytest.mark.parametrize(
    ("scene", "text"),
    [
        (FOLLOW, "A truck drives ahead of a taxi"),
        (CRASH, "A car that couldn't stop hits a van"),
        (YIELD, "A bus that isn't in a hurry waits for a pedestrian"),
        (CRASH, "Car from the west, van from the south, crossing, collision"),
        (CRASH, "A car and a van collide, the two of them"),
    ],
)
def test_words_in_other_forms_are_seen(
    made: Mapping[str, Made], place: IntersectionMap, scene: str, text: str
) -> None:
    found = account(made[scene], place, text).account
    assert {each.words: each.state for each in found if each.state not in ("seen", "manner")} == {}


def test_ways_that_cross_are_seen(made: Mapping[str, Made], place: IntersectionMap) -> None:
    words = "ways cross each other's path"
    for scene, text, state in (
        (CRASH, f"A car hits a van whose {words}", "seen"),
        (FOLLOW, f"A taxi follows a truck whose {words}", "contradicted"),
    ):
        found = account(made[scene], place, text).account
        assert {each.state for each in found if "cross" in each.words} == {state}


Forge = Callable[[Made], Made]
"""Makes a claim true, or false, in the record or in what the checker found."""


def forge_agent(number: int, **fields: object) -> Forge:
    def forge(made: Made) -> Made:
        scene, proof = made
        agents = tuple(a.model_copy(update=fields) if a.id == number else a for a in scene.agents)
        return scene.model_copy(update={"agents": agents}), proof

    return forge


def forge_relation(**fields: object) -> Forge:
    def forge(made: Made) -> Made:
        scene, proof = made
        relations = tuple(r.model_copy(update=fields) for r in scene.relations)
        return scene.model_copy(update={"relations": relations}), proof

    return forge


def forge_kind(kind: str) -> Forge:
    def forge(made: Made) -> Made:
        scene, proof = made
        events = tuple(e.model_copy(update={"kind": kind}) for e in proof.events)
        return scene, proof.model_copy(update={"events": events})

    return forge


def forge_group(made: Made) -> Made:
    scene, proof = made
    (first,) = (a for a in scene.agents if a.id == 2)
    pair = (
        first.model_copy(update={"group": 2}),
        first.model_copy(update={"id": 90, "name": "pedestrian-2", "group": 2}),
    )
    others = tuple(a for a in scene.agents if a.id != 2)
    return scene.model_copy(update={"agents": (*others, *pair)}), proof


def forge_no_lights(made: Made) -> Made:
    return made[0].model_copy(update={"signals": ()}), made[1]


def forge_unverified(made: Made) -> Made:
    return made[0], made[1].model_copy(update={"verified": False})


class Mutation(NamedTuple):
    """A text that says the opposite of what a scene shows.

    Attributes:
        words: those that are false; state: theirs.
        forge: what makes the scene the opposite, where words alone cannot.
    """

    type: ClaimType
    scene: str
    text: str
    words: str
    state: str = "contradicted"
    forge: Forge = lambda made: made


MUTATIONS = (
    Mutation("class", YIELD, YIELD.replace("bus", "truck"), "truck"),
    Mutation("count", TWO, "A car yields to a bus, and then two trucks hit a van", "two"),
    Mutation("object", ROUND, "A cyclist goes round a broken down van", "broken"),
    Mutation("background", FOLLOW, f"{FOLLOW} with no other vehicles", "vehicles"),
    Mutation("background", FOLLOW, "A taxi follows a truck with three other cars", "three"),
    Mutation("event", YIELD, YIELD.replace("yields to", "hits"), "hits"),
    Mutation("event", FOLLOW, "A truck follows a taxi going straight", "follows"),  # roles
    Mutation("time", YIELD, YIELD.replace("noon", "midnight"), "midnight"),
    Mutation("number", CRASH, CRASH.replace("30", "60"), "60 km/h"),
    Mutation("side", YIELD, YIELD.replace("north", "south"), "south"),
    Mutation("side", YIELD, YIELD.replace("east", "west"), "west"),
    Mutation("heading", FOLLOW, "An eastbound taxi follows a truck", "eastbound"),
    Mutation("movement", YIELD, YIELD.replace("left", "right"), "right"),
    Mutation("crossing", UTURN, "A car traverses and yields to a bus", "traverses"),
    Mutation("crosswalk", CRASH, "A car hits a van on the far crosswalk", "far crosswalk"),
    Mutation("tie", FOLLOW, "A taxi follows an oncoming truck", "oncoming"),
    Mutation("tie", FOLLOW, "A taxi follows a truck and their paths cross", "paths cross"),
    Mutation("red_light", FOLLOW, "A taxi runs a red light and follows a truck", "red light"),
    Mutation("red_light", CRASH, "A car does not run a red light and hits a van", "red light"),
    Mutation("light", TWO, "A car yields to a bus at the red light", "red light",
             forge=forge_no_lights),
    Mutation("stop", FOLLOW, "A taxi follows a truck and stops", "stops"),
    Mutation("stop", YIELD, "A bus does not stop and yields to a pedestrian", "not stop"),
    Mutation("pace", CRASH, "A speeding car hits a van", "speeding"),
    Mutation("braking", UTURN, "A car yields to a bus that brakes", "brakes"),
    Mutation("cause", YIELD, "A bus brakes too late and yields to a pedestrian", "late"),
    Mutation("absence", TWO, "A car yields to a bus and nothing else happens", "nothing",
             forge=forge_unverified),
    Mutation("density", FOLLOW, FOLLOW.replace("heavy", "light"), "light traffic"),
    Mutation("order", YIELD, "A bus yields to a pedestrian and the bus passes before it", "before"),
    Mutation("sequence", TWO, "A truck hits a van, and then a car yields to a bus", "and then"),
    Mutation("sequence", TWO, "A truck hits a van before a car yields to a bus", "before"),
    Mutation("moves", ROUND, "A double parked van departs", "departs"),
    # what nothing tests where no agent has it
    Mutation("motion", YIELD, "A bus yields to a pedestrian who stops halfway", "stops halfway",
             "not_shown"),
    Mutation("reaction", CRASH, "A distracted car hits a van", "distracted", "not_shown"),
    Mutation("manoeuvre", FOLLOW, "A taxi cuts in and follows a truck", "cuts", "not_shown"),
    Mutation("encounter", YIELD, "A bus overtakes and yields to a pedestrian", "overtakes",
             "not_shown"),
    Mutation("sight", YIELD, "A bus yields to a hidden pedestrian", "hidden", "not_shown"),
    Mutation("group", YIELD, "A bus yields to a pedestrian arm in arm", "arm", "not_shown"),
    Mutation("count", YIELD, "A bus yields to a group of five pedestrians", "five",
             forge=forge_group),
    Mutation("point", CRASH, "A car hits a van on the bumper", "bumper", "not_shown"),
    Mutation("kind", CRASH, "A car rear-ends a van", "rear-ends"),
    Mutation("kind", CRASH, "A car sideswipes a van", "sideswipes"),
    Mutation("phrase", YIELD, "A bus overruns the queue into a pedestrian", "overruns"),
)  # fmt: skip


def test_every_type_of_claim_has_a_mutation() -> None:
    types = set(get_args(ClaimType))
    assert {mutation.type for mutation in MUTATIONS} == types
    table = (Path(__file__).parents[3] / "docs" / "checker.md").read_text("utf-8")
    section = table.partition("## The account of words")[2].partition("\n## ")[0]
    assert set(re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE)) == types


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda m: f"{m.type}: {m.words}")
def test_the_opposite_of_what_a_scene_shows_is_not_seen(
    made: Mapping[str, Made], place: IntersectionMap, mutation: Mutation
) -> None:
    proof = account(mutation.forge(made[mutation.scene]), place, mutation.text)
    false = [e for e in proof.account if e.words == mutation.words]
    assert {e.state for e in false} == {mutation.state}
    if mutation.state == "contradicted":
        assert {(e.claim or "").split(" ")[0] for e in false} == {mutation.type}
        assert not proof.verified
        assert "word_contradicted" in {finding.rule for finding in proof.missing}


@pytest.mark.parametrize("clock", ["abc", "", "8 am", "0800"])
def test_a_scene_whose_clock_is_no_time_is_a_finding(
    made: Mapping[str, Made], place: IntersectionMap, clock: str
) -> None:
    scene, _ = made[YIELD]
    text = f"{YIELD}, by daylight, from 11 to 1 pm, at 12"
    meta = scene.meta.model_copy(update={"user_prompt": text, "time_of_day": clock})
    proof = prove(scene.model_copy(update={"meta": meta}), place)
    assert "metadata_contradicted" in {each.rule for each in proof.missing}
    assert list_states(proof)["noon"] != "seen"


@pytest.mark.parametrize(
    ("kind", "text", "words", "forge"),
    [
        ("motion", "A bus yields to a pedestrian who stops halfway", "stops halfway",
         forge_agent(2, motion="stops_midway")),
        ("reaction", "A distracted bus yields to a pedestrian", "distracted",
         forge_agent(1, reaction="none")),
        ("manoeuvre", "A bus cuts in and yields to a pedestrian", "cuts in",
         forge_relation(manoeuvre="cuts_in")),
        ("group", "A bus yields to a pedestrian arm in arm", "arm in arm", forge_group),
        ("point", "A bus yields to a pedestrian on the bumper", "bumper", forge_kind("rear_end")),
    ],
)  # fmt: skip
def test_what_is_not_shown_is_seen_where_an_agent_has_it(
    made: Mapping[str, Made],
    place: IntersectionMap,
    kind: str,
    text: str,
    words: str,
    forge: Forge,
) -> None:
    proof = account(forge(made[YIELD]), place, text)
    (entry,) = (e for e in proof.account if words in e.words)
    assert (entry.state, (entry.claim or "").split(" ")[0]) == ("seen", kind)


@pytest.mark.parametrize(
    ("scene", "text"),
    [
        (CRASH, "A car collides head on with a van"),
        (YIELD, "A bus passes before the pedestrian"),
        (FOLLOW, "A taxi follows a truck and goes first"),
        (YIELD, "A bus yields to a running pedestrian"),
        (FOLLOW, "A taxi tailgates a truck"),
        (UTURN, "A car crosses and yields to a bus"),
        (CRASH, "A car hits a van and then runs a red light"),
        (YIELD, "A bus stops three times and yields to a pedestrian"),
        (YIELD, "A bus yields to a pedestrian and stands for 29 s"),
        (YIELD, "A bus from the north turns over the south crosswalk and yields to a pedestrian"),
        (CRASH, "From the north a car runs a red light, from the south a van is hit by it"),
        (CRASH, "A car hits another"),
    ],
)  # fmt: skip
def test_what_is_true_of_a_part_does_not_hide_what_is_false(
    made: Mapping[str, Made], place: IntersectionMap, scene: str, text: str
) -> None:
    assert account(made[scene], place, text).verdict != "verified"


@pytest.mark.parametrize(
    ("scene", "text"),
    [
        (YIELD, "A bus turning to the left side yields to an 83 year old woman"),
        (YIELD, "A bus from the north turns over the east crosswalk and yields to a pedestrian"),
        (YIELD, "A pedestrian is let go by a bus on the east crosswalk"),
        (CRASH, "UTYP 321, issue #311: from the west a car runs a red light, from the south a van"
         " is hit by it"),
        (CRASH, "A car pulls out in front of a van; ours comes from the west, theirs from the"
         " south"),
        (CRASH, "A car hits a van without looking"),
        (CRASH, "A van, driver (54), is hit by a car, claim 77-20941"),
    ],
)  # fmt: skip
def test_other_words_for_what_is_shown_are_no_contradiction(
    made: Mapping[str, Made], place: IntersectionMap, scene: str, text: str
) -> None:
    proof = account(made[scene], place, text)
    assert not [each for each in proof.account if each.state in ("contradicted", "not_shown")]


def test_figures_and_standstills_are_measured_though_no_plan_asks_for_them(
    made: Mapping[str, Made], place: IntersectionMap
) -> None:
    xy = np.column_stack([np.arange(0.0, 300.0), np.zeros(300)])
    xy[50:80, 0] = 50.0  # stands for 3 s
    xy[80:, 0] -= 29.0
    tracks = {"trajectory": tuple(map(tuple, xy.tolist())), "heading": (0.0,) * 300}
    moved = forge_agent(1, **tracks)(made[YIELD])
    for text, state in (
        ("A bus at 36 km/h", "seen"),
        ("A bus at 10 m/s stands for 3 s", "seen"),
        ("A bus at 40 km/h", "not_shown"),
        ("A bus stops once", "seen"),
        ("A bus stops twice", "contradicted"),
    ):
        entries = account(moved, place, text).account
        assert entries[-1].state == state, text


@pytest.mark.parametrize(
    ("said", "asked", "holds"),
    [
        ("a TTC under 1 s", (0.0, 1.0), True),
        ("a TTC under 1 s", (1.0, 8.0), False),
        ("a minimum TTC of no more than 1 s", (1.0, 8.0), False),
        ("a TTC of at least 1 s", (1.0, 8.0), True),
        ("a TTC of at least 1 s", (0.0, 1.0), False),
        ("a TTC of no less than 1 s", (0.0, 1.0), False),
        ("a TTC between 0.5 and 1 s", (0.5, 1.0), True),
    ],
)
def test_a_bound_is_not_seen_where_the_other_side_was_asked_for(
    said: str, asked: tuple[float, float], holds: bool
) -> None:
    tokens = read_tokens(f"A car has {said}")
    (claim, *_) = [c for c in read_claims(tokens, find_mentions(tokens)) if c.value == "1 s"]
    figures = [("s", *asked, frozenset({1}))]
    facts: Any = SimpleNamespace(
        foreground=(1,), list_figures=lambda **_: figures, list_standstills=lambda _: []
    )
    assert claim.test(facts, {0: frozenset({1})}).holds is holds


@pytest.mark.parametrize(
    ("addition", "words", "state"),
    [
        (" in the rain", "rain", "not_shown"),
        (" without any rain", "rain", "stands_anyway"),
        (" at the junction", "junction", "stands_anyway"),
        (" carefully", "carefully", "manner"),
        (" at a zyzzyva", "zyzzyva", "not_shown"),
        (", missing by half a metre", "half", "not_shown"),
        (", all except one", "all except", "not_shown"),
    ],
)
def test_what_tracks_cannot_say_is_named(
    made: Mapping[str, Made], place: IntersectionMap, addition: str, words: str, state: str
) -> None:
    proof = account(made[FOLLOW], place, FOLLOW + addition)
    assert list_states(proof)[words] == state


def test_words_that_a_later_text_replaces_are_no_claims(
    made: Mapping[str, Made], place: IntersectionMap
) -> None:
    first, change = "A taxi follows a van", "replace the van with a truck"
    assert not account(made[FOLLOW], place, first).verified
    proof = account(made[FOLLOW], place, first, change)
    states = {(e.turn, e.words): e.state for e in proof.account}
    assert proof.verified
    assert (0, "van") not in states
    assert states[1, "van"] == "stands_anyway"
    assert states[1, "truck"] == "seen"


def test_words_that_no_later_text_replaces_stay_claims(
    made: Mapping[str, Made], place: IntersectionMap
) -> None:
    proof = account(made[YIELD], place, YIELD.replace("north", "south"), "make it noon")
    assert {(e.turn, e.words) for e in proof.account if e.state == "contradicted"} == {(0, "south")}


def test_words_that_no_scene_can_show_are_listed_before_there_is_one(
    place: IntersectionMap,
) -> None:
    found = list_unknown_words("A car hits a dog in the snow near a zyzzyva", place)
    assert [(e.words, e.evidence) for e in found] == [
        ("dog", "animals are not shown"),
        ("snow", "weather is not shown"),
        ("zyzzyva", "no claim covers it"),
    ]
    assert list_unknown_words("A car turns left, without any snow", place) == ()
    assert [e.words for e in list_unknown_words("All cars except one turn", place)] == ["except"]


@pytest.mark.parametrize(
    ("text", "left"),
    [
        ("In daylight, a car turns", "a car turns"),
        ("At a signalised intersection, a car turns", "a car turns"),
        ("A car turns. The speed limit is 30 mph.", "A car turns."),
        ("A car turns", "A car turns"),
        ("dry road", "dry road"),  # a text is never blanked as a whole
    ],
)
def test_standing_facts_are_blanked_in_place(text: str, left: str) -> None:
    blanked = blank_standing_facts(text)
    assert len(blanked) == len(text)
    assert blanked.strip(" .") == left.strip(" .")


def test_the_account_is_the_same_whatever_the_order_of_sets(
    made: Mapping[str, Made], place: IntersectionMap
) -> None:
    """A word with two claims that hold shows the first of its senses in their own order."""
    proof = account(made[YIELD], place, "A bus yields to a pedestrian crossing")
    assert [e.claim for e in proof.account if e.words == "crossing"] == ["crossing crosses"]


@pytest.mark.parametrize("bus", ["a bus", "a bus at its stop"])
def test_who_hides_somebody_need_not_be_called_parked(bus: str) -> None:
    text = f"A child runs out from behind {bus} and a car almost hits the child"
    assert set(list_states(synthesize(text, seed=3, refiner="none").proof).values()) == {"seen"}


@pytest.mark.parametrize(
    ("words", "state"),
    [
        ("from Amsterdam Ave", "seen"),
        ("from W 120th Street", "contradicted"),
        ("into Amsterdam Avenue", "contradicted"),
        ("near the corner of Amsterdam Avenue and West 120th Street", "seen"),
    ],
)
def test_a_street_is_a_claim_where_one_comes_from_it_or_goes_there(
    made: Mapping[str, Made], place: IntersectionMap, words: str, state: str
) -> None:
    """The bus of the scene turns left from the north, which is Amsterdam Avenue, to the east."""
    states = list_states(account(made[YIELD], place, f"A bus {words} yields to a pedestrian"))
    assert {said for name, said in states.items() if "A" in name[1:] or "W" in name} == {state}


def test_a_light_is_red_for_whom_the_text_says(
    made: Mapping[str, Made], place: IntersectionMap
) -> None:
    text = (
        "A bus yields to a girl who crosses while it is red for her, and she stops at the red light"
    )
    states = list_states(account(made[YIELD], place, text))
    assert [state for said, state in states.items() if "red" in said] == ["not_shown"] * 2, states


def test_she_is_no_bus(made: Mapping[str, Made], place: IntersectionMap) -> None:
    text = "A bus yields to a girl on the crosswalk and she turns left"
    assert list_states(account(made[YIELD], place, text))["left"] == "not_shown"
    driver = list_states(account(made[YIELD], place, text.replace("bus", "bus driver")))
    assert driver["left"] == "seen"


@pytest.mark.parametrize(
    ("said", "clock"),
    [("half past five pm", "17:30"), ("ten past five pm", "17:10"), ("quarter to 5 pm", "16:45"),
     ("twenty to six in the evening", "17:40"), ("twenty past 11 pm", "23:20")],
)  # fmt: skip
def test_minutes_to_or_past_an_hour_are_one_time(said: str, clock: str) -> None:
    text = f"A car yields to a pedestrian at {said}"
    scene = synthesize(text, seed=1, refiner="none")
    assert scene.record.meta.time_of_day == clock
    states = {each.words: each.state for each in scene.proof.account}
    assert "not_shown" not in states.values()
    assert any(each.claim and each.claim.startswith("time") for each in scene.proof.account)
