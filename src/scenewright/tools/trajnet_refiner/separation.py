"""Separation of predicted agents that would otherwise run into each other.

A network trained on distances alone lets some of its agents pass through each other. Here every
pair that comes too close is pushed apart where it is closest, both by the same amount, along the
line between them. The push fades out over the steps before and after, so motion stays smooth, and
is repeated until all pairs are far enough apart or the rounds are spent. It is deterministic,
turns with the scene, and knows only predictions, never what really happened.
"""

from __future__ import annotations

import torch
from torch import Tensor

ROUNDS = 40
FADE = 2.0
"""Steps over which a push fades, the width of a Gaussian."""
_EXTRA = 1.08
"""Pushes are a little longer than the gap lacks, or the last centimetre takes many rounds."""


def separate(xy: Tensor, *, among: Tensor, apart: float, rounds: int = ROUNDS) -> Tensor:
    """Positions in which no two of `among` come closer than `apart`, as far as rounds allow.

    Distances are taken at the steps and halfway between them.

    Args:
        xy: [B, N, P, 2] predicted positions [m]; NaN for agents that are not predicted.
        among: [B, N] the agents to move; others are neither moved nor avoided.
        apart: [m].

    Returns:
        [B, N, P, 2]; identical to `xy` where no agents come too close.
    """
    moved = xy.clone()
    flat = moved.flatten(0, 1)
    pairs = _close_pairs(xy, among, apart + 1.0)
    for _ in range(rounds if len(pairs) else 0):
        distance, when, way = _find_closest(flat, pairs)
        lacking = (apart - distance).clamp_min(0.0)
        if not bool((lacking > 0).any()):
            break
        steps = torch.arange(flat.shape[1], device=when.device, dtype=when.dtype)
        fade = torch.exp(-0.5 * ((steps[None] - when[:, None]) / FADE).square())
        push = (0.5 * _EXTRA * lacking)[:, None, None] * fade[..., None] * way[:, None]
        flat.index_add_(0, pairs[:, 0], push)
        flat.index_add_(0, pairs[:, 1], -push)
    return moved


def add_halfway(xy: Tensor) -> Tensor:
    """Append the P - 1 positions halfway between steps to positions [..., P, 2]."""
    return torch.cat((xy, 0.5 * (xy[..., 1:, :] + xy[..., :-1, :])), dim=-2)


def _close_pairs(xy: Tensor, among: Tensor, within: float) -> Tensor:
    """[Q, 2] rows of agents of one scene that ever come within `within` metres, each pair once."""
    b, n, p, _ = xy.shape
    there = among & ~xy.isnan().flatten(2).any(-1)
    place = torch.nan_to_num(xy)
    least = place.new_full((b, n, n), torch.inf)
    for k in range(p):
        least = torch.minimum(least, torch.cdist(place[:, :, k], place[:, :, k]))
    able = there[:, :, None] & there[:, None, :]
    upper = torch.ones(n, n, dtype=torch.bool, device=xy.device).triu(1)
    scene, first, second = torch.nonzero(able & upper & (least < within), as_tuple=True)
    return torch.stack((scene * n + first, scene * n + second), dim=-1)


def _find_closest(flat: Tensor, pairs: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Of each pair the least distance [m], when it is [steps], and the unit vector to the first."""
    offset = flat[pairs[:, 0]] - flat[pairs[:, 1]]
    every = add_halfway(offset)
    distance, k = every.norm(dim=-1).min(dim=1)
    p = offset.shape[1]
    when = torch.where(k < p, k.to(flat.dtype), (k - p).to(flat.dtype) + 0.5)
    way = every[torch.arange(len(k), device=k.device), k]
    return distance, when, _compute_unit_vectors(way, offset)


def _compute_unit_vectors(way: Tensor, offset: Tensor) -> Tensor:
    """Unit vectors; for two in the same place, across their relative motion, else +x."""
    motion = offset[:, -1] - offset[:, 0]
    across = torch.stack((-motion[:, 1], motion[:, 0]), dim=-1)
    length = across.norm(dim=-1, keepdim=True)
    east = torch.zeros_like(way)
    east[:, 0] = 1.0
    spare = torch.where(length > 1e-6, across / length.clamp_min(1e-6), east)
    size = way.norm(dim=-1, keepdim=True)
    return torch.where(size > 1e-4, way / size.clamp_min(1e-6), spare)
