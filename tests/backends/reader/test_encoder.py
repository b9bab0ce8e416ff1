"""The encoder in numpy computes what the trained network computes."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest
import torch

from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.reader.encoder import (
    OWN_WEIGHTS,
    Encoder,
    load_encoder,
    load_encoder_weights,
    quantize,
)
from scenewright.backends.builtin.reader.reading import read_text
from scenewright.backends.builtin.training.fit import export_weights, load_exported
from scenewright.backends.builtin.training.model import ReaderNetwork
from scenewright.errors import InputError


@pytest.fixture(scope="module")
def networks(tmp_path_factory: pytest.TempPathFactory) -> tuple[ReaderNetwork, Encoder]:
    torch.manual_seed(0)
    file = tmp_path_factory.mktemp("weights") / "reader.safetensors"
    network = ReaderNetwork().eval()
    export_weights(network.state_dict(), file)
    from safetensors.numpy import load_file

    weights = load_file(file)
    load_exported(network, weights)
    return network, Encoder(weights)


def test_both_encode_alike(networks: tuple[ReaderNetwork, Encoder]) -> None:
    network, encoder = networks
    ids, parts = np.array([101, 1037, 2482, 3216, 102]), np.array([0, 0, 0, 1, 1])
    with torch.no_grad():
        mask = torch.ones(1, 5, dtype=torch.bool)
        theirs = network.encode(torch.tensor(ids)[None], torch.tensor(parts)[None], mask)[0]
        tags = torch.log_softmax(network.tags(theirs), -1)
    ours = encoder.encode(ids, parts)
    assert np.abs(ours - theirs.numpy()).max() < 1e-3
    assert np.abs(encoder.compute_head("tags", ours) - tags.numpy()).max() < 1e-3


def test_both_score_links_alike(networks: tuple[ReaderNetwork, Encoder]) -> None:
    network, encoder = networks
    rng = np.random.default_rng(1)
    spans, users = rng.normal(size=(2, 4, 384)).astype(np.float32)
    distances = np.array([0, 3, 8, 15])
    with torch.no_grad():
        theirs = torch.log_softmax(
            network.score_links(*map(torch.tensor, (spans, users, distances))), -1
        )
    assert np.abs(encoder.score_links(spans, users, distances) - theirs.numpy()).max() < 1e-3


def test_a_quantized_matrix_is_near_its_values() -> None:
    value = np.random.default_rng(2).normal(size=(5, 100)).astype(np.float32)
    kept, scale = quantize(value)
    assert np.abs(kept * scale[:, None] - value).max() <= scale.max() / 2 + 1e-6


def test_a_text_longer_than_the_encoder_is_refused() -> None:
    with pytest.raises(Refused):
        read_text("x1 " * 600)


def test_threads_read_what_one_thread_reads() -> None:
    texts = [
        f"A car from the {side} hits {n} buses" for side in ("north", "east") for n in range(3)
    ]
    alone = [read_text(text) for text in texts]
    found: dict[int, list[object]] = {}

    def work(number: int) -> None:
        found[number] = [read_text(text) for text in texts]

    threads = [threading.Thread(target=work, args=(n,)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(each == alone for each in found.values())


def test_weights_of_ones_own_are_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(OWN_WEIGHTS, str(tmp_path / "none.safetensors"))
    with pytest.raises(InputError, match="no file of planner weights"):
        load_encoder_weights()


def test_the_packages_weights_are_small() -> None:
    assert sum(each.nbytes for each in load_encoder_weights().values()) <= 30_000_000
    assert load_encoder() is load_encoder()


def test_own_weights_for_other_labels_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from safetensors.numpy import save_file

    file = tmp_path / "mine.safetensors"
    save_file({"label.weight": np.zeros((3, 384), np.float32)}, file)
    monkeypatch.setenv(OWN_WEIGHTS, str(file))
    with pytest.raises(InputError, match="train them with"):
        load_encoder_weights()
