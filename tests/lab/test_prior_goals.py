"""Goals from the priors: on the way that they expect, in their time, and without the track."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest

import map_files
from lab.rollouts.left_out import fit_left_out_routes
from lab.rollouts.prior_goals import (
    find_abreast,
    load_bundle_routes,
    sample_continuations,
)
from lab.rollouts.rollout_tasks import (
    SPACING,
    build_tasks,
    move_goals_to_prior,
    sample_prior_goals,
)
from scenewright.errors import InputError
from scenewright.scene.track import Track, get_vehicle_shape
from scenewright.tools.gmm_sampler import load_priors
from scenewright.tools.map_import import import_map
from scenewright.tools.track_io import RecordedAgent, Recording
from scenewright.tools.track_io.taf_bw import read_taf_bw

ROUTE = "vehicle:south>north:straight"
SITE = "k9_2020-01-01"
HEADER = "track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,psi_rad,length,width\n"


def recording(*, beside: float = 0.4, speed: float = 8.0) -> Recording:
    """A car beside the likeliest way of a route, at even speed."""
    prior = load_priors("amsterdam_120").waypoints[ROUTE]
    base = prior.base[prior.weights.argmax()]
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(base, axis=0).T))])
    at = np.arange(0.0, s[-1], speed * 0.1)
    xy = np.stack([np.interp(at, s, base[:, axis]) for axis in (0, 1)], axis=1)
    ahead = np.gradient(xy, axis=0)
    ahead /= np.hypot(*ahead.T)[:, None]
    xy = xy + beside * np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    track = Track(xy, np.zeros(len(xy)), 0.0)
    agent = RecordedAgent(track, get_vehicle_shape("car"), "car", route=ROUTE)
    return Recording("here", 0.0, 30.0, (agent,))


def the_way():
    return load_bundle_routes("amsterdam_120")(recording(), recording().agents[0])


def test_the_expected_way_runs_on_beside_the_middle_as_it_began():
    xy = recording().agents[0].track.xy[::4]
    found = find_abreast(the_way(), xy[:9], xy)
    assert np.hypot(*(found - xy)[9:15].T).max() < 0.15
    assert np.hypot(*(found - xy).T).max() < 0.8


def test_draws_go_on_from_the_place_and_speed_last_seen_until_they_leave_the_map():
    xy = recording().agents[0].track.xy[::4]
    rng = np.random.default_rng(3)
    drawn = sample_continuations(the_way(), xy[:9], steps=60, size=8, rng=rng)
    first = np.hypot(*(drawn[:, 0] - xy[8]).T)
    assert (np.abs(first - 8.0 * 0.4) < 0.8).all()
    assert np.isnan(drawn[:, -1]).all()
    steps = np.hypot(*np.diff(drawn, axis=1).transpose(2, 0, 1))
    assert np.nanmax(steps) < 20.0 * 0.4
    assert len({round(float(row[5, 1]), 6) for row in drawn}) == 8


def test_no_goal_of_the_prior_knows_how_the_track_went_on():
    way_of = load_bundle_routes("amsterdam_120")
    (task,) = build_tasks([recording()], before_end=0, most=1, way_of=way_of)
    rng = np.random.default_rng(0)
    draws = list(sample_prior_goals(task, size=3, rng=rng))
    later = np.where(task.given[..., None], task.xy, task.xy + 7.0)
    other = list(sample_prior_goals(task._replace(xy=later, goals=later), size=3,
                                   rng=np.random.default_rng(0)))  # fmt: skip
    for one, two in zip(draws, other, strict=True):
        assert np.array_equal(one.goals, two.goals, equal_nan=True)
        marked = np.flatnonzero(np.isfinite(one.goals[0, :, 0]))
        assert marked[0] == int(task.given[0].sum()) - 1 + SPACING


def test_goals_on_the_priors_way_are_due_when_the_true_ones_are_and_lie_beside_them():
    way_of = load_bundle_routes("amsterdam_120")
    (task,) = build_tasks([recording(beside=1.0)], before_end=2, most=1, way_of=way_of)
    moved = move_goals_to_prior(task)
    due = np.isfinite(task.goals)
    assert np.array_equal(due, np.isfinite(moved.goals))
    off = np.hypot(*(moved.goals - task.goals)[0][due[0, :, 0]].T)
    assert 0.01 < off.max() < 1.5
    assert np.array_equal(moved.xy, task.xy, equal_nan=True)


def test_who_has_no_route_is_seen_and_not_asked_for():
    there = recording()
    unknown = replace(there, agents=(replace(there.agents[0], route=None),))
    assert not list(
        build_tasks([unknown], before_end=2, most=1, way_of=load_bundle_routes("amsterdam_120"))
    )


# ---- priors without the recording ----------------------------------------------------------------


def write(folder, number, line, beside):
    """A recording of four cars along a line, so far beside it."""
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    at = np.arange(20.0, s[-1] - 20.0, 0.8)
    xy = np.stack([np.interp(at, s, line[:, axis]) for axis in (0, 1)], axis=1)
    ahead = np.gradient(xy, axis=0)
    xy += beside * np.stack([-ahead[:, 1], ahead[:, 0]], axis=1) / np.hypot(*ahead.T)[:, None]
    rows = [
        f"{n},{k},{1000 * 20 * n + 100 * k},Car,{x:.3f},{y:.3f},0,0,0,4,2\n"
        for n in range(4)
        for k, (x, y) in enumerate(xy)
    ]
    (folder / f"vehicle_tracks_{number:03d}.csv").write_text(HEADER + "".join(rows))


@pytest.fixture
def site(tmp_path):
    """A map and three recordings, the last one beside the others."""
    (tmp_path / "maps").mkdir()
    (tmp_path / SITE).mkdir()
    file = map_files.lanelet2(tmp_path / "maps" / f"{SITE}.osm")
    line = np.asarray(import_map(file, name="k9").route_lines[ROUTE][0])
    for number, beside in enumerate((0.2, 0.4, 1.0)):
        write(tmp_path / SITE, number, line, beside)
    return tmp_path, line


def means(folder):
    """By recording, the expected waypoints of its first agent's way."""
    way_of = fit_left_out_routes(folder)
    ways = {r.name: way_of(r, r.agents[0]) for r in read_taf_bw(folder).recordings}
    assert {way.route.id for way in ways.values()} == {ROUTE}
    return {name: way.prior.means[0] for name, way in ways.items()}


