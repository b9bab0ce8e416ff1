"""Trained weights as the reader loads them: matrices in int8, the rest in float32."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from safetensors.numpy import save_file

from scenewright.backends.builtin.reader.encoder import quantize


def export_weights(trained: Path, out: Path) -> None:
    """Write the weights of a checkpoint of `fit` as int8 safetensors."""
    state = torch.load(trained, weights_only=True)["network"]
    found: dict[str, np.ndarray] = {}
    for name, tensor in state.items():
        value = tensor.float().numpy()
        if value.ndim == 2 and min(value.shape) >= 64:
            found[name], found[name + ".scale"] = quantize(value)
        else:
            found[name] = value
    save_file(found, out)


if __name__ == "__main__":
    import sys

    export_weights(Path(sys.argv[1]), Path(sys.argv[2]))
