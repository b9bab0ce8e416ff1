"""Training windows: stretches of observed and future motion of all agents seen together.

Windows are kept as arrays, put into batches of about the same number of agents, and varied when
they are drawn: mirrored, stretched, blurred, partly unseen, with and without goals.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from scenewright.scene.base import FloatArray
from scenewright.tools.trajnet_refiner.model import Scenes


@dataclass(frozen=True, eq=False)
class Window:
    """All agents seen at the present step of one stretch of time.

    Attributes:
        xy: [N, T, 2] observed and future positions [m]; NaN where unseen.
        classes: [N] places in `model.CLASSES`.
        destination: [N, 2] where each is last seen [m], beyond the window too; NaN if unknown.
        weight: [N] of each agent's errors in training.
    """

    xy: FloatArray
    classes: NDArray[np.int64]
    destination: FloatArray
    weight: FloatArray

    def __post_init__(self) -> None:
        n = len(self.xy)
        if self.xy.ndim != 3 or self.xy.shape[2] != 2:
            raise ValueError(f"positions must be [agents, steps, 2], got {self.xy.shape}")
        if self.classes.shape != (n,) or self.weight.shape != (n,):
            raise ValueError("one class and one weight per agent")
        if self.destination.shape != (n, 2):
            raise ValueError("one destination per agent")


@dataclass(frozen=True)
class Variation:
    """How windows are varied in training; the defaults of `train`.

    Attributes:
        stretch: windows are scaled by a factor between 1 - stretch and 1 + stretch.
        noise: standard deviation of what is added to observed positions [m], at most.
        unseen: share of agents of which some observed steps are taken away.
        goals: share of windows in which agents are given goals.
    """

    stretch: float = 0.25
    noise: float = 0.0
    unseen: float = 0.1
    goals: float = 0.4


SPACING = (2, 12)
"""Fewest and most steps from one waypoint of a row to the next."""


def build_batches(
    windows: Sequence[Window],
    *,
    observed: int,
    agents: int,
    variation: Variation,
    rng: np.random.Generator,
    rows: bool = False,
) -> Iterator[tuple[Scenes, Tensor, Tensor]]:
    """All windows once, in random order, about `agents` at a time, as (scenes, future, weight).

    Args:
        rows: as `collate_windows` has it.
    """
    groups = group_by_size([len(w.xy) for w in windows], agents=agents, rng=rng)
    for k in rng.permutation(len(groups)):
        chosen = [
            vary_window(windows[i], observed=observed, by=variation, rng=rng) for i in groups[k]
        ]
        yield collate_windows(chosen, observed=observed, goals=variation.goals, rng=rng, rows=rows)


def group_by_size(
    sizes: Sequence[int], *, agents: int, rng: np.random.Generator
) -> list[NDArray[np.int64]]:
    """Places of windows of similar size, together about `agents` with their padding."""
    order = np.lexsort((rng.random(len(sizes)), np.asarray(sizes)))[::-1]
    groups, start = [], 0
    while start < len(order):
        count = max(1, agents // max(1, sizes[int(order[start])]))
        groups.append(order[start : start + count])
        start += count
    return groups


def vary_window(
    window: Window, *, observed: int, by: Variation, rng: np.random.Generator
) -> Window:
    """A window that could as well have happened: mirrored, stretched, blurred, partly unseen."""
    factor = rng.uniform(1 - by.stretch, 1 + by.stretch)
    scale = np.array([factor, factor * rng.choice((-1.0, 1.0))])
    xy = window.xy * scale
    past = xy[:, :observed]
    past += rng.normal(0.0, rng.uniform(0.0, by.noise + 1e-12), past.shape)
    hit = rng.random(len(xy)) < by.unseen
    first = rng.integers(0, observed - 1, len(xy))
    length = rng.integers(1, observed, len(xy))
    k = np.arange(observed)
    gone = hit[:, None] & (k >= first[:, None]) & (k < (first + length)[:, None])
    past[gone & (k < observed - 1)] = np.nan
    return Window(xy, window.classes, window.destination * scale, window.weight)


def collate_windows(
    windows: Sequence[Window],
    *,
    observed: int,
    goals: float,
    rng: np.random.Generator,
    rows: bool = False,
) -> tuple[Scenes, Tensor, Tensor]:
    """Windows as one padded batch, centred, a share `goals` of them with goals of both kinds.

    Args:
        rows: of windows with a second horizon; then goals are rows of waypoints, one for each step.
    """
    most, steps = max(len(w.xy) for w in windows), windows[0].xy.shape[1]
    predicted = (steps - observed) // (2 if rows else 1)
    each = (predicted,) if rows else ()
    xy = np.full((len(windows), most, steps, 2), np.nan)
    classes = np.zeros((len(windows), most), dtype=np.int64)
    goal = np.full((len(windows), most, *each, 2), np.nan)
    due = np.full((len(windows), most, *each), np.nan)
    weight = np.zeros((len(windows), most))
    for b, window in enumerate(windows):
        n = len(window.xy)
        centre = np.nanmean(window.xy[:, observed - 1], axis=0)
        xy[b, :n] = window.xy - centre
        classes[b, :n], weight[b, :n] = window.classes, window.weight
        if rng.random() < goals:
            given, when = (
                _sample_waypoints(window.xy[:, observed:], predicted, rng)
                if rows
                else draw_goals(window, observed=observed, rng=rng)
            )
            goal[b, :n], due[b, :n] = given - centre, when
    scenes = Scenes(
        _make_single_precision(xy[:, :, :observed]),
        torch.from_numpy(classes),
        _make_single_precision(goal),
        _make_single_precision(due),
    )
    future = xy[:, :, observed : observed + predicted]
    return scenes, _make_single_precision(future), _make_single_precision(weight)


def draw_goals(
    window: Window, *, observed: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """For each agent its destination, a place on its way with its time, or nothing.

    Returns:
        [N, 2] goals and [N] steps until they are due; NaN for none.
    """
    n, future = len(window.xy), window.xy[:, observed:]
    when = rng.integers(2, future.shape[1] + 1, n)
    when = np.where(rng.random(n) < 0.5, future.shape[1], when)
    on_the_way = future[np.arange(n), when - 1]
    kind = rng.random(n)
    goal = np.where((kind < 0.5)[:, None], window.destination, on_the_way)
    goal = np.where((kind < 0.9)[:, None], goal, np.nan)
    due = np.where((kind >= 0.5) & np.isfinite(goal).all(axis=1), when, np.nan)
    return goal, due


def _sample_waypoints(
    future: FloatArray, predicted: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """For each agent and step the next of its waypoints, evenly spaced on its way.

    Args:
        future: [N, 2 P, 2] positions, NaN where unseen.

    Returns:
        [N, P, 2] places and [N, P] steps from now until they are due; NaN for none.
    """
    n, steps = future.shape[:2]
    spacing = rng.integers(SPACING[0], SPACING[1] + 1, size=(n, 1))
    first = rng.integers(1, SPACING[1] + 1, size=(n, 1)) % spacing
    step = np.arange(1, predicted + 1)[None]
    due = step + (first - step) % spacing  # the first of first + k spacing not before the step
    known = due <= steps
    at = np.minimum(due, steps) - 1
    places = np.take_along_axis(future, at[..., None], axis=1)
    places = np.where(known[..., None], places, np.nan)
    return places, np.where(np.isfinite(places).all(-1), due.astype(np.float64), np.nan)


def _make_single_precision(array: FloatArray) -> Tensor:
    return torch.from_numpy(array.astype(np.float32))