def test_a_recordings_prior_is_fitted_on_the_others_alone(site):
    folder, line = site
    before = means(folder)
    write(folder / SITE, 2, line, -0.6)
    after = means(folder)
    assert np.array_equal(before[f"{SITE}/002"], after[f"{SITE}/002"])
    assert np.abs(before[f"{SITE}/000"] - after[f"{SITE}/000"]).max() > 0.1


def test_recordings_of_one_session_are_moved_alike_about_origins_of_their_own(site):
    """Two origins of the same place: the same way, in either frame."""
    folder, line = site
    lat, lon = map_files.ORIGIN
    north = 7.0
    there = [lat, lat, lat + north / 6_378_137.0 * 180.0 / np.pi]
    rows = "".join(f"{n:03d},{at:.12f},{lon},12:00:00\n" for n, at in enumerate(there))
    (folder / SITE / "meta_data.csv").write_text("id,originLat,originLon,startTime\n" + rows)
    write(folder / SITE, 2, line - (0.0, north), 0.4)
    found = means(folder)
    moved = (found[f"{SITE}/002"] - found[f"{SITE}/000"]).reshape(-1, 2)
    assert moved[:, 1] == pytest.approx(-north, abs=0.2)
    assert np.abs(moved[:, 0]).max() < 0.2


def test_a_recording_found_twice_is_refused_as_none_would_be_left_out(site):
    folder, _ = site
    (folder / "copy").mkdir()
    shutil.copytree(folder / SITE, folder / "copy" / SITE)
    with pytest.raises(InputError, match="twice"):
        fit_left_out_routes(folder)


def test_a_corpus_of_another_intersection_is_one_clear_line():
    there = recording()
    foreign = replace(there.agents[0], route="vehicle:up>down:straight")
    with pytest.raises(InputError, match="not of amsterdam_120"):
        load_bundle_routes("amsterdam_120")(there, foreign)


def test_a_site_without_a_map_or_with_one_recording_is_one_clear_line(site):
    folder, _ = site
    for number in (1, 2):
        (folder / SITE / f"vehicle_tracks_{number:03d}.csv").unlink()
    with pytest.raises(InputError, match="only recording of k9"):
        fit_left_out_routes(folder)
    (folder / "maps" / f"{SITE}.osm").unlink()
    with pytest.raises(InputError, match=r"no map k9_<date>\.osm"):
        fit_left_out_routes(folder)
