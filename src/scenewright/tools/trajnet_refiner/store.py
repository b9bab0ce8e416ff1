"""Networks and unfinished trainings as safetensors files: numbers, and JSON about them.

Never pickle: a file from elsewhere must not be able to run anything.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from scenewright.errors import InputError
from scenewright.tools.trajnet_refiner.config import RefinerConfig, list_shapes
from scenewright.tools.trajnet_refiner.network import RefinerNetwork

VERSION = 1
_FORMAT = "scenewright.trajnet_refiner"
Task = Literal["scenes", "benchmark"]
_TASKS: Mapping[Task, str] = {
    "scenes": "refine the scenes of an intersection (`intersections train`)",
    "benchmark": "predict pedestrians of TrajNet++ (`lab.trajnet`)",
}


def save_refiner(
    config: RefinerConfig,
    weights: Mapping[str, NDArray[Any]],
    path: Path,
    *,
    about: Mapping[str, Any] | None = None,
) -> None:
    """Writes the weights, the configuration and the version of the format, whole or not at all.

    Args:
        weights: as `model.Refiner.list_weights` has them.
        about: anything else worth keeping, such as what it was trained on; JSON.
    """
    facts = {"config": config.model_dump(mode="json"), "about": dict(about or {})}
    write_tensors(path, weights, facts=facts)


def load_refiner(path: Path) -> RefinerNetwork:
    """A network that refines scenes, ready to predict.

    Raises:
        InputError, OSError: as `read_refiner`.
    """
    config, weights = read_refiner(path, task="scenes")
    try:
        return RefinerNetwork(config, weights)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def read_refiner(
    path: Path, *, task: Task | None = None
) -> tuple[RefinerConfig, dict[str, NDArray[Any]]]:
    """The configuration and the weights that `save_refiner` wrote.

    Args:
        task: what it must have been trained for; None for anything. Files that do not say what
            they were trained on are taken.

    Raises:
        InputError: not such a file, of another version or task, or damaged.
        OSError: it cannot be read.
    """
    tensors, facts = read_tensors(path)
    about = facts.get("about", {})
    kinds: tuple[tuple[str, Task], ...] = (("intersection", "scenes"), ("trained_on", "benchmark"))
    stored_task = next((kind for key, kind in kinds if key in about), None)
    if task is not None and stored_task is not None and stored_task != task:
        raise InputError(
            f"{path}: weights that {_TASKS[stored_task]}, not ones that {_TASKS[task]}"
        )
    try:
        config = RefinerConfig.model_validate(facts["config"])
    except (KeyError, ValidationError) as error:
        raise InputError(f"{path}: the weights do not fit their configuration") from error
    if list_shapes(config) != {name: each.shape for name, each in tensors.items()}:
        raise InputError(f"{path}: the weights do not fit their configuration")
    return config, tensors


def read_about(path: Path) -> Mapping[str, Any]:
    """What is kept with the weights about their training.

    Raises:
        InputError, OSError: as `read_refiner`.
    """
    about: Mapping[str, Any] = read_tensors(path)[1].get("about", {})
    return about


def write_tensors(
    path: Path, tensors: Mapping[str, NDArray[Any]], *, facts: Mapping[str, Any]
) -> None:
    """Arrays and facts as one safetensors file, whole or not at all."""
    from safetensors.numpy import save_file

    header = {"format": _FORMAT, "version": str(VERSION), "facts": json.dumps(facts)}
    draft = path.with_name(path.name + ".part")
    kept = {name: np.ascontiguousarray(tensor) for name, tensor in tensors.items()}
    save_file(kept, str(draft), metadata=header)
    os.replace(draft, path)


def read_tensors(path: Path) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """What `write_tensors` wrote.

    Raises:
        InputError: not such a file, or of another version.
        OSError: it cannot be read.
    """
    from safetensors import SafetensorError, safe_open

    with path.open("rb"):
        pass  # safetensors words its own errors; the system's are clearer
    try:
        with safe_open(str(path), framework="numpy") as file:
            header = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except SafetensorError as error:
        raise InputError(f"{path}: not a safetensors file") from error
    if header.get("format") != _FORMAT:
        raise InputError(f"{path}: these are not weights of the refiner")
    if header.get("version") != str(VERSION):
        raise InputError(f"{path}: weights of version {header.get('version')}, known is {VERSION}")
    facts: dict[str, Any] = json.loads(header["facts"])
    return tensors, facts
