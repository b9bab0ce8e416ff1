"""Trains the model of turns: `python -m lab.planner.turns [OUT]`.

With `--check` it trains on two thirds of the phrases, three times, and says how many of the others
get the right intent.
"""

from __future__ import annotations

import random
import sys
import tomllib
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import torch
from safetensors.numpy import save

import scenewright
from scenewright.backends.builtin.reader.encoder import SCALE, Floats, Ints, quantize
from scenewright.backends.builtin.turn_intent import WEIGHTS, compute_features
from scenewright.files import write_atomically

_FILLS = {
    "{who}": "the car|it|her|him|the van|the pedestrian|the cyclist|the bus|the truck|vehicle-1|"
    "pedestrian-1|she|he|the kid|the woman|the taxi|the bike|the other one|the motorbike|"
    "the first car|the scooter|the man|them|the driver|that guy|the lorry",
    "{a}": "a car|a van|a bus|a truck|a cyclist|a pedestrian|a taxi|a motorbike|an e-scooter|"
    "a kid|an old woman|a police car|a delivery van|a lorry|a bike|two people|a man",
    "{side}": "north|south|east|west",
    "{n}": "2|3|5|10|30|1.5|one|two|three|12|50|half a",
    "{time}": "8 am|5 pm|17:30|midnight|noon|7 o'clock|rush hour|22:00|9",
    "{street}": "the main street|Kerkstraat|the other road",
}
_BEFORE = (
    "ok |please |and |now |hmm |no, |can you |could you |then |i want you to |so |also |well, "
)
_FILLED, _PLAIN = 4, 2
"""How often a phrase is used: with braces, without."""
_ROUNDS, _RATE, _DECAY = 150, 0.05, 5e-3


def read_phrases() -> dict[str, list[str]]:
    """Intent -> phrases."""
    return tomllib.loads(Path(__file__).with_name("turns.toml").read_text("utf-8"))


def write_examples(phrases: Iterable[str], seed: int) -> list[tuple[int, str]]:
    """(number of the phrase, text): braces filled, some with a word before them."""
    draw = random.Random(seed)
    made = []
    for number, phrase in enumerate(phrases):
        for turn in range(_FILLED if "{" in phrase else _PLAIN):
            text = _fill(phrase, draw)
            made.append((number, draw.choice(["", *_BEFORE.split("|")]) + text if turn else text))
    return made


def _fill(phrase: str, draw: random.Random) -> str:
    for brace, choices in _FILLS.items():
        while brace in phrase:
            phrase = phrase.replace(brace, draw.choice(choices.split("|")), 1)
    return phrase


def fit(features: Floats, intents: Ints, count: int) -> tuple[Floats, Floats]:
    """Weight [count, features] and bias of a softmax regression."""
    torch.manual_seed(0)
    x, y = torch.from_numpy(features), torch.from_numpy(intents)
    share = torch.from_numpy(1 / np.sqrt(np.bincount(intents, minlength=count).clip(1)))
    layer = torch.nn.Linear(x.shape[1], count)
    steps = torch.optim.Adam(layer.parameters(), lr=_RATE, weight_decay=_DECAY)
    weigh = (share / share.mean()).float()
    for _ in range(_ROUNDS):
        steps.zero_grad()
        loss = torch.nn.functional.cross_entropy(layer(x), y, weight=weigh, label_smoothing=0.02)
        loss.backward()  # type: ignore[no-untyped-call]
        steps.step()
    return layer.weight.detach().numpy(), layer.bias.detach().numpy()


def main(arguments: list[str]) -> None:
    """Train and write the weights, or check."""
    phrases = read_phrases()
    names = list(phrases)
    rows = [(kind, text) for kind, name in enumerate(names) for text in phrases[name]]
    examples = write_examples([text for _, text in rows], seed=1)
    kinds = np.array([rows[number][0] for number, _ in examples])
    features = np.stack([compute_features(text) for _, text in examples])
    mean, scale = features.mean(0), 1 / (features.std(0) + 1e-6)
    features = (features - mean) * scale
    if "--check" in arguments:
        check(features, kinds, np.array([number for number, _ in examples]), names)
        return
    weight, bias = fit(features, kinds, len(names))
    small, scales = quantize(weight)
    held = {"weight": small, f"weight{SCALE}": scales, "bias": bias, "mean": mean, "scale": scale}
    held["names"] = np.frombuffer(" ".join(names).encode(), np.uint8)
    out = Path(scenewright.__file__).parent / "backends/builtin/reader" / WEIGHTS
    write_atomically(Path(arguments[0]) if arguments else out, save(held))


def check(features: Floats, kinds: Ints, numbers: Ints, names: list[str]) -> None:
    """Share of texts, of phrases not trained on, that get their intent; by how sure that is."""
    order = np.random.default_rng(0).permutation(numbers.max() + 1)
    right, sure = [], []
    for fold in range(3):
        held = np.isin(numbers, order[fold::3])
        weight, bias = fit(features[~held], kinds[~held], len(names))
        scores = features[held] @ weight.T + bias
        chances = np.exp(scores - scores.max(1, keepdims=True))
        sure.append((chances / chances.sum(1, keepdims=True)).max(1))
        right.append(scores.argmax(1) == kinds[held])
    hit, chance = np.concatenate(right), np.concatenate(sure)
    print(f"{len(hit)} texts, {hit.mean():.1%} right")
    for least in (0.4, 0.6, 0.8):
        print(f"  {(chance > least).mean():.1%} with p > {least}: {hit[chance > least].mean():.1%}")


if __name__ == "__main__":
    main(sys.argv[1:])
