"""TrajNet++ ndjson: positions of all agents every 0.4 s, and a scene row per agent to predict.

Each row of a track has two keys that the benchmark does not know, `class` and `heading`: readers
of TrajNet++ ignore them, ours uses the class.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.tools.exporters.exported_scene import ExportedScene

SAMPLE = 0.4
"""Between samples [s]."""
FPS = 2.5
LENGTH, SHORTEST = 21, 10
"""Samples of a scene of the benchmark, 9 observed and 12 predicted; and least of one of ours whose
agent takes part in an event that ends its track."""


def write_trajnet(scene: ExportedScene) -> dict[str, bytes]:
    """Frames are steps of 0.1 s from the start of the scene, so that every fourth has samples.

    Raises:
        InputError: the scene's samples lie further apart than those of the format.
    """
    stride = round(SAMPLE / scene.step)
    if stride == 0:
        raise InputError(f"scene {scene.name} has a step of {scene.step:g} s; at most {SAMPLE} s")
    rows = list(_list_scene_rows(scene, stride))
    for frame in range(0, scene.steps, stride):
        for agent in scene.agents:
            if agent.first <= frame <= agent.last:
                x, y = agent.xy[frame - agent.first].tolist()
                heading = round(float(agent.heading[frame - agent.first]), 4)
                place = {"f": frame, "p": agent.id, "x": x, "y": y}
                rows.append({"track": {**place, "class": agent.names.tracks, "heading": heading}})
    text = "".join(json.dumps(row, separators=(",", ":")) + "\n" for row in rows)
    return {f"{scene.name}.ndjson": text.encode()}


def _list_scene_rows(scene: ExportedScene, stride: int) -> Iterator[dict[str, Any]]:
    """The last 8 s of every agent that is there so long, first who takes part in an event.

    Those have a row even if they are there for a shorter time.
    """
    met, number = scene.list_event_agents(), 0
    for agent in sorted(scene.agents, key=lambda a: (a.id not in met, a.role != "foreground")):
        # The frames at which the agent has a sample.
        frames = np.arange(-(-agent.first // stride) * stride, agent.last + 1, stride)[-LENGTH:]
        if len(frames) >= (SHORTEST if agent.id in met else LENGTH):
            ends = {"s": int(frames[0]), "e": int(frames[-1])}
            yield {"scene": {"id": number, "p": agent.id, **ends, "fps": FPS}}
            number += 1
