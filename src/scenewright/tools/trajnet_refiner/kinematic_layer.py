"""What a network proposes made feasible: along the agent's own path, inside SEMANTICS section 5.

A proposal is a deviation from the edited prior in arc length over time. It is joined smoothly to
the stretches where the prior is kept, and between two such stretches the largest share of it is
taken for which every limit holds. Speeds and accelerations along the path are linear in arc length
over time, so that a small enough share of any deviation from a feasible prior is feasible.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled, compiled_to_write
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
_SHARES = (1.0, 0.85, 0.7, 0.55, 0.4, 0.3, 0.2, 0.1, 0.05)
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
    parts = np.array([(part.start, part.stop) for part in find_free_parts(kept)], dtype=np.int64)
    share = _find_shares(
        s, change, parts.reshape(-1, 2), most, astuple(limits), path.s, path.curvature
    )
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
    n = len(prior)
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
    return np.where(kept, prior, _solve_banded(bands, weight * target))


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


# ---- as machine code ----------------------------------------------------------------------------


@compiled_to_write
def _solve_banded(bands: FloatArray, x: FloatArray) -> FloatArray:
    """Solve a symmetric system in place: its diagonal and those below it [4, N], right side [N]."""
    n = len(x)
    for j in range(n):
        for k in range(1, min(4, n - j)):
            ratio = bands[k, j] / bands[0, j]
            x[j + k] -= ratio * x[j]
            for m in range(k, 4):
                bands[m - k, j + k] -= ratio * bands[m, j]
    for j in range(n - 1, -1, -1):
        for k in range(1, min(4, n - j)):
            x[j] -= bands[k, j] * x[j + k]
        x[j] /= bands[0, j]
    return x


@compiled
def _find_shares(
    s: FloatArray,
    change: FloatArray,
    parts: NDArray[np.int64],
    most: float,
    limits: tuple[float, float, float, float],
    nodes: FloatArray,
    curvature: FloatArray,
) -> FloatArray:
    """[T] the largest share of a change that breaks no limit which the prior s [T] keeps there.

    Args:
        parts: [P, 2] first sample of each part with a share of its own, and that behind its last.
        limits: those of `KinematicLimits`; nodes, curvature: of the path [m], [1/m].
    """
    own, allowed = _compute_rates(s, nodes, curvature), np.empty((4, len(s)))
    for t in range(len(s)):
        for k in range(4):
            allowed[k, t] = max(limits[k], own[k, max(t - _NEAR, 0) : t + _NEAR + 1].max())
    share = np.zeros(len(s))
    for each in _SHARES:
        if share[parts[:, 0]].all():
            break
        broken = np.zeros(len(s), np.bool_)
        # Who gets less gets less than it had, so that counts first which share it would have had.
        for size in (each, each * most):
            tried = s + size * change
            rates = _compute_rates(tried, nodes, curvature)
            for t in range(len(s)):
                broken[t] |= tried[t] < max(tried[max(t - 1, 0)], 0.0)
                for k in range(4):
                    broken[t] |= rates[k, t] > allowed[k, t]
        for begin, end in parts:
            if share[begin] == 0.0 and not broken[max(begin - _NEAR, 0) : end + _NEAR].any():
                share[begin:end] = most * each
    return share


@compiled
def _compute_rates(s: FloatArray, nodes: FloatArray, curvature: FloatArray) -> FloatArray:
    """[4, T] speed, acceleration, braking and lateral acceleration, as section 5 has them."""
    rates, last, k = np.empty((4, len(s))), len(s) - 1, 0
    for t in range(len(s)):
        before, after = max(t - 1, 0), min(t + 1, last)
        rates[0, t] = (s[after] - s[before]) / (STEP * (after - before))
    speed = rates[0]
    for t in range(len(s)):
        gained = speed[min(t + 2, last)] + speed[min(t + 1, last)]
        rate = (gained - speed[max(t - 1, 0)] - speed[max(t - 2, 0)]) / (6 * STEP)
        while k < len(nodes) - 2 and nodes[k + 1] <= s[t]:
            k += 1
        while k > 0 and nodes[k] > s[t]:
            k -= 1
        into = min(max((s[t] - nodes[k]) / (nodes[k + 1] - nodes[k]), 0.0), 1.0)
        bend = curvature[k] + into * (curvature[k + 1] - curvature[k])
        rates[1, t], rates[2, t], rates[3, t] = rate, -rate, speed[t] * speed[t] * abs(bend)
    return rates
