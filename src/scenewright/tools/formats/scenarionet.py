"""ScenarioNet pickles, which MetaDrive plays: tracks, map features, lights, metadata, summaries.

MetaDrive's ego must be there at step 0 and takes the end of its track for its goal: a scene begins
when the ego enters, and the ego's track goes on along its route after a collision ended it.
"""

from __future__ import annotations

import io
import pickle
from collections import Counter, OrderedDict, defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.tools.formats.exported_scene import ExportedAgent, ExportedScene
from scenewright.tools.formats.lanes import list_predecessors
from scenewright.tools.formats.sampled_recording import (
    AgentSamples,
    SampledRecording,
    find_road_user,
    sort_out,
)

DATASET, VERSION = "scenewright", "1"
_LIGHTS = {"green": "GREEN", "yellow": "YELLOW", "red": "RED", None: "UNKNOWN"}
PROTOCOL = 4
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


def write(scene: ExportedScene) -> dict[str, bytes]:
    """The scene as one pickle of dictionaries, arrays and plain values."""
    return {_build_file_name(scene): pickle.dumps(_describe(scene), protocol=PROTOCOL)}


def write_index(scenes: Sequence[ExportedScene]) -> dict[str, bytes]:
    """What makes a folder of pickles a ScenarioNet database: summary and mapping by file."""
    summary = {_build_file_name(scene): _describe(scene)["metadata"] for scene in scenes}
    mapping = dict.fromkeys(summary, "")
    return {
        "dataset_summary.pkl": pickle.dumps(summary, protocol=PROTOCOL),
        "dataset_mapping.pkl": pickle.dumps(mapping, protocol=PROTOCOL),
    }


def _build_file_name(scene: ExportedScene) -> str:
    return f"sd_{DATASET}_{VERSION}_{scene.name}.pkl"


def _describe(scene: ExportedScene) -> dict[str, Any]:
    scene = scene.begin_at_ego()
    tracks: dict[str, Any] = {}
    for agent in (*scene.agents, *scene.objects):
        # The ego continues along its route after a collision; all others as in the scene.
        goes_on = agent.id == scene.ego.id and agent.id in scene.collided
        shown = agent.continue_until(scene.steps - 1) if goes_on else agent
        tracks[str(agent.id)] = _describe_track(shown, scene.steps)
    kinds = Counter(track["type"] for track in tracks.values())
    features = _describe_map(scene.intersection_map)
    lights = _describe_lights(scene)
    return {
        "id": scene.name,
        "version": f"{DATASET} {VERSION}",
        "length": scene.steps,
        "tracks": tracks,
        "dynamic_map_states": lights,
        "map_features": features,
        "metadata": {
            "id": scene.name,
            "scenario_id": scene.name,
            "dataset": DATASET,
            "instruction": scene.record.meta.user_prompt,
            "coordinate": "metadrive",
            "metadrive_processed": False,
            "ts": scene.times.astype(np.float32),
            "time_offset": round(scene.offset * scene.step, 3),
            "sdc_id": str(scene.ego.id),
            "sdc_continues_from": scene.ego.last + 1 if scene.ego.id in scene.collided else None,
            "tracks_to_predict": {},
            "objects_of_interest": [str(n) for n in sorted(scene.collided)],
            "object_summary": {name: _summarize(name, track) for name, track in tracks.items()},
            "number_summary": {
                "num_objects": len(tracks),
                "num_objects_each_type": dict(kinds),
                "object_types": sorted(kinds),
                "num_traffic_lights": len(lights),
                "num_map_features": len(features),
            },
        },
    }


def _describe_track(agent: ExportedAgent, steps: int) -> dict[str, Any]:
    part = slice(agent.first, agent.last + 1)
    size = {"length": agent.length, "width": agent.width, "height": agent.height}
    state: dict[str, Any] = {
        "position": np.zeros((steps, 3), np.float32),
        "velocity": np.zeros((steps, 2), np.float32),
        "heading": np.zeros(steps, np.float32),
        "valid": np.zeros(steps, np.bool_),
        **{name: np.zeros(steps, np.float32) for name in size},
    }
    state["position"][part, :2] = agent.xy
    state["velocity"][part] = agent.velocity
    state["heading"][part] = agent.heading
    state["valid"][part] = True
    for name, value in size.items():
        state[name][part] = value
    kind = agent.names.scenarionet
    about = {
        "type": kind,
        "object_id": str(agent.id),
        "track_length": steps,
        "dataset": DATASET,
        "name": agent.name,
        "kind": agent.kind,
    }
    return {"type": kind, "state": state, "metadata": about}


