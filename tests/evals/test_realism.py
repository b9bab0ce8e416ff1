"""Distances, stops and the table of realism, on motion whose answers are known."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from scenewright.evals.realism import ClusterSample, compute_distance, compute_wasserstein, judge
from scenewright.evals.realism.__main__ import main
from scenewright.evals.realism.distances import compute_chance, compute_gain, resample_distances
from scenewright.evals.realism.fit_yielding import find_yield_cases, fit_acceleration_profiles
from scenewright.evals.realism.samples import (
    MotionFilter,
    classify_motion,
    compute_moving_shares,
    compute_steady_share,
    list_recorded_agents,
    list_scene_agents,
    measure_motion,
    sample_in_shares,
)
from scenewright.evals.realism.scenes import (
    YIELDS,
    SceneTracks,
    convert_scene,
    cut_scenes,
    list_requests,
    make_scenes,
    read_scenes,
)
from scenewright.evals.realism.stops import (
    find_all_stops,
    find_standstills,
    find_yield_stops,
    measure_line_gap,
)
from scenewright.graph.run import synthesize
from scenewright.intersections import load_map
from scenewright.scene.track import PEDESTRIAN, STEP, Track, get_vehicle_shape
from scenewright.tools.relation_checker import RoadUser, build_trajectory
from scenewright.tools.track_io import RecordedAgent, Recording, save_recordings

values = st.lists(st.floats(-50, 50), min_size=1, max_size=30).map(np.array)


@pytest.fixture(scope="module")
def intersection_map():
    return load_map("amsterdam_120")


@pytest.fixture(scope="module")
def yielding():
    """A car that comes to stand; with some seeds it only slows, which is a yield as well."""
    return synthesize("A car turning right yields to a pedestrian at 09:00", seed=7)


@given(values, values)
def test_the_distance_is_the_first_wasserstein_distance(first, second):
    found = compute_wasserstein(first, second)
    assert found == pytest.approx(stats.wasserstein_distance(first, second), abs=1e-9)
    assert found == pytest.approx(compute_wasserstein(second, first))


@given(values, st.floats(-20, 20))
def test_a_shift_is_as_far_as_it_shifts(first, by):
    assert compute_wasserstein(first, first + by) == pytest.approx(abs(by), abs=1e-9)
    assert compute_wasserstein(first, first) == 0.0


def test_without_values_there_is_no_distance():
    empty, one = ClusterSample.join_parts([[], []]), ClusterSample.join_parts([[1.0, 2.0]])
    rng = np.random.default_rng(0)
    assert compute_wasserstein(empty.values, one.values) is None
    assert compute_distance(empty, one, draws=5, rng=rng) is None
    assert compute_gain(one, empty, one, draws=5, rng=rng) is None
    assert compute_chance(one, one, draws=5, rng=rng) is None


def test_clusters_can_be_taken_out():
    sample = ClusterSample.join_parts([[1.0, 2.0], [], [3.0], [4.0, 5.0]])
    part = sample.select(np.array([3, 0]))
    assert sorted(part.values) == [1.0, 2.0, 4.0, 5.0]
    assert part.cluster[part.values == 4.0].tolist() == [0]
    assert part.clusters == 2


def clustered(rng, count, *, mean=0.0, spread=1.0, between=0.0):
    return ClusterSample.join_parts(
        [rng.normal(mean + rng.normal(0, between), spread, 20) for _ in range(count)]
    )


def test_intervals_hold_the_distance_and_widen_with_clusters():
    rng = np.random.default_rng(1)
    reference = clustered(rng, 300)
    loose, tied = clustered(rng, 60, mean=1.0), clustered(rng, 60, mean=1.0, between=1.0)
    found = [compute_distance(s, reference, draws=300, rng=rng) for s in (loose, tied)]
    for each in found:
        assert each.low <= each.value <= each.high
    assert found[0].value == pytest.approx(1.0, abs=0.1)
    assert found[1].high - found[1].low > 3 * (found[0].high - found[0].low)
    assert (found[0].n, found[0].n_reference, found[0].clusters) == (1200, 6000, 60)


def test_resampling_one_cluster_each_gives_the_distance_itself():
    rng = np.random.default_rng(2)
    one, two = (
        ClusterSample.join_parts([rng.normal(0, 1, 500)]),
        ClusterSample.join_parts([rng.normal(1, 1, 500)]),
    )
    again = resample_distances(one, two, draws=3, rng=rng)
    assert again == pytest.approx(compute_wasserstein(one.values, two.values), abs=0.01)


def test_chance_falls_with_size_and_knows_clusters():
    rng = np.random.default_rng(3)
    loose, tied = clustered(rng, 200), clustered(rng, 200, between=1.0)
    small, large = (
        ClusterSample.join_parts([np.zeros(100)]),
        ClusterSample.join_parts([np.zeros(1600)]),
    )
    few, many = (compute_chance(s, loose, draws=100, rng=rng)[0] for s in (small, large))
    assert few > 2 * many
    assert compute_chance(large, tied, draws=100, rng=rng)[0] > 2 * many


def test_gain_is_the_share_of_the_distance_that_went():
    rng = np.random.default_rng(4)
    reference = clustered(rng, 400)
    far, near = (ClusterSample(reference.values + by, reference.cluster, 400) for by in (2.0, 0.5))
    found = compute_gain(far, near, reference, draws=200, rng=rng)
    assert found.value == pytest.approx(0.75)
    assert found.low < 0.75 < found.high
    assert compute_gain(far, far, reference, draws=50, rng=rng).value == pytest.approx(0.0)
    assert compute_gain(near, far, reference, draws=50, rng=rng).value == pytest.approx(-3.0)


def ride(*, speed=8.0, braking=2.0, wait=3.0, starting=1.0, cruise=3.0):
    """Arc length at 0.1 s: cruises, brakes, stands, starts, cruises."""
    down, up = speed / braking, speed / starting
    ends = np.cumsum([cruise, down, wait, up, cruise])
    t = np.arange(0, ends[-1], 0.001)
    v = np.select(
        [t < ends[0], t < ends[1], t < ends[2], t < ends[3]],
        [speed, speed - braking * (t - ends[0]), 0.0, starting * (t - ends[2])],
        speed,
    )
    return (np.cumsum(v) * 0.001)[::100]


def mover(s, *, shape=None, origin=(0.0, 0.0), heading=0.0):
    way = np.array([np.cos(heading), np.sin(heading)])
    track = Track(np.array(origin) + s[:, None] * way, np.full(len(s), heading), 0.0)
    return build_trajectory(RoadUser(1, track, shape or get_vehicle_shape()))


def test_a_stop_is_measured_as_it_was_driven():
    (stop,) = find_all_stops([mover(ride())], intersection_map=None)
    # At 0.3 m/s or less it stands: 0.15 s of the braking and 0.3 s of the starting.
    assert stop.duration == pytest.approx(3.45, abs=0.2)
    assert stop.braking == pytest.approx(2.0, abs=0.02)
    assert stop.starting == pytest.approx(1.0, abs=0.02)
    assert stop.mean_braking == pytest.approx(2.0, abs=0.1)
    assert stop.mean_starting == pytest.approx(1.0, abs=0.1)
    assert (stop.gap, stop.line_gap, stop.yields) == (None, None, False)


def test_what_the_scene_cuts_off_is_not_measured():
    whole = ride()
    standing = find_standstills(mover(whole))[0]
    (late,) = find_all_stops([mover(whole[: standing.start + 15])], intersection_map=None)
    assert (late.duration, late.starting) == (None, None)
    assert late.braking == pytest.approx(2.0, abs=0.02)
    assert not list(find_all_stops([mover(whole[standing.start + 5 :])], intersection_map=None))


@pytest.mark.parametrize("leg", ["north", "south", "east", "west"])
def test_the_gap_to_the_stop_line_is_from_the_front_bumper(intersection_map, leg):
    line = next(each for each in intersection_map.stop_lines if each.leg == leg)
    middle = np.array(line.line).mean(axis=0)
    bearing = next(each.bearing for each in intersection_map.legs if each.name == leg)
    inwards = -np.array([np.cos(bearing), np.sin(bearing)])
    length = get_vehicle_shape().length
    for gap in (0.5, 3.0):
        place = middle - inwards * (gap + length / 2)
        here = mover(np.zeros(9), origin=place, heading=bearing + np.pi)
        assert measure_line_gap(here, 4, intersection_map) == pytest.approx(gap, abs=1e-6)
    away = mover(np.zeros(9), origin=middle + inwards * 5.0, heading=bearing)
    assert (
        measure_line_gap(away, 4, intersection_map) is None
        or measure_line_gap(away, 4, intersection_map) < 1.0
    )
    assert (
        measure_line_gap(mover(np.zeros(9), shape=PEDESTRIAN, origin=middle), 4, intersection_map)
        is None
    )


def test_the_stop_of_who_was_asked_to_yield_is_found(intersection_map, yielding):
    scene = convert_scene(yielding.record)
    stops, yields = find_yield_stops(scene, intersection_map=intersection_map)
    assert scene.asked
    (asked,) = [stop for stop in stops if stop.asked]
    assert asked.type == "vehicle"
    assert 0.0 <= asked.gap < 10.0
    assert yields.seen >= yields.stood == len(stops) >= 1
    giver = next(user for user in scene.users if user.id == scene.asked[0][0])
    lengths = [(s.stop - s.start) * STEP for s in find_standstills(build_trajectory(giver))]
    assert any(asked.duration == pytest.approx(length) for length in lengths)


def with_another(scene):
    """The same scene with a second person who walks just as the one that is let pass."""
    walker = next(user for user in scene.users if user.id == scene.asked[0][1])
    track = replace(walker.track, xy=walker.track.xy + np.array([0.3, 0.3]))
    return replace(scene, users=(*scene.users, RoadUser(99, track, walker.shape)))


def test_who_lets_one_pass_is_distinguished_from_who_lets_several(intersection_map, yielding):
    scene = convert_scene(yielding.record)
    [stop] = [
        stop for stop in find_yield_stops(scene, intersection_map=intersection_map)[0] if stop.asked
    ]
    assert (stop.to, stop.alone) == ("pedestrian", True)
    [stop] = [
        stop
        for stop in find_yield_stops(with_another(scene), intersection_map=intersection_map)[0]
        if stop.asked
    ]
    assert (stop.to, stop.alone) == ("pedestrian", False)


def test_who_stands_once_for_several_counts_once(intersection_map, yielding):
    scene = convert_scene(yielding.record)
    several = with_another(scene)
    asked = [
        each
        for each in find_yield_cases([scene], intersection_map=intersection_map)
        if each.pair == ("vehicle", "pedestrian")
    ]
    twice = [
        each
        for each in find_yield_cases([several], intersection_map=intersection_map)
        if each.pair == ("vehicle", "pedestrian")
    ]
    assert len(asked) == len(twice)
    assert all(each.stood_at is not None for each in twice)
    found = fit_acceleration_profiles(asked * 20)["vehicle"]
    assert 1.0 < found.starts[0] < 2.6
    assert 1.5 < found.brakes[0] < 3.1
    assert "pedestrian" not in fit_acceleration_profiles(asked * 20)


def test_requests_are_the_same_for_any_refiner_and_mostly_yields():
    asked = list(list_requests(90))
    assert asked == list(list_requests(90))
    texts = [text for text, _ in asked]
    yields = [t for t in texts if any(t.startswith(y.split("{")[0]) for y in YIELDS)]
    assert len(yields) == 60
    assert len({text.split(" at ")[0] for text in texts}) == 11


def agent(xs, y, *, start=0.0, shape=None, subtype="car"):
    xy = np.column_stack([xs, np.full(len(xs), y)])
    return RecordedAgent(Track(xy, np.zeros(len(xs)), start), shape or get_vehicle_shape(), subtype)


def even_traffic(name, *, speed, seconds=61.0):
    """Vehicles one after the other and one walker, all at constant speed."""
    xs = np.arange(-30.0, 30.0, speed * STEP)
    cars = [agent(xs, -3.0, start=round(k * 12.0, 1)) for k in range(5)]
    walks = np.arange(-15.0, 15.0, 1.2 * STEP)
    walker = agent(walks, 20.0, shape=PEDESTRIAN, subtype=None)
    return Recording(name, 0.0, seconds, (*cars, walker), split="test", signal_time=4.0)


def test_scenes_cut_from_a_corpus_have_its_agents_and_its_lights(intersection_map):
    cut = list(cut_scenes([even_traffic("a", speed=8.0)], intersection_map=intersection_map))
    assert len(cut) == 2
    for k, (name, scene) in enumerate(cut):
        assert name == "a"
        assert all(u.track.start >= 0.0 and u.track.end <= 30.0 + 1e-9 for u in scene.users)
        for record in scene.signals:
            if record.stop_line is not None and record.colour == "green":
                at = (
                    4.0 + 30.0 * k + (record.start + record.end) / 2
                ) % intersection_map.signals.cycle
                assert _colour(intersection_map, record.stop_line, at) == "green"
        assert scene.signals
    assert [len(scene.users) for _, scene in cut] == [4, 3]


def _colour(intersection_map, stop_line, time):
    movement = next(m for m in intersection_map.movements if m.stop_line == stop_line)
    group = next(g.id for g in intersection_map.signals.groups if movement.id in g.movements)
    ends = np.cumsum([phase.duration for phase in intersection_map.signals.phases])
    return intersection_map.signals.phases[int(np.searchsorted(ends, time, side="right"))].colours[
        group
    ]


def test_motion_is_sorted_into_standing_moving_and_unimpeded():
    free = mover(np.arange(0.0, 80.0, 0.8))
    held = mover(ride())
    users = [
        RoadUser(k, Track(m.xy, m.heading, 0.0), get_vehicle_shape())
        for k, m in enumerate((free, held))
    ]
    clusters = list_scene_agents([SceneTracks(tuple(users))])
    both = measure_motion(clusters, MotionFilter("vehicle"), side=[True]).samples
    alone = measure_motion(
        clusters, MotionFilter("vehicle", doing="is never slow"), side=[True]
    ).samples
    assert len(both["speed, standing too"]) == len(free) + len(held) - 20
    assert both["speed"].values.min() > 0.3
    assert alone["speed"].values == pytest.approx(8.0)
    assert alone["spread of speed"].values == pytest.approx([0.0], abs=1e-9)
    assert (
        compute_steady_share(
            list_scene_agents([SceneTracks(tuple(users[:1]))]), MotionFilter("vehicle")
        )
        == 1.0
    )
    assert compute_steady_share(clusters, MotionFilter("pedestrian")) is None
    shares = compute_moving_shares(clusters)
    assert shares["is never slow"] + shares["stops and sets off"] == pytest.approx(1.0)
    near = measure_motion(clusters, MotionFilter("vehicle", within=20.0), side=[True]).samples
    assert len(near["speed, standing too"]) < len(both["speed, standing too"])


@pytest.mark.parametrize(
    ("speed", "stated"),
    [
        ([5.0, 4.0, 9.0], "is never slow"),
        ([5.0, 2.0, 9.0], "slows down"),
        ([5.0, 0.0, 0.4], "comes to stand"),
        ([0.4, 0.0, 7.0], "sets off"),
        ([5.0, 0.0, 7.0], "stops and sets off"),
        ([0.4, 0.0, 0.9], "stands"),
    ],
)
def test_agents_are_distinguished_by_what_they_do_in_view(speed, stated):
    assert classify_motion(np.array(speed), "vehicle") == stated


def test_motion_is_compared_in_the_shares_of_another_set():
    """Nine cars drive on and one stops; asked for half and half, eight of the nine count less."""
    driving, held = mover(np.arange(0.0, 80.0, 0.8)), mover(ride())
    users = [
        RoadUser(k, Track(m.xy, m.heading, 0.0), get_vehicle_shape())
        for k, m in enumerate([*[driving] * 9, held])
    ]
    clusters = list_scene_agents([SceneTracks(tuple(users))])
    rng = np.random.default_rng(0)
    halves = {"is never slow": 0.5, "stops and sets off": 0.5}
    found = sample_in_shares(
        clusters, halves, MotionFilter("vehicle"), side=[True], rng=rng
    ).samples
    only = MotionFilter("vehicle", doing="stops and sets off")
    moving = len(measure_motion(clusters, only, side=[True]).samples["acceleration"])
    assert len(found["acceleration"]) == len(found["jerk"]) == 2 * moving
    assert (np.abs(found["acceleration"].values) < 1e-9).sum() >= moving
    only = {"sets off": 1.0}
    nobody = sample_in_shares(clusters, only, MotionFilter("vehicle"), side=[True], rng=rng).samples
    assert len(nobody["acceleration"]) == 0


def test_bicycles_are_no_vehicles_of_ours():
    recording = Recording("r", 0.0, 9.0, (agent(np.arange(50.0), 0.0, subtype="bicycle"),))
    assert list_recorded_agents([recording]) == []


def test_parts_of_a_scene_are_distinguished(yielding):
    scene = convert_scene(yielding.record)
    whole, front, back = (
        len(list_scene_agents([scene], part=part)[0])
        for part in ("all", "foreground", "background")
    )
    assert front == 2
    assert front + back == whole


def test_the_corpus_against_itself_and_against_a_faster_one(intersection_map):
    corpus = [even_traffic("a", speed=8.0), even_traffic("b", speed=8.0)]
    same, fast = (
        [
            scene
            for _, scene in cut_scenes(
                [even_traffic("c", speed=v)], intersection_map=intersection_map
            )
        ]
        for v in (8.0, 10.0)
    )
    report = judge(
        {"fast": fast, "same": same}, corpus, intersection_map=intersection_map, draws=20
    )
    rows = {(r.topic, r.type, r.measure, r.scenes): r for r in report.rows}
    speed = rows["Motion", "vehicle", "speed", "fast"]
    assert speed.distance.value == pytest.approx(2.0, abs=0.01)
    assert speed.between_means == pytest.approx(2.0, abs=0.01)
    assert rows["Motion", "vehicle", "speed", "same"].distance.value < 0.01
    assert rows["Motion", "vehicle", "speed", "same"].gain.value == pytest.approx(1.0, abs=0.01)
    assert speed.gain is None
    assert speed.halves == pytest.approx(0.0, abs=1e-6)
    unknown = rows["Stops of yielding agents", "vehicle", "gap", "same"]
    assert unknown.distance is unknown.between_means is None
    between = [(r.distance, r.between_means) for r in report.rows if r.distance is not None]
    assert all(least <= d.value + 1e-9 for d, least in between if least is not None)
    assert json.loads(json.dumps(report.to_json(), allow_nan=False))["rows"]
    assert "| vehicle | speed | fast | 2.0" in report.format_markdown()
    assert report.facts["same: scenes"] == 2


def test_the_command_writes_tables_and_json(tmp_path, yielding, capsys):
    save_recordings(tmp_path / "c.npz", [even_traffic("a", speed=8.0)])
    yielding.save(tmp_path / "made" / "0001")
    out = tmp_path / "r.json"
    words = ["--corpus", str(tmp_path / "c.npz"), "--scenes", f"edited={tmp_path / 'made'}"]
    assert main([*words, "--draws", "5", "--out", str(out)]) == 0
    assert "Motion, against corpus" in capsys.readouterr().out
    kept = json.loads(out.read_text("utf-8"))
    assert kept["facts"]["edited: of these come to stand"] >= 1
    assert main(["--corpus", str(tmp_path / "none.npz"), "--scenes", "a=b"]) == 2
    assert main(["--corpus", str(tmp_path / "c.npz"), "--scenes", "nothing"]) == 2
    assert "NAME=FOLDER" in capsys.readouterr().err


def test_scenes_are_made_and_read_back(tmp_path):
    counts = make_scenes(tmp_path, 1, intersection="amsterdam_120")
    assert counts == {"made": 1, "unsatisfiable": 0}
    assert len(read_scenes(tmp_path)) == 1
