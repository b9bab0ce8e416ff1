"""Intents of a turn of a conversation, by their probability.

A linear model over what the planner's encoder makes of the words. It is trained on phrases
(`lab/planner/turns.toml`) and only ranks; what is done with the words is decided by rules.
"""

from __future__ import annotations

from functools import lru_cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np

from scenewright.backends.builtin.reader.encoder import Floats, dequantize, load_encoder
from scenewright.backends.builtin.reader.single_thread import SINGLE_THREAD
from scenewright.backends.builtin.reader.tokens import MOST_TOKENS, load_tokenizer
from scenewright.time_limit import stop_clock

WEIGHTS = "turns.safetensors"


class Intent(NamedTuple):
    """What may be wanted, such as `slower` or `q_speed`, and its probability."""

    name: str
    chance: float


class TurnModel(NamedTuple):
    """The trained map: probabilities are softmax((features - mean) * scale @ weight.T + bias)."""

    names: tuple[str, ...]
    mean: Floats
    scale: Floats
    weight: Floats
    bias: Floats


def rank_intents(words: str) -> list[Intent]:
    """All intents, the likeliest first."""
    model = load_turn_model()
    features = (compute_features(words) - model.mean) * model.scale
    scores = model.weight @ features + model.bias
    raised = np.exp(scores - scores.max())
    chances = raised / raised.sum()
    ranked = sorted(zip(model.names, chances.tolist(), strict=True), key=lambda each: -each[1])
    return [Intent(name, chance) for name, chance in ranked]


def compute_features(words: str) -> Floats:
    """[2 * width] of the words: the directions of what the encoder makes of them."""
    plain = " ".join(words.lower().replace("’", "'").split())
    ids = np.array(load_tokenizer().encode(plain).ids[:MOST_TOKENS], dtype=np.int64)
    if len(ids) < 3:  # nothing between the first token and the last
        ids = np.array(load_tokenizer().encode("?").ids, dtype=np.int64)
    with SINGLE_THREAD:
        found = load_encoder().summarise(ids)
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True), np.float32).ravel()


@lru_cache(maxsize=1)
def load_turn_model() -> TurnModel:
    """The weights of the package."""
    from safetensors.numpy import load

    with stop_clock():  # once a process, whatever the request
        data = files("scenewright.backends.builtin.reader").joinpath(WEIGHTS).read_bytes()
        held = load(data)
    names = bytes(held["names"]).decode().split()
    return TurnModel(
        tuple(names), held["mean"], held["scale"], dequantize(held, "weight"), held["bias"]
    )
