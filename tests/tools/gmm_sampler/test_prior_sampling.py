"""The priors and what is drawn from them, against closed forms and the map."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from scenewright.errors import InputError
from scenewright.geometry.spline import DENSE, build_even_path, build_spline_path
from scenewright.intersections import find_bundle_folder, load_map
from scenewright.scene.candidates import DrivingProfile, K
from scenewright.tools.gmm_sampler import (
    CountPrior,
    DrivingProfilePrior,
    Priors,
    WaypointPrior,
    build_paths,
    compute_count_nll,
    compute_profile_nll,
    compute_total_mass,
    compute_waypoint_nll,
    load_priors,
    sample_count,
    sample_driving_profiles,
    sample_waypoints,
)
from scenewright.tools.gmm_sampler.prior_files import save_priors
from scenewright.tools.simulation.corpus import Trip, resample_path

NAME = "amsterdam_120"


@pytest.fixture(scope="module")
def place():
    return load_map(NAME)


@pytest.fixture(scope="module")
def priors():
    return load_priors(NAME)


def straight(speed=1.0, start=(0.0, 0.0), end=(90.0, 0.0), spread=0.5, weight=1.0):
    mean = np.linspace(start, end, K).ravel()
    base = np.linspace(start, end, DENSE)
    return weight, mean, spread * np.eye(2 * K), base


def mixture(*parts):
    weights, means, factors, bases = (np.array(column) for column in zip(*parts, strict=True))
    return WaypointPrior("test", weights, means, factors, bases, tracks=9)


def test_nll_of_one_gaussian_is_the_closed_form():
    prior = mixture(straight(spread=0.5))
    points = np.linspace((0.0, 0.0), (90.0, 0.0), K) + np.array([0.0, 0.25])
    wanted = 20 * math.log(0.5 * math.sqrt(2 * math.pi)) + 0.5 * K * (0.25 / 0.5) ** 2
    assert compute_waypoint_nll(prior, points[None]) == pytest.approx([wanted])


def test_nll_of_two_far_components_adds_the_cost_of_choosing():
    near, far = straight(weight=0.25), straight(start=(0.0, 500.0), end=(90.0, 500.0), weight=0.75)
    points = np.linspace((0.0, 0.0), (90.0, 0.0), K)[None]
    alone = compute_waypoint_nll(mixture(straight()), points)
    assert compute_waypoint_nll(mixture(near, far), points) == pytest.approx(alone - math.log(0.25))


def test_samples_have_the_mean_and_spread_of_their_gaussian():
    prior = mixture(straight(spread=0.5))
    drawn = sample_waypoints(prior, np.random.default_rng(0), size=20_000)
    assert drawn.mean(axis=0).ravel() == pytest.approx(prior.means[0], abs=0.02)
    assert drawn.std(axis=0) == pytest.approx(0.5, abs=0.02)
    expected = 20 * math.log(0.5 * math.sqrt(2 * math.pi)) + 10
    assert compute_waypoint_nll(prior, drawn).mean() == pytest.approx(expected, abs=0.1)


def test_same_seed_same_draws(priors):
    prior = priors.waypoints["vehicle:south>north:straight"]
    first, second = (sample_waypoints(prior, np.random.default_rng(7), size=16) for _ in range(2))
    assert np.array_equal(first, second)
    counts = [sample_count(priors, np.random.default_rng(7), hour=8) for _ in range(2)]
    assert counts[0] == counts[1]


@given(st.integers(0, 2**32 - 1))
def test_a_path_passes_through_its_waypoints(seed):
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.uniform(2.0, 12.0, (K, 2)), axis=0)
    path = build_spline_path(points)
    line = shapely.LineString(path.xy)
    assert max(line.distance(shapely.Point(p)) for p in points) < 0.05
    assert np.diff(path.s) == pytest.approx(path.s[1])
    assert path.s[1] == pytest.approx(0.5, abs=0.06)


def test_a_straight_path_has_no_curvature_and_a_circle_that_of_its_radius():
    line = build_spline_path(np.linspace((0.0, 0.0), (0.0, 90.0), K))
    assert line.heading == pytest.approx(math.pi / 2)
    assert line.curvature == pytest.approx(0.0, abs=1e-9)
    assert line.length == pytest.approx(90.0)
    angle = np.linspace(0.0, math.pi / 2, K)
    arc = build_spline_path(20.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    assert arc.curvature[16:-16] == pytest.approx(1 / 20.0, rel=0.05)
    assert arc.heading[-1] - arc.heading[0] == pytest.approx(math.pi / 2, abs=0.12)


def test_a_base_curve_is_kept_where_waypoints_agree_with_it():
    t = np.linspace(0.0, math.pi / 2, DENSE)
    base = 6.0 * np.stack([np.cos(t), np.sin(t)], axis=1)
    path = build_spline_path(base[:: (DENSE - 1) // (K - 1)] + 1.0, base=base)
    assert np.hypot(*(path.xy - 1.0).T) == pytest.approx(6.0, abs=1e-3)


def test_samples_of_every_route_lie_where_the_class_may_be(place, priors):
    road = shapely.unary_union([shapely.Polygon(a.exterior) for a in place.road])
    foot = shapely.unary_union([shapely.Polygon(a.exterior) for a in place.walkable])
    walks = [shapely.Polygon(c.polygon) for c in place.crosswalks]
    on_foot = shapely.unary_union([foot, *walks]).buffer(0.05)
    areas = {"vehicle": road, "crossing": on_foot, "jaywalking": foot.union(road).buffer(0.05)}
    rng = np.random.default_rng(1)
    for route in place.routes:
        prior = priors.waypoints[route.id]
        area = areas["vehicle" if route.type == "vehicle" else route.movement]
        paths = build_paths(prior, sample_waypoints(prior, rng, size=100))
        inside = np.concatenate([shapely.contains_xy(area, p.xy[:, 0], p.xy[:, 1]) for p in paths])
        assert inside.mean() >= 0.98, route.id


def test_sampled_turns_are_drivable_and_walks_walkable(place, priors):
    rng = np.random.default_rng(2)
    for route in place.routes:
        prior = priors.waypoints[route.id]
        paths = build_paths(prior, sample_waypoints(prior, rng, size=50))
        sharpest = max(float(np.abs(p.curvature).max()) for p in paths)
        assert sharpest < (1 / 6 if route.type == "vehicle" else 1.0), route.id


def test_routes_begin_and_end_on_their_sides(place, priors):
    axis = {"north": (0, 1), "south": (0, -1), "east": (1, 0), "west": (-1, 0)}
    for route in place.routes:
        for mean in priors.waypoints[route.id].means.reshape(-1, K, 2):
            assert np.dot(mean[0], axis[route.entry]) > 5.0
            assert np.dot(mean[-1], axis[route.exit]) > 5.0


def test_jaywalkers_cross_outside_the_crosswalk(place, priors):
    for route in (r for r in place.routes if r.movement == "jaywalking"):
        prior = priors.waypoints[route.id]
        assert prior.tracks == 0
        crosswalk = next(c for c in place.crosswalks if c.leg == route.crosswalk)
        area = shapely.Polygon(crosswalk.polygon)
        drawn = sample_waypoints(prior, np.random.default_rng(3), size=200)
        hit = [shapely.LineString(w).intersects(area) for w in drawn]
        assert np.mean(hit) < 0.02


def test_time_laws_stay_in_comfort_and_their_density_integrates_to_one(priors):
    route = "vehicle:north>west:right"
    laws = sample_driving_profiles(priors, route, np.random.default_rng(4), size=500)
    assert all(law.acceleration <= 2.5 and law.braking <= 3 and law.lateral <= 3 for law in laws)
    assert 7 < np.median([law.speed for law in laws]) < 12
    prior = priors.driving_profiles[route]
    axes = [np.linspace(a, b, 41) for a, b in zip(prior.low, prior.high, strict=True)]
    centre = [float(x) for x in prior.median]
    speeds = [DrivingProfile(float(v), *centre[1:]) for v in axes[0]]
    joint = np.exp(-compute_profile_nll(priors, route, speeds))
    other = [DrivingProfile(centre[0], float(v), *centre[2:]) for v in axes[1]]
    at_centre = math.exp(-compute_profile_nll(priors, route, [DrivingProfile(*centre)])[0])
    marginal = np.trapezoid(joint, axes[0]) * np.trapezoid(
        np.exp(-compute_profile_nll(priors, route, other)), axes[1]
    )
    two = np.array([[centre[0], centre[1], x, y] for x in axes[2] for y in axes[3]])
    rest = np.exp(
        -compute_profile_nll(priors, route, [DrivingProfile(*map(float, row)) for row in two])
    )
    rest = np.trapezoid(np.trapezoid(rest.reshape(41, 41), axes[3]), axes[2])
    assert marginal * rest / at_centre**2 == pytest.approx(1.0, abs=0.02)


def test_a_time_law_out_of_bounds_is_impossible(priors):
    law = DrivingProfile(speed=30.0, acceleration=2.0, braking=2.0, lateral=2.0)
    assert compute_profile_nll(priors, "vehicle:north>south:straight", [law]) == np.inf


def test_counts_are_a_distribution_over_whole_numbers(priors):
    mass = compute_total_mass(priors, hour=17)
    assert mass.sum() == pytest.approx(1.0)
    rng = np.random.default_rng(5)
    drawn = [sum(sample_count(priors, rng, hour=17)) for _ in range(2000)]
    assert np.mean(drawn) == pytest.approx(mass @ np.arange(len(mass)), rel=0.03)
    night = compute_total_mass(priors, hour=3)
    assert night @ np.arange(len(night)) < 0.4 * mass @ np.arange(len(mass))
    assert compute_count_nll(priors, hour=17, vehicles=900, pedestrians=0) == np.inf
    with pytest.raises(InputError, match="0 to 23"):
        sample_count(priors, rng, hour=24)


def test_one_gaussian_of_counts_is_discretised(tmp_path):
    prior = CountPrior(np.ones(1), np.array([[4.0, 2.0]]), np.array([[[1.0, 0.0], [0.0, 0.25]]]))
    grid = np.exp(-0.5 * (np.arange(60) - 4.0) ** 2)
    wanted = grid / grid.sum()
    assert prior.mass.sum(axis=1) == pytest.approx(wanted[: len(prior.mass)], abs=1e-6)


def test_saving_and_loading_changes_nothing(tmp_path, priors):
    save_priors(tmp_path / "priors.npz", priors)
    again = load_priors(tmp_path)
    for route, prior in priors.waypoints.items():
        assert np.array_equal(again.waypoints[route].means, prior.means)
    assert again.subtypes == priors.subtypes
    assert again.driving_profiles.keys() == priors.driving_profiles.keys()


def test_damaged_or_missing_priors_are_one_clear_line(tmp_path):
    with pytest.raises(InputError, match="no priors"):
        load_priors(tmp_path)
    (tmp_path / "priors.npz").write_bytes(b"PK not really")
    with pytest.raises(InputError, match="cannot read"):
        load_priors(tmp_path)
    (tmp_path / "bundle.toml").write_text('[sha256]\n"priors.npz" = "0"\n')
    load_priors.__globals__["_load_bundle"].cache_clear()
    with pytest.raises(InputError, match="checksum"):
        load_priors(tmp_path)


def test_the_bundle_is_small_and_unpickled():
    folder = find_bundle_folder(NAME)
    assert sum(f.stat().st_size for f in folder.iterdir()) < 20e6
    for file in folder.glob("*.npz"):
        with np.load(file, allow_pickle=False) as stored:
            assert all(stored[key].dtype != object for key in stored.files)


def test_frequency_and_subtypes_cover_every_route(place, priors):
    for route in place.routes:
        assert priors.frequency[route.id].shape == (24,)
    for shares in priors.subtypes.values():
        assert sum(shares.values()) == pytest.approx(1.0, abs=1e-3)


def test_equal_arc_length_is_equal_along_the_curve():
    corner = np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 9.0]])
    points = resample_path(corner)
    assert points[0].tolist() == [0.0, 0.0]
    assert points[-1].tolist() == [9.0, 9.0]
    assert np.linalg.norm(np.diff(points, axis=0), axis=1)[:4] == pytest.approx(2.0)


def test_a_trip_has_ten_waypoints():
    path = np.stack([np.linspace(0, 45, 91), np.zeros(91)], axis=1)
    trip = Trip("vehicle:x", "car", path, np.zeros(3), 0.0)
    assert trip.waypoints.shape == (K, 2)


def test_priors_hold_every_route(place, priors):
    assert isinstance(priors, Priors)
    wanted = {route.id for route in place.routes}
    assert set(priors.waypoints) == set(priors.driving_profiles) == wanted
    assert all(isinstance(law, DrivingProfilePrior) for law in priors.driving_profiles.values())


def test_points_of_a_curve_may_coincide() -> None:
    x = np.array([0.0, 0.0, 5.0, 5.0, 10.0, 10.0])
    path = build_even_path(np.column_stack([x, np.zeros_like(x)]))
    assert path.length == pytest.approx(10.0)
    assert path.xy[:, 0] == pytest.approx(path.s)
    assert path.heading == pytest.approx(np.zeros(len(path.s)))
