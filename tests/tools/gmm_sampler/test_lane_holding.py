"""Where paths run between what p_wp says: along the lane on approaches, swaying on foot."""

from __future__ import annotations

import numpy as np
import pytest

from scenewright.geometry.spline import PER_INTERVAL, build_spline_path
from scenewright.intersections import load_map
from scenewright.scene.candidates import K
from scenewright.tools.gmm_sampler import compute_waypoint_nll, load_priors, sample_waypoints
from scenewright.tools.gmm_sampler.lane_holding import ApproachLanes, find_approach_lanes
from scenewright.tools.gmm_sampler.sample import build_paths
from scenewright.tools.gmm_sampler.wander import sample_lateral_wander

ON, PRIORS = load_map("amsterdam_120"), load_priors("amsterdam_120")
STRAIGHT = next(r for r in ON.routes if r.id == "vehicle:north>south:straight")
LANES = find_approach_lanes(ON, STRAIGHT.movement_id)
FIRST_STANDS = 13.4
"""Of the middle of who stands first in its lane from the middle of the map [m]."""


def paths(lanes, count=40):
    rng = np.random.default_rng(1)
    prior = PRIORS.waypoints[STRAIGHT.id]
    return build_paths(prior, lanes.draw(prior, rng, size=count)[0])


def slopes(path) -> np.ndarray:
    """How far it points away from its lane [deg], where queues stand."""
    stands = path.xy[:, 1] > FIRST_STANDS
    return np.abs(np.degrees(path.heading[stands] + np.pi / 2))


def test_no_path_is_aslant_where_queues_stand_and_all_differ():
    drawn = paths(LANES)
    assert max(slopes(path).max() for path in drawn) > 2.0
    held = [(LANES.hold(path) or (path,))[0] for path in drawn]
    assert max(slopes(path).max() for path in held) < 1.0
    from_middle = [min(abs(path.xy[10, 0] + 1.65), abs(path.xy[10, 0] + 4.95)) for path in held]
    assert np.std([path.xy[10, 0] for path in held]) > 1.0  # in both lanes
    assert max(from_middle) < 1.2
    assert np.std(from_middle) > 0.1


def test_a_held_path_changes_nowhere_else():
    changed = 0
    for path in paths(LANES, 12):
        if (held := LANES.hold(path)) is not None:
            changed += 1
            assert held[1].shape == (K, 2)
            assert held[0].xy[-1] == pytest.approx(path.xy[-1], abs=1e-9)
            south = path.xy[path.xy[:, 1] < 5.0]
            away = np.hypot(*(south[:, None] - held[0].xy[None]).transpose(2, 0, 1)).min(axis=1)
            assert away.max() < 0.26  # their points are half a metre apart
    assert changed > 3


def test_a_curved_lane_is_followed():
    turn = np.linspace(0.0, 0.5, 60)
    lane = 80.0 * np.column_stack([np.sin(turn), 1.0 - np.cos(turn)])
    aside = np.linspace(0.0, 1.5, 60)[:, None] * np.column_stack([-np.sin(turn), np.cos(turn)])
    path = build_spline_path((lane + aside)[np.linspace(0, 59, K).astype(int)])
    held = ApproachLanes((lane,)).hold(path)
    assert held is not None
    before = np.abs(held[0].heading[10:50] - np.interp(held[0].s[10:50], 80.0 * turn, turn))
    assert np.degrees(before.max()) < 1.2


def test_who_has_no_lane_is_left_alone():
    nobody = find_approach_lanes(ON, None)
    prior = PRIORS.waypoints[STRAIGHT.id]
    waypoints, nll, _ = nobody.draw(prior, np.random.default_rng(2), size=3)
    assert waypoints == pytest.approx(sample_waypoints(prior, np.random.default_rng(2), size=3))
    assert nll == pytest.approx(compute_waypoint_nll(prior, waypoints))
    assert nobody.hold(build_spline_path(waypoints[0])) is None


def test_walkers_sway_about_a_path_through_their_waypoints():
    draw_aside = sample_lateral_wander(50.0, np.random.default_rng(3), size=60)
    aside = np.array([draw_aside(m) for m in range(60)])
    assert np.abs(aside[:, ::PER_INTERVAL]).max() < 1e-12
    assert 0.05 < np.median(aside.std(axis=1)) < 0.15
    assert np.abs(aside).max() < 0.36
    line = np.column_stack([np.linspace(0.0, 50.0, K), np.zeros(K)])
    path = build_spline_path(line, aside=aside[0])
    assert np.abs(path.xy[:, 1]).max() > 0.02
    near = np.hypot(*(path.xy[None] - line[:, None]).transpose(2, 0, 1)).min(axis=1)
    assert near.max() < 0.26
    assert np.abs(np.degrees(path.heading)).max() < 25.0
