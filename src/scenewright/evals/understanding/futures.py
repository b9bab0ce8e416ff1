"""How a scene may go on: sampled futures of everybody seen, moving as if nobody gave way.

In each future the lights run with one offset that fits what was seen of them, and everybody has a
way drawn from its posterior, a law that fits its speed so far, and stops at red or behind whoever
stands in its lane. Who is slower than its way demands is also driven on `undelayed`, as if it had
kept its speed: only so can be said for whom it slows down (SEMANTICS section 4, yielding, cause).
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.understanding.intent import Fit, fits_of, rows_interp
from scenewright.evals.understanding.observing import Observation, Seen, SeenLight
from scenewright.evals.understanding.ways import Ways
from scenewright.intersections import load_map
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map import IntersectionMap, SignalProgram
from scenewright.tools.map_grounding.signal_plan import is_showing

BoolArray = NDArray[np.bool_]

SIZE = 120
"""Futures of a scene."""
DT = 0.25
"""Between the moments of a future [s]."""
AHEAD = 13.0
"""How far is looked ahead [s]."""
TICKS = int(AHEAD / DT) + 1
_CREEP = 0.1
_LINE_GAP, _START_LAG = (0.3, 1.5), (0.8, 1.5)
_QUEUE_GAP, _LANE = 2.5, 1.5
_STANDS = 0.3
"""Slower than this [m/s] somebody stands."""
_STOOD = 1.5
"""Who stands this little beyond a line [m], as far as the mean curve tells, stands at it."""
_HARDEST = 6.0
_RUNS, _HEEDLESS, _LATE = 0.25, 0.03, 1.25
"""Share of futures in which somebody does not stop who should; how likely that is; and how much
harder than its law has it somebody would have to brake to be thought to mean it."""
_CRAWLS, _SLACK = 1.5, 0.3
"""Slower than this [m/s] nobody runs a light; how exactly it is known where to stop [m]."""
_RULED_OUT = 0.015
"""Exits less likely than this are not looked at."""


@dataclass(frozen=True, eq=False)
class Future:
    """One agent in K futures.

    Attributes:
        xy: [K, T, 2] centre [m]; heading: [K, T] [rad], from now on every `DT`; there: [K, T]
            whether it is still on the map.
        free: [K] speed that its way would let it have now [m/s].
        held: [K] it stops, or stands, at red or in a queue.
        runs: [K] it goes on where it should stop.
        component: [K] which it follows; weight: [K] how likely, 1 in sum.
        stop: [K] how far it is from where it should stop [m], inf where it need not.
    """

    xy: FloatArray
    heading: FloatArray
    there: BoolArray
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


@dataclass(frozen=True, eq=False)
class Outlook:
    """All futures of a scene.

    Attributes:
        agents: those still there; futures: of each; undelayed: of each, as if it had not slowed
            down, or the same where it has not.
        delay: [A] by how much slower than its way allows each is now [m/s], median.
    """

    agents: tuple[Seen, ...]
    fits: tuple[Fit, ...]
    futures: tuple[Future, ...]
    undelayed: tuple[Future, ...]
    delay: FloatArray


@dataclass(frozen=True, eq=False)
class _Drive:
    """K ways of one agent with the law of each, before lights and queues."""

    agent: Seen
    ways: Ways
    component: NDArray[np.intp]
    weight: FloatArray
    runs: BoolArray
    curve: FloatArray
    s: FloatArray
    ceiling: FloatArray
    law: FloatArray
    begins: FloatArray
    line: FloatArray
    stop: FloatArray


def outlook(
    observation: Observation,
    *,
    size: int = SIZE,
    known: Mapping[str, Fit] | None = None,
) -> Outlook:
    """Samples `size` futures of everybody who is still there.

    Chance comes from each agent's own motion, so that ids and order make no difference.

    Args:
        known: fits that were made already, by agent.
    """
    intersection_map = load_map(observation.intersection)
    agents = tuple(agent for agent in observation.agents if not agent.left)
    made = fits_of(observation) if known is None else known
    fits = tuple(made[agent.id] for agent in agents)
    chance = [_chance(agent.xy.tobytes()) for agent in agents]
    drives = [_drive(a, f, c, size) for a, f, c in zip(agents, fits, chance, strict=True)]
    offsets = _offsets(intersection_map, observation, size)
    futures: dict[int, Future] = {}
    undelayed: dict[int, Future] = {}
    stops: dict[int, tuple[FloatArray, FloatArray]] = {}
    delay = np.zeros(len(agents))
    for n in _front_first(drives):
        ahead = _leader(n, drives)
        queue = None if ahead is None or ahead not in stops else stops[ahead]
        leader = None if ahead is None else drives[ahead]
        plan = _stops(
            drives[n], intersection_map, offsets, observation.now, chance[n], queue, leader
        )
        stops[n] = plan
        drives[n], plan = _heedless(drives[n], plan, chance[n])
        futures[n] = _go(drives[n], plan)
        delay[n] = _delay(drives[n], futures[n])
        undelayed[n] = _undelayed(drives[n], futures[n], plan)
    order = range(len(agents))
    return Outlook(
        agents, fits, tuple(futures[n] for n in order), tuple(undelayed[n] for n in order), delay
    )


def _chance(of: bytes) -> np.random.Generator:
    return np.random.default_rng(zlib.crc32(of))


def _drive(agent: Seen, seen: Fit, rng: np.random.Generator, size: int) -> _Drive:
    ways = seen.ways
    picked, weight = _components(seen, rng, size)
    curve, component = _curves(seen, picked, rng), seen.kept[picked]
    step = np.diff(curve, axis=1)
    s = np.zeros(curve.shape[:2])
    np.cumsum(np.hypot(step[..., 0], step[..., 1]), axis=1, out=s[:, 1:])
    law = _laws(agent, ways, component, rng)
    lateral = law[:, 3:4] / np.maximum(np.abs(ways.curvature[component]), 1e-3)
    ceiling = np.minimum(law[:, :1] ** 2, lateral)
    begins = _project(curve, s, agent.xy[-1])
    line = ways.line[component] - (agent.length / 2 if agent.vehicle else 0.0)
    return _Drive(agent, ways, component, weight, np.zeros(size, dtype=np.bool_), curve, s,
                  _backwards(s, ceiling, law[:, 2:3]), law, begins, line,
                  np.full(size, np.inf))  # fmt: skip


def _components(
    seen: Fit, rng: np.random.Generator, size: int
) -> tuple[NDArray[np.intp], FloatArray]:
    """[K] which of those kept, every exit that is not ruled out equally often; and its weight.

    Rare turns are what accidents are made of; drawn by their posterior alone, none would be seen.
    """
    exits = np.array([route.exit for route in seen.routes])
    weights = seen.weights
    shares = {side: float(weights[exits == side].sum()) for side in dict.fromkeys(exits.tolist())}
    sides = [side for side, share in shares.items() if share > _RULED_OUT]
    order = rng.permutation(np.arange(size) % len(sides))
    component, weight = np.zeros(size, dtype=np.intp), np.zeros(size)
    for n, side in enumerate(sides):
        mine = np.flatnonzero(order == n)
        inside = np.where(exits == side, weights, 0.0)
        component[mine] = rng.choice(len(weights), size=len(mine), p=inside / inside.sum())
        weight[mine] = shares[side] / len(mine)
    return component, weight / weight.sum()


def _curves(seen: Fit, picked: NDArray[np.intp], rng: np.random.Generator) -> FloatArray:
    """[K, P, 2] draws of the way, each given where the agent has been."""
    ways, size, component = seen.ways, len(picked), seen.kept[picked]
    white = rng.standard_normal((size, 2 * K))
    rows, off = seen.seen[picked], seen.off[picked]
    noise = seen.noise * rng.standard_normal(off.shape)
    spread = np.einsum("kji,kli->kjl", rows, rows) + np.diag(seen.noise**2)
    miss = off - np.einsum("kji,ki->kj", rows, white) - noise
    gain = np.linalg.solve(spread, miss[..., None])[..., 0]
    white = white + np.einsum("kji,kj->ki", rows, gain)
    moved = np.einsum("kij,kj->ki", ways.cholesky[component], white).reshape(size, K, 2)
    return np.asarray(ways.curve[component] + np.einsum("pk,nkd->npd", ways.knots, moved))


def _laws(
    agent: Seen, ways: Ways, component: NDArray[np.intp], rng: np.random.Generator
) -> FloatArray:
    """[K, 4] speed, acceleration, braking, lateral; the speed is the agent's own if it was seen."""
    median, spread = ways.law[component], ways.spread[component]
    law = median * np.exp(spread * rng.standard_normal(median.shape))
    law = np.clip(law, ways.low[component], ways.high[component])
    own = _own_speed(agent)
    fastest = float(agent.speed.max())
    if own is not None:
        law[:, 0] = own * np.exp(0.01 * rng.standard_normal(len(law)))
    else:
        law[:, 0] = np.maximum(law[:, 0], fastest)
    return np.asarray(law)


