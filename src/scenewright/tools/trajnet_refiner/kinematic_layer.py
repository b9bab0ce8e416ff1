"""What a network proposes made feasible: along the agent's own path, inside SEMANTICS section 5.

A proposal is a deviation from the edited prior in arc length over time. It is joined smoothly to
the stretches where the prior is kept, and between two such stretches the largest share of it is
taken for which every limit holds. Speeds and accelerations along the path are linear in arc length
over time, so that a small enough share of any deviation from a feasible prior is feasible.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.candidates import Path
from scenewright.scene.track import STEP

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class KinematicLimits:
    """What a refined agent may do at most, unless its edited prior does more just there.

    Far less than the gate allows: this is what people do without need. Above 3.4 m/s^2 of braking,
    an agent close behind another would be in a near miss with it (SEMANTICS section 4).

    Attributes:
        speed [m/s], acceleration, braking, lateral [m/s^2].
    """

    speed: float
    acceleration: float
    braking: float
    lateral: float


LIMITS: dict[AgentClass, KinematicLimits] = {
    "vehicle": KinematicLimits(19.5, 2.2, 3.3, 4.5),
    "pedestrian": KinematicLimits(2.9, 2.2, 2.2, np.inf),
}
SMOOTHING: dict[AgentClass, tuple[float, float]] = {"vehicle": (3.2, 3.2), "pedestrian": (1.5, 3.5)}
"""Waves in progress shorter than that [s] lose half of their height or more: far from where the
prior is kept, and just before or after it, as people stop and start more softly than they walk."""
_AROUND = 3.0
"""How long before and after it that is [s]."""
SETTLING = 3.5
"""How long before and after the prior is kept a proposal counts less [s]."""
RIPPLES_WITHIN = 2.0
"""How long before and after it that is for a ripple [s]."""
_BEGUN = 12
"""Samples at most of a track that are the prior's because it begins there."""
_FAINT = 0.02
"""How little it counts next to the prior, beside 1 further off."""
_FIRM = 1e7
_SHARES = np.array([1.0, 0.85, 0.7, 0.55, 0.4, 0.3, 0.2, 0.1, 0.05])
_AT_END = 0.1
"""Slack with which a prior leaves at the end of its path [m]."""
_CREEP, _LONGEST = 0.5, 300
"""Least pace at which a path is gone on with [m/s], and for how many samples at most."""
_NEAR = 5
"""Samples around one at which the prior's own excess over a limit is allowed."""


