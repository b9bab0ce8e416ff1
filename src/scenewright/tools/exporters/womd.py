"""Records of the Waymo Open Motion Dataset in a TFRecord, without TensorFlow."""

from __future__ import annotations

from typing import Any

import numpy as np

from scenewright.scene.map import IntersectionMap
from scenewright.tools.exporters.exported_scene import ExportedAgent, ExportedScene
from scenewright.tools.exporters.lanes import list_points, list_predecessors, number_lanes
from scenewright.tools.exporters.womd_example import (
    find_current_step,
    is_predicted,
    write_example,
)
from scenewright.tools.track_io.womd import load_scenario_class, write_records

WINDOW, CURRENT, EVENT = 91, 10, 60
"""Steps of a scenario of the dataset, which of them is now, and where a window has its event."""
MPH = 0.44704
_STATES = {"red": 4, "yellow": 5, "green": 6, None: 0}
_SURFACE_STREET, _BOUNDARY = 2, 1


def write_womd(scene: ExportedScene, *, form: str = "window") -> dict[str, bytes]:
    """One record: the 9.1 s of the dataset around the event, or the whole scene.

    Args:
        form: `window` or `whole`, a Scenario; `example`, the window as tf.Example.
    """
    if form != "whole":
        scene = scene.cut_window(WINDOW, now=CURRENT, event=EVENT)
    if form == "example":
        features, lights = _describe_map(scene.intersection_map), _describe_lights(scene)
        record = write_example(scene, features, lights)
        return {f"{scene.name}.tfexample.tfrecord": write_records([record])}
    scenario = load_scenario_class()(
        scenario_id=scene.name,
        timestamps_seconds=scene.times.tolist(),
        current_time_index=find_current_step(scene),
        tracks=[_describe_track(a, scene.steps) for a in (*scene.agents, *scene.objects)],
        sdc_track_index=[agent.id for agent in scene.agents].index(scene.ego.id),
        objects_of_interest=scene.list_event_agents()[:2],
        tracks_to_predict=[
            {"track_index": index, "difficulty": 0}
            for index, agent in enumerate(scene.agents)
            if is_predicted(agent, scene)
        ],
        map_features=_describe_map(scene.intersection_map),
        dynamic_map_states=_describe_lights(scene),
    )
    record = scenario.SerializeToString(deterministic=True)
    return {f"{scene.name}.tfrecord": write_records([record])}


def _describe_track(agent: ExportedAgent, steps: int) -> dict[str, Any]:
    """A state for every step; those at which the agent is not there are invalid."""
    heading = np.where(agent.heading >= np.pi, -np.pi, agent.heading)
    states: list[dict[str, Any]] = [{"valid": False}] * steps
    for k, ((x, y), (vx, vy), turn) in enumerate(
        zip(agent.xy.tolist(), agent.velocity.tolist(), heading.tolist(), strict=True)
    ):
        states[agent.first + k] = {
            "center_x": x, "center_y": y, "center_z": agent.height / 2,
            "length": agent.length, "width": agent.width, "height": agent.height,
            "heading": turn, "velocity_x": vx, "velocity_y": vy, "valid": True,
        }  # fmt: skip
    return {"id": agent.id, "object_type": agent.names.womd, "states": states}


def _describe_map(intersection: IntersectionMap) -> list[dict[str, Any]]:
    numbers = number_lanes(intersection)
    before = list_predecessors(intersection)
    features: list[dict[str, Any]] = [
        {
            "id": numbers[each.id],
            "lane": {
                "speed_limit_mph": each.speed_limit / MPH,
                "type": _SURFACE_STREET,
                "polyline": list_points(each.centreline),
                "entry_lanes": [numbers[name] for name in before[each.id]],
                "exit_lanes": [numbers[name] for name in each.successors],
            },
        }
        for each in intersection.lanelets
        if each.id in numbers
    ]
    rings = [ring for area in intersection.road for ring in (area.exterior, *area.holes)]
    areas: list[dict[str, Any]] = [
        {"road_edge": {"type": _BOUNDARY, "polyline": list_points((*ring, ring[0]))}}
        for ring in rings
    ]
    areas += [{"crosswalk": {"polygon": list_points(c.polygon)}} for c in intersection.crosswalks]
    return features + [{"id": len(numbers) + k, **each} for k, each in enumerate(areas, start=1)]


def _describe_lights(scene: ExportedScene) -> list[dict[str, Any]]:
    """At every step the light of each lane that ends at a stop line."""
    numbers, colours = number_lanes(scene.intersection_map), scene.list_colours()
    ends = {each.id: each.centreline[-1] for each in scene.intersection_map.lanelets}
    lanes = [
        (lane, line.id)
        for line in scene.intersection_map.stop_lines
        for lane in line.lanelets
        if line.id in colours
    ]
    return [
        {
            "lane_states": [
                {
                    "lane": numbers[lane],
                    "state": _STATES[colours[line][k]],
                    "stop_point": list_points([ends[lane]])[0],
                }
                for lane, line in lanes
            ]
        }
        for k in range(scene.steps)
    ]
