"""Lawful scenes come first; a red light that is run unasked is refused by name, or named."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from scenewright import synthesize
from scenewright.cli.agent import OrderOptions, PaperOptions
from scenewright.cli.scene_summary import format_verdict
from scenewright.dataset.batch.answering import PLAINLY
from scenewright.dataset.batch.rows import DatasetRow, Named
from scenewright.dataset.batch.worker import Job, Options, build_job, work
from scenewright.dataset.orders.agent import build_slots
from scenewright.dataset.orders.order_spec import read_order
from scenewright.dataset.orders.wording import choose_runner, draw_story
from scenewright.dataset.orders.writers import BuiltinWriter, StoryRequest
from scenewright.errors import Rejected, Unsatisfiable
from scenewright.graph import routes
from scenewright.graph.run import Scene
from scenewright.intersections import load_map
from scenewright.nodes.agent_generator import count_samples
from scenewright.nodes.context import Budgets
from scenewright.scene.rejection import Rejection
from scenewright.scene.social import AgentNode, RelationEdge, SocialGraph
from scenewright.tools.gmm_sampler import load_priors
from scenewright.tools.gmm_sampler.generate import assign_foreground
from scenewright.tools.map_grounding.grounding import ground_graph
from scenewright.tools.map_grounding.role_search import (
    find_asked_runners,
    list_unasked_runners,
    may_run_unasked,
)
from scenewright.viz.html_player import build_player
from scenewright.viz.still import draw_scene

ON = load_map("amsterdam_120")
PRIORS = load_priors("amsterdam_120")
CROSSING = "A car going straight from the north nearly hits a truck going straight from the east."
RUNNER = CROSSING.replace("nearly", "runs a red light and nearly")
EITHER = SocialGraph(
    agents=(AgentNode(id="vehicle-1", type="vehicle"), AgentNode(id="vehicle-2", type="vehicle")),
    relations=(RelationEdge(type="near_miss", from_="vehicle-1", to="vehicle-2"),),
)
NEVER = EITHER.model_copy(
    update={
        "agents": (
            AgentNode(id="vehicle-1", type="vehicle", entry="north", movement="straight"),
            AgentNode(id="vehicle-2", type="vehicle", entry="east", movement="straight"),
        )
    }
)


@cache
def unlawful() -> Scene:
    """A scene with a red light that no word asks for."""
    return synthesize(CROSSING, seed=1, refiner="none")


def test_a_scene_that_needs_a_red_light_is_refused_by_name() -> None:
    with pytest.raises(Unsatisfiable, match="vehicle-1 would have to run a red light") as refused:
        synthesize(CROSSING, seed=1, refiner="none", lawful=True)
    assert [each.code for each in refused.value.rejections] == ["unlawful"]


def test_a_red_light_that_is_asked_for_is_lawful_enough() -> None:
    scene = synthesize(RUNNER, seed=1, refiner="none", lawful=True)
    assert scene.proof.figures["red_light_runs"]
    assert scene.proof.unasked_red_lights == 0
    assert scene.provenance["lawful"] is True


def test_what_is_run_unasked_stands_beside_the_tick(tmp_path: Path) -> None:
    scene = unlawful()
    assert (scene.proof.verified, scene.proof.unasked_red_lights) == (True, 1)
    assert format_verdict(scene.proof) == "verified, 1 red light run unasked"
    assert scene.proof.unasked_red_lights == 1
    assert '"unasked_red_light_runs":' in build_player(
        scene=scene.record, proof=scene.proof, intersection=ON
    )
    figures = {k: v for k, v in scene.proof.figures.items() if k != "unasked_red_light_runs"}
    lawful = scene.proof.model_copy(update={"figures": figures})
    assert format_verdict(lawful) == "verified"
    for name, proof in (("unlawful", scene.proof), ("lawful", lawful)):
        draw_scene(tmp_path / name, scene=scene.record, proof=proof, intersection=ON)
    assert (tmp_path / "unlawful").read_bytes() != (tmp_path / "lawful").read_bytes()


def assign(graph: SocialGraph, seed: int, *, lawful: bool) -> list[str]:
    found = assign_foreground(
        graph, ground_graph(graph, intersection_map=ON), PRIORS, intersection_map=ON, hour=12.0,
        rng=np.random.default_rng(seed), lawful=lawful,
    )  # fmt: skip
    return list_unasked_runners(graph, found)


@pytest.mark.parametrize("seed", range(10))
def test_lawful_samples_have_no_runner_and_the_others_have_one(seed: int) -> None:
    assert assign(EITHER, seed, lawful=True) == []
    assert assign(EITHER, seed, lawful=False) != []
    with pytest.raises(Rejected, match="vehicle-1 would have to run a red light"):
        assign(NEVER, seed, lawful=True)


def test_only_those_of_whom_it_is_said_may_run_red() -> None:
    hit = EITHER.relations[0].model_copy(update={"cause": "red_light_run"})
    runs = tuple(each.model_copy(update={"runs_red": True}) for each in EITHER.agents[:1])
    assert find_asked_runners(EITHER) == frozenset()
    assert find_asked_runners(EITHER.model_copy(update={"relations": (hit,)})) == {
        "vehicle-1", "vehicle-2"
    }  # fmt: skip
    assert find_asked_runners(
        EITHER.model_copy(update={"agents": (*runs, EITHER.agents[1])})
    ) == {"vehicle-1"}  # fmt: skip
    follow = EITHER.relations[0].model_copy(update={"type": "follow"})
    behind = EITHER.model_copy(update={"relations": (follow,)})
    for graph, may in ((EITHER, True), (NEVER, True), (behind, False)):
        grounding = ground_graph(graph, intersection_map=ON)
        assert may_run_unasked(graph, grounding, intersection_map=ON) is may


@pytest.mark.parametrize(
    ("graph", "lawful", "samples"),
    [(EITHER, False, 6), (EITHER, True, 3), (NEVER, False, 3)],
    ids=["either", "--lawful", "no lawful one"],
)
def test_unlawful_samples_come_after_as_many_lawful_ones(
    graph: SocialGraph, samples: int, *, lawful: bool
) -> None:
    """With a budget of two more samples: three, then three more where the law may be broken."""
    grounding = ground_graph(graph, intersection_map=ON)
    context = SimpleNamespace(
        budgets=Budgets(generator=2), lawful=lawful, intersection=ON,
        backend=SimpleNamespace(deterministic=True),
    )  # fmt: skip
    refused = Rejection(stage="waypoint_filter", code="no_surviving_combination", detail="so")
    drawn, state = 0, cast(Any, {"rejections": []})
    onwards = "agent_generator"
    while onwards == "agent_generator":
        obeys = graph is EITHER and count_samples(state["rejections"], None) <= 2
        found = assign_foreground(
            graph, grounding, PRIORS, intersection_map=ON, hour=12.0,
            rng=np.random.default_rng(drawn), lawful=obeys,
        )  # fmt: skip
        drawn += 1
        state = {
            "social_graph": graph, "grounding": grounding, "refused": refused,
            "candidates": SimpleNamespace(cast=found), "rejections": [refused] * drawn,
        }  # fmt: skip
        onwards = routes.route_after_filter(state, cast(Any, SimpleNamespace(context=context)))
    assert (onwards, drawn) == ("give_up", samples)


def test_orders_and_datasets_are_lawful_unless_told_otherwise() -> None:
    assert OrderOptions().lawful
    assert PaperOptions().lawful
    assert Options("amsterdam_120").list_settings().get("lawful") is None
    assert Options("amsterdam_120", lawful=True).list_settings()["lawful"] is True


def test_a_lawful_row_that_needs_a_red_light_is_refused() -> None:
    job = Job(0, "a", "a", CROSSING, 1, Options("amsterdam_120", lawful=True))
    outcome = work(job)
    assert (outcome.status, outcome.code) == ("refused", "unlawful")
    named = Named(DatasetRow(id="a", text=CROSSING), None, 0, 1, "a")
    assert build_job(named, job.options, PLAINLY).options.lawful


def test_texts_of_a_lawful_order_name_the_red_lights_that_they_need() -> None:
    """`straight crossing` never has green together; of a right turn and a walker some do."""
    assert choose_runner("straight_crossing_near_miss", ON.name) == 0
    assert choose_runner("vehicle_yields_to_pedestrian_through", ON.name) == 1
    assert choose_runner("pedestrian_near_miss_right_turn", ON.name) is None
    assert choose_runner("rear_end_collision", ON.name) is None
    wish, writer = read_order("24 near misses"), BuiltinWriter(ON, lawful=True)
    options = Options(ON.name, lawful=True)
    worded = dict[str | None, str]()
    for slot in build_slots(wish, seed=0, places=[ON.name]):
        rng = np.random.default_rng(slot.number)
        for _ in range(12):
            story = draw_story(slot, wish, options, rng)
            written = writer.write_text(story, StoryRequest(slot.number), rng=rng)
            if written is not None:
                worded[story.leaf] = written.text
                said = " red" in written.text.lower()
                assert said == (story.runner is not None), written.text
                break
    assert set(worded) == set(wish.quotas[0].leaves)


def test_a_hidden_pedestrian_is_met_with_nobody_running_a_red_light() -> None:
    text = "A pedestrian hidden behind a parked truck is hit by a car"
    scene = synthesize(text, seed=4, refiner="none", lawful=True)
    assert scene.proof.verdict == "verified"
    assert scene.proof.unasked_red_lights == 0
    (seen,) = scene.proof.figures["first_visible"]
    event = scene.proof.events[0]
    assert 1.0 <= event.time - seen["first_visible"] <= 3.0
