"""Scenes to roll out: the given part of each track, and the goals."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lab.rollouts.prior_goals import (
    FindRoutePrior,
    RoutePrior,
    find_abreast,
    sample_continuations,
)
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.track_io import Recording, RecordingWindow, cut_windows
from scenewright.tools.track_io.recording import TRAJNET_EVERY, BoolArray, IntArray

COLUMNS = 75
GIVEN, SPACING = 9, 8
FURTHER = 4
"""Steps that a track must at least go on for after what is given."""


class RolloutTask(NamedTuple):
    """One scene to roll out.

    Attributes:
        xy: [N, T, 2] true positions [m], NaN where not there; given: [N, T] the positions given.
        goals: [N, T, 2] places to be in at that step [m]; NaN for none.
        kinds: [N] classes.
        ways: [N] the route and prior of agents to roll out; empty if unknown.
    """

    xy: FloatArray
    given: BoolArray
    goals: FloatArray
    kinds: tuple[str, ...]
    ways: tuple[RoutePrior | None, ...] = ()

    @property
    def there(self) -> BoolArray:
        """[N, T] whether an agent is present at a step."""
        return np.asarray(np.isfinite(self.xy).all(-1))

    @property
    def sought(self) -> BoolArray:
        """[N, T] the steps at which an agent's position is to be found."""
        return self.there & ~self.given

    @property
    def asked(self) -> IntArray:
        """Indices of the agents that are rolled out."""
        return np.flatnonzero(self.sought.any(axis=1))


def build_tasks(
    recordings: Sequence[Recording],
    *,
    before_end: int,
    most: int,
    way_of: FindRoutePrior | None = None,
) -> Iterator[RolloutTask]:
    """Build tasks from scenes end to end, evenly chosen if above `most`; goals on the true tracks.

    Args:
        before_end: steps of 0.4 s from the last goal to the end.
        way_of: if given, only agents with a route prior are rolled out, and the priors are kept.
    """
    cuts = [
        (recording, window)
        for recording in map(_extend_to_whole_scenes, recordings)
        for window in cut_windows(recording, steps=COLUMNS, stride=4 * COLUMNS, least_whole=0)
    ]
    chosen = np.unique(np.linspace(0, len(cuts) - 1, min(most, len(cuts))).astype(int))
    for recording, window in (cuts[k] for k in chosen):
        task = _build_task(recording, window, before_end, way_of)
        if len(task.asked):
            yield task


def _extend_to_whole_scenes(recording: Recording) -> Recording:
    """Extend a recording so that its last scene has full length; the added part is empty."""
    scene = COLUMNS * TRAJNET_EVERY * STEP
    scenes = math.ceil((recording.end - recording.begin) / scene - 1e-6)
    return replace(recording, end=recording.begin + max(scenes, 1) * scene)


def _build_task(
    recording: Recording, window: RecordingWindow, before_end: int, way_of: FindRoutePrior | None
) -> RolloutTask:
    members = [recording.agents[k] for k in window.members]
    kept = [k for k, agent in enumerate(members) if agent.subtype != "bicycle"]
    there = window.present[kept]
    xy = np.where(there[..., None], window.xy[kept], np.nan)
    marks = [_split_given(row, before_end) for row in there]
    ways: list[RoutePrior | None] = []
    if way_of is not None:
        ways = [way_of(recording, members[k]) if marks[n][1].any() else None
                for n, k in enumerate(kept)]  # fmt: skip
        marks = [mark if way else (row, np.zeros_like(row))
                 for mark, way, row in zip(marks, ways, there, strict=True)]  # fmt: skip
    given = np.array([mark[0] for mark in marks], dtype=bool).reshape(there.shape)
    goals = np.array([mark[1] for mark in marks], dtype=bool).reshape(there.shape)
    kinds = tuple(members[k].shape.type for k in kept)
    return RolloutTask(xy, given, np.where(goals[..., None], xy, np.nan), kinds, tuple(ways))


def _split_given(present: BoolArray, before_end: int) -> tuple[BoolArray, BoolArray]:
    """Return the [T] masks of the given part and of the goals; a short track is given whole."""
    given, goals = present.copy(), np.zeros_like(present)
    first, count = int(np.argmax(present)), int(present.sum())
    last_goal = first + count - 1 - before_end
    if count >= GIVEN + FURTHER + before_end:
        given[first + GIVEN :] = False
        at = np.append(np.arange(first + GIVEN - 1 + SPACING, last_goal, SPACING), last_goal)
        goals[at] = True
    return given, goals


def move_goals_to_prior(task: RolloutTask) -> RolloutTask:
    """Move the goals to the nearest points of the prior's path, due at the same times."""
    goals = task.goals.copy()
    for n in task.asked:
        at = np.flatnonzero(np.isfinite(goals[n, :, 0]))
        goals[n, at] = find_abreast(
            _get_route_prior(task, n), task.xy[n, task.given[n]], goals[n, at]
        )
    return task._replace(goals=goals)


def sample_prior_goals(
    task: RolloutTask, *, size: int, rng: np.random.Generator
) -> Iterator[RolloutTask]:
    """Sample goals from the prior: its place every `SPACING` steps, and at the last.

    That is at the end of the track, or before the prior has left the map.
    """
    drawn = {}
    for n in task.asked:
        steps = int(task.sought[n].sum())
        seen = task.xy[n, task.given[n]]
        drawn[n] = sample_continuations(
            _get_route_prior(task, n), seen, steps=steps, size=size, rng=rng
        )
    for k in range(size):
        goals = np.full_like(task.goals, np.nan)
        for n, places in drawn.items():
            begin = int(np.argmax(task.sought[n]))
            there = int(np.isfinite(places[k, :, 0]).sum())
            at = np.append(np.arange(SPACING - 1, there - 1, SPACING), there - 1)
            goals[n, begin + at[at >= 0]] = places[k, at[at >= 0]]
        yield task._replace(goals=goals)


def _get_route_prior(task: RolloutTask, n: int) -> RoutePrior:
    way = task.ways[n]
    if way is None:
        raise ValueError("an agent rolled out with the prior's goals needs a route prior")
    return way
