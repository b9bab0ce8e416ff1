"""Sampled futures of all observed agents, in which no agent gives way.

In each future the lights run with one offset that fits what was seen of them, and every agent has a
route drawn from its posterior, a driving profile that fits its speed so far, and stops at red or
behind a vehicle that stops in its lane. An agent slower than its route demands is also forecast
`unslowed`, as if it had kept its speed: the cause of its slowing is looked for there (SEMANTICS
section 4, yielding, cause).
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

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
from scenewright.scene.map import IntersectionMap, SignalProgram
from scenewright.tools.map_grounding.signal_plan import is_showing

BoolArray = NDArray[np.bool_]

SIZE = 120
"""Futures of a scene."""
DT = 0.25
"""Step of a future [s]."""
HORIZON = 13.0
"""Length of a future [s]."""
TICKS = int(HORIZON / DT) + 1
_CREEP = 0.1
_LINE_GAP, _START_LAG = (0.3, 1.5), (0.8, 1.5)
_QUEUE_GAP, _LANE = 2.5, 1.5
_STANDS = 0.3
"""Below this speed [m/s] an agent is stationary."""
_STOOD = 1.5
"""An agent stationary this little beyond a line [m], by the mean curve, stands at it."""
_HARDEST = 6.0
_RUNS, _HEEDLESS, _LATE = 0.25, 0.03, 1.25
"""Share of futures in which an agent ignores a stop; the probability of that; and how much harder
than its profile it would have to brake for that to count as intended."""
_CRAWLS, _SLACK = 1.5, 0.3
"""Below this speed [m/s] no agent runs a light; accuracy of the position of stops [m]."""
_RULED_OUT = 0.015
"""Exits less likely than this are not sampled."""


@dataclass(frozen=True, eq=False)
class AgentForecast:
    """One agent in K futures.

    Attributes:
        xy: [K, T, 2] centre [m]; heading: [K, T] [rad], from now on every `DT`; present: [K, T]
            whether it is still on the map.
        free: [K] speed that its route allows it now [m/s].
        held: [K] it stops, or stands, at red or in a queue; runs: [K] it ignores a stop.
        component: [K] which it follows; weight: [K] probability.
        stop: [K] distance to where it should stop [m], inf where it need not.
    """

    xy: FloatArray
    heading: FloatArray
    present: BoolArray
    free: FloatArray
    held: BoolArray
    runs: BoolArray
    component: NDArray[np.intp]
    weight: FloatArray
    stop: FloatArray

    @cached_property
    def box(self) -> tuple[FloatArray, FloatArray]:
        """[K, 2] least and greatest x and y [m] of each future."""
        x, y = self.xy[..., 0], self.xy[..., 1]
        least = np.stack([x.min(axis=1), y.min(axis=1)], axis=1)
        return least, np.stack([x.max(axis=1), y.max(axis=1)], axis=1)

    @cached_property
    def facing(self) -> tuple[FloatArray, FloatArray]:
        """[K, T] cosine and sine of the heading."""
        return np.cos(self.heading), np.sin(self.heading)


@dataclass(frozen=True, eq=False)
class SceneForecast:
    """All futures of a scene.

    Attributes:
        agents: those still on the map; posteriors, futures: of each; unslowed: of each as if it had
            not slowed down, or the same object where it has not.
        delay: [A] median of how much slower than its route allows each is now [m/s].
    """

    agents: tuple[ObservedAgent, ...]
    posteriors: tuple[RoutePosterior, ...]
    futures: tuple[AgentForecast, ...]
    unslowed: tuple[AgentForecast, ...]
    delay: FloatArray


class _Stops(NamedTuple):
    """[K] where an agent stops [m of its route], inf for nowhere; [K] when it goes on [s]."""

    place: FloatArray
    release: FloatArray


@dataclass(frozen=True, eq=False)
class _DriveForecast:
    """K sampled routes of one agent with their driving profiles, before stops."""

    agent: ObservedAgent
    components: RouteComponents
    component: NDArray[np.intp]
    weight: FloatArray
    runs: BoolArray
    curve: FloatArray
    s: FloatArray
    squared_limit: FloatArray
    law: FloatArray
    begins: FloatArray
    line: FloatArray
    stop: FloatArray

    @property
    def speed(self) -> float:
        """Speed now [m/s]."""
        return float(self.agent.speed[-1])


def forecast_scene(
    observation: ObservedScene, known: Mapping[str, RoutePosterior]
) -> SceneForecast:
    """Sample `SIZE` futures of every agent still on the map.

    Each agent's random numbers come from its own motion, so that ids and order do not matter.

    Args:
        known: posteriors by agent.
    """
    intersection_map = load_map(observation.intersection)
    agents = tuple(agent for agent in observation.agents if not agent.left)
    posteriors = tuple(known[agent.id] for agent in agents)
    rngs = [_seed_rng(agent.xy) for agent in agents]
    drives = [_sample_drive(*each) for each in zip(agents, posteriors, rngs, strict=True)]
    program, offsets = intersection_map.signals, _sample_offsets(intersection_map, observation)
    clock = None if offsets is None else observation.now + offsets
    stops = dict[int, _Stops]()
    found = dict[int, tuple[AgentForecast, AgentForecast, float]]()
    # Agents ahead are forecast before those behind them.
    order = [float(np.median(drive.line - drive.begins)) for drive in drives]
    for n in sorted(range(len(agents)), key=order.__getitem__):
        stops[n] = _plan_stops(n, drives, stops, program, clock, rngs[n])
        drive, plan = _ignore_stops(drives[n], stops[n], rngs[n])
        squared = interpolate_rows(drive.begins[:, None], drive.s, drive.squared_limit)
        future = _sample_track(drive, plan, np.sqrt(np.maximum(squared, 0))[:, 0])
        lost = np.where(future.held, 0.0, future.free - drive.speed)
        delay = find_weighted_quantile(lost, future.weight, 0.5)
        found[n] = future, _forecast_unslowed(drive, future, plan), delay
    rows = [found[n] for n in range(len(agents))]
    futures, unslowed = tuple(row[0] for row in rows), tuple(row[1] for row in rows)
    return SceneForecast(agents, posteriors, futures, unslowed, np.array([row[2] for row in rows]))


def find_weighted_quantile(values: FloatArray, weight: FloatArray, share: float) -> float:
    """The least of the values up to which lies so much of their weight, which sums to one."""
    order = np.argsort(values)
    at = int(np.searchsorted(np.cumsum(weight[order]), share))
    return float(values[order[min(at, len(order) - 1)]])


def _seed_rng(values: FloatArray) -> np.random.Generator:
    return np.random.default_rng(zlib.crc32(values.tobytes()))


def _sample_drive(
    agent: ObservedAgent, posterior: RoutePosterior, rng: np.random.Generator
) -> _DriveForecast:
    """Routes, laws and limits of speed; the point of each route nearest to the agent now."""
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
    line = components.line[component] - (agent.length / 2 if agent.is_vehicle else 0.0)
    k, apart = np.arange(SIZE), np.square(curve - agent.xy[-1]).sum(axis=-1)
    i = np.clip(apart.argmin(axis=1), 1, curve.shape[1] - 2)
    chord, length = curve[k, i + 1] - curve[k, i - 1], s[k, i + 1] - s[k, i - 1]
    off = ((agent.xy[-1] - curve[k, i]) * chord).sum(axis=1) / np.maximum(length, 1e-6)
    return _DriveForecast(
        agent, components, component, weight, np.zeros(SIZE, dtype=np.bool_), curve, s, limit,
        law, s[k, i] + off, line, np.full(SIZE, np.inf),
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
    rows, off = posterior.seen[picked], posterior.off[picked]
    noise = posterior.noise * rng.standard_normal(off.shape)
    distinct, which = np.unique(picked, return_inverse=True)  # few, so each is multiplied once
    seen = posterior.seen[distinct]
    spread = (np.einsum("kji,kli->kjl", seen, seen) + np.diag(posterior.noise**2))[which]
    miss = off - np.einsum("kji,ki->kj", rows, white) - noise
    gain = np.linalg.solve(spread, miss[..., None])[..., 0]
    white = white + np.einsum("kji,kj->ki", rows, gain)
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


def _find_leader(n: int, drives: Sequence[_DriveForecast]) -> int | None:
    """The next vehicle ahead in the lane of a vehicle, if there is one."""
    own = drives[n].agent
    if not own.is_vehicle:
        return None
    facing = np.array([np.cos(own.heading[-1]), np.sin(own.heading[-1])])
    found: list[tuple[float, int]] = []
    for m, other in enumerate(each.agent for each in drives):
        if m == n or not other.is_vehicle:
            continue
        away = other.xy[-1] - own.xy[-1]
        along, lateral = away @ facing, away @ np.array([-facing[1], facing[0]])
        aligned = np.cos(other.heading[-1] - own.heading[-1]) > 0.9
        if 0.0 < along < 45.0 and abs(lateral) < _LANE and aligned:
            found.append((float(along), m))
    return min(found)[1] if found else None


def _sample_offsets(
    intersection_map: IntersectionMap, observation: ObservedScene
) -> FloatArray | None:
    """[K] offsets [s] of the signal programme under which the lights show what was seen."""
    program = intersection_map.signals
    if program is None or not observation.lights:
        return None
    lines = {movement.id: movement.stop_line for movement in intersection_map.movements}
    groups: dict[tuple[str | None, str | None], str] = {}
    for group in program.groups:
        for movement in group.movements:
            groups.setdefault((lines[movement], None), group.id)
        for crosswalk in group.crosswalks:
            groups.setdefault((None, crosswalk), group.id)
    tried = np.arange(0.0, program.cycle, 0.25)
    good = np.ones(len(tried), dtype=np.bool_)
    for light in observation.lights:
        name = groups.get((light.stop_line, light.crosswalk))
        if name is None:
            continue
        times = np.arange(light.start + 0.05, max(light.end - 0.05, light.start + 0.06), 0.4)
        times = np.append(times, max(light.end - 0.05, light.start + 0.05))
        good &= is_showing(program, name, tried[:, None] + times, (light.colour,)).all(axis=1)
    fits = tried[good]
    return _seed_rng(fits).choice(fits, size=SIZE) if len(fits) else None


def _plan_stops(
    n: int,
    drives: Sequence[_DriveForecast],
    earlier: Mapping[int, _Stops],
    program: SignalProgram | None,
    clock: FloatArray | None,
    rng: np.random.Generator,
) -> _Stops:
    """Where each future of an agent stops, at red or behind its leader.

    Args:
        clock: [K] time of the signal programme now [s]; None where no lights are known.
    """
    drive, leader = drives[n], _find_leader(n, drives)
    gap = rng.uniform(*_LINE_GAP, SIZE) if drive.agent.is_vehicle else np.full(SIZE, 0.3)
    lag = rng.uniform(*_START_LAG, SIZE)
    plan = _Stops(np.full(SIZE, np.inf), np.zeros(SIZE))
    if program is not None and clock is not None:
        place, release = plan
        groups = [drive.components.group[c] for c in drive.component]
        reaches = np.maximum(_compute_arrival(drive, plan, drive.line), 0.0)
        moment = clock + np.minimum(reaches, 200.0)
        before = drive.begins < drive.line + (_STOOD if drive.speed < _STANDS else 0.2)
        for name in dict.fromkeys(group for group in groups if group is not None):
            mine = np.array([group == name for group in groups])
            green = is_showing(program, name, moment, ("green",))
            at_red = mine & before & ~green & np.isfinite(reaches)
            # Time until green from moments of the programme.
            grid = np.arange(0.0, program.cycle, 0.25)
            shown = np.tile(is_showing(program, name, grid, ("green",)), 2)
            index = np.where(shown, np.arange(len(shown)), len(shown))
            following = np.minimum.accumulate(index[::-1])[::-1][: len(grid)]
            at = (moment % program.cycle / 0.25).astype(np.intp) % len(grid)
            waits = reaches + (following[at] - at) * 0.25 + lag
            place = np.where(at_red, np.maximum(drive.line - gap, drive.begins), place)
            release = np.where(at_red, waits, release)
        plan = _Stops(place, release)
    if leader is None or leader not in earlier:
        return plan
    return _stop_in_queue(drive, drives[leader], earlier[leader], plan, lag)


def _stop_in_queue(
    drive: _DriveForecast, leader: _DriveForecast, queue: _Stops, plan: _Stops, lag: FloatArray
) -> _Stops:
    """Stop behind the leader where that stops first and still stands on arrival."""
    between = float(np.hypot(*(leader.agent.xy[-1] - drive.agent.xy[-1])))
    room = (leader.agent.length + drive.agent.length) / 2 + _QUEUE_GAP
    behind = drive.begins + between + (queue.place - leader.begins) - room
    stands = np.isfinite(queue.place)
    never = plan._replace(place=np.full(len(behind), np.inf))
    comes = _compute_arrival(drive, never, np.where(stands, behind, 0.0))
    waits = stands & (comes < queue.release + 0.5) & (behind < plan.place)
    return _Stops(
        np.where(waits, np.maximum(behind, drive.begins), plan.place),
        np.where(waits, queue.release + lag, plan.release),
    )


def _ignore_stops(
    drive: _DriveForecast, plan: _Stops, rng: np.random.Generator
) -> tuple[_DriveForecast, _Stops]:
    """Let some futures ignore their stop, weighted by how the agent has braked so far."""
    place, speed = plan.place, drive.speed
    held, runs = np.isfinite(place), rng.random(len(place)) < _RUNS
    left = np.maximum(place - drive.begins, 0.0)
    late = (speed > _CRAWLS) & (speed**2 / (2.0 * (left + _SLACK)) > _LATE * drive.law[:, 2])
    last = drive.agent.speed[-6:]
    slowing = len(last) > 2 and bool(last[0] - last[-1] > 0.08 * len(last))
    stopping = speed < _STANDS or slowing
    share = np.where(late, 0.9, 0.004 if stopping else _HEEDLESS)
    factor = np.where(runs, share / _RUNS, (1.0 - share) / (1.0 - _RUNS))
    weight = np.where(held, drive.weight * factor, drive.weight)
    stop = np.where(held, left, np.inf)
    changed = replace(drive, weight=weight / weight.sum(), runs=held & runs, stop=stop)
    return changed, plan._replace(place=np.where(runs, np.inf, place))


def _compute_times(drive: _DriveForecast, plan: _Stops) -> tuple[FloatArray, FloatArray]:
    """[K, P+2] nodes [m], strictly rising for interpolation, and when each is reached [s].

    Nodes are the present position and the stop as well.
    """
    stops = np.isfinite(plan.place)[:, None]
    stop = np.where(stops, plan.place[:, None], drive.s[:, -1:])
    nodes = np.sort(np.concatenate([drive.s, drive.begins[:, None], stop], axis=1), axis=1)
    w = interpolate_rows(nodes, drive.s, drive.squared_limit)  # squared speed
    v0, braking, push = drive.speed, drive.law[:, 2:3], drive.law[:, 1:2]
    ahead = nodes - drive.begins[:, None]
    held = stops & (nodes <= stop + 1e-9)
    w = np.where(held, np.minimum(w, 2.0 * braking * np.maximum(stop - nodes, 0.0)), w)
    w = np.minimum(w, v0**2 + 2.0 * push * np.maximum(ahead, 0.0))
    w = np.where(stops & (nodes > stop), np.minimum(w, 2.0 * push * (nodes - stop)), w)
    slowest = v0**2 - 2.0 * _HARDEST * np.maximum(ahead, 0.0)
    w = np.maximum(w, np.where(held & (ahead >= 0), np.minimum(slowest, w + 1e9), slowest))
    v = np.sqrt(np.maximum(w, 0.0))
    dt = 2.0 * np.diff(nodes, axis=1) / np.maximum(v[:, 1:] + v[:, :-1], 2 * _CREEP)
    times, rising = np.zeros(nodes.shape), nodes + 1e-9 * np.arange(nodes.shape[1])
    np.cumsum(dt, axis=1, out=times[:, 1:])
    times -= interpolate_rows(drive.begins[:, None], rising, times)
    if stops.any():
        stop = np.where(stops, plan.place[:, None], 0.0)
        comes = interpolate_rows(stop, rising, times)
        wait = np.where(stops, np.maximum(plan.release[:, None] - comes, 0.0), 0.0)
        times = np.where(stops & (nodes > stop + 1e-6), times + wait, times)
    return nodes, times


def _compute_arrival(drive: _DriveForecast, plan: _Stops, at: FloatArray) -> FloatArray:
    """[K] when the arc length `at` is reached [s from now]."""
    nodes, times = _compute_times(drive, plan)
    finite = np.where(np.isfinite(at), at, 0.0)[:, None]
    found = interpolate_rows(finite, nodes + 1e-9 * np.arange(nodes.shape[1]), times)[:, 0]
    return np.where(np.isfinite(at), found, np.inf)


def _sample_track(
    drive: _DriveForecast, plan: _Stops, free: FloatArray, *, after: float = 0.0
) -> AgentForecast:
    """The agent along its routes, every `DT` from `after` [s] on."""
    nodes, times = _compute_times(drive, plan)
    ticks = DT * np.arange(TICKS) + after
    rising = times + 1e-7 * np.arange(times.shape[1])
    s = interpolate_rows(np.broadcast_to(ticks, (len(nodes), TICKS)), rising, nodes)
    return AgentForecast(
        interpolate_points(s, drive.s, drive.curve),
        interpolate_rows(s, drive.s, measure_headings(drive.curve)), ticks <= times[:, -1:], free,
        np.isfinite(plan.place), drive.runs, drive.component, drive.weight, drive.stop,
    )  # fmt: skip


def _forecast_unslowed(drive: _DriveForecast, future: AgentForecast, plan: _Stops) -> AgentForecast:
    """The future as if it had kept its speed since it began to slow down."""
    agent = drive.agent
    desired = _find_desired_speed(agent)
    if desired is None or agent.speed[-1] > desired - 0.5:
        return future
    fast = np.flatnonzero(agent.speed > desired - 0.3)
    since = int(fast[-1]) if len(fast) else 0
    earlier = replace(
        drive,
        agent=replace(agent, speed=np.append(agent.speed[:-1], desired)),
        begins=drive.begins - (agent.moved[-1] - agent.moved[since]),
    )
    never = plan._replace(place=np.full(len(drive.begins), np.inf))
    ago = 0.1 * (len(agent.speed) - 1 - since)
    return _sample_track(earlier, never, future.free, after=ago)