def _own_speed(agent: Seen) -> float | None:
    """The speed it keeps to when free: one that it kept for half a second or more."""
    if len(agent.speed) < 6:
        return float(agent.speed.max()) if agent.start > 0.05 or not agent.vehicle else None
    top = float(np.sort(agent.speed)[-4:].mean())
    steady = np.abs(agent.speed - top) < 0.12 + 0.01 * top
    return top if top > (2.0 if agent.vehicle else 0.5) and steady.sum() >= 6 else None


def _project(curve: FloatArray, s: FloatArray, xy: FloatArray) -> FloatArray:
    """[K] arc length of the place nearest to a position [m]."""
    apart = np.square(curve - xy).sum(axis=-1)
    k = np.arange(len(curve))
    i = np.clip(apart.argmin(axis=1), 1, curve.shape[1] - 2)
    chord = curve[k, i + 1] - curve[k, i - 1]
    length = np.maximum(s[k, i + 1] - s[k, i - 1], 1e-6)
    along = ((xy - curve[k, i]) * chord).sum(axis=1) / length
    return np.asarray(s[k, i] + along)


def _backwards(s: FloatArray, ceiling: FloatArray, braking: FloatArray) -> FloatArray:
    """Squared speed from which every ceiling further on can be met."""
    reach = ceiling + 2.0 * braking * s
    return np.asarray(np.minimum.accumulate(reach[:, ::-1], axis=1)[:, ::-1] - 2.0 * braking * s)


