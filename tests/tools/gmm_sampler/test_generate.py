"""The amplified scene: how many, who, when, and the same again from the same seed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenewright.errors import InputError
from scenewright.intersections import load_map
from scenewright.scene.relations import load_patterns
from scenewright.scene.social import (
    AgentNode,
    Background,
    RelationEdge,
    SceneContext,
    SocialGraph,
)
from scenewright.tools.gmm_sampler import compute_waypoint_nll, load_priors
from scenewright.tools.gmm_sampler.assumed_priors import build_rider_priors
from scenewright.tools.gmm_sampler.background_counts import draw_background_counts
from scenewright.tools.gmm_sampler.generate import (
    amplify,
    assign_foreground,
    choose_hour,
)
from scenewright.tools.gmm_sampler.lane_holding import sample_lane_departures
from scenewright.tools.gmm_sampler.sample import compute_total_mass
from scenewright.tools.map_grounding.grounding import ground_graph

ON = load_map("amsterdam_120")
PRIORS = load_priors("amsterdam_120")
SEEDS = st.integers(0, 10_000)
WORDS = {"low": (1, 4), "medium": (5, 10), "high": (11, 90)}


def graph_of(relation="near_miss", *, kind=None, **context) -> SocialGraph:
    return SocialGraph(
        agents=(
            AgentNode(id="vehicle-2", type="vehicle"),
            AgentNode(id="vehicle-4", type="vehicle", subtype="bus"),
        ),
        relations=(RelationEdge(type=relation, from_="vehicle-2", to="vehicle-4", kind=kind),),
        context=SceneContext(**context),
    )


def pool_of(graph, *, seed=0, hour=12.0, size=6):
    rng = np.random.default_rng(seed)
    cast = assign_foreground(
        graph,
        ground_graph(graph, intersection_map=ON),
        PRIORS,
        intersection_map=ON,
        hour=hour,
        rng=rng,
    )
    return amplify(graph, cast, PRIORS, intersection_map=ON, hour=hour, size=size, rng=rng)


def counts(graph, seed, hour=12.0, **options):
    rng = np.random.default_rng(seed)
    return draw_background_counts(graph, PRIORS, hour=hour, rng=rng, **options)


@given(st.sampled_from(sorted(WORDS)), SEEDS, st.floats(0.0, 23.9))
def test_a_density_word_sets_the_number(word, seed, hour):
    low, high = WORDS[word]
    assert low <= sum(counts(graph_of(density=word), seed, hour).values()) <= high


def test_every_number_of_a_density_word_comes_about():
    seen = {sum(counts(graph_of(density="low"), seed).values()) for seed in range(60)}
    assert seen == {1, 2, 3, 4}


@given(st.integers(0, 20), st.integers(0, 20), SEEDS)
def test_explicit_numbers_are_kept(vehicles, pedestrians, seed):
    asked = Background(vehicles=vehicles, pedestrians=pedestrians)
    found = counts(graph_of(density="low", background=asked), seed)
    assert found == {"vehicle": vehicles, "pedestrian": pedestrians}


def test_a_class_left_free_is_drawn():
    found = [counts(graph_of(background=Background(pedestrians=0)), seed) for seed in range(20)]
    assert {each["pedestrian"] for each in found} == {0}
    assert len({each["vehicle"] for each in found}) > 1


def test_without_a_word_noon_is_busier_than_night():
    noon, night = (
        np.mean([sum(counts(graph_of(), seed, hour).values()) for seed in range(60)])
        for hour in (12.0, 3.0)
    )
    assert noon > night


def test_everybody_in_the_scene_follows_the_hour():
    """The mean of what is drawn, the two named vehicles included, is p_tod's own."""
    mass = PRIORS.counts[12].mass
    expected = mass.sum(axis=1) @ np.arange(mass.shape[0])
    drawn = [2 + counts(graph_of(), seed)["vehicle"] for seed in range(400)]
    assert np.mean(drawn) == pytest.approx(expected, rel=0.05)


def test_high_density_is_the_busiest_third_of_the_hour():
    totals = compute_total_mass(PRIORS, hour=12).cumsum()
    for seed in range(40):
        here = 2 + sum(counts(graph_of(density="high"), seed).values())
        assert totals[here - 1] >= 2 / 3


