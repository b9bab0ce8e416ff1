"""Predictors: constant velocity and the refiner."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

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


class Predictor(Protocol):
    """Predicts all agents of many scenes."""

    def __call__(
        self,
        pasts: Sequence[FloatArray],
        goals: Sequence[FloatArray] | None = None,
        *,
        due: float | None = None,
        step: float = 0.4,
    ) -> list[FloatArray]:
        """Predict the motion of all agents.

        Args:
            pasts: of each scene [N, 9, 2] [m], NaN where unseen; all are seen at the last step.
            goals: of each scene [N, 2] where they are headed [m], NaN for none; or None.
            due: predicted step, from 1, at which agents are at their goals; None if unknown.
            step: [s] between positions.

        Returns:
            of each scene [N, 12, 2].
        """
        ...


def predict_constant_velocity(
    pasts: Sequence[FloatArray],
    goals: Sequence[FloatArray] | None = None,
    *,
    due: float | None = None,
    step: float = 0.4,
) -> list[FloatArray]:
    """Repeat each agent's last step; agents unseen before it stay. Goals are ignored."""
    del goals, due, step
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
        own = self.net.config.step
        if step < own + 1e-6:
            return self._predict_by_size(pasts, goals, due, PREDICTED)
        given, wanted = (
            compute_times_around_now(OBSERVED, before=OBSERVED - 1, step=s) for s in (step, own)
        )
        steps = int(np.ceil(PREDICTED * step / own - 1e-6))
        ahead = self._predict_by_size(
            [interpolate_at_times(past, given, wanted) for past in pasts],
            goals,
            None if due is None else due * step / own,
            steps,
        )
        drawn = compute_times_around_now(steps + 1, before=0, step=own)
        wanted = compute_times_around_now(PREDICTED + 1, before=0, step=step)[1:]
        return [
            interpolate_at_times(np.concatenate((past[:, -1:], path), axis=1), drawn, wanted)
            for past, path in zip(pasts, ahead, strict=True)
        ]

    def _predict_by_size(
        self,
        pasts: Sequence[FloatArray],
        goals: Sequence[FloatArray] | None,
        due: float | None,
        steps: int,
    ) -> list[FloatArray]:
        """[N, steps, 2] of each scene at the network's step, scenes of like size together."""
        import torch

        from scenewright.tools.trajnet_refiner.model import Scenes, predict
        from scenewright.tools.trajnet_refiner.windows import group_by_size

        found: dict[int, FloatArray] = {}
        sizes = [len(past) for past in pasts]
        device = next(self.net.parameters()).device
        for group in group_by_size(sizes, agents=2048, rng=np.random.default_rng(0)):
            chosen = [int(i) for i in group]
            most = max(sizes[i] for i in chosen)
            xy = np.full((len(chosen), most, OBSERVED, 2), np.nan)
            goal = np.full((len(chosen), most, 2), np.nan)
            centres = [pasts[i][:, -1].mean(axis=0) for i in chosen]
            for b, (i, centre) in enumerate(zip(chosen, centres, strict=True)):
                xy[b, : sizes[i]] = pasts[i] - centre
                if goals is not None:
                    goal[b, : sizes[i]] = goals[i] - centre
            scenes = Scenes(
                torch.from_numpy(xy.astype(np.float32)),
                torch.zeros(xy.shape[:2], dtype=torch.long),
                torch.from_numpy(goal.astype(np.float32)),
                torch.full(xy.shape[:2], torch.nan if due is None else float(due)),
            )
            ahead = predict(self.net, scenes.to(device), steps=steps).xy.cpu().numpy()
            for b, (i, centre) in enumerate(zip(chosen, centres, strict=True)):
                found[i] = ahead[b, : sizes[i]].astype(np.float64) + centre
        return [found[i] for i in range(len(pasts))]
