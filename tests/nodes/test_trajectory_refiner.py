"""The refiner's stage: what it refines, what it leaves alone, and what it does when refused."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from refiner_networks import convert_network
from scenewright import synthesize
from scenewright.backends import load_backend
from scenewright.geometry.map_areas import MapAreas
from scenewright.intersections import load_map
from scenewright.nodes.context import RunContext
from scenewright.nodes.trajectory_refiner import NO_WALKERS, NO_WEIGHTS, SHARES, refine_trajectories
from scenewright.scene.rejection import Rejection
from scenewright.tools.gmm_sampler import load_priors
from scenewright.tools.trajnet_refiner.bundled import BundledRefiner
from scenewright.tools.trajnet_refiner.config import RefinerConfig
from scenewright.tools.trajnet_refiner.model import Refiner

GROUND = MapAreas(load_map("amsterdam_120"))
PRIORS = load_priors("amsterdam_120")
TEXT = "A car from the north turning left yields to an oncoming car, six background cars, at noon."
GIVER, TAKER = "vehicle-1", "vehicle-2"


@pytest.fixture(scope="module")
def run() -> dict[str, Any]:
    """Every product of one run, as it comes to the refiner."""
    return dict(synthesize(TEXT, seed=5, refiner="none").state)


@pytest.fixture(scope="module")
def learned() -> BundledRefiner:
    """A network with a will of its own."""
    torch.manual_seed(0)
    config = RefinerConfig(
        hidden=16, embedding=8, pooled=8, neighbours=4, apart=None, mirrored=False
    )
    net = Refiner(config)
    torch.nn.init.normal_(net.output.weight, std=0.1)
    return BundledRefiner(convert_network(net), "0123456789abcdef")


def runtime(learned: BundledRefiner | None) -> Any:
    context = RunContext(
        backend=load_backend("builtin"), ground=GROUND, priors=PRIORS, seed=3, refiner="trajnet",
        learned=learned,
    )  # fmt: skip
    return SimpleNamespace(context=context)


def refused(*names: str) -> Rejection:
    return Rejection(
        stage="scene_verifier", code="background_interferes", agents=names, detail="too close"
    )


def again(state: dict[str, Any], learned: BundledRefiner, *names: str) -> dict[str, Any]:
    """The same after the verifier has named somebody."""
    given = refused(*names)
    # Another figure each time, as after another refinement.
    detail = f"{given.detail} ({len(state['rejections'])})"
    state = state | {"refused": given.model_copy(update={"detail": detail})}
    state["rejections"] = [*state["rejections"], state["refused"]]
    return state | refine_trajectories(state, runtime=runtime(learned))


def first(run: dict[str, Any], learned: BundledRefiner) -> dict[str, Any]:
    state = {k: v for k, v in run.items() if k not in ("refinement", "rolled")}
    return state | refine_trajectories(state, runtime=runtime(learned))


def moved(state: dict[str, Any], name: str) -> float:
    """How far an agent's refined track is off its edited one at most [m]."""
    edited, refined = state["edited"][name].xy, state["refined"][name].xy
    n = min(len(edited), len(refined))
    return float(np.hypot(*(edited[:n] - refined[:n]).T).max())


def test_all_agents_move_a_little_otherwise_and_who_stands_keeps_standing(run, learned):
    state = first(run, learned)
    assert state["refinement"].refiner == "trajnet"
    assert state["refinement"].weights == "0123456789abcdef"
    assert all(np.isfinite(track.xy).all() for track in state["refined"].values())
    assert sum(moved(state, name) > 0.05 for name in state["refined"]) >= 4
    stop = next(s for s in run["behavior"].segments[GIVER] if s.status == "stop")
    edited, refined = state["edited"][GIVER], state["refined"][GIVER]
    waiting = (edited.times > stop.start + 0.5) & (edited.times < stop.end - 0.5)
    assert np.array_equal(edited.xy[waiting], refined.xy[waiting])


def test_weights_that_know_no_real_walkers_move_none(learned):
    state = dict(synthesize("Ordinary traffic at noon.", seed=4, refiner="none").state)
    done = first(state, replace(learned, walks=False))
    kinds = {n: a.candidate.shape.type for n, a in state["selection"].agents.items()}
    walkers = [name for name in done["refined"] if kinds[name] == "pedestrian"]
    assert walkers
    assert all(moved(done, name) == 0.0 for name in walkers)
    assert {done["refinement"].agents[name].reason for name in walkers} == {NO_WALKERS}
    assert any(moved(done, name) > 0.05 for name in done["refined"] if name not in walkers)


def test_refined_positions_lie_on_the_agents_own_path(run, learned):
    state = first(run, learned)
    for name, agent in run["selection"].agents.items():
        path = agent.candidate.path.xy
        track = state["refined"][name]
        off = np.hypot(*(track.xy[:, None] - path[None]).transpose(2, 0, 1)).min(axis=1)
        assert off.max() <= 0.3


def test_who_is_named_is_supervised_more_strongly_and_no_other_agent(run, learned):
    state = first(run, learned)
    later = again(state, learned, GIVER)
    assert moved(later, GIVER) < moved(state, GIVER)
    for name in state["refined"]:
        if name != GIVER:
            assert np.array_equal(later["refined"][name].xy, state["refined"][name].xy)
    assert later["refinement"].agents[GIVER].refusals == 1
    assert (later["refinement"].attempt, later["refinement"].retries) == (2, 1)


def test_who_is_named_twice_is_drawn_anew_among_the_others(run, learned):
    once = again(first(run, learned), learned, GIVER)
    twice = again(once, learned, GIVER)
    assert not np.array_equal(twice["rolled"][GIVER], once["rolled"][GIVER])
    assert np.array_equal(twice["rolled"][TAKER], once["rolled"][TAKER])


def test_who_is_named_again_and_again_keeps_the_edited_prior_and_the_reason_is_reported(
    run, learned
):
    state = first(run, learned)
    for _ in range(len(SHARES) - 1):
        state = again(state, learned, GIVER)
    assert np.array_equal(state["refined"][GIVER].xy, state["edited"][GIVER].xy)
    kept = state["refinement"].agents[GIVER]
    assert kept.share == 0.0
    assert "too close" in kept.reason
    assert moved(state, TAKER) == moved(first(run, learned), TAKER)


def test_a_figure_that_no_refinement_changes_is_a_fault_of_the_prior(run, learned):
    state = again(first(run, learned), learned, GIVER)
    for kept in ((GIVER,), (GIVER, TAKER)):
        state["rejections"] = [*state["rejections"], state["refused"]]
        state = state | refine_trajectories(state, runtime=runtime(learned))
        for name in kept:
            assert moved(state, name) == 0.0
    assert state["refinement"].attempt == 6


def test_on_the_last_attempt_all_agents_keep_the_edited_prior(run, learned):
    state = first(run, learned)
    for name in (GIVER, TAKER, GIVER, TAKER, GIVER):
        state = again(state, learned, name)
    assert state["refinement"].attempt == 6
    assert not state["refinement"].may_retry
    for name, track in state["refined"].items():
        assert np.array_equal(track.xy, state["edited"][name].xy)


def test_a_bundle_without_weights_leaves_the_tracks_as_edited_and_says_so(run):
    state = dict(run) | refine_trajectories(run, runtime=runtime(None))
    assert state["refinement"].note == NO_WEIGHTS
    assert state["refined"] is state["edited"]
