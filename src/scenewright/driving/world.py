"""Simulation step: the ego moves by its action, the others by a traffic model; collisions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from scenewright.driving.ego_motion import ActionMode, EgoState, move_ego
from scenewright.driving.scenario import BoolArray, Scenario
from scenewright.scene.base import FloatArray


def find_overlaps(
    xy: FloatArray,
    heading: FloatArray,
    size: FloatArray,
    other_xy: FloatArray,
    other_heading: FloatArray,
    other_size: FloatArray,
    other_is_disc: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Whether one rectangle touches others.

    Args:
        xy, heading, size: [..., 2] centre, [...] direction and [2] length and width of the one.
        other_xy, other_heading: [..., 2] and [...] of the others, of the same or a shape that
            broadcasts; other_size: [..., 2]; other_is_disc: [...] discs of diameter length.

    Returns:
        [...] bool.
    """
    delta = other_xy - xy
    along, across = _turn(delta, heading)
    half, other_half = size / 2, other_size / 2
    radius = other_half[..., 0]
    outside = np.hypot(
        np.maximum(np.abs(along) - half[0], 0.0), np.maximum(np.abs(across) - half[1], 0.0)
    )
    turn = other_heading - heading
    c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    length, width = other_half[..., 0], other_half[..., 1]
    back, side = _turn(delta, other_heading)
    apart = (
        (np.abs(along) > half[0] + c * length + s * width)
        | (np.abs(across) > half[1] + s * length + c * width)
        | (np.abs(back) > length + c * half[0] + s * half[1])
        | (np.abs(side) > width + s * half[0] + c * half[1])
    )
    return np.asarray(np.where(other_is_disc, outside <= radius, ~apart))


