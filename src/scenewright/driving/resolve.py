"""Agents bound to the ego, re-timed so that the asked conflict comes about for this ego."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from scenewright.driving.ego_motion import EgoState
from scenewright.driving.passing_order import find_passing_order
from scenewright.driving.reactive import Reactive
from scenewright.driving.scenario import COLOURS, KINDS, Scenario
from scenewright.driving.world import OtherStates
from scenewright.scene.base import FloatArray
from scenewright.scene.record import RelationRecord

Status = Literal["open", "committed", "over"]

EVERY = 5
"""Steps between two re-timings."""
COMMITTED = np.array([1.5, 0.7, 1.0, 1.0])
"""So long before the conflict an agent is not re-timed any more [s], by kind."""
GAIN, LOSS = np.array([2.5, 1.2, 1.8, 1.8]), np.array([3.0, 1.5, 2.5, 2.5])
"""Acceleration and braking with which one is re-timed [m/s^2], by kind."""
FASTEST = np.array([16.0, 2.4, 7.0, 6.0])
"""To which one is re-timed [m/s], by kind; vehicles to no more than 1.4 of their recorded speed."""
LATERAL = 4.0
LONGEST_LAG = 1.2
"""Between the two at the place of a near miss [s]."""
YIELD_LAG = 0.3
"""How long the agent with priority comes before the other would [s]."""
QUICKEST = 3.0
"""At which an ego is taken to set off at most [m/s^2]."""
NEAR, SLOW = 14.0, 2.0
"""An ego whose front is so near to the place [m] and so slow [m/s] gives way to a coming agent."""
FORESIGHT = 40.0
"""So far ahead one takes precedence over others [m]."""
CLEAR = np.array([14.0, 5.0, 8.0, 8.0])
"""Way through a place where two ways meet [m], by kind."""
HOLD = np.array([12.0, 2.5, 5.0, 5.0])
"""Before the place at which one waits for an ego that stands [m], by kind."""
EARLY, LATE = 2.0, 0.2
"""Who would be at the place earlier than planned by more than this waits before it; the second,
where it is to come as late and as fast as it can [s]."""


@dataclass(frozen=True)
class Plan:
    """When an agent shall be at the place of its conflict, whatever the ego does.

    Attributes:
        time: of the scene [s]; late: whether it waits before the place and sets off so late that
            it must hurry, or comes at an even speed.
        stand_in: another agent that takes its part, and the place on that agent's way [m].
    """

    time: float
    late: bool = False
    stand_in: tuple[int, float] | None = None


@dataclass(eq=False)
class EgoConflict:
    """A conflict that is to come about.

    Attributes:
        asked: the agent that the ego is to meet; agent: the one re-timed, the same or its stand-in.
        ego_at, agent_at: place on either's way [m]; lag: by which the
            agent is to be there after the ego [s].
        heeds: whether the agent is one that gives way to the ego.
        target: speed that it is given [m/s]; None to go as it likes.
        status: `open`, `committed` (left alone), `over` (one of the two has passed the place).
        way, left: of the ego and of the agent to the place, when last looked at [m].
        time [s], reason: when one of the two passed the place, and how far off the other was.
    """

    asked: int
    agent: int
    ego_at: float
    agent_at: float
    lag: float
    heeds: bool
    target: float | None = None
    status: Status = "open"
    way: float = np.inf
    left: float = np.inf
    time: float | None = None
    reason: str | None = None

    def explain(self) -> str:
        """Why a meeting that did not come about did not."""
        if self.reason is not None:
            return self.reason
        return (
            f"the drive ended with the ego {self.way:.0f} m and the other {self.left:.0f} m before "
            "the place"
        )


class Resolve(Reactive):
    """As `Reactive`, but agents bound to the ego by a relation are re-timed every 0.5 s.

    From how the ego drives now follows when it will be at the place of the conflict; the agent is
    given the speed with which it is there with the lag of the recorded scene, within what its kind
    can do, its lights and the order it has among the others allow. 1.5 s before, it is left alone.

    Args:
        plans: by index of the agent that the ego is to meet; one without a plan is re-timed.

    Attributes:
        meetings: what is to come about, and what became of it.
    """

    meetings: tuple[EgoConflict, ...]

    def __init__(self, plans: Mapping[int, Plan] | None = None) -> None:
        self._plans = plans or {}

    def start(self, scenario: Scenario, rng: np.random.Generator) -> OtherStates:
        """The others at the first step, and the places where conflicts are to be."""
        shown = super().start(scenario, rng)
        self.meetings = tuple(list_meetings(scenario))
        for meeting in self.meetings:
            plan = self._plans.get(meeting.asked)
            if plan is not None and plan.stand_in is not None:
                meeting.agent, meeting.agent_at = plan.stand_in
            self._retimed[meeting.agent] = True
        return shown

    def _find_free_speeds(self, ego: EgoState, step: int) -> FloatArray:
        free = super()._find_free_speeds(ego, step)
        for meeting in self.meetings:
            if not self._state.entered[meeting.agent]:
                continue
            if step % EVERY == 0 or meeting.target is None:
                self._retime(meeting, ego, step)
                self._take_precedence(meeting.agent)
            free[meeting.agent] = self._drive(meeting)
        return free

    def _take_precedence(self, k: int) -> None:
        """Let a re-timed agent pass before those that stand, or would be there much later."""
        one, state, order = self._one, self._state, self._order
        mine = min(int(state.s[k] / self._spacing[k]), self._points[k] - 1)
        for i in np.flatnonzero(one.moves & ~state.gone & ~self._swapped[k]):
            at = min(int(state.s[i] / self._spacing[i]), self._points[i] - 1)
            limits = order.limits_any_order if self._swapped[i, k] else order.limits
            begin, room = limits[i, at, k], order.limits_any_order[k, mine, i] - state.s[i]
            if i == k or not state.s[k] - 0.3 <= begin < state.s[k] + FORESIGHT:
                continue
            if not state.entered[i]:
                self._swapped[k, i], self._swapped[i, k] = True, False
                continue
            if order.blocks_path[i, at, k] or not np.isfinite(room):
                continue
            kind = int(one.kinds[i])
            clear = self._time_of(k, begin - float(state.s[k]) + CLEAR[one.kinds[k]]) + 1.0
            stops = state.speed[i] ** 2 / (2 * LOSS[kind]) + 0.5
            stands = state.speed[i] < 0.1 and state.entered[i]
            if room > stops and (stands or self._time_of(int(i), float(room)) > clear):
                self._swapped[k, i], self._swapped[i, k] = True, False

    def _drive(self, meeting: EgoConflict) -> float:
        """The speed of a re-timed agent, its curves minded [m/s]."""
        j = meeting.agent
        speed, kind = float(self._state.speed[j]), int(self._one.kinds[j])
        wanted = float(self._cruise[j]) if meeting.target is None else meeting.target
        step = self._one.step
        wanted = min(max(wanted, speed - LOSS[kind] * step), speed + GAIN[kind] * step)
        path, s = self._one.paths[j], float(self._state.s[j])
        ahead = slice(int(s / path.spacing), int(s / path.spacing) + 40)
        bend = np.maximum(np.abs(path.curvature[ahead]), 1e-3)
        away = path.arc[ahead] - s
        reach = np.sqrt(LATERAL / bend + 2 * 2.0 * np.maximum(away, 0.0))
        return float(min(wanted, float(reach.min(initial=50.0))))

    def _ignores_ego(self, j: int) -> bool:
        found = [meeting for meeting in self.meetings if meeting.agent == j]
        return any(each.status in ("open", "committed") and not each.heeds for each in found)

    def _retime(self, meeting: EgoConflict, ego: EgoState, step: int) -> None:
        """Give an agent the speed with which it meets the ego."""
        state, j = self._state, meeting.agent
        way, left = meeting.ego_at - ego.progress, meeting.agent_at - float(state.s[j])
        if meeting.status == "over":
            meeting.target = None
            return
        meeting.way, meeting.left = way, left
        if way <= 0.0 or left <= 0.0:
            name = self._one.names[j]
            self._close(
                meeting, step,
                f"the ego passed the place when {name} was {left:.0f} m short of it"
                if left > 0
                else f"{name} passed the place when the ego was {max(way, 0.0):.0f} m short of it",
            )  # fmt: skip
            return
        if meeting.status == "committed":
            return
        if meeting.asked in self._plans:
            self._keep_to_plan(meeting, self._plans[meeting.asked], left, step)
            return
        if self._gives_way(ego, way, meeting, step):
            meeting.target, meeting.status = None, "committed"
            return
        if self._is_too_late(meeting, ego, way, step):
            return
        ego_in = self._predict_ego(ego, way, step)
        if not np.isfinite(ego_in):
            self._wait_for_ego(meeting, left)
            return
        time = max(ego_in + meeting.lag, 0.1)
        meeting.target = self._find_target(j, left, time)
        if min(time, ego_in) <= COMMITTED[self._one.kinds[j]]:
            meeting.status = "committed"

    def _keep_to_plan(self, meeting: EgoConflict, plan: Plan, left: float, step: int) -> None:
        """Be at the place at the planned time, with a wait before it if there is much time."""
        j, time = meeting.agent, plan.time - step * self._one.step
        spare = time - self._time_of(j, left)
        if left > HOLD[self._one.kinds[j]] and spare > (LATE if plan.late else EARLY):
            self._wait_for_ego(meeting, left)
        else:
            meeting.target = self._find_target(j, left, max(time, 0.1))

    def _gives_way(self, ego: EgoState, way: float, meeting: EgoConflict, step: int) -> bool:
        """Whether the ego, near the place, has slowed down for an agent that is coming."""
        one, j, at = self._one, meeting.agent, meeting.agent_at
        near = way - float(one.sizes[one.ego, 0]) / 2 < NEAR
        slow = ego.speed < SLOW and ego.acceleration < 0.3
        left = at - float(self._state.s[j])
        coming = float(self._state.speed[j]) > 0.4 or left < HOLD[one.kinds[j]] + 1.5
        return near and slow and coming and not self._faces_red(ego, way, step)

    def _close(self, meeting: EgoConflict, step: int, reason: str) -> None:
        meeting.target, meeting.status, meeting.reason = None, "over", reason
        meeting.time = round(step * self._one.step, 2)

    def _is_too_late(self, meeting: EgoConflict, ego: EgoState, way: float, step: int) -> bool:
        """Whether an ego that stands at a red light is kept there until it is too late; say so."""
        one = self._one
        if ego.speed > 0.5 or not self._faces_red(ego, way, step):
            return False
        left = (one.steps - 1 - step) * one.step
        needed = float(np.sqrt(2 * way / QUICKEST))
        green = min(self._find_next_green(light, step) for light, _ in one.paths[one.ego].stops)
        if green + needed < left:
            return False
        when = f"for {green:.1f} s more" if np.isfinite(green) else "until the scene ends"
        self._close(
            meeting, step,
            f"the ego stands at a light that is red {when}, {way:.0f} m before the place, "
            f"and the scene ends in {left:.1f} s",
        )  # fmt: skip
        return True

    def _find_next_green(self, light: int, step: int) -> float:
        """Until a light shows green [s]; inf if it does not before the scene ends."""
        green = np.flatnonzero(self._one.colours[light, step:] == COLOURS.index("green"))
        return float(green[0]) * self._one.step if len(green) else float(np.inf)

    def _predict_ego(self, ego: EgoState, way: float, step: int) -> float:
        """Until the ego is there [s]; inf if it stands, or stops before as it brakes now."""
        one = self._one
        if self._faces_red(ego, way, step):
            return float(np.inf)
        if ego.acceleration < -0.5 and ego.speed**2 < 2 * -ego.acceleration * way * 0.9:
            return float(np.inf) if ego.speed < 1.0 else way / max(ego.speed, 1.0)
        if ego.speed < 0.3 and ego.acceleration <= 0.05:
            return float(np.inf)
        top = max(min(one.speed_limit * 0.9, ego.speed + 2.5), ego.speed, 2.0)
        gain = min(max(ego.acceleration, 0.05), 2.0)
        needed = (top**2 - ego.speed**2) / (2 * gain)
        if way < needed:
            return float((np.sqrt(ego.speed**2 + 2 * gain * way) - ego.speed) / gain)
        return float((top - ego.speed) / gain + (way - needed) / top)

    def _faces_red(self, ego: EgoState, way: float, step: int) -> bool:
        one = self._one
        return ego.speed < 3.0 and any(
            0.0 <= s - ego.progress + 1.0 < way
            and one.get_colour(light, step) == COLOURS.index("red")
            for light, s in one.paths[one.ego].stops
        )

    def _wait_for_ego(self, meeting: EgoConflict, left: float) -> None:
        """Where the ego stands the agent waits for it: before the place, or at its stop line."""
        j = meeting.agent
        kind, s = int(self._one.kinds[j]), float(self._state.s[j])
        line = [at - s for _, at in self._one.paths[j].stops if at > s - 0.3]
        room = min([left - HOLD[kind], *(each for each in line if each < left)])
        braking, until_next = 0.6 * LOSS[kind], EVERY * self._one.step
        space = (braking * until_next) ** 2 + 2 * braking * max(room, 0.0)
        meeting.target = float(np.sqrt(space)) - braking * until_next
        meeting.target = min(meeting.target, float(self._cruise[j]))

    def _find_target(self, j: int, left: float, time: float) -> float:
        """The speed that covers a way [m] in a time [s] after speeding up or braking evenly."""
        speed, kind = float(self._state.speed[j]), int(self._one.kinds[j])
        gain, loss = GAIN[kind], LOSS[kind]
        more = left - speed * time
        if more >= 0:
            inside = (gain * time) ** 2 - 2 * gain * more
            wanted = speed + gain * time - np.sqrt(max(inside, 0.0))
        else:
            inside = (loss * time) ** 2 + 2 * loss * more
            wanted = speed - loss * time + np.sqrt(max(inside, 0.0))
        top = FASTEST[kind]
        if kind == KINDS.index("vehicle"):
            top = min(top, max(1.4 * float(self._cruise[j]), 8.0))
        return float(np.clip(wanted, 0.0, top))


def list_meetings(scenario: Scenario) -> list[EgoConflict]:
    """The relations between the ego and others, as meetings at a place with a lag."""
    record = scenario.record
    if record is None:
        return []
    ids = [agent.id for agent in record.agents]
    me = ids[scenario.ego]
    meetings = []
    for row in record.relations:
        if me not in (row.from_, row.to) or row.type == "follow":
            continue
        other = ids.index(row.to if row.from_ == me else row.from_)
        place = _find_place(scenario, row, other)
        if place is not None:
            meetings.append(
                EgoConflict(other, other, *place, heeds=row.type == "yielding" and row.to == me)
            )
    return meetings


def _find_place(
    scenario: Scenario, row: RelationRecord, other: int
) -> tuple[float, float, float] | None:
    """Where the two meet on their ways [m], and with which lag [s]; None if their ways do not."""
    ego, agent = scenario.paths[scenario.ego], scenario.paths[other]
    if row.type == "collision":
        times = [
            event.time for event in scenario.record.events  # type: ignore[union-attr]
            if event.type == "collision" and {event.from_, event.to} == {row.from_, row.to}
        ]  # fmt: skip
        if times and times[0] is not None:
            at = np.arange(len(ego.progress)) * scenario.step
            ego_at, agent_at = (float(np.interp(times[0], at, p.progress)) for p in (ego, agent))
            return ego_at, agent_at, 0.0
    met = find_passing_order(scenario).ego_overlap.get(other)
    if met is None:
        return None
    rows, columns = np.nonzero(met)
    lags = (agent.arrival[columns] - ego.arrival[rows]) * scenario.step
    k = int(np.argmin(np.abs(lags)))
    lag = float(np.clip(lags[k], -LONGEST_LAG, LONGEST_LAG))
    if row.type == "yielding":
        lag = -YIELD_LAG if row.from_ == scenario.record.agents[scenario.ego].id else YIELD_LAG  # type: ignore[union-attr]
        middle = rows + 0.2 * columns
        k = int(np.argsort(middle)[len(middle) // 2])
    return float(ego.arc[rows[k]]), float(agent.arc[columns[k]]), lag