def _front_first(drives: Sequence[_Drive]) -> list[int]:
    """Agents, those who are furthest along before those behind them."""
    left = [float(np.median(d.line - d.begins)) for d in drives]
    return sorted(range(len(drives)), key=lambda n: left[n])


def _leader(n: int, drives: Sequence[_Drive]) -> int | None:
    """Who is next ahead in the lane of a vehicle, before the line, if anybody."""
    own = drives[n].agent
    if not own.vehicle:
        return None
    facing = np.array([np.cos(own.heading[-1]), np.sin(own.heading[-1])])
    found: tuple[float, int] | None = None
    for m, other in enumerate(drives):
        if m == n or not other.agent.vehicle:
            continue
        away = other.agent.xy[-1] - own.xy[-1]
        along, beside = away @ facing, away @ np.array([-facing[1], facing[0]])
        same = np.cos(other.agent.heading[-1] - own.heading[-1]) > 0.9
        ahead = 0.0 < along < 45.0 and abs(beside) < _LANE and same
        if ahead and (found is None or along < found[0]):
            found = (float(along), m)
    return None if found is None else found[1]


def _offsets(
    intersection_map: IntersectionMap, observation: Observation, size: int
) -> FloatArray | None:
    """[K] offsets of the programme under which the lights show what was seen."""
    program = intersection_map.signals
    if program is None or not observation.lights:
        return None
    tried = np.arange(0.0, program.cycle, 0.25)
    good = np.ones(len(tried), dtype=np.bool_)
    for light in observation.lights:
        group = group_of(light, intersection_map)
        if group is None:
            continue
        times = np.arange(light.start + 0.05, max(light.end - 0.05, light.start + 0.06), 0.4)
        times = np.append(times, max(light.end - 0.05, light.start + 0.05))
        good &= is_showing(program, group, tried[:, None] + times, (light.colour,)).all(axis=1)
    fits = tried[good]
    return _chance(fits.tobytes()).choice(fits, size=size) if len(fits) else None