def limit_deviation(
    prior: FloatArray,
    deviation: FloatArray,
    *,
    kept: BoolArray,
    path: Path,
    kind: AgentClass,
    most: float = 1.0,
    ripple: FloatArray | None = None,
    steady: BoolArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """The prior with as much of a deviation as the limits allow.

    Args:
        prior: [T] arc length every 0.1 s [m], never falling.
        deviation: [T] what is to be added [m].
        kept: [T] where the prior stays as it is, but for the ripple.
        most: what is taken of the largest share that the limits allow.
        ripple: [T] what is added to that [m], away from where `steady`: as `kept` if None.

    Returns:
        [T'] arc length [m], shorter than the prior if the path's end is reached earlier, longer if
        later; and [T] the share taken of what was proposed; 0 where the prior is kept.
    """
    if most <= 0.0:
        return prior, np.zeros(len(prior))
    smooth = smooth_proposal(prior + deviation, prior, kept=kept, over=SMOOTHING[kind]) - prior
    s, share = _add_share(prior, smooth, kept, path, LIMITS[kind], most)
    if ripple is not None:
        still = kept if steady is None else steady
        waves = ripple * _compute_blend(still, RIPPLES_WITHIN)
        s, _ = _add_share(s, waves, still, path, LIMITS[kind], most)
    s = _extend_to_end(s, prior, path)
    past = np.flatnonzero(s > path.length)
    return (s[: past[0]] if len(past) else s), share


def _add_share(
    s: FloatArray, change: FloatArray, kept: BoolArray, path: Path, limits: KinematicLimits,
    most: float,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Arc lengths with the largest share of a change that the limits allow, and that share [T]."""
    share = np.zeros(len(s))
    # Who gets less gets less than it had, so that counts first which share it would have had.
    broken = np.logical_or.reduce(
        [
            _find_broken(s + each * _SHARES[:, None] * change, s, path, limits)
            for each in {1.0, most}
        ]
    )
    for part in find_free_parts(kept):
        wide = slice(max(part.start - _NEAR, 0), part.stop + _NEAR)
        good = np.flatnonzero(~broken[:, wide].any(axis=1))
        if len(good):
            share[part] = most * _SHARES[good[0]]
    return s + share * change, share


def _extend_to_end(s: FloatArray, prior: FloatArray, path: Path) -> FloatArray:
    """[T'] arc length, gone on with at an even pace where the prior leaves and it is not there yet.

    No agent leaves before the end of its path.
    """
    if len(s) < 2 or path.length - prior[-1] > prior[-1] - prior[-2] + _AT_END:
        return s
    pace = max(float(s[-1] - s[-2]), _CREEP * STEP)
    steps = int((path.length - s[-1]) / pace)
    return np.append(s, s[-1] + pace * np.arange(1, min(steps, _LONGEST) + 1))


def smooth_proposal(
    proposal: FloatArray, prior: FloatArray, *, kept: BoolArray, over: tuple[float, float]
) -> FloatArray:
    """[T] the proposal with little jerk, joined without a kink to the prior where that is kept.

    Least squares with a penalty on third differences (Whittaker 1923): s minimises
    sum w (s - y)^2 + k sum (d^3 s)^2, y the prior where it is kept, with a very large weight, else
    the proposal. A wave of period T keeps half its height where k = (2 sin(pi dt / T))^-6.

    Args:
        over: such periods [s], far from where the prior is kept and near it.
    """
    from scipy import linalg

    n, solve = len(prior), linalg.solveh_banded
    if n < 8:
        return prior
    far, near = ((2.0 * np.sin(np.pi * STEP / each)) ** -6 for each in over)
    penalty = np.where(_find_joints(kept, n - 3), near, far)
    weight = np.where(kept, _FIRM, _FAINT ** (1.0 - _compute_blend(kept)))
    third = np.array([-1.0, 3.0, -3.0, 1.0])
    bands = np.zeros((4, n))
    bands[0] = weight
    for j in range(4):
        for k in range(j, 4):
            bands[k - j, j : n - 3 + j] += penalty * third[j] * third[k]
    target = np.where(kept, prior, proposal)
    found = np.asarray(solve(bands, weight * target, lower=True, check_finite=False))
    return np.where(kept, prior, found)


def _find_joints(kept: BoolArray, count: int) -> BoolArray:
    """[count] third differences that lie just before the prior is kept, or just after it was."""
    about, width = np.zeros(count, dtype=np.bool_), round(_AROUND / STEP)
    for turn in np.flatnonzero(np.diff(kept.astype(np.int8))) + 1:
        # Every track begins as its prior does: an entering agent has not stood.
        if turn > _BEGUN:
            first = max(int(turn) - 2 - width, 0) if kept[turn] else int(turn)
            about[first : first + width] = True
    return about


def _compute_blend(kept: BoolArray, within: float = SETTLING) -> FloatArray:
    """[T] 0 where the prior is kept, rising to 1 within so many seconds of it."""
    at = np.arange(len(kept))
    before = np.maximum.accumulate(np.where(kept, at, -len(kept) - 999))
    after = np.minimum.accumulate(np.where(kept, at, 2 * len(kept) + 999)[::-1])[::-1]
    return np.clip(np.minimum(at - before, after - at) * STEP / within, 0.0, 1.0)


def find_free_parts(kept: BoolArray) -> list[slice]:
    """The stretches between the places at which the prior is kept."""
    edges = np.flatnonzero(np.diff((~kept).astype(np.int8), prepend=0, append=0))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _find_broken(
    tried: FloatArray, prior: FloatArray, path: Path, limits: KinematicLimits
) -> BoolArray:
    """[S, T] samples at which arc lengths [S, T] break a limit that the prior keeps there."""
    speed, acceleration = _compute_rates(tried)
    own_speed, own_acceleration = (each[0] for each in _compute_rates(prior[None]))
    curvature = np.abs(np.interp(tried, path.s, path.curvature))
    own_lateral = own_speed**2 * np.abs(np.interp(prior, path.s, path.curvature))
    return np.asarray(
        (np.diff(tried, axis=1, prepend=tried[:, :1]) < 0.0)
        | (tried < 0.0)
        | (speed > _compute_allowed(limits.speed, own_speed))
        | (acceleration > _compute_allowed(limits.acceleration, own_acceleration))
        | (-acceleration > _compute_allowed(limits.braking, -own_acceleration))
        | (speed**2 * curvature > _compute_allowed(limits.lateral, own_lateral))
    )


def _compute_allowed(limit: float, own: FloatArray) -> FloatArray:
    """[T] the limit, or the most that the prior itself does within half a second."""
    wide = np.pad(own, _NEAR, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(wide, 2 * _NEAR + 1)
    return np.asarray(np.maximum(limit, windows.max(axis=1)))


def _compute_rates(s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """[S, T] speed and acceleration along the path, as section 5 has them, ends held."""
    speed = np.gradient(s, STEP, axis=1)
    wide = np.pad(speed, ((0, 0), (2, 2)), mode="edge")
    rate = (wide[:, 4:] + wide[:, 3:-1] - wide[:, 1:-3] - wide[:, :-4]) / (6 * STEP)
    return speed, rate
