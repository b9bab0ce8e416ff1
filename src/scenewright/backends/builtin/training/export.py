"""Trained weights as the reader loads them: matrices in int8, the rest in float32."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from scenewright.backends.builtin.reader.encoder import SCALE, dequantize, quantize
from scenewright.backends.builtin.training.model import ReaderNetwork

_SMALLEST = 64
"""Matrices with a side shorter than this stay in float32."""


def export_weights(state: Mapping[str, torch.Tensor], out: Path) -> None:
    """Write the state of a network as int8 safetensors."""
    from safetensors.numpy import save_file

    found: dict[str, NDArray[Any]] = {}
    for name, tensor in state.items():
        value = tensor.float().numpy()
        if value.ndim == 2 and min(value.shape) >= _SMALLEST:
            found[name], found[name + SCALE] = quantize(value)
        else:
            found[name] = np.ascontiguousarray(value)
    save_file(found, out)


def load_exported(network: ReaderNetwork, weights: Mapping[str, NDArray[Any]]) -> None:
    """Start a network from exported weights."""
    state = {
        name: torch.from_numpy(dequantize(weights, name))
        for name in weights
        if not name.endswith(SCALE)
    }
    network.load_state_dict(state)