def _describe_map(intersection: IntersectionMap) -> dict[str, Any]:
    """Lanes with their neighbours along the way, crosswalks, and the edges of the road."""
    before = list_predecessors(intersection)
    features: dict[str, Any] = {}
    for lanelet in intersection.lanelets:
        if lanelet.kind != "parking":
            features[lanelet.id] = {
                "type": "LANE_SURFACE_STREET",
                "polyline": _flatten(lanelet.centreline),
                "polygon": _flatten((*lanelet.left, *lanelet.right[::-1])),
                "entry_lanes": before[lanelet.id],
                "exit_lanes": list(lanelet.successors),
                "speed_limit_kmh": round(3.6 * lanelet.speed_limit, 2),
            }
    for crosswalk in intersection.crosswalks:
        features[crosswalk.id] = {"type": "CROSSWALK", "polygon": _flatten(crosswalk.polygon)}
    rings = [ring for area in intersection.road for ring in (area.exterior, *area.holes)]
    for k, ring in enumerate(rings):
        line = _flatten((*ring, ring[0]))
        features[f"road edge {k}"] = {"type": "ROAD_EDGE_BOUNDARY", "polyline": line}
    return features


def _flatten(points: Sequence[Sequence[float]]) -> np.ndarray[Any, np.dtype[np.float32]]:
    """[P, 2] points, as MetaDrive takes the polygons of lanes."""
    return np.array(points, np.float32)


def _describe_lights(scene: ExportedScene) -> dict[str, Any]:
    """The light of every lane that ends at a stop line with one."""
    return {
        name: {
            "type": "TRAFFIC_LIGHT",
            "state": {"object_state": [f"TRAFFIC_LIGHT_{_LIGHTS[c]}" for c in colours]},
            "lane": name,
            "stop_point": np.array([*end, 0.0], np.float32),
            "metadata": {
                "type": "TRAFFIC_LIGHT", "object_id": name, "dataset": DATASET,
                "track_length": scene.steps,
            },
        }
        for name, end, colours in scene.list_lane_lights()
    }  # fmt: skip


def _summarize(name: str, track: dict[str, Any]) -> dict[str, Any]:
    valid = track["state"]["valid"]
    way = track["state"]["position"][valid, :2].astype(np.float64)
    return {
        "type": track["type"],
        "object_id": name,
        "track_length": len(valid),
        "moving_distance": float(np.hypot(*np.diff(way, axis=0).T).sum()),
        "valid_length": int(valid.sum()),
        "continuous_valid_length": int(valid.sum()),
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


def read(data: bytes, *, name: str) -> list[SampledRecording]:
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
        raise InputError(f"{name} is no ScenarioNet scenario: {_say(error)}") from error
    return [sort_out("", found)]


def load_arrays(data: bytes, *, name: str) -> dict[str, Any]:
    """The dictionary in a pickle of arrays and plain values.

    Raises:
        InputError: it is damaged, holds something else, or asks for any code.
    """
    try:
        value = _ArraysOnly(io.BytesIO(data)).load()
    except Exception as error:  # damaged pickles raise anything
        raise InputError(f"{name} is no pickle of plain arrays: {_say(error)}") from error
    if not isinstance(value, dict):
        raise InputError(f"{name} is no ScenarioNet scenario: it holds no dictionary")
    return value


def _say(error: Exception) -> str:
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
    length, width = (
        float(np.median(np.asarray(state[name], dtype=np.float64).reshape(-1)[valid]))
        if name in state and valid.any() else None
        for name in ("length", "width")
    )  # fmt: skip
    # The subtype by our own exporter's note, which says more than VEHICLE.
    kind = track.get("metadata", {}).get("kind")
    subtype = (find_road_user(kind) if isinstance(kind, str) else None) or subtype
    return word, AgentSamples(key, subtype, times[valid], xy, heading, length, width)