def _turn(delta: FloatArray, heading: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Vectors along a direction and to the left of it."""
    c, s = np.cos(heading), np.sin(heading)
    x, y = delta[..., 0], delta[..., 1]
    return x * c + y * s, y * c - x * s


End = Literal["collision", "arrived", "over", "policy_failed"]
"""Why a drive ended: the ego hit an agent, reached the end of its route, the scene was over, or the
policy failed (set by `run_drive`)."""

COLLISION_CHECKS = np.linspace(0.25, 1.0, 4)
"""Fractions of a step at which collisions are checked."""
ARRIVAL_TOLERANCE = 1.0
"""Distance to the end of its route at which the ego has arrived [m]."""


@dataclass(eq=False)
class OtherStates:
    """All others than the ego at one moment, N agents and objects; row `ego` is not used.

    Attributes:
        xy: [N, 2] [m]; heading: [N] [rad]; speed: [N] [m/s]; present: [N].
    """

    xy: FloatArray
    heading: FloatArray
    speed: FloatArray
    present: BoolArray


class TrafficModel(Protocol):
    """How the others move."""

    def start(self, scenario: Scenario, rng: np.random.Generator) -> OtherStates:
        """The others at the first step of a drive."""
        ...

    def move(self, now: OtherStates, ego: EgoState, step: int) -> OtherStates:
        """The others at `step`, one step after `now`; `ego` is the state of the ego at `now`."""
        ...


class Replay:
    """All others follow the recorded scene, whatever the ego does."""

    def start(self, scenario: Scenario, rng: np.random.Generator) -> OtherStates:  # noqa: ARG002
        """The others at the first step."""
        self._scenario = scenario
        self._speed = compute_recorded_speeds(scenario)
        return self._get_state_at(scenario.start)

    def move(self, now: OtherStates, ego: EgoState, step: int) -> OtherStates:  # noqa: ARG002
        """The others at a step."""
        return self._get_state_at(step)

    def _get_state_at(self, step: int) -> OtherStates:
        scenario = self._scenario
        k = min(step, scenario.steps - 1)
        return OtherStates(
            scenario.xy[:, k], scenario.heading[:, k], self._speed[:, k], scenario.present[:, k]
        )


def compute_recorded_speeds(scenario: Scenario) -> FloatArray:
    """[N, T] speed of the recorded agents [m/s]."""
    speed = np.hypot(*np.gradient(scenario.xy, scenario.step, axis=1).transpose(2, 0, 1))
    return np.asarray(speed)


@dataclass(eq=False)
class World:
    """A drive in progress.

    Attributes:
        step: index of the present sample; history: the ego at every step from the first.
        others: all others now; record: their states at every step.
        hit: index of the agent or object that the ego touches; end: why the drive is over.
    """

    scenario: Scenario
    traffic: TrafficModel
    mode: ActionMode
    step: int
    ego: EgoState
    others: OtherStates
    history: list[EgoState]
    record: list[OtherStates]
    hit: int | None = None
    end: End | None = None

    def advance(self, action: FloatArray) -> None:
        """Advance all agents by one step, and look for a contact of the ego."""
        scenario = self.scenario
        before, others = self.ego, self.others
        self.ego = move_ego(
            before, action, self.mode, scenario.paths[scenario.ego],
            length=float(scenario.sizes[scenario.ego, 0]), step=scenario.step,
        )  # fmt: skip
        self.step += 1
        self.others = self.traffic.move(others, before, self.step)
        self.history.append(self.ego)
        self.record.append(self.others)
        self.hit = _find_hit(scenario, before, self.ego, others, self.others)
        if self.hit is not None:
            self.end = "collision"
        elif self.ego.progress >= scenario.paths[scenario.ego].length - ARRIVAL_TOLERANCE:
            self.end = "arrived"
        elif self.step >= scenario.steps - 1:
            self.end = "over"


def start_world(
    scenario: Scenario, traffic: TrafficModel, mode: ActionMode, *, rng: np.random.Generator
) -> World:
    """A drive at its first step."""
    others = traffic.start(scenario, rng)
    path, k = scenario.paths[scenario.ego], scenario.start
    x, y = scenario.xy[scenario.ego, k]
    heading = float(scenario.heading[scenario.ego, k])
    speed = float(path.progress[k + 1] - path.progress[k]) / scenario.step
    ego = EgoState(float(x), float(y), heading, speed, 0.0, 0.0, float(path.progress[k]), 0.0)
    return World(scenario, traffic, mode, scenario.start, ego, others, [ego], [others])


def _find_hit(
    scenario: Scenario, before: EgoState, after: EgoState, was: OtherStates, now: OtherStates
) -> int | None:
    """The first agent that the ego touches on the way from one step to the next."""
    me = scenario.ego
    apart = np.hypot(now.xy[:, 0] - after.x, now.xy[:, 1] - after.y)
    near = now.present & (apart < scenario.reach[me] + scenario.reach + 5.0)
    near[me] = False
    who = np.flatnonzero(near)
    if not len(who):
        return None
    begin = np.where(was.present[who], 0.0, 1.0)
    part = np.maximum(COLLISION_CHECKS[:, None], begin)
    turned = np.angle(np.exp(1j * (now.heading[who] - was.heading[who])))
    hits = find_overlaps(
        *_interpolate_ego(before, after), scenario.sizes[me],
        was.xy[who] + part[..., None] * (now.xy[who] - was.xy[who]),
        was.heading[who] + part * turned,
        scenario.sizes[who], scenario.is_disc[who],
    )  # fmt: skip
    touched = np.flatnonzero(hits.any(axis=0))
    if not len(touched):
        return None
    first = np.argmax(hits[:, touched], axis=0)
    return int(who[touched[int(np.argmin(first))]])


def _interpolate_ego(before: EgoState, after: EgoState) -> tuple[FloatArray, FloatArray]:
    """[parts, 1, 2] positions and [parts, 1] headings on the way."""
    turn = np.angle(np.exp(1j * (after.heading - before.heading)))
    x = before.x + COLLISION_CHECKS * (after.x - before.x)
    y = before.y + COLLISION_CHECKS * (after.y - before.y)
    return np.stack([x, y], axis=-1)[:, None], (before.heading + COLLISION_CHECKS * turn)[:, None]


def list_ego_points(history: Sequence[EgoState]) -> FloatArray:
    """[n, 4] x, y [m], heading [rad] and speed [m/s] of the ego at every step."""
    return np.array([(state.x, state.y, state.heading, state.speed) for state in history])
