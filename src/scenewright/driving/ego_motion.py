"""How the ego moves under an action: kinematic bicycle, acceleration along the route, waypoints."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from scenewright.driving.scenario import AgentPath
from scenewright.errors import InputError
from scenewright.scene.base import FloatArray

ActionMode = Literal["bicycle", "route", "waypoints"]
ACTION_MODES: tuple[ActionMode, ...] = ("bicycle", "route", "waypoints")

HARDEST_BRAKING, HARDEST_ACCELERATION = 10.0, 4.0
"""Of an action [m/s^2]; more is cut off."""
FASTEST = 20.0
LARGEST_STEERING = 0.6
"""Steering angle of the front wheels [rad]; more is cut off."""
WHEELBASE_SHARE = 0.6
"""Of the length."""
LOOK_AHEAD, LOOK_AHEAD_TIME = 2.0, 0.6
"""Pure pursuit steers for a point at least so far ahead [m], and as far as this time takes [s]."""
WAYPOINTS = 6
WAYPOINT_STEP = 0.5
"""Time between the waypoints of an action [s]."""
FARTHEST_WAYPOINT = 60.0


@dataclass(frozen=True)
class EgoState:
    """The ego at one moment.

    Attributes:
        x, y: centre [m]; heading [rad]; speed [m/s]; acceleration [m/s^2]; steering [rad].
        progress: distance along its route [m]; offset: to the left of it [m].
    """

    x: float
    y: float
    heading: float
    speed: float
    acceleration: float
    steering: float
    progress: float
    offset: float


def find_action_bounds(mode: ActionMode) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest action: [2], [1] or [WAYPOINTS, 2]."""
    if mode == "bicycle":
        low = np.array([-HARDEST_BRAKING, -LARGEST_STEERING])
        return low, np.array([HARDEST_ACCELERATION, LARGEST_STEERING])
    if mode == "route":
        return np.array([-HARDEST_BRAKING]), np.array([HARDEST_ACCELERATION])
    far = np.full((WAYPOINTS, 2), FARTHEST_WAYPOINT)
    return -far, far


def read_action(action: Any, mode: ActionMode) -> FloatArray:
    """An action as the array that its mode asks for.

    Raises:
        InputError: it is none: no numbers, another shape, NaN or infinity.
    """
    shape = find_action_bounds(mode)[0].shape
    try:
        values = np.asarray(action, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(
            f"an action is an array of shape {shape}, no {type(action).__name__}"
        ) from None
    if values.shape != shape:
        raise InputError(f"an action of {mode} has shape {shape}, not {values.shape}")
    if not np.isfinite(values).all():
        raise InputError("an action has finite numbers, no NaN or infinity")
    return values


def move_ego(
    state: EgoState, action: FloatArray, mode: ActionMode, route: AgentPath, *, length: float,
    step: float,
) -> EgoState:  # fmt: skip
    """The ego one step later.

    Args:
        action: `bicycle`: acceleration [m/s^2] and steering angle [rad]; `route`: acceleration;
            `waypoints`: [WAYPOINTS, 2] where the centre shall be after 0.5, 1.0, ... s, in its
            own frame [m].
        length: of the ego [m].
    """
    if mode == "route":
        return _move_along_route(state, float(action[0]), route, step)
    if mode == "waypoints":
        action = _follow_waypoints(state, action, length * WHEELBASE_SHARE)
    return _move_bicycle(state, action, route, length * WHEELBASE_SHARE, step)


def _change_speed(state: EgoState, acceleration: float, step: float) -> float:
    wanted = min(max(acceleration, -HARDEST_BRAKING), HARDEST_ACCELERATION)
    return min(max(state.speed + wanted * step, 0.0), FASTEST)


def _move_along_route(
    state: EgoState, acceleration: float, route: AgentPath, step: float
) -> EgoState:
    speed = _change_speed(state, acceleration, step)
    progress = min(state.progress + speed * step, route.length)
    xy, heading = route.get_poses(np.array([progress]))
    return replace(
        state, x=float(xy[0, 0]), y=float(xy[0, 1]), heading=float(heading[0]), speed=speed,
        acceleration=(speed - state.speed) / step, progress=progress, offset=0.0,
    )  # fmt: skip


def _move_bicycle(
    state: EgoState, action: FloatArray, route: AgentPath, wheelbase: float, step: float
) -> EgoState:
    """The bicycle about its centre, which lies midway between the axles."""
    speed = _change_speed(state, float(action[0]), step)
    steering = min(max(float(action[1]), -LARGEST_STEERING), LARGEST_STEERING)
    slip = np.arctan(np.tan(steering) / 2)
    turn = speed * np.sin(slip) / (wheelbase / 2) * step
    course = state.heading + slip + turn / 2
    x = state.x + speed * step * float(np.cos(course))
    y = state.y + speed * step * float(np.sin(course))
    progress, offset = project(route, x, y, near=state.progress)
    return EgoState(
        x, y, float(state.heading + turn), speed, (speed - state.speed) / step, steering,
        progress, offset,
    )  # fmt: skip


def _follow_waypoints(state: EgoState, waypoints: FloatArray, wheelbase: float) -> FloatArray:
    """Acceleration and steering (pure pursuit) that lead through the waypoints."""
    legs = np.diff(np.concatenate([np.zeros((1, 2)), waypoints]), axis=0)
    lengths = np.hypot(*legs.T)
    desired_speed = lengths[:2].sum() / (2 * WAYPOINT_STEP)
    reach = max(LOOK_AHEAD, LOOK_AHEAD_TIME * state.speed)
    ahead = np.flatnonzero(np.hypot(*waypoints.T) >= reach)
    target = waypoints[ahead[0] if len(ahead) else -1]
    squared_distance = max(float(target @ target), 1.0)
    steering = np.arctan(2 * wheelbase * target[1] / squared_distance) if target[0] > 0.1 else 0.0
    return np.array([(desired_speed - state.speed) / WAYPOINT_STEP, steering])


def project(route: AgentPath, x: float, y: float, *, near: float) -> tuple[float, float]:
    """Distance along a route [m] and offset to its left [m] of a place, near an earlier one."""
    low = max(int((near - 5.0) / max(route.length, 1e-9) * (len(route.xy) - 1)), 0)
    part = route.xy[low : low + 40]
    if len(part) < 2:
        return near, 0.0
    legs, off = np.diff(part, axis=0), np.array([x, y]) - part[:-1]
    square = np.maximum((legs**2).sum(axis=1), 1e-12)
    share = np.clip((off * legs).sum(axis=1) / square, 0.0, 1.0)
    rest = off - share[:, None] * legs
    k = int(np.argmin((rest**2).sum(axis=1)))
    spacing = route.length / (len(route.xy) - 1)
    side = (legs[k, 0] * off[k, 1] - legs[k, 1] * off[k, 0]) / np.sqrt(square[k])
    return float((low + k + share[k]) * spacing), float(side)
