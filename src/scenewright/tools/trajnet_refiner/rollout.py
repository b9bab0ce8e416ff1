"""Iterated prediction (paper 3.5): x_rf = DNN(x_ob; goals), x_ob <- concat(x_ob, x_rf).

A whole scene is written in one go: whoever has been seen for a step or more is predicted, what was
predicted is taken for seen, and everybody heads for the next of its waypoints.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from scenewright.tools.trajnet_refiner.model import Refiner, Scenes, predict


class Waypoints(NamedTuple):
    """Where agents shall be, and when.

    Attributes:
        xy: [B, N, S, 2] places [m], in the order of time; NaN for none.
        due: [B, N, S] the column of the scene's time axis at which each is due; NaN for none.
    """

    xy: Tensor
    due: Tensor


def roll_out(
    net: Refiner,
    known: Tensor,
    *,
    classes: Tensor,
    waypoints: Waypoints | None = None,
    until: Tensor | None = None,
    keep: int | None = None,
) -> Tensor:
    """A scene of any length, filled in from what is known of it.

    Args:
        known: [B, N, T, 2] positions [m], one per step of the network; NaN where not known. An
            agent is there from its first known position on; known positions are kept.
        classes: [B, N] places in `model.CLASSES`.
        until: [B, N] first column at which an agent is no longer there; to the end if None.
        keep: predicted steps that are kept before everybody is observed anew; all if None.

    Returns:
        [B, N, T, 2]; NaN before an agent's first known position and from `until` on.
    """
    config = net.config
    filled, columns = known.clone(), known.shape[2]
    keep = min(keep or config.predicted, config.predicted)
    ends = _ends(known)
    if until is not None:
        gone = torch.arange(columns, device=known.device) >= until[..., None]
        filled[gone] = torch.nan
    now = 1
    while now < columns:
        ahead = min([keep, columns - now, *(end - now for end in ends if end > now)])
        goal, due = (None, None) if waypoints is None else _next(waypoints, now, config.predicted)
        scenes = Scenes(filled[:, :, :now], classes, goal, due)
        drawn = predict(net, scenes).xy[:, :, :ahead]
        part = filled[:, :, now : now + ahead]
        filled[:, :, now : now + ahead] = torch.where(part.isnan(), drawn, part)
        if until is not None:
            filled[gone] = torch.nan
        now += ahead
    return filled


def _ends(known: Tensor) -> list[int]:
    """Columns behind somebody's last known position: from there on it is predicted afresh."""
    there = ~known.isnan().any(-1)
    columns = torch.arange(1, known.shape[2] + 1, device=known.device)
    return sorted(set(torch.where(there, columns, 0).amax(-1).flatten().tolist()))


def _next(waypoints: Waypoints, now: int, steps: int) -> tuple[Tensor, Tensor]:
    """Per predicted step the next waypoint, [B, N, P, 2], and [B, N, P] steps from `now` to it.

    A step's own waypoint counts: due at column `now` means due at the first predicted step. After
    the last waypoint there is no goal.
    """
    due = torch.nan_to_num(waypoints.due, nan=-1.0)
    column = now + torch.arange(steps, device=due.device)
    ahead = due[:, :, None, :] >= column[:, None]
    later = torch.where(ahead, due[:, :, None, :], torch.inf)
    when, which = later.min(dim=-1)
    places = waypoints.xy.gather(2, which[..., None].expand(*which.shape, 2))
    none = when.isinf()
    return (
        places.masked_fill(none[..., None], torch.nan),
        (when - now + 1).masked_fill(none, torch.nan),
    )
