"""The shipped bundle as it is built: its map, demand and priors."""

import numpy as np
import pytest

from lab.bundle.build_bundle import build_bundle, main
from lab.bundle.corpus_hours import CorpusHour
from lab.bundle.derive_demand import derive_demand
from lab.bundle.fit_priors import count_present, fit_waypoints
from lab.bundle.four_leg_map import build_map
from scenewright.errors import InputError
from scenewright.intersections import load_map
from scenewright.tools.fitting.path_frame import FLOOR
from scenewright.tools.gmm_sampler import compute_waypoint_nll
from scenewright.tools.simulation.corpus import resample_path
from scenewright.tools.simulation.sumo_run import Demand

NAME = "amsterdam_120"


def test_the_shipped_map_is_what_the_builder_makes():
    assert build_map() == load_map(NAME)


def test_fitting_finds_two_lanes():
    rng = np.random.default_rng(6)
    x = np.linspace(-50.0, 50.0, 201)
    lanes = rng.choice([1.65, 4.95], 300) + rng.normal(0, 0.3, 300)
    paths = [np.stack([x, np.full_like(x, lane)], axis=1) for lane in lanes]
    prior = fit_waypoints("test", paths)
    assert len(prior.weights) == 2
    assert sorted(prior.means[:, 1]) == pytest.approx([1.65, 4.95], abs=0.1)
    smallest = min(np.linalg.eigvalsh(c @ c.T).min() for c in prior.cholesky)
    assert smallest >= 0.99 * FLOOR**2


def test_fitting_survives_few_tracks():
    x = np.linspace(-50.0, 50.0, 201)
    paths = [np.stack([x, np.full_like(x, y)], axis=1) for y in (0.0, 0.2, 0.4)]
    prior = fit_waypoints("test", paths, most=1)
    assert np.isfinite(
        compute_waypoint_nll(prior, np.array([resample_path(p) for p in paths]))
    ).all()


def test_presence_counts_who_is_inside_at_any_time_of_the_window():
    presence = np.array([[0, 5.0, 35.0], [0, 29.0, 30.5], [1, 61.0, 62.0]])
    counts = count_present(CorpusHour(0, 0, (), presence), 30.0)
    assert counts[:3].tolist() == [[2, 0], [2, 0], [0, 1]]


def test_each_hour_of_the_day_is_in_each_split_once():
    splits = [[CorpusHour(d, h, (), np.zeros((0, 3))).split for d in range(3)] for h in range(24)]
    assert all(set(days) == {"fit", "validation", "test"} for days in splits)


def test_demand_comes_from_the_named_streets(tmp_path):
    head = "ID,Segment ID,Roadway Name,From,To,Direction,Date," + ",".join("h" * 24)
    rows = [head]
    for road, start, end, ways in (
        ("AMSTERDAM AVE ", " WEST 118 ST", "WEST 119 ST", ("NB", "SB")),
        ("Morningside Drive", "120 STREET", "121 STREET", ("EB", "WB")),
    ):
        for way in ways:
            rows += [
                f"1,1,{road},{start},{end},{way},10/0{d}/2012," + ",".join(["9"] * 24)
                for d in (1, 2)
            ]
            rows.append(f"1,1,{road},{start},{end},{way},10/06/2012," + ",".join(["999"] * 24))
    (tmp_path / "Traffic_Volume_Counts_x.csv").write_text("\n".join(rows))
    with pytest.raises(InputError, match="pedestrian"):
        derive_demand(tmp_path)
    (tmp_path / "ped").mkdir()
    lines = ["SIGNAL,TIME1,TDIFF,DIR,PED"]
    lines += [f"7,2019-01-28 {h:02d}:00:00,60.0,N,4" for h in range(24)]
    (tmp_path / "ped" / "dat.csv").write_text("\n".join(lines))
    demand = derive_demand(tmp_path)
    assert demand.vehicles["south"] == (9.0,) * 24
    assert demand.pedestrians == (8.0,) * 24
    assert isinstance(demand, Demand)


def test_building_refuses_what_it_cannot_do(tmp_path):
    with pytest.raises(InputError, match="no plan"):
        build_bundle("nowhere", out=tmp_path / "out")
    with pytest.raises(InputError, match="3 days"):
        build_bundle(NAME, out=tmp_path / "out", days=1)
    with pytest.raises(InputError, match="Traffic_Volume"):
        build_bundle(NAME, out=tmp_path / "out", counts=tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write"):
        build_bundle(NAME, out=tmp_path / "file" / "out")
    assert not (tmp_path / "out").exists()


def test_an_unknown_plan_is_one_line(tmp_path, capsys):
    assert main(["nowhere", "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