@given(st.integers(2, 40), SEEDS, st.sampled_from([None, "high"]))
def test_no_scene_holds_more_than_the_most_agents(most, seed, density):
    found = counts(graph_of(density=density), seed, max_agents=most)
    whole = counts(graph_of(density=density), seed)
    assert 2 + sum(found.values()) == min(most, 2 + sum(whole.values()))


def test_numbers_beyond_the_most_agents_are_refused():
    asked = graph_of(background=Background(vehicles=9))
    with pytest.raises(InputError, match="11 agents, more than --max-agents 10"):
        counts(asked, 0, max_agents=10)


@given(SEEDS)
def test_names_never_collide_and_spares_come_on_top(seed):
    wanted = Background(vehicles=3, pedestrians=2)
    pool = pool_of(graph_of(background=wanted), seed=seed, size=1)
    foreground = [n for n, each in pool.agents.items() if each.role == "foreground"]
    assert foreground == ["vehicle-2", "vehicle-4"]
    assert pool.background == {"vehicle": 3, "pedestrian": 2}
    for kind, count in pool.background.items():
        crowd = [
            each
            for each in pool.agents.values()
            if each.role == "background" and each.route.type == kind
        ]
        assert [each.reserve for each in crowd] == [n >= count for n in range(len(crowd))]
        for part in (crowd[:count], crowd[count:]):  # whoever comes first is first in its queue
            assert [each.arrival for each in part] == sorted(each.arrival for each in part)
        assert all(each.name.startswith(f"{kind}-") for each in crowd)
        assert all(0.0 <= each.arrival <= 30.0 for each in crowd)
        assert "jaywalking" not in {each.route.movement for each in crowd}
    assert {name: each.name for name, each in pool.agents.items()} == {n: n for n in pool.agents}
    assert all(pool.agents[name].arrival is None for name in foreground)


def test_nobody_wanted_nobody_drawn():
    pool = pool_of(graph_of(background=Background(vehicles=0, pedestrians=0)))
    assert set(pool.agents) == {"vehicle-2", "vehicle-4"}


def test_arrivals_are_spread_evenly_over_the_scene():
    """Given their number, exponential intervals make uniform arrivals."""
    asked = Background(vehicles=12, pedestrians=0)
    arrivals = np.array(
        [
            each.arrival
            for seed in range(40)
            for each in pool_of(graph_of(background=asked), seed=seed, size=1).agents.values()
            if each.arrival is not None
        ]
    )
    shares = np.histogram(arrivals, bins=3, range=(0.0, 30.0))[0] / len(arrivals)
    assert shares == pytest.approx([1 / 3] * 3, abs=0.1)


def test_some_walk_with_another_at_its_pace_on_its_route():
    asked = graph_of(background=Background(vehicles=0, pedestrians=20))
    found = 0
    for seed in range(4):
        pool = pool_of(asked, seed=seed)
        for other in (each for each in pool.agents.values() if each.beside is not None):
            leader = pool.agents[other.beside]
            ours, theirs = other.build(0), leader.build(0)
            assert (other.route, ours.time_law) == (leader.route, theirs.time_law)
            assert 0.7 < np.hypot(*(ours.path.xy - theirs.path.xy).T).mean() < 1.3
            assert leader.beside is None
            found += 1
    assert 5 <= found <= 24  # 17 % of 80


def test_candidates_are_built_from_what_was_drawn():
    pool = pool_of(graph_of())
    alone = {name: agent for name, agent in pool.agents.items() if agent.beside is None}
    for name, agent in alone.items():
        assert agent.drawn.waypoints.shape == (6, 10, 2)
        candidate = agent.build(3)
        assert candidate.route == agent.route
        if agent.route.type == "pedestrian":
            assert (candidate.waypoints == agent.drawn.waypoints[3]).all()
        prior = PRIORS.waypoints[agent.route.id]
        nll = compute_waypoint_nll(prior, candidate.waypoints[None])
        assert candidate.nll == pytest.approx(float(nll[0]))  # of a path held to its lane, too
        pace = agent.drawn.pace(3)
        assert candidate.time_law == replace(agent.drawn.time_laws[3], pace=pace)
        assert np.hypot(*(candidate.path.xy[0] - candidate.waypoints[0])) < 1e-9
        assert np.hypot(*(candidate.path.xy[-1] - agent.drawn.waypoints[3, -1])) < 0.2
        if name == "vehicle-4":
            assert (agent.subtype, agent.shape.length) == ("bus", 12.0)
        if agent.route.type == "pedestrian":
            assert agent.subtype is None


