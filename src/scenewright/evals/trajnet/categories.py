"""What kind of scene a primary pedestrian is in, by the rules of TrajNet++.

Files of the benchmark carry the type of every scene; it is worked out here only where they do
not. One step differs: the benchmark fits the noise of its Kalman filter to every path and draws
five predictions at random, here the filter keeps the noise it starts from and predicts the mean.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.trajnet.recording import OBSERVED, PREDICTED
from scenewright.scene.base import FloatArray

STATIC, LINEAR, INTERACTING, OTHER = 1, 2, 3, 4
TYPE_NAMES = {STATIC: "static", LINEAR: "linear", INTERACTING: "interacting", OTHER: "other"}
LEADER_FOLLOWER, AVOIDANCE, GROUP, OTHER_INTERACTION = 1, 2, 3, 4
SUBTYPE_NAMES = {
    LEADER_FOLLOWER: "leader-follower",
    AVOIDANCE: "avoidance",
    GROUP: "group",
    OTHER_INTERACTION: "other interaction",
}

STANDING = 1.0
"""An agent that ends less than this far from its start is static [m]."""
STRAIGHT = 0.5
"""An agent whose last position the filter predicts better than this is linear [m]."""
_NEAR, _CONE, _SIDE = 5.0, 15.0, 45.0
_STRIDE = 3
_GROUP_DISTANCE, _GROUP_DEVIATION = 0.8, 0.2
_FOLLOWING = 5


def categorise(primary: FloatArray, others: FloatArray) -> tuple[int, tuple[int, ...]]:
    """Type and subtypes of a scene.

    Args:
        primary: [21, 2] positions [m], complete; others: [M, 21, 2], NaN where unseen.
    """
    if np.linalg.norm(primary[-1] - primary[0]) < STANDING:
        return STATIC, ()
    last = filter_path(primary[:OBSERVED], steps=PREDICTED)[-1]
    if np.linalg.norm(primary[-1] - last) < STRAIGHT:
        return LINEAR, ()
    # Where others are and which way they move, [M, 12] against the way the primary moves [degrees].
    way = _compute_angle(primary[OBSERVED:] - primary[OBSERVED - _STRIDE : -_STRIDE])
    offset = others[:, OBSERVED:] - primary[OBSERVED:]
    moved = others[:, OBSERVED:] - others[:, OBSERVED - _STRIDE : -_STRIDE]
    place, motion = (_compute_angle(offset) - way) % 360, (_compute_angle(moved) - way) % 360
    near = np.linalg.norm(offset, axis=-1) < _NEAR
    ahead = _is_within(place, 0.0, _CONE) & near
    # In a group are those at the primary's side once and close to it all along.
    side = _is_within(place, 90.0, _SIDE) | _is_within(place, 270.0, _SIDE)
    apart = np.linalg.norm(others - primary, axis=-1)
    close = (apart.mean(axis=1) < _GROUP_DISTANCE) & (apart.std(axis=1) < _GROUP_DEVIATION)
    group = (side & near).any(axis=1) & close
    if not (ahead.any() or group.any()):
        return OTHER, ()
    following = (ahead & _is_within(motion, 0.0, _CONE)).sum(axis=1) >= _FOLLOWING
    meeting = ahead & _is_within(motion, 180.0, _CONE)
    found = {LEADER_FOLLOWER: following.any(), AVOIDANCE: meeting.any(), GROUP: group.any()}
    return INTERACTING, tuple(k for k, yes in found.items() if yes) or (OTHER_INTERACTION,)


def filter_path(observed: FloatArray, *, steps: int) -> FloatArray:
    """[steps, D] the mean path that a constant-velocity Kalman filter expects.

    Noise as the benchmark starts from: 1e-5 on the state, 0.05 m on the observation; positions and
    velocities per step; the first state is the first position at rest, known to 1.

    Args:
        observed: [T, D] positions [m], one path or several side by side.
    """
    move = np.array([[1.0, 1.0], [0.0, 1.0]])
    mean = np.array([observed[0], np.zeros_like(observed[0])])
    spread = np.eye(2)
    for k, seen in enumerate(observed):
        if k:
            mean, spread = move @ mean, move @ spread @ move.T + 1e-5 * np.eye(2)
        gain = spread[:, :1] / (spread[0, 0] + 0.05**2)
        mean = mean + gain * (seen - mean[0])
        spread = spread - gain @ spread[:1]
    ahead = np.arange(1, steps + 1)[:, None]
    return np.asarray(mean[0] + ahead * mean[1])


def _compute_angle(vector: FloatArray) -> FloatArray:
    return np.asarray(np.degrees(np.arctan2(vector[..., 1], vector[..., 0])))


def _is_within(angle: FloatArray, centre: float, reach: float) -> NDArray[np.bool_]:
    """Whether an angle lies above centre - reach and at most at centre + reach; NaN does not."""
    off = (angle - centre + 180.0) % 360.0 - 180.0
    return np.asarray((off > -reach) & (off <= reach))
