"""Scenes of any origin in one form: generated ones, and scenes of equal length cut from a corpus.

A generated scene lasts up to 30 s and its agents may begin and end inside the map. The corpus is
cut the same way; else long waits would look rare in scenes only because they end.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import SceneRecord, SignalRecord
from scenewright.scene.track import STEP, Track
from scenewright.tools.map_grounding.signal_plan import SignalClock, build_signal_records
from scenewright.tools.relation_checker import RoadUser, read_users
from scenewright.tools.track_io import Recording, cut_windows

LENGTH = 30.0
"""Of the scenes cut from a corpus [s]: that of the longest scenes we make."""


@dataclass(frozen=True, eq=False)
class SceneTracks:
    """The motion of all agents in one scene.

    Attributes:
        users: all agents, in time of the scene; signals: its lights.
        asked: pairs of ids that a relation binds, `from` first.
    """

    users: tuple[RoadUser, ...]
    signals: tuple[SignalRecord, ...] = ()
    asked: tuple[tuple[int, int], ...] = ()


def convert_scene(scene: SceneRecord) -> SceneTracks:
    """Convert a generated scene."""
    asked = tuple((relation.from_, relation.to) for relation in scene.relations)
    return SceneTracks(read_users(scene), scene.signals, asked)


def cut_scenes(
    recordings: Iterable[Recording], *, intersection_map: IntersectionMap
) -> Iterator[tuple[str, SceneTracks]]:
    """Cut scenes of equal length, end to end, each with the name of its recording."""
    steps, program = round(LENGTH / STEP) + 1, intersection_map.signals
    for recording in recordings:
        for window in cut_windows(recording, steps=steps, every=1, stride=steps - 1, least_whole=0):
            users = []
            cut = zip(window.members, window.xy, window.heading, window.present, strict=True)
            for number, (member, xy, heading, present) in enumerate(cut):
                if present.sum() > 1:  # recorded tracks have no gaps
                    start = round(int(np.argmax(present)) * window.step, 1)
                    track = Track(xy[present], heading[present], start)
                    users.append(RoadUser(number, track, recording.agents[member].shape))
            signals: Sequence[SignalRecord] = ()
            if program is not None and recording.signal_time is not None:
                offset = (recording.signal_time + window.start) % program.cycle
                until = window.step * (window.present.shape[1] - 1)
                signals = build_signal_records(
                    SignalClock(program, offset), intersection_map=intersection_map, until=until
                )
            yield recording.name, SceneTracks(tuple(users), tuple(signals))