@given(SEEDS)
def test_the_same_generator_draws_the_same(seed):
    one, other = (pool_of(graph_of(density="low"), seed=seed, size=2) for _ in range(2))
    assert one.cast == other.cast
    assert list(one.agents) == list(other.agents)
    for name, agent in one.agents.items():
        twin = other.agents[name]
        assert (agent.drawn.waypoints == twin.drawn.waypoints).all()
        assert (agent.drawn.time_laws, agent.arrival) == (twin.drawn.time_laws, twin.arrival)
        assert agent.shape == twin.shape


def test_no_red_light_is_run_by_those_who_go_together():
    graph = SocialGraph(
        agents=(
            AgentNode(id="vehicle-1", type="vehicle", entry="north", movement="left"),
            AgentNode(id="vehicle-2", type="vehicle", entry="south", movement="straight"),
        ),
        relations=(RelationEdge(type="yield_to", from_="vehicle-1", to="vehicle-2"),),
    )
    for seed in range(10):
        [played] = pool_of(graph, seed=seed, size=1).cast.patterns
        assert played.pattern == "left_turn_yields_to_oncoming"
        assert played.violator is None


def test_the_hour_is_as_asked():
    rng = np.random.default_rng(0)
    assert choose_hour(SceneContext(time_of_day="08:30"), PRIORS, rng) == 8.5
    assert 0 <= choose_hour(SceneContext(), PRIORS, rng) < 24


@given(st.integers(0, 1439), st.integers(1, 600), SEEDS)
def test_an_hour_within_a_range_stays_in_it(start, lasts, seed):
    end = (start + lasts) % 1440
    text = f"{start // 60:02d}:{start % 60:02d}-{end // 60:02d}:{end % 60:02d}"
    hour = choose_hour(SceneContext(time_of_day=text), PRIORS, np.random.default_rng(seed))
    assert 0 <= hour < 24
    assert (hour * 60 - start + 1e-6) % 1440 <= lasts + 1e-5


def test_a_lane_change_begins_on_its_own_lane_and_ends_on_the_others():
    t = np.linspace(0.0, 1.0, 10)
    own = np.stack([np.column_stack([100 * t, np.zeros(10)])] * 3)
    other = np.stack([np.column_stack([100 * t, np.full(10, 3.3)])] * 3)
    changed = sample_lane_departures(own, other, np.random.default_rng(0), reverse=False)
    assert changed[:, 0] == pytest.approx(own[:, 0], abs=1e-9)
    assert changed[:, -1] == pytest.approx(other[:, -1], abs=1e-9)
    assert ((changed[..., 1] > -1e-9) & (changed[..., 1] < 3.3 + 1e-9)).all()
    back = sample_lane_departures(own, other[:, ::-1], np.random.default_rng(0), reverse=True)
    assert back[:, -1] == pytest.approx(other[:, -1], abs=1e-9)


@pytest.mark.parametrize("kind", ["sideswipe", "head_on"])
def test_who_drifts_leaves_its_lane_for_the_others(kind):
    pool = pool_of(graph_of("collide_at", kind=kind))
    [played] = pool.cast.patterns
    assert played.pattern in {pattern.id for pattern in load_patterns() if pattern.kind == kind}
    drifting, other = pool.agents[played.from_], pool.agents[played.to]

    def away(waypoints) -> float:
        """How far a drifter's end lies from where the other drives."""
        dense = np.concatenate([other.build(m).path.xy for m in range(6)])
        return float(np.hypot(*(dense - waypoints[-1]).T).min())

    assert max(away(waypoints) for waypoints in drifting.drawn.waypoints) < 3.0
    assert np.isfinite(drifting.nll).all()


def test_riders_on_a_crosswalk_come_from_the_edge_of_the_map_and_leave_there():
    crossing = [r for r in ON.routes if r.type == "pedestrian" and r.movement == "crossing"]
    for route in crossing:
        prior = build_rider_priors(PRIORS, "cyclist", route, intersection_map=ON)
        base = prior.waypoints[route.id].base
        assert np.abs(base[:, [0, -1]]).max(axis=2) == pytest.approx(ON.extent - 0.1)
        # The way over the crosswalk between stays where pedestrians walk.
        walked = PRIORS.waypoints[route.id].base
        middle = np.linalg.norm(walked[:, 108, None] - base, axis=2).min(axis=1)
        assert middle.max() < 0.3
