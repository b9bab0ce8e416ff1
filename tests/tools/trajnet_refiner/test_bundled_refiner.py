"""The refiner that a bundle ships: which weights are taken, and which are refused."""

from __future__ import annotations

import hashlib
import shutil

import pytest
import torch

from scenewright.errors import InputError
from scenewright.graph.arguments import find_refiner_gap
from scenewright.intersections import REFINER_WEIGHTS, find_bundle_folder
from scenewright.nodes.trajectory_refiner import NO_WEIGHTS
from scenewright.tools.trajnet_refiner.bundled import find_refiner, load_bundled_refiner
from scenewright.tools.trajnet_refiner.config import RefinerConfig
from scenewright.tools.trajnet_refiner.model import Refiner
from scenewright.tools.trajnet_refiner.store import save_refiner

NAME = "own_corner"
SMALL = RefinerConfig(hidden=8, embedding=8, pooled=8, neighbours=2, apart=None, mirrored=False)
FIGURES = {"pedestrian_n": 90.0, "pedestrian_ade_alone": 0.6, "pedestrian_ade_even": 0.7}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A bundle of one's own with the shipped map and no refiner."""
    monkeypatch.setenv("SCENEWRIGHT_INTERSECTIONS", str(tmp_path))
    found = tmp_path / NAME
    found.mkdir()
    shutil.copy(find_bundle_folder("amsterdam_120") / "map.json", found)
    return found


def put(folder, seed: int, *, listed: bool = True) -> str:
    """Weights drawn from a seed, and bundle.toml to match; their checksum."""
    torch.manual_seed(seed)
    save_refiner(SMALL, Refiner(SMALL).list_weights(), folder / REFINER_WEIGHTS)
    digest = hashlib.sha256((folder / REFINER_WEIGHTS).read_bytes()).hexdigest()
    if listed:
        text = f'format = 1\n[sha256]\n"{REFINER_WEIGHTS}" = "{digest}"\n'
        (folder / "bundle.toml").write_text(text, "utf-8")
    return digest


def test_a_bundle_without_weights_has_no_refiner(folder):
    assert load_bundled_refiner(NAME) is None


def test_the_weights_are_read_once_and_again_when_they_change(folder):
    first = put(folder, 1)
    learned = load_bundled_refiner(NAME)
    assert learned is load_bundled_refiner(NAME)
    assert first.startswith(learned.digest)
    second = put(folder, 2)
    assert second.startswith(load_bundled_refiner(NAME).digest)


def test_weights_other_than_the_bundle_lists_are_refused(folder):
    put(folder, 1)
    put(folder, 2, listed=False)
    with pytest.raises(InputError, match=rf"{REFINER_WEIGHTS} of '{NAME}' does not match"):
        load_bundled_refiner(NAME)


def test_weights_that_were_changed_after_they_were_read_are_refused(folder):
    put(folder, 1)
    assert load_bundled_refiner(NAME) is not None
    file = folder / REFINER_WEIGHTS
    whole = bytearray(file.read_bytes())
    whole[-1] ^= 1
    file.write_bytes(whole)
    with pytest.raises(InputError, match="checksum"):
        load_bundled_refiner(NAME)


def test_a_file_that_is_no_weights_is_refused_even_if_listed(folder):
    put(folder, 1)
    (folder / REFINER_WEIGHTS).write_bytes(b"nothing of the kind")
    digest = hashlib.sha256(b"nothing of the kind").hexdigest()
    (folder / "bundle.toml").write_text(f'[sha256]\n"{REFINER_WEIGHTS}" = "{digest}"\n', "utf-8")
    with pytest.raises(InputError, match="not a safetensors file"):
        load_bundled_refiner(NAME)


def test_the_shipped_refiner_is_the_one_that_its_bundle_lists():
    learned = load_bundled_refiner("amsterdam_120")
    assert learned is not None
    assert len(learned.digest) == 16


def test_a_card_says_where_nobody_could_be_tried() -> None:
    from scenewright.tools.trajnet_refiner.bundle_training import compute_figures, format_card

    net = load_bundled_refiner("amsterdam_120").net
    found = compute_figures(net, [])
    assert found == {"pedestrian_n": 0.0, "vehicle_n": 0.0}
    hours: dict[str, list[str]] = {"fit": [], "validation": [], "test": []}
    about = {"intersection": "amsterdam_120", "hours": hours, "command": "x", "started": False}
    about |= {"windows": 0, "recipe": {"epochs": 1, "seed": 0}, "losses": [], "figures": found}
    assert "| vehicle | 0 | – | – | – | – |" in format_card(net.config, about)


def test_an_intersection_without_weights_is_served_by_the_shipped_ones(folder):
    served = find_refiner(NAME)
    assert served is not None
    assert (served.place, served.digest) == (
        "amsterdam_120",
        load_bundled_refiner("amsterdam_120").digest,
    )


def test_an_intersections_own_weights_come_first(folder):
    own = put(folder, 1)
    assert own.startswith(find_refiner(NAME).digest)


def test_where_no_weights_serve_a_line_says_so(folder, monkeypatch):
    monkeypatch.setattr("scenewright.graph.arguments.ships_refiner", lambda _: False)
    assert find_refiner_gap(NAME, "trajnet") == NO_WEIGHTS
    assert find_refiner_gap(NAME, "none") is None


@pytest.mark.parametrize(
    ("about", "walks"),
    [
        ({}, False),
        ({"figures": FIGURES}, False),  # of simulated people
        ({"walkers_figures": FIGURES}, True),
        ({"walkers_figures": FIGURES | {"pedestrian_ade_alone": 0.9}}, False),
        ({"command": "scenewright intersections fit x --train", "figures": FIGURES}, True),
    ],
)
def test_weights_move_pedestrians_only_if_they_predict_real_ones(folder, about, walks):
    save_refiner(SMALL, Refiner(SMALL).list_weights(), folder / REFINER_WEIGHTS, about=about)
    assert load_bundled_refiner(NAME).walks == walks


def test_the_shipped_weights_move_no_pedestrians():
    assert not load_bundled_refiner("amsterdam_120").walks
