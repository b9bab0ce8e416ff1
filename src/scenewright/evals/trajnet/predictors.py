"""Predictors: constant velocity and the refiner."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from scenewright.evals.trajnet.recording import (
    OBSERVED,
    PREDICTED,
    compute_times_around_now,
    interpolate_at_times,
)
from scenewright.scene.base import FloatArray

if TYPE_CHECKING:
    from scenewright.tools.trajnet_refiner.model import Refiner


Predictor = Callable[..., list[FloatArray]]
"""Predicts all agents of many scenes: of each scene [N, 12, 2] [m].

Args:
    pasts: of each scene [N, 9, 2] [m], NaN where unseen; all are seen at the last step.
    goals: of each scene [N, 2] where they are headed [m], NaN for none; or None.
    due: predicted step, from 1, at which agents are at their goals; None if unknown.
    step: [s] between positions.
"""


def predict_constant_velocity(pasts: Sequence[FloatArray], *_: Any, **__: Any) -> list[FloatArray]:
    """Repeat each agent's last step; agents unseen before it stay. Goals are ignored."""
    ahead = np.arange(1, PREDICTED + 1)[:, None]
    return [past[:, -1:] + ahead * np.nan_to_num(past[:, -1:] - past[:, -2:-1]) for past in pasts]


class Refining:
    """The refiner as a predictor of pedestrians.

    It has steps of its own; where a recording has longer ones, its inputs and what it
    predicts are drawn in between.
    """

    def __init__(self, net: Refiner) -> None:
        self.net = net

    def __call__(
        self,
        pasts: Sequence[FloatArray],
        goals: Sequence[FloatArray] | None = None,
        *,
        due: float | None = None,
        step: float = 0.4,
    ) -> list[FloatArray]:
        """See `Predictor`."""
        own, last = self.net.config.step, OBSERVED - 1
        longer = step > own + 1e-6
        given, wanted = (
            compute_times_around_now(OBSERVED, before=last, step=s) for s in (step, own)
        )
        steps = int(np.ceil(PREDICTED * step / own - 1e-6)) if longer else PREDICTED
        due = due if due is None or not longer else due * step / own
        drawn = compute_times_around_now(steps + 1, before=0, step=own)
        later = compute_times_around_now(PREDICTED + 1, before=0, step=step)[1:]
        aims: Sequence[FloatArray | None] = goals or [None] * len(pasts)
        found = []
        for past, goal in zip(pasts, aims, strict=True):
            seen = interpolate_at_times(past, given, wanted) if longer else past
            ahead = self._predict_scene(seen, goal, due, steps)
            if longer:
                whole = np.concatenate((past[:, -1:], ahead), axis=1)
                ahead = interpolate_at_times(whole, drawn, later)
            found.append(ahead)
        return found

    def _predict_scene(
        self, past: FloatArray, goal: FloatArray | None, due: float | None, steps: int
    ) -> FloatArray:
        """[N, steps, 2] at the network's step."""
        import torch

        from scenewright.tools.trajnet_refiner.model import Scenes, predict

        count = len(past)
        if not count:
            return np.zeros((0, steps, 2))
        centre = past[:, -1].mean(axis=0)
        away = np.full((count, 2), np.nan) if goal is None else goal - centre
        xy, aim = (
            torch.from_numpy(each.astype(np.float32))[None] for each in (past - centre, away)
        )
        moment = torch.full((1, count), torch.nan if due is None else float(due))
        scene = Scenes(xy, torch.zeros((1, count), dtype=torch.long), aim, moment)
        ahead = predict(self.net, scene.to(next(self.net.parameters()).device), steps=steps).xy[0]
        return np.asarray(ahead.cpu().numpy().astype(np.float64) + centre)
