"""Scenes to roll out: what is told of everybody's track, and where the goals come from."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from scenewright.evals.realism.prior_goals import Way, WayOf, abreast, driven
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.track_io import Recording, RecordingWindow, cut_windows
from scenewright.tools.track_io.recording import IntArray
from scenewright.tools.track_io.windows import TRAJNET_EVERY, BoolArray

COLUMNS = 75
GIVEN, SPACING = 9, 8
FURTHER = 4
"""Steps that a track must at least go on for after what is given."""


class Task(NamedTuple):
    """One scene to roll out.

    Attributes:
        xy: [N, T, 2] true positions [m], NaN where not there; given: [N, T] which are told.
        goals: [N, T, 2] places to be in at that step [m]; NaN for none.
        kinds: [N] classes.
        ways: [N] what else is known of who is rolled out; empty if nothing is.
    """

    xy: FloatArray
    given: BoolArray
    goals: FloatArray
    kinds: tuple[str, ...]
    ways: tuple[Way | None, ...] = ()

    @property
    def there(self) -> BoolArray:
        """[N, T] who is there when."""
        return np.asarray(np.isfinite(self.xy).all(-1))

    @property
    def sought(self) -> BoolArray:
        """[N, T] where who is rolled out is to be found."""
        return self.there & ~self.given

    @property
    def asked(self) -> IntArray:
        """Who is rolled out."""
        return np.flatnonzero(self.sought.any(axis=1))


def tasks(
    recordings: Sequence[Recording], *, before_end: int, most: int, way_of: WayOf | None = None
) -> Iterator[Task]:
    """Scenes end to end, evenly chosen if there are more than `most`; goals on the true ways.

    Args:
        before_end: steps of 0.4 s from the last goal to the end.
        way_of: then only who has a way is rolled out, and the ways are kept.
    """
    cuts = [
        (recording, window)
        for recording in map(_in_whole_scenes, recordings)
        for window in cut_windows(recording, steps=COLUMNS, stride=4 * COLUMNS, least_whole=0)
    ]
    chosen = np.unique(np.linspace(0, len(cuts) - 1, min(most, len(cuts))).astype(int))
    for recording, window in (cuts[k] for k in chosen):
        task = _task(recording, window, before_end, way_of)
        if len(task.asked):
            yield task


def _in_whole_scenes(recording: Recording) -> Recording:
    """The recording, its last scene as long as any: nobody is there in what is added."""
    scene = COLUMNS * TRAJNET_EVERY * STEP
    scenes = math.ceil((recording.end - recording.begin) / scene - 1e-6)
    return replace(recording, end=recording.begin + max(scenes, 1) * scene)


def _task(
    recording: Recording, window: RecordingWindow, before_end: int, way_of: WayOf | None
) -> Task:
    members = [recording.agents[k] for k in window.members]
    kept = [k for k, agent in enumerate(members) if agent.subtype != "bicycle"]
    there = window.present[kept]
    xy = np.where(there[..., None], window.xy[kept], np.nan)
    marks = [_told(row, before_end) for row in there]
    ways: list[Way | None] = []
    if way_of is not None:
        ways = [way_of(recording, members[k]) if marks[n][1].any() else None
                for n, k in enumerate(kept)]  # fmt: skip
        marks = [mark if way else (row, np.zeros_like(row))
                 for mark, way, row in zip(marks, ways, there, strict=True)]  # fmt: skip
    given = np.array([mark[0] for mark in marks], dtype=bool).reshape(there.shape)
    goals = np.array([mark[1] for mark in marks], dtype=bool).reshape(there.shape)
    kinds = tuple(members[k].shape.type for k in kept)
    return Task(xy, given, np.where(goals[..., None], xy, np.nan), kinds, tuple(ways))


def _told(present: BoolArray, before_end: int) -> tuple[BoolArray, BoolArray]:
    """[T] what is given of a track, and its goals; a track that is too short is given whole."""
    given, goals = present.copy(), np.zeros_like(present)
    first, count = int(np.argmax(present)), int(present.sum())
    last_goal = first + count - 1 - before_end
    if count >= GIVEN + FURTHER + before_end:
        given[first + GIVEN :] = False
        at = np.append(np.arange(first + GIVEN - 1 + SPACING, last_goal, SPACING), last_goal)
        goals[at] = True
    return given, goals


def on_the_priors_way(task: Task) -> Task:
    """The same task, its goals due at the same times where the prior's way is abreast of them."""
    goals = task.goals.copy()
    for n in task.asked:
        at = np.flatnonzero(np.isfinite(goals[n, :, 0]))
        goals[n, at] = abreast(_way(task, n), task.xy[n, task.given[n]], goals[n, at])
    return task._replace(goals=goals)


def as_the_prior_goes(task: Task, *, size: int, rng: np.random.Generator) -> Iterator[Task]:
    """Draws of the same task: where the prior is every `SPACING` steps, and at the last.

    That is at the end of the track, or before the prior has left the map.
    """
    drawn = {}
    for n in task.asked:
        steps = int(task.sought[n].sum())
        seen = task.xy[n, task.given[n]]
        drawn[n] = driven(_way(task, n), seen, steps=steps, size=size, rng=rng)
    for k in range(size):
        goals = np.full_like(task.goals, np.nan)
        for n, places in drawn.items():
            begin = int(np.argmax(task.sought[n]))
            there = int(np.isfinite(places[k, :, 0]).sum())
            at = np.append(np.arange(SPACING - 1, there - 1, SPACING), there - 1)
            goals[n, begin + at[at >= 0]] = places[k, at[at >= 0]]
        yield task._replace(goals=goals)


def _way(task: Task, n: int) -> Way:
    way = task.ways[n]
    if way is None:
        raise ValueError("who is rolled out with the prior's goals has a way")
    return way
