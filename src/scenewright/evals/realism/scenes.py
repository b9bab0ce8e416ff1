"""Scenes of any origin in one form: generated ones, and scenes of equal length cut from a corpus.

A generated scene lasts up to 30 s and its agents may begin and end inside the map. The corpus is
cut the same way; else long waits would look rare in scenes only because they end.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenewright.errors import InputError, Unsatisfiable
from scenewright.graph.run import load_scene, synthesize
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import SceneRecord, SignalRecord
from scenewright.scene.track import STEP, Track
from scenewright.tools.map_grounding.signal_plan import SignalClock, build_signal_records
from scenewright.tools.relation_checker import RoadUser, read_users
from scenewright.tools.track_io import Recording, RecordingWindow, cut_windows

LENGTH = 30.0
"""Of the scenes cut from a corpus [s]: that of the longest scenes we make."""
TIMES = ("09:00", "15:00", "21:00", "12:00", "18:00")
YIELDS = (
    "A vehicle yields to a pedestrian at {time}",
    "A car turning left yields to an oncoming car at {time}",
    "A car turning right yields to a pedestrian at {time}",
    "A car turning left yields to a pedestrian at {time}",
    "A car turning right yields to a car going straight on the cross street at {time}",
    "A pedestrian yields to a car turning right at {time}",
)
"""Requests for yielding agents."""
OTHERS = (
    "Normal traffic at {time}",
    "A car follows another car through the intersection at {time}",
    "A car narrowly misses a pedestrian at {time}",
    "A car hits a pedestrian at {time}",
    "Two cars collide at a right angle at {time}",
)
"""Requests for everything else that a scene may be."""


@dataclass(frozen=True, eq=False)
class SceneTracks:
    """The motion of all agents in one scene.

    Attributes:
        users: all agents, in time of the scene; signals: its lights.
        asked: pairs of ids that a relation binds, `from` first.
        foreground: ids of the agents that the request names; empty in a scene cut from a corpus.
    """

    users: tuple[RoadUser, ...]
    signals: tuple[SignalRecord, ...] = ()
    asked: tuple[tuple[int, int], ...] = ()
    foreground: frozenset[int] = frozenset()


def convert_scene(scene: SceneRecord) -> SceneTracks:
    """Convert a generated scene."""
    return SceneTracks(
        read_users(scene),
        scene.signals,
        tuple((relation.from_, relation.to) for relation in scene.relations),
        frozenset(agent.id for agent in scene.agents if agent.role == "foreground"),
    )


def list_requests(count: int) -> Iterator[tuple[str, int]]:
    """List instructions and seeds, two in three for yields, over relations and times of day."""
    for n in range(count):
        family, k = (OTHERS, n // 3) if n % 3 == 2 else (YIELDS, n - n // 3 - (n % 3 == 2))
        yield family[k % len(family)].format(time=TIMES[n % len(TIMES)]), n


def make_scenes(
    folder: Path, count: int, *, intersection: str, refiner: str = "none"
) -> dict[str, int]:
    """Make `count` scenes into a folder, one folder each, and count the outcomes.

    A request that cannot be met leaves no scene; the next ones are the same with any refiner.

    Raises:
        InputError: an argument that cannot be used.
    """
    counts = {"made": 0, "unsatisfiable": 0}
    for text, seed in list_requests(count):
        try:
            made = synthesize(text, intersection=intersection, seed=seed, refiner=refiner)
        except Unsatisfiable:
            counts["unsatisfiable"] += 1
            continue
        made.save(folder / f"{seed:04d}")
        counts["made"] += 1
    return counts


def read_scenes(folder: Path) -> list[SceneTracks]:
    """Read the scenes below a folder, in order of their names.

    Raises:
        InputError: there are none, or one cannot be read.
    """
    files = sorted(folder.rglob("scene.json"))
    if not files:
        raise InputError(f"there is no scene.json below {folder}")
    return [convert_scene(load_scene(file)) for file in files]


def cut_scenes(
    recordings: Iterable[Recording], *, intersection_map: IntersectionMap, length: float = LENGTH
) -> Iterator[tuple[str, SceneTracks]]:
    """Cut scenes of equal length, end to end, each with the name of its recording."""
    steps = round(length / STEP) + 1
    for recording in recordings:
        for window in cut_windows(recording, steps=steps, every=1, stride=steps - 1, least_whole=0):
            yield recording.name, _convert_window(window, recording, intersection_map)


def _convert_window(
    window: RecordingWindow, recording: Recording, intersection_map: IntersectionMap
) -> SceneTracks:
    users = (
        RoadUser(number, track, recording.agents[member].shape)
        for number, (member, track) in enumerate(
            zip(window.members, _cut_tracks(window), strict=True)
        )
    )
    signals: Sequence[SignalRecord] = ()
    if intersection_map.signals is not None and recording.signal_time is not None:
        offset = (recording.signal_time + window.start) % intersection_map.signals.cycle
        until = window.step * (window.present.shape[1] - 1)
        signals = build_signal_records(
            SignalClock(intersection_map.signals, offset),
            intersection_map=intersection_map,
            until=until,
        )
    return SceneTracks(tuple(user for user in users if len(user.track.xy) > 1), tuple(signals))


def _cut_tracks(window: RecordingWindow) -> Iterator[Track]:
    """Cut each agent's track to the time of the window; recorded tracks have no gaps."""
    for xy, heading, present in zip(window.xy, window.heading, window.present, strict=True):
        first = int(np.argmax(present))
        yield Track(xy[present], heading[present], round(first * window.step, 1))