def group_of(light: SeenLight, intersection_map: IntersectionMap) -> str | None:
    """The signal group that a light belongs to."""
    if intersection_map.signals is None:
        return None
    lines = {movement.id: movement.stop_line for movement in intersection_map.movements}
    for group in intersection_map.signals.groups:
        if light.crosswalk in group.crosswalks and light.crosswalk is not None:
            return group.id
        if light.stop_line is not None and light.stop_line in (lines[m] for m in group.movements):
            return group.id
    return None


def _stops(
    drive: _Drive,
    intersection_map: IntersectionMap,
    offsets: FloatArray | None,
    now: float,
    rng: np.random.Generator,
    queue: tuple[FloatArray, FloatArray] | None,
    leader: _Drive | None,
) -> tuple[FloatArray, FloatArray]:
    """[K] where it stops [m of its own way], inf for nowhere; [K] when it goes on [s from now]."""
    size = len(drive.begins)
    place, release = np.full(size, np.inf), np.zeros(size)
    program = intersection_map.signals
    groups = [drive.ways.group[c] for c in drive.component]
    gap = rng.uniform(*_LINE_GAP, size) if drive.agent.vehicle else np.full(size, 0.3)
    lag = rng.uniform(*_START_LAG, size)
    stands = drive.agent.speed[-1] < _STANDS
    if program is not None and offsets is not None:
        reaches = _times(drive, np.full(size, np.inf), release, drive.line)
        for name in dict.fromkeys(groups):
            if name is None:
                continue
            mine = np.array([group == name for group in groups])
            before = drive.begins < drive.line + (_STOOD if stands else 0.2)
            clock = now + offsets
            reaches = np.maximum(reaches, 0.0)
            green = is_showing(program, name, clock + np.minimum(reaches, 200.0), ("green",))
            at_red = mine & before & ~green & np.isfinite(reaches)
            place = np.where(at_red, np.maximum(drive.line - gap, drive.begins), place)
            wait = _until_green(program, name, clock + np.minimum(reaches, 200.0))
            release = np.where(at_red, reaches + wait + lag, release)
    if queue is not None and leader is not None:
        place, release = _queued(drive, leader, queue, place, release, lag)
    return place, release


def _heedless(
    drive: _Drive, plan: tuple[FloatArray, FloatArray], rng: np.random.Generator
) -> tuple[_Drive, tuple[FloatArray, FloatArray]]:
    """Some of those who should stop go on; how likely, their braking so far tells."""
    place, release = plan
    agent = drive.agent
    held, runs = np.isfinite(place), rng.random(len(place)) < _RUNS
    v = float(agent.speed[-1])
    left = np.maximum(place - drive.begins, 0.0)
    late = (v > _CRAWLS) & (v**2 / (2.0 * (left + _SLACK)) > _LATE * drive.law[:, 2])
    share = np.where(late, 0.9, 0.004 if v < _STANDS or _slowing(agent) else _HEEDLESS)
    factor = np.where(runs, share / _RUNS, (1.0 - share) / (1.0 - _RUNS))
    weight = np.where(held, drive.weight * factor, drive.weight)
    stop = np.where(held, left, np.inf)
    moved = replace(drive, weight=weight / weight.sum(), runs=held & runs, stop=stop)
    return moved, (np.where(runs, np.inf, place), release)


