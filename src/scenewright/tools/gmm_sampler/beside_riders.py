"""How vehicles drive where a rider is with them in a lane: beside it, or at its pace behind it.

p_wp knows no riders: its vehicles keep to the middle of their lanes, where a rider on the lane's
outer side has no room, and none drives at a bicycle's pace.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenewright.geometry.polyline import compute_normals
from scenewright.geometry.spline import PER_INTERVAL
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import AgentCandidates, Candidate, K
from scenewright.tools.gmm_sampler.priors import WaypointPrior

_SAME_PACE = (0.96, 1.0)
"""Free speed of a follower, as a share of its leader's."""


def make_room(
    vehicle: AgentCandidates,
    prior: WaypointPrior,
    rider: AgentCandidates,
    gaps: tuple[float, float],
    rng: np.random.Generator,
    *,
    until: tuple[float, float],
) -> FloatArray:
    """The vehicle's waypoints [M, K, 2] moved aside so that a gap [m] to the rider is left.

    Args:
        gaps: least and greatest distance of the two footprints where they are abreast [m].
        until: share of the vehicle's way from which on it is back on its own line, and at last.
    """
    begin, end = until
    x = np.clip((np.linspace(0.0, 1.0, K) - begin) / (end - begin), 0.0, 1.0)
    share = 1.0 - x * x * (3.0 - 2.0 * x)
    drawn, beside = vehicle.drawn, np.asarray(rider.drawn.waypoints.mean(axis=0))
    half = (vehicle.shape.width + rider.shape.width) / 2
    shifted = []
    for waypoints, component in zip(drawn.waypoints, drawn.component.tolist(), strict=True):
        normals = compute_normals(prior.base[component])[::PER_INTERVAL]
        apart = _measure_offset(waypoints, normals, beside)
        away = float(np.sign(apart) or 1.0)
        more = max(float(rng.uniform(*gaps)) + half - abs(apart), 0.0) * away
        shifted.append(waypoints + more * share[:, None] * normals)
    return np.stack(shifted)


def _measure_offset(waypoints: FloatArray, normals: FloatArray, line: FloatArray) -> float:
    """How far to the left of the rider's line the vehicle's approach lies [m], in the mean."""
    near = slice(0, 4)
    ahead = np.gradient(line, axis=0)
    ahead = ahead / np.hypot(*ahead.T)[:, None]
    offsets = []
    for point, normal in zip(waypoints[near], normals[near], strict=True):
        n = int(np.hypot(*(line - point).T).argmin())
        away = point - line[n]
        offsets.append(float((away - (away @ ahead[n]) * ahead[n]) @ normal))
    return float(np.mean(offsets))


def keep_pace(
    follower: AgentCandidates, leader: AgentCandidates, rng: np.random.Generator
) -> tuple[AgentCandidates, AgentCandidates]:
    """Both at one free speed: what the slower of the two classes is likely to have."""
    speeds = [np.median([law.speed for law in each.drawn.time_laws]) for each in (follower, leader)]
    pace = float(min(speeds))
    return (
        _drive_at(follower, pace * float(rng.uniform(*_SAME_PACE))),
        _drive_at(leader, pace),
    )


def _drive_at(agent: AgentCandidates, speed: float) -> AgentCandidates:
    def build(m: int) -> Candidate:
        built = agent.build(m)
        return replace(built, time_law=replace(built.time_law, speed=speed))

    return replace(agent, build=build)
