"""Iterated prediction (paper 3.5): x_rf = DNN(x_ob; goals), x_ob <- concat(x_ob, x_rf).

A whole scene is written in one go: agents seen for a step or more are predicted, predictions count
as observed, and each agent heads for the next of its waypoints. With noise, what counts as observed
is drawn from the predicted Gaussian: real agents do not move as evenly as a mean.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from scenewright.tools.trajnet_refiner.model import Prediction, Refiner, Scenes, predict, turn


class Waypoints(NamedTuple):
    """Where agents shall be, and when.

    Attributes:
        xy: [B, N, S, 2] places [m], in the order of time; NaN for none.
        due: [B, N, S] the column of the scene's time axis at which each is due; NaN for none.
    """

    xy: Tensor
    due: Tensor


def run_rollout(
    net: Refiner,
    known: Tensor,
    *,
    classes: Tensor,
    waypoints: Waypoints | None = None,
    until: Tensor | None = None,
    keep: int | None = None,
    lead: int | Tensor = 0,
    noise: Tensor | None = None,
) -> Tensor:
    """A scene of any length, filled in from what is known of it.

    Args:
        known: [B, N, T, 2] positions [m], one per step of the network; NaN where not known. An
            agent is there from its first known position on; known positions are kept.
        classes: [B, N] places in `model.CLASSES`.
        until: [B, N] first column at which an agent is no longer there; to the end if None.
        keep: predicted steps that are kept before agents are observed anew; all if None.
        lead: steps before a waypoint is due from which the next one counts, for all or [B, N]: who
            must be in a place to the moment gets there with a jerk. The last one counts to the end.
        noise: [B, N, T, 2] standard normal numbers; those of the first column of what is kept
            move all of it off the mean. The mean itself if None.

    Returns:
        [B, N, T, 2]; NaN before an agent's first known position and from `until` on.
    """
    config = net.config
    filled, columns = known.clone(), known.shape[2]
    steps = min(keep or config.predicted, config.predicted)
    ends = _list_ends(known)
    if until is not None:
        gone = torch.arange(columns, device=known.device) >= until[..., None]
        filled[gone] = torch.nan
    now = 1
    while now < columns:
        ahead = min([steps, columns - now, *(end - now for end in ends if end > now)])
        goal, due = None, None
        if waypoints is not None:
            goal, due = _select_next_waypoints(waypoints, now, config.predicted, lead)
        scenes = Scenes(filled[:, :, max(0, now - config.observed) : now], classes, goal, due)
        predicted = predict(net, scenes, steps=config.predicted if keep is None else steps)
        drawn = predicted.xy[:, :, :ahead]
        if noise is not None:
            drawn = drawn + _sample_offsets(predicted, noise[:, :, now])[:, :, :ahead]
        part = filled[:, :, now : now + ahead]
        filled[:, :, now : now + ahead] = torch.where(part.isnan(), drawn, part)
        if until is not None:
            filled[gone] = torch.nan
        now += ahead
    return filled


def _sample_offsets(predicted: Prediction, noise: Tensor) -> Tensor:
    """[B, N, P, 2] deviations from the predicted means [m] for normal samples [B, N, 2]."""
    log_x, log_y, rho = predicted.spread.unbind(-1)
    one, two = noise[:, :, None].unbind(-1)
    along = log_x.exp() * one
    across = log_y.exp() * (rho * one + (1.0 - rho.square()).sqrt() * two)
    off = torch.stack((along, across), -1)
    return turn(off, predicted.along[:, :, None].expand_as(off))


def _list_ends(known: Tensor) -> list[int]:
    """List the columns behind an agent's last known position, from which it is predicted."""
    there = ~known.isnan().any(-1)
    columns = torch.arange(1, known.shape[2] + 1, device=known.device)
    return sorted(set(torch.where(there, columns, 0).amax(-1).flatten().tolist()))


def _select_next_waypoints(
    waypoints: Waypoints, now: int, steps: int, lead: int | Tensor = 0
) -> tuple[Tensor, Tensor]:
    """Per predicted step the next waypoint, [B, N, P, 2], and [B, N, P] steps from `now` to it.

    A step's own waypoint counts: due at column `now` means due at the first predicted step. After
    the last waypoint there is no goal.
    """
    due = torch.nan_to_num(waypoints.due, nan=-1.0)
    column = now + torch.arange(steps, device=due.device)
    every = due[:, :, None, :]
    early = torch.as_tensor(lead, device=due.device)[..., None, None]
    in_time = every >= column[:, None] + early
    last = (every == due.amax(-1)[..., None, None]) & (every >= column[:, None])
    later = torch.where(in_time | last, every, torch.inf)
    when, which = later.min(dim=-1)
    places = waypoints.xy.gather(2, which[..., None].expand(*which.shape, 2))
    none = when.isinf()
    return (
        places.masked_fill(none[..., None], torch.nan),
        (when - now + 1).masked_fill(none, torch.nan),
    )
