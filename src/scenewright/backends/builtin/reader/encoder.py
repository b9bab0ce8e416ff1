"""The trained encoder in numpy: int8 weights from a safetensors file, float32 arithmetic."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenewright.backends.builtin.reader.labels import LABELS
from scenewright.errors import InputError
from scenewright.time_limit import stop_clock

OWN_WEIGHTS = "SCENEWRIGHT_PLANNER"
Floats = NDArray[np.float32]
Ints = NDArray[np.int64]
HEADS = 12
SCALE = ".scale"
_LABEL_TABLE = "label.weight"


class Encoder:
    """A MiniLM encoder and its heads; unchanged after loading, so threads may share it."""

    def __init__(self, weights: Mapping[str, NDArray[Any]]) -> None:
        tables = {"word.weight", "position.weight"}
        self._tables = {name: weights[name] for name in tables}
        self._scales = {name: weights[name + SCALE] for name in tables}
        self._weights = {
            name: dequantize(weights, name)
            for name in weights
            if name not in tables and not name.endswith(SCALE)
        }
        self._layers = 1 + max(int(n.split(".")[1]) for n in weights if n.startswith("layers."))

    def encode(self, ids: Ints, parts: Ints) -> Floats:
        """Token representations [tokens, width] of one text; `parts` is 1 in an edit's change."""
        x = self._get_rows("word.weight", ids) + self._get_rows(
            "position.weight", np.arange(len(ids))
        )
        x = self._apply_norm(x + self._weights["part.weight"][parts], "norm")
        for index in range(self._layers):
            x = self._apply_layer(x, f"layers.{index}.")
        return x

    def summarise(self, ids: Ints) -> Floats:
        """One text as [2, width]: the mean token after half of the layers, the mean word vector."""
        words = self._get_rows("word.weight", ids)
        parts = np.zeros(len(ids), dtype=np.int64)
        x = words + self._get_rows("position.weight", np.arange(len(ids)))
        x = self._apply_norm(x + self._weights["part.weight"][parts], "norm")
        for index in range(self._layers // 2):
            x = self._apply_layer(x, f"layers.{index}.")
        return np.stack([x.mean(0), words[1:-1].mean(0)])

    def compute_head(self, name: str, x: Floats) -> Floats:
        """Log-probabilities of a two-layer head, such as `tags`, for rows of representations."""
        return _log_softmax(
            self.apply_linear(_apply_gelu(self.apply_linear(x, f"{name}.0")), f"{name}.3")
        )

    def represent(self, x: Floats, spans: Ints, labels: Ints) -> Floats:
        """Mean token of each span [n, 2] (first, last token) plus its label's vector."""
        means = np.stack([x[first : last + 1].mean(0) for first, last in spans])
        return np.asarray(means + self._weights["label.weight"][labels], np.float32)

    def compute_members(self, which: Ints) -> Floats:
        """Vectors that distinguish the members of a group; 0: not in a group."""
        return self._weights["member.weight"][which]

    def score_links(self, spans: Floats, users: Floats, distances: Ints) -> Floats:
        """Log-probabilities of LINKS for pairs of span and road user, [n, 3]."""
        summed = self.apply_linear(spans, "span_in") + self.apply_linear(users, "user_in")
        summed = _apply_gelu(summed + self._weights["distance.weight"][distances])
        gated = self.apply_linear(spans, "span_gate") * self.apply_linear(users, "user_gate")
        return _log_softmax(self.apply_linear(np.concatenate([summed, gated], -1), "link"))

    def apply_linear(self, x: Floats, name: str) -> Floats:
        """The affine map of that name."""
        product = x @ self._weights[f"{name}.weight"].T
        return np.asarray(product + self._weights[f"{name}.bias"], np.float32)

    def _apply_layer(self, x: Floats, at: str) -> Floats:
        tokens, width = x.shape
        query, key, value = (
            part.reshape(tokens, HEADS, width // HEADS).transpose(1, 0, 2)
            for part in np.split(self.apply_linear(x, at + "qkv"), 3, axis=1)
        )
        seen = (
            _apply_softmax(query @ key.transpose(0, 2, 1) / np.sqrt(np.float32(width // HEADS)))
            @ value
        )
        merged = seen.transpose(1, 0, 2).reshape(tokens, width)
        x = self._apply_norm(x + self.apply_linear(merged, at + "out"), at + "norm1")
        inner = self.apply_linear(_apply_gelu(self.apply_linear(x, at + "up")), at + "down")
        return self._apply_norm(x + inner, at + "norm2")

    def _apply_norm(self, x: Floats, name: str) -> Floats:
        x = x - x.mean(-1, keepdims=True)
        x = x / np.sqrt((x * x).mean(-1, keepdims=True) + 1e-12)
        return x * self._weights[f"{name}.weight"] + self._weights[f"{name}.bias"]

    def _get_rows(self, name: str, which: Ints) -> Floats:
        rows = self._tables[name][which].astype(np.float32)
        return np.asarray(rows * self._scales[name][which][:, None], np.float32)


def dequantize(weights: Mapping[str, NDArray[Any]], name: str) -> Floats:
    """A weight of that name in float32."""
    value = weights[name].astype(np.float32)
    scale = weights.get(name + SCALE)
    return value if scale is None else np.asarray(value * scale[:, None], np.float32)


def quantize(value: Floats) -> tuple[NDArray[np.int8], Floats]:
    """A matrix as int8 with one scale for each row, the largest value of a row being 127."""
    scale = np.maximum(np.abs(value).max(1), 1e-12) / 127
    return np.round(value / scale[:, None]).astype(np.int8), scale.astype(np.float32)


def _apply_gelu(x: Floats) -> Floats:
    inner = np.float32(0.7978845608) * (x + np.float32(0.044715) * x * x * x)
    return np.asarray(np.float32(0.5) * x * (1 + np.tanh(inner)), np.float32)


def _apply_softmax(x: Floats) -> Floats:
    raised = np.exp(x - x.max(-1, keepdims=True))
    return np.asarray(raised / raised.sum(-1, keepdims=True), np.float32)


def _log_softmax(x: Floats) -> Floats:
    x = x - x.max(-1, keepdims=True)
    return np.asarray(x - np.log(np.exp(x).sum(-1, keepdims=True)), np.float32)


@lru_cache(maxsize=1)
def load_encoder() -> Encoder:
    """The encoder with the weights of the package, or those that SCENEWRIGHT_PLANNER names."""
    with stop_clock():  # once a process, whatever the request
        return Encoder(load_encoder_weights())


def load_encoder_weights() -> dict[str, NDArray[Any]]:
    """The weights by name.

    Raises:
        InputError: SCENEWRIGHT_PLANNER names no file of such weights.
    """
    from safetensors import SafetensorError
    from safetensors.numpy import load

    own = os.environ.get(OWN_WEIGHTS)
    if own is None:
        folder = files("scenewright.backends.builtin.reader")
        return dict(load(folder.joinpath("reader.safetensors").read_bytes()))
    try:
        weights = dict(load(Path(own).read_bytes()))
    except (OSError, SafetensorError) as error:
        raise InputError(f"{OWN_WEIGHTS}={own} is no file of planner weights: {error}") from error
    if len(weights.get(_LABEL_TABLE, ())) != len(LABELS):
        raise InputError(
            f"{OWN_WEIGHTS}={own} holds no planner weights for the {len(LABELS)} labels of this "
            "version; train them with 'scenewright planner train'"
        )
    return weights
