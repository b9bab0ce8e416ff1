"""Others that keep their routes, but brake, wait and give way to the ego and to one another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scenewright.compiled import compiled
from scenewright.driving.ego_motion import EgoState
from scenewright.driving.passing_order import find_passing_order
from scenewright.driving.scenario import COLOURS, KINDS, BoolArray, IntArray, Scenario
from scenewright.driving.world import OtherStates, compute_recorded_speeds, find_overlaps
from scenewright.scene.base import FloatArray
from scenewright.scene.reaction_behavior import REACTION_TIME

AHEAD = np.array([0.0, 0.4, 0.8, 1.2, 1.8, 2.5, 3.5, 5.0, 8.0])
"""Times at which all positions are predicted [s]."""
COMFORTABLE = np.array([3.0, 2.0, 2.5, 2.5, 3.0])
HARDEST = np.array([8.0, 3.0, 3.5, 3.5, 8.0])
SPEEDING_UP = np.array([2.0, 1.0, 1.5, 1.5, 2.0])
"""Braking and acceleration [m/s^2] by kind."""
STRENGTH_MEDIAN = np.array([5.0, 2.5, 3.0, 3.0, 5.0])
STRENGTH_SPREAD = 0.25
PERCEPTIBLE = 3.0
"""A conflict is perceptible this long before either is there [s]."""
EGO_BRAKING = 8.0
OFF_ROUTE = 0.8
"""An ego that is further beside its route is met where it is, not where the route leads [m]."""
WINDOW = 200
"""Points of the ways that are looked at in advance."""


Temper = Literal["obedient", "hasty", "careless"]


@dataclass(frozen=True)
class Temperament:
    """How the others take an ego that crosses their routes; nobody drives into one on its way.

    Attributes:
        reaction: median perception-reaction time [s]; strength: of braking, as a factor.
        margin: time between the ego and another at one place that it wants [s].
        waives: share of those with the right of way over the ego that let it pass all the same.
        respects: share of those without it that give way.
    """

    reaction: float = REACTION_TIME.median
    strength: float = 1.0
    margin: float = 0.8
    waives: float = 1.0
    respects: float = 1.0


TEMPERAMENTS: dict[Temper, Temperament] = {
    "obedient": Temperament(),
    "hasty": Temperament(reaction=1.2, strength=0.8, margin=0.4, waives=0.25, respects=0.9),
    "careless": Temperament(reaction=1.8, strength=0.7, margin=0.2, waives=0.0, respects=0.5),
}
"""By the name that `--temperament` takes; stated, not measured."""


@dataclass(eq=False)
class _Clocks:
    """Progress of all agents along their own recorded motions.

    Attributes:
        clock: [N] step of the recording; s: [N] distance along the way [m]; speed: [N] [m/s].
        rate: [N] how fast the clock went in the last step, 0 to 1.
        entered, gone: [N]; waited: [N] time for which a conflict with the ego was perceptible [s].
    """

    clock: FloatArray
    s: FloatArray
    speed: FloatArray
    rate: FloatArray
    entered: BoolArray
    gone: BoolArray
    waited: FloatArray


class Reactive:
    """Each agent goes through its recorded motion, more slowly where another is in the way.

    Each has a clock of its own, which slows down to brake and stops to wait. All agents keep
    the order of the recorded scene (`passing_order`) and their red lights. They give way to the
    ego: followers at once, agents that cross its route after a reaction time, with a strength of
    their own; an agent that is there well before it, or cannot stop any more, goes on.

    Attributes:
        reaction: [N] perception-reaction time [s]; strength: [N] of braking for the ego [m/s^2].
        temperament: how they take the ego.
    """

    reaction: FloatArray
    strength: FloatArray
    temperament = TEMPERAMENTS["obedient"]

    def start(self, scenario: Scenario, rng: np.random.Generator) -> OtherStates:
        """The others at the first step of a drive, as recorded."""
        self._one, self._order = scenario, find_passing_order(scenario)
        n, k = len(scenario.names), scenario.start
        steps = max(len(path.progress) for path in scenario.paths)
        self._progress = np.array([
            np.pad(path.progress, (0, steps - len(path.progress)), mode="edge")
            for path in scenario.paths
        ])  # fmt: skip
        self._first = np.array([path.first for path in scenario.paths])
        self._last = np.array([path.last for path in scenario.paths])
        self._spacing = np.array([max(path.spacing, 1e-6) for path in scenario.paths])
        self._points = np.array([len(path.xy) for path in scenario.paths])
        self._cruise = np.maximum(compute_recorded_speeds(scenario).max(axis=1), 0.8)
        temper, kinds = self.temperament, scenario.kinds
        self.reaction = rng.lognormal(np.log(temper.reaction), REACTION_TIME.spread, n)
        drawn = rng.lognormal(np.log(STRENGTH_MEDIAN[kinds] * temper.strength), STRENGTH_SPREAD)
        self.strength = np.minimum(drawn, HARDEST[kinds])
        share = np.where(scenario.priority, temper.waives, temper.respects)
        self._looks = rng.random(n) < share
        self._swapped = np.zeros((n, n), dtype=bool)
        self._held = np.zeros(n, dtype=bool)
        self._retimed = np.zeros(n, dtype=bool)
        self._lengths = np.array([path.length for path in scenario.paths])
        there = scenario.present[:, k]
        clock = np.maximum(float(k), self._first.astype(np.float64))
        speed = np.where(there, compute_recorded_speeds(scenario)[:, k], 0.0)
        self._state = _Clocks(
            clock, self._interpolate_at_clock(clock), speed, np.ones(n), there.copy(),
            (self._last < k), np.zeros(n),
        )  # fmt: skip
        return self._show(scenario.xy[:, k].copy(), scenario.heading[:, k].copy())

    def move(self, now: OtherStates, ego: EgoState, step: int) -> OtherStates:
        """Advance all agents by one step."""
        one, state, dt = self._one, self._state, self._one.step
        active = state.entered & ~state.gone & one.moves
        free = self._find_free_speeds(ego, step)
        yields, follows, blocked = self._find_yielding(now, ego, active)
        room, emergency = self._find_room(ego, yields | follows, step)
        room, emergency = np.minimum(room, blocked), np.minimum(emergency, blocked)
        kinds = one.kinds
        calm = _find_speed(room - state.s[:, None], COMFORTABLE[kinds], dt)
        sharp = _find_speed(emergency - state.s[:, None], HARDEST[kinds], dt)
        # As recorded, or speeding up towards it, where there is room.
        up = state.speed + SPEEDING_UP[kinds] * dt
        as_recorded = (state.rate >= 0.999) & ~self._retimed
        wanted = np.minimum(np.where(as_recorded, free, np.minimum(free, up)), calm)
        most = np.where(yields, self.strength, np.maximum(COMFORTABLE[kinds], 4.0))
        wanted = np.maximum(wanted, state.speed - np.minimum(most, HARDEST[kinds]) * dt)
        speed = np.minimum(wanted, np.maximum(sharp, state.speed - HARDEST[kinds] * dt))
        self._advance(np.maximum(speed, 0.0), free, active, step)
        self._enter(emergency, step)
        return self._place(now, step)

    def _find_free_speeds(self, ego: EgoState, step: int) -> FloatArray:  # noqa: ARG002
        """Free speeds [N] of all agents [m/s]: as recorded."""
        state = self._state
        return np.asarray(
            (self._interpolate_at_clock(state.clock + 1.0) - state.s) / self._one.step
        )

    # ---- room --------------------------------------------------------------------------------

    def _find_room(
        self, ego: EgoState, heeds: BoolArray, step: int
    ) -> tuple[FloatArray, FloatArray]:
        """How far each may go by each time ahead [N, U] [m]: as foreseen, and if all brake."""
        one, state = self._one, self._state
        u = AHEAD[None, :]
        clock = np.where(state.entered, state.clock, np.minimum(step - 1.0, self._first))
        foreseen = self._interpolate_at_clock(clock[:, None] + state.rate[:, None] * u / one.step)
        hardest = HARDEST[one.kinds][:, None]
        braking = state.s[:, None] + _brake(state.speed[:, None], hardest, u + one.step)
        going_on = state.s[:, None] + state.speed[:, None] * u
        foreseen = np.where(self._retimed[:, None], going_on, foreseen)
        foreseen[one.ego] = ego.progress + _predict(ego, AHEAD)
        braking[one.ego] = ego.progress + _brake(np.array(ego.speed), EGO_BRAKING, AHEAD + one.step)
        lights = self._find_lights(step)
        return tuple(  # type: ignore[return-value]
            np.minimum(self._look_up(where, heeds), lights[:, None])
            for where in (foreseen, braking)
        )

    def _look_up(self, where: FloatArray, heeds: BoolArray) -> FloatArray:
        """[N, U] how far each may go while the others are at places [N, U] on their ways [m]."""
        one, state, order = self._one, self._state, self._order
        k = np.maximum((where / self._spacing[:, None]).astype(int), 0)
        k = np.minimum(k, self._points[:, None] - 1)
        return _find_least_limits(
            k, order.limits, order.limits_any_order, self._swapped, state.gone, state.entered,
            state.s, heeds, one.ego,
        )  # fmt: skip

    def _find_lights(self, step: int) -> FloatArray:
        """Distances [N] that delayed agents may go for red and yellow lights [m]; others obey."""
        one, state = self._one, self._state
        lights = np.full(len(one.names), np.inf)
        late = (step - state.clock > 1.5) | self._retimed
        late &= ~one.violators & state.entered & ~state.gone
        held = np.zeros(len(lights), dtype=bool)
        for j in np.flatnonzero(late):
            for light, s in one.paths[j].stops:
                if state.s[j] > s + 0.3:
                    continue
                colour = one.get_colour(light, step)
                stopping = state.speed[j] ** 2 / (2 * COMFORTABLE[one.kinds[j]])
                if colour == COLOURS.index("red") or (
                    colour == COLOURS.index("yellow") and s - state.s[j] > stopping
                ):
                    lights[j] = min(lights[j], s)
                    held[j] |= state.speed[j] < 0.1
        order, free = self._order, one.moves & ~state.gone & ~held
        for j in np.flatnonzero(held):  # later agents pass who stands at a red light, if they can
            k = min(int(state.s[j] / self._spacing[j]), self._points[j] - 1)
            passing = free & ~order.blocks_path[j, k] & np.isfinite(order.limits[j, k])
            self._swapped[:, j] |= passing
            self._swapped[j, :] &= ~passing
        for j in np.flatnonzero(self._held & ~held):  # goes before those still to enter again
            late = self._swapped[:, j] & ~state.entered & np.isfinite(order.limits[j]).any(axis=0)
            self._swapped[late, j] = False
        self._held = held
        return lights

    # ---- the ego -----------------------------------------------------------------------------

    def _find_yielding(
        self, now: OtherStates, ego: EgoState, active: BoolArray
    ) -> tuple[BoolArray, BoolArray, FloatArray]:
        """Find agents [N] that yield to the ego, those behind it, and how far an ego off its
        route lets each go [m]."""
        n = len(self._one.names)
        yields, follows = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
        blocked = np.full(n, np.inf)
        near = active & (np.hypot(now.xy[:, 0] - ego.x, now.xy[:, 1] - ego.y) < 70.0)
        if abs(ego.offset) > OFF_ROUTE:
            self._meet_off_route(ego, near, blocked)
            return yields, follows, blocked[:, None]
        for j in self._order.ego_overlap:
            meets = False
            if near[j]:
                meets, follows[j] = self._meet(j, ego)
            self._state.waited[j] = self._state.waited[j] + self._one.step if meets else 0.0
            yields[j] = meets and self._looks[j] and self._state.waited[j] >= self.reaction[j]
            if self._ignores_ego(j):
                yields[j] = follows[j] = False
        return yields, follows, blocked[:, None]

    def _ignores_ego(self, j: int) -> bool:  # noqa: ARG002
        """Whether an agent goes on although the ego is in its way."""
        return False

    def _meet(self, j: int, ego: EgoState) -> tuple[bool, bool]:
        """Whether an agent is to give way to the ego, and whether the ego is on its way already."""
        one, state, margin = self._one, self._state, self.temperament.margin
        ke, kj = int(ego.progress / self._spacing[one.ego]), int(state.s[j] / self._spacing[j])
        part = self._order.ego_overlap[j][ke : ke + WINDOW, kj : kj + WINDOW]
        columns = _find_stretch(part.T)
        if columns[0] <= 0:
            return False, False
        rows = _find_stretch(part)
        if rows[0] == 0:
            return False, True
        ego_in, ego_out = (row * self._spacing[one.ego] for row in rows)
        way_in, way_out = (column * self._spacing[j] for column in columns)
        arrives, leaves = (_time_to(ego, d) for d in (ego_in, ego_out))
        begin, end = (self._time_of(j, d) for d in (way_in, way_out))
        if not (arrives < end + margin and begin < leaves + margin):
            return False, False
        if min(begin, arrives) > PERCEPTIBLE or end + 0.3 < arrives:
            return False, False
        needed = state.speed[j] ** 2 / (2 * self.strength[j])
        return bool(needed <= way_in or arrives <= begin), False

    def _time_of(self, j: int, distance: float) -> float:
        """Compute the time until an agent has come so far on a free path [s]."""
        speed, top = float(self._state.speed[j]), float(self._cruise[j])
        gain = SPEEDING_UP[self._one.kinds[j]]
        top = max(top, speed)
        needed = (top**2 - speed**2) / (2 * gain)
        if distance < needed:
            return float((np.sqrt(speed**2 + 2 * gain * distance) - speed) / gain)
        return float((top - speed) / gain + (distance - needed) / top)

    def _meet_off_route(self, ego: EgoState, near: BoolArray, blocked: FloatArray) -> None:
        """Stop agents before an ego beside its route, and before where it heads."""
        one, state = self._one, self._state
        ahead = np.array([0.0, 0.5, 1.0, 1.5])[:, None]
        course = np.array([np.cos(ego.heading), np.sin(ego.heading)])
        places = np.array([ego.x, ego.y]) + (ahead * ego.speed) * course
        for j in np.flatnonzero(near):
            kj = int(state.s[j] / self._spacing[j]) + 1
            xy, heading = one.paths[j].xy[kj : kj + 60], one.paths[j].heading[kj : kj + 60]
            hits = find_overlaps(
                places[:, None], np.array(ego.heading), one.sizes[one.ego] + (1.0, 0.4), xy[None],
                heading[None], one.sizes[j], np.array(one.is_disc[j]),
            ).any(axis=0)  # fmt: skip
            state.waited[j] = state.waited[j] + one.step if hits.any() else 0.0
            if hits.any() and state.waited[j] >= self.reaction[j]:
                blocked[j] = (kj + int(np.argmax(hits)) - 1) * self._spacing[j]

    # ---- motion ------------------------------------------------------------------------------

    def _advance(self, speed: FloatArray, free: FloatArray, active: BoolArray, step: int) -> None:
        state, dt = self._state, self._one.step
        moving = free > 0.05
        rate = np.where(moving, np.minimum(speed / np.maximum(free, 1e-9), 1.0), 1.0)
        rate = np.where(active, rate, 0.0)
        state.clock = np.where(self._retimed, float(step), state.clock + rate)
        going_on = np.minimum(state.s + speed * dt, self._lengths)
        reached = np.where(self._retimed, going_on, self._interpolate_at_clock(state.clock))
        state.speed = np.where(active, (reached - state.s) / dt, state.speed)
        state.s, state.rate = np.where(active, reached, state.s), rate
        over = np.where(
            self._retimed, state.s >= self._lengths - 1e-6, state.clock >= self._last - 1e-6
        )
        state.gone |= active & over

    def _enter(self, emergency: FloatArray, step: int) -> None:
        """An agent that is due enters, unless another stands in the way."""
        state, one = self._state, self._one
        due = ~state.entered & (self._first <= step) & one.moves
        for j in np.flatnonzero(due):
            k = int(self._first[j])
            speed = float(self._progress[j, min(k + 1, self._progress.shape[1] - 1)]) / one.step
            stops = speed**2 / (2 * HARDEST[one.kinds[j]])
            if emergency[j].min() > stops:
                state.entered[j], state.clock[j], state.s[j] = True, float(k), 0.0
                state.speed[j], state.rate[j] = speed, 1.0

    def _interpolate_at_clock(self, clock: FloatArray) -> FloatArray:
        """Distances along the ways at steps [N] or [N, U] of the recording [m]."""
        last = self._progress.shape[1] - 1
        low = np.minimum(np.maximum(clock.astype(int), 0), last - 1)
        part = np.minimum(np.maximum(clock - low, 0.0), 1.0)
        who = np.arange(len(clock)) if clock.ndim == 1 else np.arange(len(clock))[:, None]
        before, after = self._progress[who, low], self._progress[who, low + 1]
        return np.asarray(before + part * (after - before))

    def _place(self, now: OtherStates, step: int) -> OtherStates:
        """Compute all positions: as recorded for agents on time, else along their paths."""
        one, state = self._one, self._state
        k = min(step, one.steps - 1)
        late = ((step - state.clock > 1e-6) | self._retimed) & one.moves & state.entered
        xy, heading = one.xy[:, k].copy(), one.heading[:, k].copy()
        for j in np.flatnonzero(late):
            there, facing = one.paths[j].get_poses(state.s[j : j + 1])
            xy[j], heading[j] = there[0], facing[0]
            if state.rate[j] < 1e-9 and not self._retimed[j]:
                xy[j], heading[j] = now.xy[j], now.heading[j]
        return self._show(xy, heading)

    def _show(self, xy: FloatArray, heading: FloatArray) -> OtherStates:
        state, one = self._state, self._one
        there = state.entered & ~state.gone & one.moves
        there |= one.kinds == KINDS.index("object")
        return OtherStates(xy, heading, np.where(there, state.speed, 0.0), there)


@compiled
def _find_least_limits(
    k: IntArray, limits: FloatArray, any_order: FloatArray, swapped: BoolArray, gone: BoolArray,
    entered: BoolArray, s: FloatArray, heeds: BoolArray, ego: int,
) -> FloatArray:  # fmt: skip
    """[N, U] how far each may go [m] while the others are at points k [N, U] of their ways.

    Args:
        limits, any_order: [N, P, N] of `PassingOrderTables`; swapped: [i, j] whether j goes after i
            against the order; s: [N] where each is [m]; heeds: [N] whether it minds the ego.
    """
    least = np.full(k.shape, np.inf)
    for i in range(len(k)):
        if gone[i] and i != ego:
            continue
        for j in range(len(k)):
            if (i == ego and not heeds[j]) or (i != ego and swapped[j, i]):
                continue
            table = any_order if i == ego or swapped[i, j] else limits
            for u in range(k.shape[1]):
                limit = table[i, k[i, u], j]
                if limit < least[j, u] and not (entered[j] and limit < s[j] - 0.3):
                    least[j, u] = limit
    return least


def _brake(speed: FloatArray, braking: FloatArray | float, u: FloatArray) -> FloatArray:
    """Way in times u of who brakes until it stands [m]."""
    stops = speed / braking
    t = np.minimum(u, stops)
    return np.asarray(speed * t - braking * t**2 / 2)


def _predict(ego: EgoState, u: FloatArray) -> FloatArray:
    """Way of the ego in times u at its present speed, or its present braking [m]."""
    if ego.acceleration < -0.3:
        return _brake(np.array(ego.speed), -ego.acceleration, u)
    return np.asarray(ego.speed * u)


def _time_to(ego: EgoState, distance: float) -> float:
    """Until the ego has come so far as it drives now [s]; inf if it stops before."""
    if ego.acceleration < -0.3:
        rest = ego.speed**2 + 2 * ego.acceleration * distance
        if rest <= 0:
            return float(np.inf)
        return float((ego.speed - np.sqrt(rest)) / -ego.acceleration)
    if ego.speed < 0.3 and ego.acceleration < 0.3:
        return float(np.inf)
    return distance / max(ego.speed, 0.5)


@compiled
def _find_stretch(met: BoolArray) -> tuple[int, int]:
    """First row [n, m] with a True in it, and the next without one; -1 twice if all are False."""
    first = -1
    for k in range(len(met)):
        if met[k].any():
            first = k if first < 0 else first
        elif first >= 0:
            return first, k
    return first, len(met) if first >= 0 else -1


def _find_speed(room: FloatArray, braking: FloatArray, step: float) -> FloatArray:
    """[N] highest speed from which braking keeps within the room [N, U] at all times [m/s].

    Within a step at that speed, then braking: before it stands, u after, the way is
    v (u + step) - b u^2 / 2; afterwards v step + v^2 / 2b.
    """
    b, u = braking[:, None], AHEAD[None, :]
    space = np.maximum(room, 0.0)
    standing = -b * step + np.sqrt((b * step) ** 2 + 2 * b * np.minimum(space, 1e6))
    moving = (space + b * u**2 / 2) / (u + step)
    allowed = np.where(standing <= b * u, standing, np.maximum(moving, b * u))
    return np.asarray(np.where(np.isfinite(room), allowed, np.inf).min(axis=1))
