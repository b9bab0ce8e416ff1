"""Tracks in ScenarioNet / MetaDrive pickles.

A pickle is a program: it is read by an unpickler that can build nothing but plain values and
arrays, and refuses everything else by name.
"""

from __future__ import annotations

import io
import pickle
from collections import OrderedDict, defaultdict
from collections.abc import Mapping
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.tools.track_io.sampled_recording import (
    AgentSamples,
    SampledRecording,
    find_road_user,
    sort_out,
)

_LATIN = {"latin1": "latin-1", "latin-1": "latin-1"}
"""The encodings by which old pickles of arrays call for their bytes."""
_NUMPY = ("numpy.core.", "numpy._core.")
_DESCRIPTION = ("metadrive.scenario.scenario_description", "ScenarioDescription")
_HARMLESS: dict[tuple[str, str], Any] = {
    ("numpy", "ndarray"): np.ndarray,
    ("numpy", "dtype"): np.dtype,
    ("collections", "OrderedDict"): OrderedDict,
    ("collections", "defaultdict"): defaultdict,
    ("builtins", "set"): set,
    ("builtins", "int"): int,
    ("builtins", "float"): float,
    ("builtins", "list"): list,
    ("builtins", "dict"): dict,
}


class _ArraysOnly(pickle.Unpickler):
    """Builds plain values and numpy arrays; nothing else is looked up, so nothing else can run."""

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) == _DESCRIPTION:
            return dict
        if module.startswith(_NUMPY) and name in ("_reconstruct", "scalar", "_frombuffer"):
            home = "numeric" if name == "_frombuffer" else "multiarray"
            return getattr(getattr(np._core, home), name)  # type: ignore[attr-defined]
        if (module, name) == ("_codecs", "encode"):
            return lambda text, encoding: text.encode(_LATIN[encoding])
        if (module, name) not in _HARMLESS:
            raise pickle.UnpicklingError(f"it wants {module}.{name}"[:120])
        return _HARMLESS[module, name]


def read_scenarionet(data: bytes, *, name: str) -> list[SampledRecording]:
    """The tracks of one scenario; steps at which an agent is not valid are gaps.

    Raises:
        InputError: no ScenarioNet pickle, or one that wants more than arrays and plain values.
    """
    scenario = load_arrays(data, name=name)
    tracks = scenario.get("tracks")
    if not isinstance(tracks, Mapping):
        raise InputError(f"{name} is no ScenarioNet scenario: it has no tracks")
    try:
        about = scenario["metadata"]
        stamps = about["ts"] if "ts" in about else about["timestep"]
        times = np.array(stamps, dtype=np.float64).round(4)
        invented = {str(about.get("sdc_id")): about.get("sdc_continues_from")}
        found = [
            _read_track(str(key), track, times, invented.get(str(key)))
            for key, track in tracks.items()
        ]
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise InputError(f"{name} is no ScenarioNet scenario: {_describe(error)}") from error
    return [sort_out("", found)]


def load_arrays(data: bytes, *, name: str) -> dict[str, Any]:
    """The dictionary in a pickle of arrays and plain values.

    Raises:
        InputError: it is damaged, holds something else, or asks for any code.
    """
    try:
        value = _ArraysOnly(io.BytesIO(data)).load()
    except Exception as error:  # damaged pickles raise anything
        raise InputError(f"{name} is no pickle of plain arrays: {_describe(error)}") from error
    if not isinstance(value, dict):
        raise InputError(f"{name} is no ScenarioNet scenario: it holds no dictionary")
    return value


def _describe(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"[:160]


def _read_track(
    key: str, track: Mapping[str, Any], times: FloatArray, until: int | None
) -> tuple[str, AgentSamples | None]:
    word, state = str(track["type"]), track["state"]
    subtype = find_road_user(word)
    valid = np.asarray(state["valid"]).astype(bool).reshape(-1)
    if subtype is None:
        return word, None
    if until is not None:  # from there on our own exporter has continued the ego's track
        valid = valid & (np.arange(len(valid)) < until)
    xy = np.asarray(state["position"], dtype=np.float64)[valid, :2]
    heading = np.asarray(state["heading"], dtype=np.float64).reshape(-1)[valid]
    sizes = {
        name: float(np.median(np.asarray(state[name], dtype=np.float64).reshape(-1)[valid]))
        for name in ("length", "width")
        if name in state and valid.any()
    }
    # The subtype by our own exporter's note, which says more than VEHICLE.
    kind = track.get("metadata", {}).get("kind")
    subtype = (find_road_user(kind) if isinstance(kind, str) else None) or subtype
    return word, AgentSamples(key, subtype, times[valid], xy, heading, **sizes)
