"""Data sets to compare: generated scenes and recordings of any origin, in stretches of 30 s.

A source is a folder of scenes (a batch's output, too), a corpus (`simulate --corpus`), or tracks
in any form that `intersections fit` reads. All are cut alike, so that neither the length of a track
separates them, nor long waits look rare in scenes only because scenes end.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path

import numpy as np

from scenewright.errors import InputError
from scenewright.graph.scene_files import load_scene
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import EventRecord, SceneRecord, SignalRecord
from scenewright.scene.track import PEDESTRIAN, STEP, Track, get_rider_shape, get_vehicle_shape
from scenewright.tools.map_grounding.signal_plan import SignalClock, build_signal_records
from scenewright.tools.relation_checker import RoadUser, read_users
from scenewright.tools.track_io import Recording, load_recordings
from scenewright.tools.track_io.track_files import read_track_files

LENGTH = 30.0
"""Of a stretch [s]: that of the longest scenes."""
_FEWEST = 5
"""Pieces of fewer samples are left out."""
MOST_STRETCHES = 240
"""Of a corpus: spread evenly over its test hours."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """The motion of all agents in one scene, or in up to 30 s of a recording.

    Attributes:
        users: all agents; foreground: ids of the agents that a request names.
        groups: by id, the group that is kept together when data are split: the scene, or for a
            recording the agents that came into it at about the same time.
        events: the scene's annotated events; None where there are no annotations.
        place: the intersection; None where it is none of ours. hour: of the day, if a scene's
            number of people was left to the hour; else None.
        begin: in time of the recording [s].
        signals: its lights; asked: pairs of ids that a relation binds, `from` first.
    """

    users: tuple[RoadUser, ...]
    groups: Mapping[int, str] = field(default_factory=dict)
    foreground: frozenset[int] = frozenset()
    events: tuple[EventRecord, ...] | None = None
    place: str | None = None
    hour: int | None = None
    begin: float = 0.0
    signals: tuple[SignalRecord, ...] = ()
    asked: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, eq=False)
class TrackSource:
    """A data set.

    Attributes:
        name: for tables; stretches: of it; notes: what cleaning took away.
    """

    name: str
    stretches: tuple[Stretch, ...]
    notes: tuple[str, ...] = field(default=())


def read_source(text: str, *, place: str | None = None, scale: float | None = None) -> TrackSource:
    """Read the data set at NAME=PATH, or at PATH, whose last part is then its name.

    Args:
        place: the intersection of a corpus or recording, whose frame its positions are in.
        scale: metres per pixel of tracks in pixels (VTP-TL); others are in metres as they are.

    Raises:
        InputError: nothing there, or it cannot be read.
    """
    name, separator, rest = text.partition("=")
    path = Path(rest if separator else text)
    name = name if separator else path.stem
    if path.is_dir() and next(path.rglob("scene.json"), None) is not None:
        return TrackSource(name, tuple(read_scenes(path)))
    if path.suffix == ".npz":
        recordings = load_recordings(path, split="test")
        if not recordings:
            raise InputError(f"{path} holds no test hours")
        cut = (_cut(r.name, list_users(r, riders=False), place=place) for r in recordings)
        every = [*chain.from_iterable(cut)]
        step = max(len(every) // MOST_STRETCHES, 1)
        return TrackSource(name, tuple(every[::step][:MOST_STRETCHES]))
    pixels = path.suffix == ".txt" or (path.is_dir() and any(path.rglob("DJI_*.txt")))
    files = read_track_files([path], scale=scale if pixels else None)
    shapes = {"pedestrian": PEDESTRIAN, "bicycle": get_rider_shape("cyclist")}
    stretches: list[Stretch] = []
    for file in files:
        users = [
            RoadUser(k, track, shapes.get(word) or get_vehicle_shape(word))
            for k, (word, track) in enumerate(file.tracks)
        ]
        stretches += _cut(file.name, users, place=place)
    removed = sum((file.removed for file in files[1:]), start=files[0].removed)
    if not stretches:
        raise InputError(f"{path} holds no tracks that can be believed")
    return TrackSource(name, tuple(stretches), tuple(removed.format_lines()))


def list_users(recording: Recording, *, riders: bool = True) -> list[RoadUser]:
    """List the agents of a recording, with or without bicycles, numbered."""
    kept = (agent for agent in recording.agents if riders or agent.subtype != "bicycle")
    return [RoadUser(k, agent.track, agent.shape) for k, agent in enumerate(kept)]


def read_scenes(folder: Path) -> Iterator[Stretch]:
    """Read every scene below a folder, in order of their names."""
    for file in sorted(folder.rglob("scene.json")):
        yield convert_scene(load_scene(file), str(file.parent.relative_to(folder)))


def convert_scene(scene: SceneRecord, name: str = "") -> Stretch:
    """Convert a generated scene."""
    users = tuple(user for user in read_users(scene) if len(user.track.xy) > 1)
    counted = scene.meta.density is None and scene.meta.duration >= LENGTH - STEP
    return Stretch(
        users,
        {user.id: name for user in users},
        frozenset(agent.id for agent in scene.agents if agent.role == "foreground"),
        scene.events,
        scene.meta.intersection,
        int(scene.meta.time_of_day[:2]) if counted else None,
        signals=scene.signals,
        asked=tuple((relation.from_, relation.to) for relation in scene.relations),
    )


def cut_scenes(
    recordings: Iterable[Recording], *, intersection_map: IntersectionMap
) -> Iterator[Stretch]:
    """Cut scenes of 30 s, end to end, with the lights of the recordings that know theirs."""
    program = intersection_map.signals
    for recording in recordings:
        span = recording.begin, recording.end
        for scene in _cut(recording.name, list_users(recording), span=span, shortest=LENGTH):
            signals: Sequence[SignalRecord] = ()
            if program is not None and recording.signal_time is not None:
                clock = SignalClock(program, (recording.signal_time + scene.begin) % program.cycle)
                signals = build_signal_records(
                    clock, intersection_map=intersection_map, until=LENGTH
                )
            yield replace(scene, signals=tuple(signals))


def _cut(
    name: str,
    users: Sequence[RoadUser],
    *,
    place: str | None = None,
    span: tuple[float, float] | None = None,
    shortest: float = 0.0,
) -> Iterator[Stretch]:
    """Cut a recording into stretches of 30 s, end to end; the last may be as short as `shortest`.

    Args:
        span: first and last moment [s]; those of the tracks if None.
    """
    begin = span[0] if span else min((user.track.start for user in users), default=0.0)
    end = span[1] if span else max((user.track.end for user in users), default=0.0)
    for first in np.arange(begin, end - max(shortest, 1e-6) + 1e-6, LENGTH).tolist():
        parts = [(user, clip(user.track, first, first + LENGTH)) for user in users]
        seen = tuple(RoadUser(u.id, part, u.shape) for u, part in parts if part is not None)
        groups = {u.id: f"{name}:{int((u.track.start - begin) // LENGTH)}" for u, _ in parts}
        if seen:
            yield Stretch(seen, groups, place=place, begin=first)


def clip(track: Track, begin: float, end: float, *, fewest: int = _FEWEST) -> Track | None:
    """Cut a track from `begin` to before `end` [s], in time since `begin`.

    None where fewer than `fewest` samples are left.
    """
    times = track.times
    kept = np.flatnonzero((times >= begin - 1e-6) & (times < end - 1e-6))
    if len(kept) < fewest:
        return None
    start = round((float(times[kept[0]]) - begin) / STEP) * STEP
    return Track(track.xy[kept], track.heading[kept], round(start, 1), track.step)
