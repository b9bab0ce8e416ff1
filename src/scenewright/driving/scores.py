"""nuPlan's closed-loop score and NAVSIM's EPDMS of one drive, by their published definitions.

nuPlan: docs/metrics_description.md and docs/nuplan_metrics_aggeregation.md of nuplan-devkit. EPDMS:
NC x DAC x DDC x TLC x (5 TTC + 5 EP + 2 LK + 2 HC + 2 EC) / 16. EC compares successive plans of a
planner; a drive has none, so that EC is left out and the weights are those of the other four.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from scenewright.scene.base import FloatArray

LEAST_TTC = 0.95
LEAST_PROGRESS = 0.2
PROGRESS_FLOOR = 2.0
"""Shorter ways count as this long [m]."""
MOST_OVERSPEED = 2.23
OFF_ROAD = 0.3
"""By which a corner may lie outside of the drivable area [m]."""
AGAINST_FLOW, FAR_AGAINST_FLOW = 2.0, 6.0
"""Way against the traffic within 1 s from which the rule counts half, then as broken [m]."""
LANE_OFFSET, LANE_TIME = 0.5, 2.0
"""EPDMS: so far off the lane's centre [m] for so long [s] the lane is not kept."""


@dataclass(frozen=True)
class Comfort:
    """Extremes of the driven motion.

    Attributes:
        acceleration, braking: along the way [m/s^2]; lateral: [m/s^2]; yaw_rate: [rad/s];
        yaw_acceleration: [rad/s^2]; jerk_along: [m/s^3]; jerk: change of the acceleration's
            magnitude, as nuPlan's code has it [m/s^3].
    """

    acceleration: float
    braking: float
    lateral: float
    yaw_rate: float
    yaw_acceleration: float
    jerk_along: float
    jerk: float

    @property
    def is_comfortable(self) -> bool:
        """Whether all lie within nuPlan's bounds."""
        return (
            self.acceleration <= 2.40 and self.braking <= 4.05 and self.lateral <= 4.89
            and self.yaw_rate <= 0.95 and self.yaw_acceleration <= 1.93
            and self.jerk_along <= 4.13 and self.jerk <= 8.37
        )  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        """The figures, to the millimetre, and the verdict."""
        return {k: round(v, 3) for k, v in asdict(self).items()} | {"ok": self.is_comfortable}


def measure_comfort(points: FloatArray, step: float) -> Comfort:
    """Comfort of a driven motion.

    Args:
        points: [n, 4] x, y, heading, speed at every step; step: [s].
    """
    if len(points) < 5:
        return Comfort(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    heading = np.unwrap(points[:, 2])
    yaw = _fit(heading, 5, step, derivative=1)
    along = np.gradient(points[:, 3], step, edge_order=2)
    across = points[:, 3] * yaw
    size = np.hypot(along, across)
    along, across, size = (_fit(each, 8, step) for each in (along, across, size))
    jerk_along, jerk = (_fit(each, 15, step, derivative=1) for each in (along, size))
    yaw_acceleration = _fit(heading, 5, step, degree=3, derivative=2)
    return Comfort(
        float(along.max()), float(-along.min()), float(np.abs(across).max()),
        float(np.abs(yaw).max()), float(np.abs(yaw_acceleration).max()),
        float(np.abs(jerk_along).max()), float(np.abs(jerk).max()),
    )  # fmt: skip


def _fit(
    values: FloatArray, window: int, step: float, *, degree: int = 2, derivative: int = 0
) -> FloatArray:
    """Polynomials fitted over a window of samples, or their derivative: nuPlan's filters."""
    from scipy import signal

    filters: Any = signal

    window = min(window, len(values))
    return np.asarray(filters.savgol_filter(values, window, degree, deriv=derivative, delta=step))


@dataclass(frozen=True)
class ScoreInputs:
    """What the two scores are made of.

    Attributes:
        at_fault: collisions at fault with road users; at_fault_objects: with objects.
        off_road: largest distance of a corner outside of the drivable area [m].
        against_flow: longest way against the traffic within 1 s [m].
        red_lights: run; ttc: least 2-D time to collision with agents that count for it [s].
        progress, reference: way of the ego, and of the recorded one by then [m].
        overspeed: speed above the limit, integrated [m]; duration: [s].
        off_lane: longest time more than 0.5 m off the route's centre [s].
    """

    at_fault: int
    at_fault_objects: int
    off_road: float
    against_flow: float
    red_lights: int
    ttc: float
    progress: float
    reference: float
    overspeed: float
    duration: float
    off_lane: float
    comfortable: bool

    @property
    def no_collision(self) -> float:
        """1, 0.5 after one collision with an object, 0."""
        if self.at_fault or self.at_fault_objects > 1:
            return 0.0
        return 0.5 if self.at_fault_objects else 1.0

    @property
    def direction(self) -> float:
        """1; 0.5 after some way against the traffic, 0 after a longer one."""
        if self.against_flow < AGAINST_FLOW:
            return 1.0
        return 0.5 if self.against_flow < FAR_AGAINST_FLOW else 0.0

    @property
    def progress_ratio(self) -> float:
        """Of the recorded way, at most 1."""
        floor = PROGRESS_FLOOR
        return min(1.0, max(self.progress, floor) / max(self.reference, floor))


def score_nuplan(given: ScoreInputs) -> dict[str, float]:
    """The closed-loop score, 0 to 1, and its parts."""
    over = given.overspeed / (MOST_OVERSPEED * max(given.duration, 1e-9))
    parts = {
        "no_ego_at_fault_collisions": given.no_collision,
        "drivable_area_compliance": float(given.off_road <= OFF_ROAD),
        "driving_direction_compliance": given.direction,
        "ego_is_making_progress": float(given.progress_ratio >= LEAST_PROGRESS),
        "time_to_collision_within_bound": float(given.ttc >= LEAST_TTC),
        "ego_progress_along_expert_route": given.progress_ratio,
        "speed_limit_compliance": max(0.0, 1.0 - over),
        "ego_is_comfortable": float(given.comfortable),
    }
    values = list(parts.values())
    mean = float(np.average(values[4:], weights=[5, 5, 4, 2]))
    return _round({"score": float(np.prod(values[:4])) * mean} | parts)


def score_epdms(given: ScoreInputs) -> dict[str, float]:
    """EPDMS without EC, 0 to 1, and its parts."""
    parts = {
        "NC": given.no_collision,
        "DAC": float(given.off_road <= OFF_ROAD),
        "DDC": given.direction,
        "TLC": float(given.red_lights == 0),
        "TTC": float(given.ttc >= LEAST_TTC),
        "EP": given.progress_ratio,
        "LK": float(given.off_lane <= LANE_TIME),
        "HC": float(given.comfortable),
    }
    values = list(parts.values())
    mean = float(np.average(values[4:], weights=[5, 5, 2, 2]))
    return _round({"score": float(np.prod(values[:4])) * mean} | parts)


def _round(parts: dict[str, float]) -> dict[str, float]:
    return {name: round(value, 4) for name, value in parts.items()}
