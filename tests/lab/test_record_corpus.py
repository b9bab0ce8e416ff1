"""Recorded hours of the corpus: which, with whom, and until when."""

from collections import Counter

import numpy as np
import pytest

from lab.bundle import record_corpus
from lab.bundle.corpus_hours import assign_split, simulate_raw_hour, spawn_hour_seeds
from lab.bundle.four_leg_plan import PLANS
from lab.bundle.record_corpus import main, record_hour, record_traffic, spread_hours
from scenewright.errors import InputError
from scenewright.intersections import find_bundle_folder, load_map
from scenewright.tools.simulation.corpus import build_footways, clean_trip
from scenewright.tools.simulation.sumo_run import WARM_UP, read_demand
from scenewright.tools.track_io import load_recordings

NAME = "amsterdam_120"


@pytest.mark.parametrize("count", [3, 4, 12, 15, 16, 24, 48, 71, 72])
def test_every_split_gets_hours_of_its_own_over_the_day(count):
    hours = spread_hours(count)
    assert len(set(hours)) == count
    splits = Counter(assign_split(*each) for each in hours)
    assert set(splits) == {"fit", "validation", "test"}
    assert splits["fit"] >= splits["test"] >= splits["validation"]
    for split, n in splits.items():
        own = sorted(hour for day, hour in hours if assign_split(day, hour) == split)
        assert max(np.diff([*own, own[0] + 24])) <= 24 / n + 1


def test_fifteen_hours_have_four_to_test_on():
    assert Counter(assign_split(*each) for each in spread_hours(15))["test"] == 4


@pytest.mark.parametrize("count", [2, 73])
def test_a_number_of_hours_that_cannot_be_is_refused(count):
    with pytest.raises(InputError, match=str(count)):
        spread_hours(count)


def test_an_unknown_place_is_refused(tmp_path):
    with pytest.raises(InputError, match="nowhere"):
        record_traffic("nowhere", out=tmp_path / "c.npz")


@pytest.fixture(scope="module")
def quiet_hour():
    """The same hour as a recording and as trips."""
    pytest.importorskip("sumo")
    plan, place = PLANS[NAME], load_map(NAME)
    demand = read_demand(find_bundle_folder(NAME) / "demand.json")
    seed = spawn_hour_seeds(0)[2, 3]
    options = {"plan": plan, "intersection_map": place, "demand": demand}
    made = record_hour(2, 3, rng=np.random.default_rng(seed), **options)
    rng = np.random.default_rng(seed)
    raw, _ = simulate_raw_hour(3, rng=rng, **options)
    trips = []
    for track in raw:
        half = plan.extent if track.subtype else plan.pedestrian_extent
        trips += clean_trip(track, half, build_footways(place), rng)
    return made, trips


def test_every_trip_of_the_corpus_is_in_the_recording_with_its_times(quiet_hour):
    made, trips = quiet_hour
    ours = {(a.route, a.track.start): a.track for a in made.agents if a.complete}
    assert len(ours) == len(trips) > 150
    for trip in trips:
        track = ours[trip.route, round(trip.start, 1)]
        assert len(track.xy) == len(trip.progress)
        assert np.linalg.norm(track.xy[0] - trip.path[0]) <= trip.progress[0] + 1e-6


def test_everybody_is_labelled_and_inside_the_map(quiet_hour):
    made, _ = quiet_hour
    place = load_map(NAME)
    routes = {route.id: route for route in place.routes}
    assert made.split == "test"
    for each in made.agents:
        route = routes[each.route]
        assert (each.entry, each.exit, each.shape.type) == (route.entry, route.exit, route.type)
        assert np.abs(each.track.xy).max() <= place.extent + 0.5


def test_nobody_enters_the_junction_at_red(quiet_hour):
    made, _ = quiet_hour
    place = load_map(NAME)
    assert made.signal_time == WARM_UP % place.signals.cycle
    movements = {m.id: m for m in place.movements}
    lines = {line.id: np.array(line.line).mean(axis=0) for line in place.stop_lines}
    groups = {m: g.id for g in place.signals.groups for m in g.movements}
    red = seen = 0
    for each in made.agents:
        movement = movements.get(each.route.removeprefix("vehicle:"))
        if movement is None or not each.complete:
            continue
        line = lines[movement.stop_line]
        inward = -line / np.linalg.norm(line)
        front = each.track.xy + each.shape.length / 2 * np.column_stack(
            [np.cos(each.track.heading), np.sin(each.track.heading)]
        )
        past = (front - line) @ inward > 0.0
        time = float(each.track.times[int(np.argmax(past))]) + made.signal_time
        left = time % place.signals.cycle
        for phase in place.signals.phases:
            if left < phase.duration:
                red += phase.colours[groups[movement.id]] == "red"
                break
            left -= phase.duration
        seen += 1
    assert seen > 100
    assert red == 0


def test_a_corpus_is_written_and_read(tmp_path, monkeypatch, capsys):
    pytest.importorskip("sumo")
    monkeypatch.setattr(record_corpus, "spread_hours", lambda _: [(2, 3)])
    out = tmp_path / "c.npz"
    assert main([NAME, "--out", str(out)]) == 0
    assert capsys.readouterr().out == f"{out}\n"
    (kept,) = load_recordings(out, split="test")
    assert len(kept.agents) > 150
    assert kept.name.endswith("hour 03")


def test_the_command_refuses_what_cannot_be(tmp_path, capsys):
    out = ["--out", str(tmp_path / "c.npz")]
    assert main([NAME, *out, "--hours", "2"]) == 2
    assert main(["nowhere", *out]) == 2
    assert "got 2" in capsys.readouterr().err
    assert not (tmp_path / "c.npz").exists()
