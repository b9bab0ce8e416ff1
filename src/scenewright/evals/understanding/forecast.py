"""Sampled futures of all observed agents, in which no agent gives way or stops at a light.

In each future every agent has a route drawn from its posterior and a driving profile that fits its
speed so far. Whether a light holds it now is said beside it.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.understanding.cases import ObservedAgent, ObservedScene
from scenewright.evals.understanding.intent import RoutePosterior
from scenewright.evals.understanding.route_components import (
    RouteComponents,
    brake_backwards,
    interpolate_points,
    interpolate_rows,
    measure_arc_length,
    measure_headings,
)
from scenewright.intersections import load_map
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K

BoolArray = NDArray[np.bool_]

SIZE = 120
"""Futures of a scene."""
DT = 0.25
"""Step of a future [s]."""
HORIZON = 13.0
"""Length of a future [s]."""
TICKS = int(HORIZON / DT) + 1
_CREEP = 0.1
"""Least speed of an agent that goes on [m/s]."""
_HARDEST = 6.0
_RULED_OUT = 0.015
"""Exits less likely than this are not sampled."""


@dataclass(frozen=True, eq=False)
class AgentForecast:
    """One agent in K futures.

    Attributes:
        agent: itself; components: of p_wp, of its class.
        xy: [K, T, 2] centre [m]; heading: [K, T] [rad], from now on every `DT`; present: [K, T]
            whether it is still on the map.
        free: [K] speed that its route allows it now [m/s].
        held: [K] the light of its route is not green and its line still ahead.
        line: [K] distance to that line [m], inf where there is none or it is behind.
        component: [K] which it follows; weight: [K] probability.
    """

    agent: ObservedAgent
    components: RouteComponents
    xy: FloatArray
    heading: FloatArray
    present: BoolArray
    free: FloatArray
    held: BoolArray
    line: FloatArray
    component: NDArray[np.intp]
    weight: FloatArray

    @cached_property
    def box(self) -> tuple[FloatArray, FloatArray]:
        """[K, 2] least and greatest x and y [m] of each future."""
        return self.xy.min(axis=1), self.xy.max(axis=1)

    @cached_property
    def facing(self) -> tuple[FloatArray, FloatArray]:
        """[K, T] cosine and sine of the heading."""
        return np.cos(self.heading), np.sin(self.heading)


def forecast_scene(
    observation: ObservedScene, known: Mapping[str, RoutePosterior]
) -> tuple[AgentForecast, ...]:
    """Sample `SIZE` futures of every agent still on the map.

    Each agent's random numbers come from its own motion, so that ids and order do not matter.

    Args:
        known: posteriors by agent.
    """
    closed, there = _find_closed(observation), (x for x in observation.agents if not x.left)
    return tuple(_forecast_agent(agent, known[agent.id], closed) for agent in there)


def _find_closed(observation: ObservedScene) -> frozenset[str]:
    """Signal groups that do not show green now."""
    place = load_map(observation.intersection)
    shown = {light.stop_line or light.crosswalk: light.colour
             for light in sorted(observation.lights, key=lambda each: each.start)}  # fmt: skip
    lines = {movement.id: movement.stop_line for movement in place.movements}
    return frozenset(
        group.id
        for group in (place.signals.groups if place.signals is not None else ())
        for name in (*(lines[movement] for movement in group.movements), *group.crosswalks)
        if shown.get(name, "green") != "green"
    )


def _forecast_agent(
    agent: ObservedAgent, posterior: RoutePosterior, closed: frozenset[str]
) -> AgentForecast:
    """Routes, laws and limits of speed from where the agent is now, and its way along them."""
    rng = np.random.default_rng(zlib.crc32(agent.xy.tobytes()))
    components = posterior.components
    picked, weight = _sample_components(posterior, rng)
    curve, component = _sample_curves(posterior, picked, rng), posterior.kept[picked]
    s = measure_arc_length(curve)
    median, spread = components.law[component], components.spread[component]
    law = median * np.exp(spread * rng.standard_normal(median.shape))
    law = np.clip(law, components.low[component], components.high[component])
    desired = _find_desired_speed(agent)
    if desired is None:
        law[:, 0] = np.maximum(law[:, 0], float(agent.speed.max()))
    else:
        law[:, 0] = desired * np.exp(0.01 * rng.standard_normal(len(law)))
    lateral = law[:, 3:4] / np.maximum(np.abs(components.curvature[component]), 1e-3)
    limit = brake_backwards(s, np.minimum(law[:, :1] ** 2, lateral), law[:, 2:3])
    # The point of each route nearest to the agent now.
    k, apart = np.arange(SIZE), np.square(curve - agent.xy[-1]).sum(axis=-1)
    i = np.clip(apart.argmin(axis=1), 1, curve.shape[1] - 2)
    chord, length = curve[k, i + 1] - curve[k, i - 1], s[k, i + 1] - s[k, i - 1]
    off = ((agent.xy[-1] - curve[k, i]) * chord).sum(axis=1) / np.maximum(length, 1e-6)
    here, v0 = (s[k, i] + off)[:, None], float(agent.speed[-1])
    # Squared speed at the points of the route and here, and when each is reached [s from now].
    nodes = np.sort(np.concatenate([s, here], axis=1), axis=1)
    ahead = np.maximum(nodes - here, 0.0)
    squared = np.minimum(interpolate_rows(nodes, s, limit), v0**2 + 2.0 * law[:, 1:2] * ahead)
    squared = np.maximum(squared, v0**2 - 2.0 * _HARDEST * ahead)
    v, times = np.sqrt(np.maximum(squared, 0.0)), np.zeros(nodes.shape)
    dt = 2.0 * np.diff(nodes, axis=1) / np.maximum(v[:, 1:] + v[:, :-1], 2 * _CREEP)
    np.cumsum(dt, axis=1, out=times[:, 1:])
    times -= interpolate_rows(here, nodes + 1e-9 * np.arange(nodes.shape[1]), times)
    ticks = np.broadcast_to(DT * np.arange(TICKS), (SIZE, TICKS))
    at = interpolate_rows(ticks, times + 1e-7 * np.arange(nodes.shape[1]), nodes)
    line = components.line[component] - (agent.length / 2 if agent.is_vehicle else 0.0)
    line = np.where(line - here[:, 0] > -1.5, line - here[:, 0], np.inf)
    groups = [components.group[c] in closed for c in component]
    return AgentForecast(
        agent, components, interpolate_points(at, s, curve),
        interpolate_rows(at, s, measure_headings(curve)),
        ticks <= times[:, -1:], np.sqrt(interpolate_rows(here, s, limit))[:, 0],
        np.array(groups) & np.isfinite(line), line, component, weight,
    )  # fmt: skip


def _sample_components(
    posterior: RoutePosterior, rng: np.random.Generator
) -> tuple[NDArray[np.intp], FloatArray]:
    """[K] which of those kept, every possible exit equally often; [K] importance weights.

    Accidents happen on rare turns; drawn by their posterior alone, none would be sampled.
    """
    routes = posterior.components.routes
    exits, weights = np.array([routes[c].exit for c in posterior.kept]), posterior.weights
    shares = {side: float(weights[exits == side].sum()) for side in dict.fromkeys(exits.tolist())}
    sides = [side for side, share in shares.items() if share > _RULED_OUT]
    order = rng.permutation(np.arange(SIZE) % len(sides))
    component, weight = np.zeros(SIZE, dtype=np.intp), np.zeros(SIZE)
    for n, side in enumerate(sides):
        mine = np.flatnonzero(order == n)
        inside = np.where(exits == side, weights, 0.0)
        component[mine] = rng.choice(len(weights), size=len(mine), p=inside / inside.sum())
        weight[mine] = shares[side] / len(mine)
    return component, weight / weight.sum()


def _sample_curves(
    posterior: RoutePosterior, picked: NDArray[np.intp], rng: np.random.Generator
) -> FloatArray:
    """[K, P, 2] draws of the route, conditioned on the track so far."""
    components, component = posterior.components, posterior.kept[picked]
    white = rng.standard_normal((SIZE, 2 * K))
    sensitivity, residual = posterior.sensitivity[picked], posterior.residual[picked]
    noise = posterior.noise * rng.standard_normal(residual.shape)
    distinct, which = np.unique(picked, return_inverse=True)  # few, so each is multiplied once
    rows = posterior.sensitivity[distinct]
    covariance = (np.einsum("kji,kli->kjl", rows, rows) + np.diag(posterior.noise**2))[which]
    unexplained = residual - np.einsum("kji,ki->kj", sensitivity, white) - noise
    gain = np.linalg.solve(covariance, unexplained[..., None])[..., 0]
    white = white + np.einsum("kji,kj->ki", sensitivity, gain)
    moved = np.einsum("kij,kj->ki", components.cholesky[component], white).reshape(SIZE, K, 2)
    return np.asarray(
        components.curve[component] + np.einsum("pk,nkd->npd", components.knots, moved)
    )  # fmt: skip


def _find_desired_speed(agent: ObservedAgent) -> float | None:
    """The speed that it kept for half a second or more [m/s], if it did."""
    if len(agent.speed) < 6:
        return float(agent.speed.max()) if agent.start > 0.05 or not agent.is_vehicle else None
    top = float(np.sort(agent.speed)[-4:].mean())
    steady = np.abs(agent.speed - top) < 0.12 + 0.01 * top
    return top if top > (2.0 if agent.is_vehicle else 0.5) and steady.sum() >= 6 else None
