"""Streets named in a text: their legs are taken, however the names are written."""

import pytest

from scenewright.backends.builtin.draft import Site
from scenewright.backends.builtin.planner import plan
from scenewright.backends.builtin.references import read_choice
from scenewright.backends.builtin.revising import read
from scenewright.cli.scene_summary import list_choices
from scenewright.scene.edits import AgentView, Situation
from scenewright.scene.social import Refusal
from scenewright.scene.streets import expand_name

ROADS = (
    ("north", "Borough High Street"),
    ("east", "Great Dover Street"),
    ("south", "Borough High Street"),
    ("west", "Marshalsea Road"),
)
SITE = Site(roads=ROADS)
TAIPEI = Site(
    roads=(("north", "中山北路二段"), ("south", "中山北路一段"), ("east", "南京東路一段"))
)


@pytest.mark.parametrize(
    "name",
    ["Marshalsea Road", "marshalsea rd", "Marshalsea Rd.", "the Marshalsea", "Marshallsea Road"],
)
def test_a_street_is_known_by_its_variants(name):
    graph = plan(f"A car from {name} yields to a pedestrian", site=SITE)
    assert graph.agents[0].entry == "west"


def test_the_account_quotes_the_text_itself():
    text = "A car from Marshalsea Rd turning left hits a car from Great Dover St"
    graph = plan(text, site=SITE)
    assert [agent.entry for agent in graph.agents] == ["west", "east"]
    entries = [each for each in graph.said if each.became == "entry"]
    assert [each.words for each in entries] == ["from Marshalsea Rd", "from Great Dover St"]
    assert all(text[each.start : each.end] == each.words for each in graph.said)


def test_of_a_street_with_two_legs_that_is_taken_which_the_map_can_serve():
    text = "A car from Borough High Street hits a car from Marshalsea Road"
    for leg in ("north", "south"):
        site = Site(roads=ROADS, can_serve=lambda graph, leg=leg: graph.agents[0].entry == leg)
        assert plan(text, site=site).agents[0].entry == leg


@pytest.mark.parametrize("words", ["from Borough High St", "coming up Borough High Street"])
def test_which_leg_of_a_street_with_two_is_drawn_and_said(words):
    text = f"A car {words} hits a pedestrian"
    graphs = [plan(text, site=SITE, seed=seed) for seed in range(4)]
    assert [graph.agents[0].entry for graph in graphs] == ["north", "south"] * 2
    (entry,) = (each for each in graphs[1].said if each.became == "entry")
    assert entry.note.endswith("has the legs north and south; the words leave open which")
    assert list_choices(graphs[1].said)[-1].startswith("chosen: the south leg (Borough High St")


def test_two_on_one_street_who_cannot_meet_on_one_leg_come_from_both():
    site = Site(roads=ROADS, can_serve=lambda graph: len({a.entry for a in graph.agents}) == 2)
    graph = plan("Two cars on Borough High Street collide head-on", site=site)
    assert [agent.entry for agent in graph.agents] == ["north", "south"]


def test_no_leg_is_drawn_where_the_words_say_which():
    graph = plan("A car from Marshalsea Road hits a car from southern Borough High St", site=SITE)
    assert [each.note for each in graph.said if each.became == "entry"] == [None, None]


def test_a_change_asks_which_leg_of_a_street_with_two():
    car = AgentView(
        id="vehicle-1", number=1, type="vehicle", subtype="car", entry="east", exit="west",
        movement="straight", role="foreground", speed=10.0,
    )  # fmt: skip
    situation = Situation(graph=plan("A car from the east"), present=(car,))
    words = "make the car come from Borough High Street"
    asked = read(words, situation, site=SITE)
    assert asked.question == "Which leg of Borough High Street: north or south?"
    choice = read_choice("the south leg", asked)
    chosen = {choice.means.partition("=")[0]: choice.answer}
    (edit,) = read(words, situation, chosen=chosen, site=SITE).edits
    assert edit.node.entry == "south"


def test_a_compass_word_beside_the_name_chooses_the_leg_or_is_refused():
    graph = plan("A car from southern Borough High Street hits a pedestrian", site=SITE)
    assert graph.agents[0].entry == "south"
    refused = plan("A car from northern Marshalsea Road hits a pedestrian", site=SITE)
    assert isinstance(refused, Refusal)
    assert "is the west leg" in refused.reason


def test_a_street_on_no_leg_is_refused_with_those_that_are_there():
    refused = plan("A car from Elm Street yields to a pedestrian", site=SITE)
    assert isinstance(refused, Refusal)
    assert "'Elm Street'" in refused.reason
    assert all(road in refused.reason for _, road in ROADS)


def test_who_walks_over_a_street_is_on_its_crosswalk():
    graph = plan("A car on Marshalsea Road yields to a man crossing Great Dover Street", site=SITE)
    assert (graph.agents[0].entry, graph.agents[1].crosswalk) == ("west", "east")


def test_names_in_other_scripts_are_distinguished_by_their_sections():
    graph = plan(
        "A car from 中山北路二段 nearly hits a car from 中山北路一段 turning left", site=TAIPEI
    )
    assert [agent.entry for agent in graph.agents] == ["north", "south"]


def test_ordinals_and_points_of_the_compass_are_spelt_alike():
    assert expand_name("Fifth Ave NE") == expand_name("5th Avenue Northeast")
    assert expand_name("St. James's Rd") == expand_name("Saint James Road")
