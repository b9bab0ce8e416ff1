"""Tracks in tf.Example records of the Waymo Open Motion Dataset, without TensorFlow."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.tools.track_io.protobuf_schema import build_messages
from scenewright.tools.track_io.sampled_recording import AgentSamples, SampledRecording, sort_out

PACKAGE = "tensorflow"
SCHEMA = """
BytesList: value 1 *bytes
FloatList: value 1 +float
Int64List: value 1 +int64
Feature: bytes_list 1 BytesList, float_list 2 FloatList, int64_list 3 Int64List
FeatureEntry: key 1 string, value 2 Feature
Features: feature 1 *FeatureEntry
Example: features 1 Features
"""
PARTS = {"past": slice(0, 10), "current": slice(10, 11), "future": slice(11, 91)}
"""Steps of a record that each part of its names holds."""
STATES = (
    "x", "y", "z", "length", "width", "height", "bbox_yaw", "vel_yaw", "velocity_x", "velocity_y",
    "timestamp_micros", "valid",
)  # fmt: skip
"""What a record says of an object at a step."""

_Tensors = dict[str, np.ndarray[Any, Any]]


@cache
def load_example_class() -> Any:
    """The message class of tf.Example; a map of features has the bytes of repeated entries."""
    return build_messages(PACKAGE, SCHEMA)["Example"]


def read_example(record: bytes) -> _Tensors | None:
    """The features of a record as flat arrays by name; None if it is no tf.Example of a scene."""
    from google.protobuf.message import DecodeError

    try:
        entries = load_example_class().FromString(record).features.feature
    except DecodeError:
        return None
    found: _Tensors = {}
    for entry in entries:
        value = entry.value
        held = value.float_list.value or value.int64_list.value or value.bytes_list.value
        found[entry.key] = np.array(list(held))
    return found if "state/id" in found else None


def read_example_tracks(tensors: _Tensors, name: str, subtypes: dict[int, str]) -> SampledRecording:
    """The tracks of a record.

    Args:
        subtypes: of the dataset's numbers of object types.

    Raises:
        InputError: a tensor is missing, or not of the size that the dataset has.
    """
    objects = len(tensors["state/id"])
    states = {each: _join(tensors, each, objects, name) for each in STATES}
    found: list[tuple[str, AgentSamples | None]] = []
    for k, number in enumerate(tensors["state/id"]):
        valid = states["valid"][k] > 0
        if not valid.any():
            continue
        kind = int(_get(tensors, "state/type", objects, name)[k])
        agent, subtype = None, subtypes.get(kind)
        if subtype is not None:
            here = {each: values[k][valid] for each, values in states.items()}
            sizes = (round(float(np.median(here[each])), 4) for each in ("length", "width"))
            agent = AgentSamples(
                f"{number:.0f}", subtype, (here["timestamp_micros"] * 1e-6).round(4),
                np.stack([here["x"], here["y"]], axis=1), here["bbox_yaw"],
                *(size if size > 0 else None for size in sizes),
            )  # fmt: skip
        found.append((f"type {kind}", agent))
    title = tensors.get("scenario/id", np.array([b""]))[0]
    return sort_out(title.decode(errors="replace") if isinstance(title, bytes) else "", found)


def _get(tensors: _Tensors, key: str, size: int, name: str) -> np.ndarray[Any, Any]:
    values = tensors.get(key)
    if values is None or len(values) != size:
        held = "is missing" if values is None else f"has {len(values)} values, not {size}"
        raise InputError(f"{name}: {key} {held}")
    return values


def _join(tensors: _Tensors, state: str, objects: int, name: str) -> np.ndarray[Any, Any]:
    """[objects, 91] a state from the past to the future; a part that is left out is invalid."""
    parts = []
    for part, span in PARTS.items():
        count = span.stop - span.start
        if f"state/{part}/valid" not in tensors:
            parts.append(np.zeros((objects, count)))
            continue
        values = _get(tensors, f"state/{part}/{state}", objects * count, name)
        parts.append(values.reshape(objects, count).astype(np.float64))
    return np.concatenate(parts, axis=1)
