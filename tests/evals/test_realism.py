"""Distances of samples and scenes cut from a corpus, where the answers are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from scenewright.evals.realism.sources import cut_scenes
from scenewright.evals.tables.nearness import compare_with_reference, compute_distance
from scenewright.intersections import load_map
from scenewright.scene.track import PEDESTRIAN, STEP, Track, get_vehicle_shape
from scenewright.tools.track_io import RecordedAgent, Recording

values = st.lists(st.floats(-50, 50), min_size=1, max_size=30).map(np.array)


@pytest.fixture(scope="module")
def intersection_map():
    return load_map("amsterdam_120")


def measure(first, second):
    return compute_distance([first], [second], draws=2, rng=np.random.default_rng(0)).value


@given(values, values)
def test_the_distance_is_the_first_wasserstein_distance(first, second):
    found = measure(first, second)
    assert found == pytest.approx(stats.wasserstein_distance(first, second), abs=1e-9)
    assert found == pytest.approx(measure(second, first))


@given(values, st.floats(-20, 20))
def test_a_shift_is_as_far_as_it_shifts(first, by):
    assert measure(first, first + by) == pytest.approx(abs(by), abs=1e-9)
    assert measure(first, first) == 0.0


def test_without_values_there_is_no_distance():
    empty, one = [np.zeros(0), np.zeros(0)], [np.array([1.0, 2.0])]
    rng = np.random.default_rng(0)
    for pair in ((empty, one), (one, empty), ([], one)):
        assert compute_distance(*pair, draws=5, rng=rng).value is None


def clustered(rng, count, *, mean=0.0, spread=1.0, between=0.0):
    return [rng.normal(mean + rng.normal(0, between), spread, 20) for _ in range(count)]


def test_intervals_hold_the_distance_and_widen_with_clusters():
    rng = np.random.default_rng(1)
    reference = clustered(rng, 300)
    loose, tied = clustered(rng, 60, mean=1.0), clustered(rng, 60, mean=1.0, between=1.0)
    found = [compute_distance(s, reference, draws=300, rng=rng) for s in (loose, tied)]
    for each in found:
        assert each.low <= each.value <= each.high
    assert found[0].value == pytest.approx(1.0, abs=0.1)
    assert found[1].high - found[1].low > 3 * (found[0].high - found[0].low)
    assert found[0].n == 1200


def test_resampling_one_cluster_each_gives_the_distance_itself():
    rng = np.random.default_rng(2)
    one, two = [rng.normal(0, 1, 500)], [rng.normal(1, 1, 500)]
    found = compute_distance(one, two, draws=3, rng=rng)
    assert (found.low, found.high) == pytest.approx((found.value, found.value), abs=0.01)


def test_a_measure_is_compared_with_its_reference_and_its_halves():
    rng = np.random.default_rng(3)
    key = ("speed", "vehicle")
    ours, reference = {key: clustered(rng, 60)}, {key: [*clustered(rng, 300), np.zeros(0)]}
    (found,) = compare_with_reference(ours, reference, named="corpus", draws=5, seed=0)
    assert (found.scenes, found.distance.n, found.n_reference) == (60, 1200, 6000)
    even, odd = (np.concatenate(reference[key][half::2]) for half in (0, 1))
    assert found.halves == pytest.approx(stats.wasserstein_distance(even, odd))
    assert found.quantiles[1] == pytest.approx(0.0, abs=0.2)


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
    for k, scene in enumerate(cut):
        assert {name.split(":")[0] for name in scene.groups.values()} == {"a"}
        assert all(u.track.start >= 0.0 and u.track.end <= 30.0 + 1e-9 for u in scene.users)
        for record in scene.signals:
            if record.stop_line is not None and record.colour == "green":
                at = (
                    4.0 + 30.0 * k + (record.start + record.end) / 2
                ) % intersection_map.signals.cycle
                assert _colour(intersection_map, record.stop_line, at) == "green"
        assert scene.signals
    assert [len(scene.users) for scene in cut] == [4, 3]


def _colour(intersection_map, stop_line, time):
    movement = next(m for m in intersection_map.movements if m.stop_line == stop_line)
    group = next(g.id for g in intersection_map.signals.groups if movement.id in g.movements)
    ends = np.cumsum([phase.duration for phase in intersection_map.signals.phases])
    return intersection_map.signals.phases[int(np.searchsorted(ends, time, side="right"))].colours[
        group
    ]
