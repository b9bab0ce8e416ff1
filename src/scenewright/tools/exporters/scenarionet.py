"""ScenarioNet pickles, which MetaDrive plays: tracks, map features, lights, metadata, summaries.

MetaDrive's ego must be there at step 0 and takes the end of its track for its goal: a scene begins
when the ego enters, and the ego's track goes on along its route after a collision ended it.
"""

from __future__ import annotations

import pickle
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.tools.exporters.exported_scene import ExportedAgent, ExportedScene
from scenewright.tools.exporters.lanes import list_predecessors

DATASET, VERSION = "scenewright", "1"
_LIGHTS = {"green": "GREEN", "yellow": "YELLOW", "red": "RED", None: "UNKNOWN"}
PROTOCOL = 4


def write_scenarionet(scene: ExportedScene) -> dict[str, bytes]:
    """The scene as one pickle of dictionaries, arrays and plain values."""
    return {_build_file_name(scene): pickle.dumps(_describe(scene), protocol=PROTOCOL)}


def write_summaries(scenes: Sequence[ExportedScene]) -> dict[str, bytes]:
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
    lanelets = {each.id: each for each in scene.intersection_map.lanelets}
    states = {}
    for line in scene.intersection_map.stop_lines:
        colours = scene.list_colours().get(line.id)
        for name in line.lanelets if colours else ():
            end: FloatArray = np.array(lanelets[name].centreline[-1])
            states[name] = {
                "type": "TRAFFIC_LIGHT",
                "state": {"object_state": [f"TRAFFIC_LIGHT_{_LIGHTS[c]}" for c in colours or ()]},
                "lane": name,
                "stop_point": np.array([*end, 0.0], np.float32),
                "metadata": {
                    "type": "TRAFFIC_LIGHT", "object_id": name, "dataset": DATASET,
                    "track_length": scene.steps,
                },
            }  # fmt: skip
    return states


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
