"""TrajNet++ ndjson: positions of all agents every 0.4 s, and a scene row per agent to predict.

Each row of a track has two keys that the benchmark does not know, `class` and `heading`: readers
of TrajNet++ ignore them, ours uses the class.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Literal, NoReturn

import numpy as np

from scenewright.errors import InputError
from scenewright.tools.formats.exported_scene import ExportedScene
from scenewright.tools.formats.sample_table import SampleTable, crop, decode_text, find_fault
from scenewright.tools.formats.sampled_recording import SampledRecording

SAMPLE = 0.4
"""Between samples [s]."""
FPS, SLOWEST, FASTEST = 2.5, 0.5, 1000.0
"""Samples a second, and the fewest and the most that a file may have."""
LENGTH, SHORTEST = 21, 10
"""Samples of a scene of the benchmark, 9 observed and 12 predicted; and least of one of ours whose
agent takes part in an event that ends its track."""
Kind = Literal["scene", "track"]
_KINDS: tuple[Kind, ...] = ("scene", "track")
Predictions = Literal["refuse", "leave out", "first as tracks"]
"""What becomes of rows with a `prediction_number`: files of the benchmark hold up to three
predictions, numbered from 0, beside or in place of what was observed."""


def write(scene: ExportedScene) -> dict[str, bytes]:
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


def read(data: bytes, *, name: str, predictions: Predictions = "refuse") -> list[SampledRecording]:
    """Pedestrians from lines {"scene": {…, fps}} and {"track": {f, p, x, y}}.

    A track with a key `class`, as `write` writes it, is of that class.
    The scenes only say how fast the clock runs (2.5 frames/s unless they do): all tracks are taken
    for one recording. Frames keep the numbers of the video, so that the commonest step from frame
    to frame is one sample: t = f / (step in frames x fps).

    Raises:
        InputError: names the line and what to mend.
    """
    table, fps = SampleTable(name), dict[float, int]()
    lines = decode_text(data, name=name).split("\n")
    rows = iterate_trajnet_rows(lines, predictions=predictions, refuse=table.refuse)
    for line, kind, values in rows:
        if kind == "scene":
            rate = _check_number(values.get("fps", FPS), "fps", line, table)
            if not SLOWEST <= rate <= FASTEST:
                table.refuse(line, f"fps = {rate:g} must be frames per second of the samples")
            fps[rate] = line
            continue
        missing = [key for key in ("f", "p", "x", "y") if values.get(key) is None]
        if missing:
            table.refuse(line, f"the track has no {', '.join(missing)}; it needs f, p, x and y")
        who = values["p"]
        if isinstance(who, bool) or not isinstance(who, int | str) or who == "":
            table.refuse(line, "p must be the number of an agent")
        t, x, y = (_check_number(values[key], key, line, table) for key in "fxy")
        if t != int(t):
            table.refuse(line, f"f = {t:g} must be the whole number of a frame")
        word = str(values.get("class", "pedestrian"))
        table.add(line, str(who), word, {"t": t, "x": x, "y": y})
    if len(fps) > 1:
        (one, _), (other, line) = list(fps.items())[:2]
        table.refuse(line, f"fps {other:g} here and {one:g} elsewhere; split the file by fps")
    agents = table.list_agents()
    # The commonest step from one row of an agent to the next [frames]; 1 if there is none.
    steps = np.concatenate([np.zeros(0), *(np.diff(agent.t) for agent in agents)])
    found, counts = np.unique(steps, return_counts=True)
    stride = float(found[np.argmax(counts)]) if len(found) else 1.0
    unit = 1 / (next(iter(fps), FPS) * stride) if stride > 0 else 1.0
    return [SampledRecording("", agents, clock="f", unit=unit)]


def _check_number(value: Any, key: str, line: int, table: SampleTable) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        table.refuse(line, f"{key} is {crop(json.dumps(value))}, not a number")
    try:
        number = float(value)
    except OverflowError:
        table.refuse(line, f"{key} is too large")
    if reason := find_fault(key, number):
        table.refuse(line, reason)
    return number


def iterate_trajnet_rows(
    lines: Iterable[str], *, predictions: Predictions, refuse: Callable[[int, str], NoReturn]
) -> Iterator[tuple[int, Kind, dict[str, Any]]]:
    """The line, from 1, kind and values of every scene and row of a track; empty lines skipped.

    Args:
        refuse: raises the reader's error for a line and what is wrong with it.
    """
    for line, content in enumerate(lines, start=1):
        if not content.strip():
            continue
        try:
            entry = json.loads(content)
        except (ValueError, RecursionError) as error:
            refuse(line, f"no JSON: {getattr(error, 'msg', None) or 'cannot be read'}")
        if not isinstance(entry, dict):
            refuse(line, "expected one JSON object per line")
        kind = next((each for each in _KINDS if isinstance(entry.get(each), dict)), None)
        if kind is None:
            refuse(line, 'expected {"scene": {...}} or {"track": {"f", "p", "x", "y"}}')
        number = entry[kind].get("prediction_number") if kind == "track" else None
        if number is not None and predictions == "refuse":
            refuse(line, "this is a prediction; leave out tracks with a prediction_number")
        if number is None or (number == 0 and predictions == "first as tracks"):
            yield line, kind, entry[kind]