def _slowing(agent: Seen) -> bool:
    """Whether it has been braking for the last half second."""
    last = agent.speed[-6:]
    return len(last) > 2 and bool(last[0] - last[-1] > 0.08 * len(last))


def _queued(
    drive: _Drive,
    leader: _Drive,
    queue: tuple[FloatArray, FloatArray],
    place: FloatArray,
    release: FloatArray,
    lag: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Behind whoever stops ahead in the lane, if it still stands when this one comes."""
    between = float(np.hypot(*(leader.agent.xy[-1] - drive.agent.xy[-1])))
    room = (leader.agent.length + drive.agent.length) / 2 + _QUEUE_GAP
    behind = drive.begins + between + (queue[0] - leader.begins) - room
    stands = np.isfinite(queue[0])
    comes = _times(drive, np.full(len(behind), np.inf), release, np.where(stands, behind, 0.0))
    waits = stands & (comes < queue[1] + 0.5) & (behind < place)
    place = np.where(waits, np.maximum(behind, drive.begins), place)
    return place, np.where(waits, queue[1] + lag, release)


def _until_green(program: SignalProgram, group: str, times: FloatArray) -> FloatArray:
    """[K] how long it takes until green from moments of the programme [s]."""
    grid = np.arange(0.0, program.cycle, 0.25)
    green = is_showing(program, group, grid, ("green",))
    twice = np.concatenate([green, green])
    index = np.where(twice, np.arange(len(twice)), len(twice))
    following = np.minimum.accumulate(index[::-1])[::-1][: len(grid)]
    at = (times % program.cycle / 0.25).astype(np.intp) % len(grid)
    return np.asarray((following[at] - at) * 0.25)


def _profile(drive: _Drive, place: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Nodes [K, P+2] from where it is, its stop among them, and squared speed there."""
    stop = np.where(np.isfinite(place), place, drive.s[:, -1])
    nodes = np.sort(np.concatenate([drive.s, drive.begins[:, None], stop[:, None]], axis=1), axis=1)
    w = rows_interp(nodes, drive.s, drive.ceiling)
    v0 = float(drive.agent.speed[-1])
    braking, push = drive.law[:, 2:3], drive.law[:, 1:2]
    ahead = nodes - drive.begins[:, None]
    held = np.isfinite(place)[:, None] & (nodes <= stop[:, None] + 1e-9)
    w = np.where(held, np.minimum(w, 2.0 * braking * np.maximum(stop[:, None] - nodes, 0.0)), w)
    w = np.minimum(w, v0**2 + 2.0 * push * np.maximum(ahead, 0.0))
    restart = np.isfinite(place)[:, None] & (nodes > stop[:, None])
    w = np.where(restart, np.minimum(w, 2.0 * push * (nodes - stop[:, None])), w)
    slowest = v0**2 - 2.0 * _HARDEST * np.maximum(ahead, 0.0)
    w = np.maximum(w, np.where(held & (ahead >= 0), np.minimum(slowest, w + 1e9), slowest))
    return nodes, np.maximum(w, 0.0)


def _clock(drive: _Drive, place: FloatArray, release: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Nodes [K, P+2] [m] and when each is reached [s from now]."""
    nodes, w = _profile(drive, place)
    v = np.sqrt(w)
    dt = 2.0 * np.diff(nodes, axis=1) / np.maximum(v[:, 1:] + v[:, :-1], 2 * _CREEP)
    times = np.zeros(nodes.shape)
    np.cumsum(dt, axis=1, out=times[:, 1:])
    times -= rows_interp(drive.begins[:, None], nodes + 1e-9 * np.arange(nodes.shape[1]), times)
    held = np.isfinite(place)
    if held.any():
        stop = np.where(held, place, 0.0)[:, None]
        comes = rows_interp(stop, nodes + 1e-9 * np.arange(nodes.shape[1]), times)
        wait = np.where(held[:, None], np.maximum(release[:, None] - comes, 0.0), 0.0)
        times = np.where(held[:, None] & (nodes > stop + 1e-6), times + wait, times)
    return nodes, times


def _times(drive: _Drive, place: FloatArray, release: FloatArray, at: FloatArray) -> FloatArray:
    """[K] when the arc length `at` is reached [s from now]."""
    nodes, times = _clock(drive, place, release)
    finite = np.where(np.isfinite(at), at, 0.0)
    found = rows_interp(finite[:, None], nodes + 1e-9 * np.arange(nodes.shape[1]), times)[:, 0]
    return np.where(np.isfinite(at), found, np.inf)


def _go(drive: _Drive, plan: tuple[FloatArray, FloatArray]) -> Future:
    """The agent along its ways in time."""
    place, release = plan
    nodes, times = _clock(drive, place, release)
    ticks = DT * np.arange(TICKS)
    rising = times + 1e-7 * np.arange(times.shape[1])
    s = rows_interp(np.broadcast_to(ticks, (len(nodes), TICKS)), rising, nodes)
    there = ticks <= times[:, -1:]
    free = np.sqrt(np.maximum(rows_interp(drive.begins[:, None], drive.s, drive.ceiling), 0))[:, 0]
    return _located(drive, s, there, free, np.isfinite(place))


def _located(
    drive: _Drive, s: FloatArray, there: BoolArray, free: FloatArray, held: BoolArray
) -> Future:
    xy = np.stack([rows_interp(s, drive.s, drive.curve[..., d]) for d in (0, 1)], axis=-1)
    heading = rows_interp(s, drive.s, _headings(drive.curve))
    return Future(
        xy, heading, there, free, held, drive.runs, drive.component, drive.weight, drive.stop
    )  # fmt: skip


def _headings(curve: FloatArray) -> FloatArray:
    middle = np.gradient(curve, axis=1)
    return np.unwrap(np.arctan2(middle[..., 1], middle[..., 0]), axis=1)


def _delay(drive: _Drive, future: Future) -> float:
    """By how much slower than it could be it is [m/s], for no reason of its own way or lights."""
    slower = future.free - float(drive.agent.speed[-1])
    return float(_median(np.where(future.held, 0.0, slower), future.weight))


def _median(values: FloatArray, weight: FloatArray) -> float:
    order = np.argsort(values)
    return float(values[order[np.searchsorted(np.cumsum(weight[order]), 0.5)]])


def _undelayed(drive: _Drive, future: Future, plan: tuple[FloatArray, FloatArray]) -> Future:
    """The future as if it had kept its speed since it began to slow down."""
    agent = drive.agent
    own = _own_speed(agent)
    if own is None or agent.speed[-1] > own - 0.5:
        return future
    slow = np.flatnonzero(agent.speed > own - 0.3)
    since = int(slow[-1]) if len(slow) else 0
    back = agent.moved[-1] - agent.moved[since]
    earlier = replace(
        drive,
        agent=replace(agent, speed=np.append(agent.speed[:-1], own)),
        begins=drive.begins - back,
    )
    nodes, times = _clock(earlier, np.full(len(drive.begins), np.inf), plan[1])
    ago = 0.1 * (len(agent.speed) - 1 - since)
    ticks = DT * np.arange(TICKS) + ago
    rising = times + 1e-7 * np.arange(times.shape[1])
    s = rows_interp(np.broadcast_to(ticks, (len(nodes), TICKS)), rising, nodes)
    there = ticks <= times[:, -1:]
    return _located(drive, s, there, future.free, np.zeros(len(s), dtype=np.bool_))
