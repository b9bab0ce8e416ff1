"""Iterated prediction (paper 3.5): x_rf = DNN(x_ob; goals), x_ob <- concat(x_ob, x_rf).

A whole scene is written in one go: agents seen for a step or more are predicted, predictions count
as observed, and each agent heads for the next of its waypoints. With noise, what counts as observed
is drawn from the predicted Gaussian: real agents do not move as evenly as a mean.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.tools.trajnet_refiner.network import (
    Observed,
    Places,
    Prediction,
    RefinerNetwork,
)


class Waypoints(NamedTuple):
    """Where agents shall be, and when.

    Attributes:
        xy: [N, S, 2] places [m], in the order of time; NaN for none.
        due: [N, S] the column of the scene's time axis at which each is due; NaN for none.
    """

    xy: FloatArray
    due: FloatArray


def run_rollout(
    net: RefinerNetwork,
    known: FloatArray,
    *,
    classes: Places,
    waypoints: Waypoints | None = None,
    until: Places | None = None,
    keep: int | None = None,
    lead: int | Places = 0,
    noise: FloatArray | None = None,
) -> FloatArray:
    """A scene of any length, filled in from what is known of it.

    Args:
        known: [N, T, 2] positions [m], one per step of the network; NaN where not known. An
            agent is there from its first known position on; known positions are kept.
        classes: [N] places in `config.CLASSES`.
        until: [N] first column at which an agent is no longer there; to the end if None.
        keep: predicted steps that are kept before agents are observed anew; all if None.
        lead: steps before a waypoint is due from which the next one counts, for all or [N]: who
            must be in a place to the moment gets there with a jerk. The last one counts to the end.
        noise: [N, T, 2] standard normal numbers; those of the first column of what is kept
            move all of it off the mean. The mean itself if None.

    Returns:
        [N, T, 2]; NaN before an agent's first known position and from `until` on.
    """
    config = net.config
    filled, columns = np.array(known, dtype=np.float64), known.shape[1]
    steps = min(keep or config.predicted, config.predicted)
    # The columns behind an agent's last known position, from which it is predicted.
    there = np.isfinite(filled).all(-1)
    ends = {int(each) for each in np.where(there, np.arange(1, columns + 1), 0).max(axis=1)}
    gone = np.zeros(filled.shape[:2], dtype=np.bool_)
    if until is not None:
        gone = np.arange(columns) >= until[:, None]
    filled[gone] = np.nan
    early = np.zeros(len(known), dtype=np.int64) + lead
    now = 1
    while now < columns:
        ahead = min([steps, columns - now, *(end - now for end in ends if end > now)])
        wanted = config.predicted if keep is None else steps
        goal, due = None, None
        if waypoints is not None:
            goal, due = _select_next_waypoints(*waypoints, now, wanted, early)
        scene = Observed(filled[:, max(0, now - config.observed) : now], classes, goal, due)
        part = filled[:, now : now + ahead]
        open_ = np.isnan(part) & ~gone[:, now : now + ahead, None]
        # Who is not predicted stays where it is, so all are if there is a second stride.
        asked = np.asarray(open_.any(axis=(1, 2))) if wanted <= config.stride else None
        predicted = net.predict(scene, steps=wanted, wanted=asked)
        drawn = predicted.xy[:, :ahead].astype(np.float64)
        if noise is not None:
            drawn = drawn + _sample_offsets(predicted, noise[:, now])[:, :ahead]
        part[open_] = drawn[open_]
        now += ahead
    return filled


def _sample_offsets(predicted: Prediction, noise: FloatArray) -> FloatArray:
    """[N, P, 2] deviations from the predicted means [m] for normal samples [N, 2]."""
    log_x, log_y, rho = predicted.spread.astype(np.float64).transpose(2, 0, 1)
    one, two = noise[:, :1], noise[:, 1:]
    along = np.exp(log_x) * one
    across = np.exp(log_y) * (rho * one + np.sqrt(1.0 - rho**2) * two)
    c, s = predicted.along[:, :1], predicted.along[:, 1:]
    return np.stack((c * along - s * across, s * along + c * across), -1)


@compiled
def _select_next_waypoints(
    places: FloatArray, due: FloatArray, now: int, steps: int, lead: Places
) -> tuple[FloatArray, FloatArray]:
    """Per predicted step the next waypoint, [N, P, 2], and [N, P] steps from `now` to it.

    A step's own waypoint counts: due at column `now` means due at the first predicted step. After
    the last waypoint there is no goal.

    Args:
        places, due, lead: as `run_rollout` has them.
    """
    goal, when = np.full((len(due), steps, 2), np.nan), np.full((len(due), steps), np.nan)
    for n in range(len(due)):
        last = np.nanmax(due[n])
        for step in range(steps):
            for k in range(due.shape[1]):
                counts = due[n, k] >= now + step + (0 if due[n, k] == last else lead[n])
                if counts and not due[n, k] - now + 1 >= when[n, step]:
                    goal[n, step], when[n, step] = places[n, k], due[n, k] - now + 1
    return goal, when
