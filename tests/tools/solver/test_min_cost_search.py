"""Least-cost selection: what is called optimal, and what is not."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenewright.geometry.map_areas import MapAreas
from scenewright.intersections import load_map
from scenewright.scene.candidates import CandidateSet, RoleAssignment
from scenewright.tools.dsl_validator.parse import parse
from scenewright.tools.solver.select import enumerate_best_first, select
from solver_agents import SOUTH, SOUTHBOUND, WEST, WESTBOUND, candidate, draws, law, straight

GROUND = MapAreas(load_map("amsterdam_120"))
NEAR_MISS = "time_gap(vehicle-1, vehicle-2) in [0.6, 1.2] s\nruns_red(vehicle-1)"


def southbound(shift=0.0, speed=10.0):
    path = straight((-4.95 + shift, 49.5), SOUTH, 99.0)
    return candidate(path, time_law=law(speed), route=SOUTHBOUND)


def westbound(shift=0.0, speed=10.0):
    path = straight((49.5, 1.75 + shift), WEST, 99.0)
    return candidate(path, time_law=law(speed), route=WESTBOUND)


def least(program, *agents, background=None, seed=0):
    pool = CandidateSet(
        agents={each.name: each for each in agents},
        cast=RoleAssignment(routes={each.name: each.route for each in agents}, patterns=()),
        hour=12.0,
        background=background or {"vehicle": 0, "pedestrian": 0},
    )
    rng = np.random.default_rng(seed)
    return select(parse(program), pool, map_areas=GROUND, rng=rng, mode="map")


@given(st.lists(st.lists(st.integers(0, 9), min_size=1, max_size=4), max_size=3))
def test_tuples_come_by_ascending_sum_each_once(costs):
    found = list(enumerate_best_first([np.array(each, dtype=float) for each in costs]))
    sums = [sum(own[m] for own, m in zip(costs, choice, strict=True)) for choice in found]
    assert sums == sorted(sums)
    assert sorted(found) == sorted(product(*(range(len(own)) for own in costs)))


@pytest.mark.parametrize("seed", range(3))
def test_what_costs_no_more_than_its_floor_is_optimal(seed):
    """The cheapest candidate fails its clause for good, and so is no reason for doubt."""
    selection = least(
        f"{NEAR_MISS}\nspeed(vehicle-1) in [8, 12] m/s",
        draws("vehicle-1", [southbound(speed=4.0), southbound(0.2)], nll=[0.0, 2.5]),
        draws("vehicle-2", [westbound()]),
        seed=seed,
    )
    assert selection.cost == pytest.approx(2.5)
    assert selection.optimal
    assert selection.figures["gap"] == 0.0


def test_a_tuple_that_only_failed_at_the_moments_tried_leaves_a_doubt():
    """Too slow to strike at 11 m/s: no staging serves the clause, but none proves it futile."""
    selection = least(
        "contact(vehicle-1, vehicle-2, 11 m/s)\nruns_red(vehicle-1)",
        draws("vehicle-1", [southbound(speed=5.0), southbound(speed=11.5)], nll=[0.0, 2.5]),
        draws("vehicle-2", [westbound(speed=4.0)]),
    )
    assert selection.agents["vehicle-1"].index == 1
    assert not selection.optimal
    assert selection.figures["gap"] == pytest.approx(2.5)


def test_paths_that_never_touch_are_no_reason_for_doubt():
    beside = candidate(straight((30.0, 49.5), SOUTH, 20.0), time_law=law(10.0), route=SOUTHBOUND)
    selection = least(
        NEAR_MISS,
        draws("vehicle-1", [beside, southbound()], nll=[0.0, 1.0]),
        draws("vehicle-2", [westbound()]),
    )
    assert selection.agents["vehicle-1"].index == 1
    assert selection.optimal


@pytest.mark.parametrize("seed", range(3))
def test_everybody_else_has_its_cheapest_candidate_whenever_it_drew_to_come(seed):
    crowd = [
        draws(
            f"vehicle-{n}",
            [westbound(speed=8.0), westbound(0.1)],
            nll=[3.0, 1.0],
            role="background",
            arrival=14.0,
        )
        for n in (3, 4)
    ]
    selection = least(
        NEAR_MISS,
        draws("vehicle-1", [southbound()]),
        draws("vehicle-2", [westbound()]),
        *crowd,
        background={"vehicle": 2, "pedestrian": 0},
        seed=seed,
    )
    assert {selection.agents[f"vehicle-{n}"].index for n in (3, 4)} == {1}
    assert selection.cost == pytest.approx(2.0)
    assert selection.optimal
