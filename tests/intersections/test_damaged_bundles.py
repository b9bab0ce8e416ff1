"""A bundle whose numbers cannot be is one line of why, never a scene and never a traceback."""

from __future__ import annotations

import json
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenewright.arrays import read_arrays
from scenewright.errors import InputError
from scenewright.intersections import find_bundle_folder, load_map
from scenewright.tools.gmm_sampler import load_priors

Arrays = dict[str, Any]


@pytest.fixture
def bundle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the shipped bundle's map and priors, without checksums."""
    folder = tmp_path / "mine"
    folder.mkdir()
    for name in ("map.json", "priors.npz"):
        shutil.copy(find_bundle_folder("amsterdam_120") / name, folder / name)
    monkeypatch.setenv("SCENEWRIGHT_INTERSECTIONS", str(tmp_path))
    return folder


def put(name: str, change: Callable[[Any], Any]) -> Callable[[Arrays], None]:
    def damage(arrays: Arrays) -> None:
        arrays[name] = change(arrays[name].copy())

    return damage


def poison(value: float) -> Callable[[Any], Any]:
    def change(array: Any) -> Any:
        array.reshape(-1)[0] = value
        return array

    return change


@pytest.mark.parametrize(
    ("damage", "told"),
    [
        (put("means", poison(np.nan)), "NaN or infinity"),
        (put("means", poison(1e9)), "m away"),
        (put("means", lambda a: a[:0]), "other shapes"),
        (put("means", lambda a: a[:, :10]), "other shapes"),
        (put("base", lambda a: a[:, :1]), "have the shape"),
        (put("cholesky", poison(-1.0)), "spread of"),
        (put("weights", lambda a: a * 0), "weights of"),
        (put("counts_means", poison(1e8)), "agents"),
        (put("counts_components", lambda a: a[:5]), "shapes|hours"),
        (put("laws", poison(0.0)), "cannot be"),
        (put("frequency", lambda a: a[:, :3]), "has the shape"),
        (put("routes", lambda a: a[:2]), "cannot read the priors"),
        (lambda arrays: arrays.pop("laws"), "cannot read the priors"),
    ],
)
def test_arrays_that_cannot_be_priors_are_refused(
    bundle: Path, damage: Callable[[Arrays], object], told: str
) -> None:
    file = bundle / "priors.npz"
    with np.load(file) as stored:
        arrays = dict(stored)
    damage(arrays)
    np.savez(file, **arrays)
    with pytest.raises(InputError, match=told):
        load_priors("mine")


@pytest.mark.parametrize("size", [0, 30, 5000, -1])
def test_a_file_that_was_cut_off_is_refused(bundle: Path, size: int) -> None:
    file = bundle / "priors.npz"
    file.write_bytes(file.read_bytes()[:size])
    with pytest.raises(InputError, match="cannot read the priors"):
        load_priors("mine")


def test_a_small_file_that_unpacks_to_much_is_not_unpacked(tmp_path: Path) -> None:
    file = tmp_path / "bomb.npz"
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("zeros.npy", bytes(3_000_000))
    assert file.stat().st_size < 5_000
    with pytest.raises(InputError, match="unpack to 3,000,000 bytes"):
        read_arrays(file, what="it", most_bytes=1_000_000)


def test_an_array_that_claims_more_than_there_is_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "claims.npz"
    np.savez(file, a=np.zeros(4))
    with zipfile.ZipFile(file) as archive:
        data = archive.read("a.npy").replace(b"(4,)", b"(4" + b"0" * 15 + b",)")
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("a.npy", data)
    with pytest.raises(InputError, match="cannot read it"):
        read_arrays(file, what="it")


@pytest.mark.parametrize("count", [0, 1, 2, 12, 13])
def test_a_lane_of_few_points_has_no_curvature(count: int) -> None:
    from scenewright.tools.map_import.survey_lanes import _measure_curvature

    line = np.stack((np.arange(count) * 0.5, np.zeros(count)), axis=1)
    assert _measure_curvature(line).tolist() == [0.0] * count


@pytest.mark.parametrize(
    ("forge", "told"),
    [
        (lambda m: m["lanelets"][0].update(width=float("nan")), "width of lanelet"),
        (lambda m: m["lanelets"][0].update(speed_limit=-3.0), "speed limit"),
        (lambda m: m["lanelets"][0]["centreline"].__setitem__(0, [1e9, 0.0]), "no place"),
        (lambda m: m["lanelets"][0].update(centreline=[[0.0, 0.0]]), "needs 2"),
        (lambda m: m["crosswalks"][0].update(polygon=[]), "needs 3"),
        (lambda m: m.update(extent=0.0), "extent"),
        (
            lambda m: m["signals"]["groups"][0].update(movements=["up>down"]),
            "are for 'up>down', which",
        ),
        (lambda m: m["signals"]["groups"][0].update(crosswalks=["x"]), "are for 'x', which"),
        (lambda m: m["signals"]["phases"][0].update(colours={}), "has no colour for"),
    ],
)
def test_a_map_that_cannot_be_is_refused(
    bundle: Path, forge: Callable[[dict[str, Any]], object], told: str
) -> None:
    file = bundle / "map.json"
    content = json.loads(file.read_bytes())
    forge(content)
    file.write_text(json.dumps(content))
    with pytest.raises(InputError, match=told):
        load_map("mine")
