"""Whether the motion could be real (SEMANTICS section 5)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.events import Finding
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import AgentRecord, SceneRecord
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.footprints import angle_between
from scenewright.tools.relation_checker.ground import ground_of
from scenewright.tools.relation_checker.motion import Mover

VEHICLE_SPEED = 20.0
VEHICLE_ACCELERATION = 4.0
VEHICLE_BRAKING = 8.0
EMERGENCY_BRAKING = 10.0
EMERGENCY_SPAN = 1.5
AFTERMATH = 0.25
"""A track may go on for 0.2 s after a contact, still braking [s]."""
LATERAL = 5.0
SLIP = np.deg2rad(20.0)
SLIP_ABOVE = 1.0
PEDESTRIAN_SPEED = 3.0
RUNNING_SPEED = 4.5
PEDESTRIAN_ACCELERATION = 3.0
STEP_FACTOR = 1.2
STEP_MARGIN = 0.05
HELD = np.deg2rad(5.0)
ON_ROAD = 0.98
LONGEST = 30.0
ROUNDING = 0.02
"""Allowance for positions kept to 1 mm, in m/s and m/s^2 alike."""


@dataclass(frozen=True)
class Licence:
    """What one agent may do beyond the rule.

    Attributes:
        emergencies: times of its collisions and near misses [s].
        running: a pedestrian that runs; jaywalking: one that may walk on the road.
    """

    emergencies: tuple[float, ...] = ()
    running: bool = False
    jaywalking: bool = False


def odd_form(scene: SceneRecord) -> tuple[Finding, ...]:
    """Time step, duration and sizes that SEMANTICS section 1 and 5 do not know."""
    found = []
    if abs(scene.meta.step - STEP) > 1e-9:
        detail = f"the time step is {scene.meta.step} s; it must be {STEP} s"
        found.append(Finding(rule="step", agents=(), measured=scene.meta.step, detail=detail))
    if scene.meta.duration > LONGEST + 1e-6:
        detail = f"the scene lasts {scene.meta.duration:.1f} s; at most {LONGEST:.0f} s"
        found.append(Finding(rule="duration", agents=(), limit=LONGEST, detail=detail))
    for agent in scene.agents:
        if not _usual_size(agent):
            detail = f"{agent.type} {agent.id} measures {agent.length:g} x {agent.width:g} m"
            found.append(Finding(rule="size", agents=(agent.id,), detail=detail))
    return tuple(found)


def _usual_size(agent: AgentRecord) -> bool:
    if agent.type == "pedestrian":
        return max(abs(agent.length - 0.6), abs(agent.width - 0.6)) < 0.01
    return 1.5 <= agent.length <= 20.0 and 0.5 <= agent.width <= 3.0


def implausible(mover: Mover, *, licence: Licence) -> tuple[Finding, ...]:
    """Every limit of SEMANTICS section 5 that the motion of one agent breaks, worst value each."""
    rules = _vehicle(mover, licence) if mover.is_vehicle else _pedestrian(mover, licence)
    return tuple(f for f in (*rules, _steps(mover)) if f is not None)


def _vehicle(mover: Mover, licence: Licence) -> Iterator[Finding | None]:
    yield _worst(mover, "speed", mover.speed, VEHICLE_SPEED, "m/s")
    yield _worst(mover, "acceleration", mover.acceleration, VEHICLE_ACCELERATION, "m/s^2")
    yield _worst(mover, "braking", -mover.acceleration, _braking_limit(mover, licence), "m/s^2")
    yield _worst(mover, "lateral_acceleration", mover.lateral_acceleration, LATERAL, "m/s^2")
    yield _worst(mover, "heading", slip_angle(mover), SLIP, "rad from the motion")
    yield _worst(mover, "heading_step", _turns(mover), SLIP, "rad in one step")
    yield _worst(mover, "heading_held", _standing_turns(mover), HELD, "rad turned at standstill")


def _pedestrian(mover: Mover, licence: Licence) -> Iterator[Finding | None]:
    limit = RUNNING_SPEED if licence.running else PEDESTRIAN_SPEED
    yield _worst(mover, "speed", mover.speed, limit, "m/s")
    change = np.abs(mover.acceleration)
    yield _worst(mover, "acceleration", change, PEDESTRIAN_ACCELERATION, "m/s^2")


def _braking_limit(mover: Mover, licence: Licence) -> FloatArray:
    limit = np.full(len(mover), VEHICLE_BRAKING)
    for time in licence.emergencies:
        limit[(mover.times >= time - EMERGENCY_SPAN) & (mover.times <= time + AFTERMATH)] = (
            EMERGENCY_BRAKING
        )
    return limit


def slip_angle(mover: Mover) -> FloatArray:
    """[T] angle between heading and motion [rad]; 0 at speeds up to 1 m/s."""
    course = np.arctan2(mover.velocity[:, 1], mover.velocity[:, 0])
    return np.where(mover.speed > SLIP_ABOVE, angle_between(course, mover.heading), 0.0)


def _turns(mover: Mover) -> FloatArray:
    return np.append(np.abs(np.diff(mover.heading)), 0.0)


def _standing_turns(mover: Mover) -> FloatArray:
    """[T] how far the heading has turned since this standstill began [rad]; 0 while moving."""
    still = mover.speed < 0.05
    begin = np.maximum.accumulate(np.where(still, 0, np.arange(1, len(mover) + 1)))
    begin = np.minimum(begin, len(mover) - 1)
    return np.where(still, np.abs(mover.heading - mover.heading[begin]), 0.0)


def _steps(mover: Mover) -> Finding | None:
    """Step length <= 1.2 x the larger of the speeds in the steps before and after, + 0.05 m."""
    if len(mover.steps) < 2:
        return None
    before = np.concatenate(([0.0], mover.steps[:-1]))
    after = np.concatenate((mover.steps[1:], [0.0]))
    limit = STEP_FACTOR * np.maximum(before, after) + STEP_MARGIN
    k = int(np.argmax(mover.steps - limit))
    if mover.steps[k] <= limit[k] + 2e-3:
        return None
    measured, most = float(mover.steps[k]), float(limit[k])
    return _finding(mover, "step_length", k, measured=measured, limit=most, unit="m in one step")


def _worst(
    mover: Mover, rule: str, values: FloatArray, limit: FloatArray | float, unit: str
) -> Finding | None:
    excess = values - limit
    k = int(np.argmax(excess))
    if excess[k] <= ROUNDING:
        return None
    most = float(limit if isinstance(limit, float) else np.broadcast_to(limit, values.shape)[k])
    return _finding(mover, rule, k, measured=float(values[k]), limit=most, unit=unit)


def _finding(
    mover: Mover, rule: str, k: int, *, measured: float, limit: float, unit: str
) -> Finding:
    return Finding(
        rule=rule, agents=(mover.id,), time=round(float(mover.times[k]), 3),
        measured=round(measured, 3), limit=round(limit, 3),
        detail=f"{mover.type} {mover.id}: {rule} {measured:.2f} {unit} at {mover.times[k]:.1f} s; "
        f"at most {limit:.2f}",
    )  # fmt: skip


def off_ground(
    movers: tuple[Mover, ...], intersection: IntersectionMap, *, jaywalkers: frozenset[int]
) -> tuple[Finding, ...]:
    """Agents with less than 98 % of their positions where their class belongs."""
    found = []
    for mover, share in zip(movers, ground_shares(movers, intersection, jaywalkers), strict=True):
        if share < ON_ROAD:
            where = "road" if mover.is_vehicle else "walkable area and crosswalks"
            found.append(Finding(
                rule="off_road" if mover.is_vehicle else "off_walkable", agents=(mover.id,),
                measured=round(share, 4), limit=ON_ROAD,
                detail=f"{mover.type} {mover.id}: {share:.1%} of its positions on the {where}; "
                f"at least {ON_ROAD:.0%}",
            ))  # fmt: skip
    return tuple(found)


def ground_shares(
    movers: tuple[Mover, ...], intersection: IntersectionMap, jaywalkers: frozenset[int]
) -> list[float]:
    """Share of each agent's positions where its class belongs."""
    ground = ground_of(intersection)
    shares = [0.0] * len(movers)
    for area, chosen in (
        (ground.road, [n for n, m in enumerate(movers) if m.is_vehicle]),
        (ground.walkable, [n for n, m in enumerate(movers)
                           if not m.is_vehicle and m.id not in jaywalkers]),
        (ground.anywhere, [n for n, m in enumerate(movers)
                           if not m.is_vehicle and m.id in jaywalkers]),
    ):  # fmt: skip
        if chosen:
            inside = area.contains(np.concatenate([movers[n].xy for n in chosen]))
            ends = np.cumsum([len(movers[n]) for n in chosen])[:-1]
            for n, part in zip(chosen, np.split(inside, ends), strict=True):
                shares[n] = float(part.mean())
    return shares


def extremes(movers: tuple[Mover, ...]) -> dict[str, Any]:
    """Largest speeds and accelerations per class, for the report."""
    result: dict[str, Any] = {}
    for name in ("vehicle", "pedestrian"):
        chosen = [m for m in movers if m.type == name and len(m) > 1]
        if chosen:
            result[name] = {
                "speed": round(max(float(m.speed.max()) for m in chosen), 3),
                "acceleration": round(max(float(m.acceleration.max()) for m in chosen), 3),
                "braking": round(max(float(-m.acceleration.min()) for m in chosen), 3),
                "lateral_acceleration": round(
                    max(float(m.lateral_acceleration.max()) for m in chosen), 3
                ),
            }
    return result
