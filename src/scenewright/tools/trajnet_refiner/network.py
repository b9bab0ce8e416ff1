"""The network of the refiner for inference, in numpy (paper Eq. 7).

It computes what `model.Refiner` learns, for the agents of one scene: each has an LSTM that reads
its motion so far, pools what its nearest neighbours do, sees the way to its goal, and changes its
velocity. All of it is expressed in the frame of the agent itself, in which it came along +x.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.tools.trajnet_refiner.config import (
    BEFORE,
    CLASSES,
    GOAL_FEATURES,
    LATE,
    RefinerConfig,
)

Floats = NDArray[np.float32]
Flags = NDArray[np.bool_]
Places = NDArray[np.int64]


class Observed(NamedTuple):
    """The agents of a scene that are seen now.

    Attributes:
        xy: [N, T, 2] observed positions [m], the last one now; NaN where unseen.
        classes: [N] places in `CLASSES`.
        goal: [N, P, 2] where each is headed at each predicted step [m], NaN for none; or None.
        due: [N, P] predicted steps from now (1 is the next) at which the goal is to be reached;
            NaN if it does not matter when.
    """

    xy: FloatArray
    classes: Places
    goal: FloatArray | None = None
    due: FloatArray | None = None


class Prediction(NamedTuple):
    """The predicted motion of agents.

    Attributes:
        xy: [N, P, 2] mean positions [m]; NaN of agents that are not seen now.
        spread: [N, P, 3] of the Gaussian in the agent's own frame: log standard deviations along
            and across its direction [log m], and the correlation.
        along: [N, 2] unit vector of that direction in the map frame.
    """

    xy: Floats
    spread: Floats
    along: Floats


@dataclass
class _Present:
    """Agents at one step: places, moves and late changes of the move [m], and places before."""

    xy: Floats
    move: Floats
    change: Floats
    before: Floats
    moved: Flags
    known: Flags


class RefinerNetwork:
    """A trained network, ready to predict.

    Args:
        weights: arrays of the names and shapes of `config.list_shapes`.

    Raises:
        InputError: the configuration is one that only the benchmark has.
    """

    def __init__(self, config: RefinerConfig, weights: Mapping[str, FloatArray | Floats]) -> None:
        self.config = config
        self.weights = {name: np.asarray(w, dtype=np.float32) for name, w in weights.items()}
        if config.mirrored or config.apart is not None:
            raise InputError("weights of the benchmark predict mirrored and apart; scenes do not")
        self._pace = np.array(config.pace, dtype=np.float32) * np.float32(config.step)
        self._reach = np.array(config.reach, dtype=np.float32)
        self._read = _Cell(self.weights, "encoder", "_l0")
        self._write = _Cell(self.weights, "decoder", "")

    def predict(self, scene: Observed, *, steps: int | None = None) -> Prediction:
        """The mean motion of all agents seen now.

        Args:
            steps: how many are predicted; as many as the configuration says if None.
        """
        c = self.config
        steps = steps or c.predicted
        observed = _select_latest(scene.xy, c.observed)
        seen = np.asarray(np.isfinite(observed).all(axis=2))
        here = np.flatnonzero(seen[:, -1])
        xy = np.full((len(seen), steps, 2), np.nan, dtype=np.float32)
        spread = np.zeros((len(seen), steps, 3), dtype=np.float32)
        along = np.zeros((len(seen), 2), dtype=np.float32)
        if len(here):
            goal, due = (None if e is None else e[here] for e in (scene.goal, scene.due))
            own = Observed(observed[here], scene.classes[here], goal, due)
            xy[here], spread[here], along[here] = self._predict_seen(own, seen[here], steps)
        return Prediction(xy, spread, along)

    def _predict_seen(self, scene: Observed, seen: Flags, steps: int) -> Prediction:
        c, classes = self.config, scene.classes
        xy = np.nan_to_num(scene.xy).astype(np.float32)
        along = _compute_heading(xy, seen)
        unit = self._pace[classes][:, None]
        both = seen[:, 1:] & seen[:, :-1]
        moves = np.where(both[..., None], xy[:, 1:] - xy[:, :-1], np.float32(0.0))
        state = self._encode(moves, both, classes, along, unit)
        now = _build_present(xy, seen, moves, both)
        places, spreads = [], []
        for step in range(0, steps, c.stride):
            state = self._advance(state, now, scene, step, along, unit)
            out = self._apply("output", state[0]).reshape(len(xy), c.stride, -1)
            own = self._limit_walking(out[..., :2], classes) * (0.5 * unit[:, None])
            change = _turn(own, along[:, None]) + self._compute_even_changes(now, scene, step)
            path = now.xy[:, None] + np.cumsum(now.move[:, None] + change, axis=1)
            last = change[:, -1]
            now = _Present(path[:, -1], now.move + last, last / np.float32(c.stride), now.before,
                           np.ones(len(xy), dtype=np.bool_), now.known)  # fmt: skip
            places.append(path)
            spreads.append(out[..., 2:])
        spread = np.concatenate(spreads, axis=1)[:, :steps]
        spread[..., :2] = np.clip(spread[..., :2], -6.0, 4.0)
        spread[..., 2:] = 0.95 * np.tanh(spread[..., 2:])
        return Prediction(np.concatenate(places, axis=1)[:, :steps], spread, along)

    def _apply(self, layer: str, x: Floats) -> Floats:
        """A linear map."""
        y: Floats = x @ self.weights[f"{layer}.weight"].T
        bias = self.weights.get(f"{layer}.bias")
        return y if bias is None else y + bias

    def _encode(
        self, moves: Floats, both: Flags, classes: Places, along: Floats, unit: Floats
    ) -> tuple[Floats, Floats]:
        """The memory of each agent's past, [N, hidden] twice."""
        own = _turn_back(moves, along[:, None]) / unit[:, None]
        change = np.zeros_like(own)
        steady = (both[:, 1:] & both[:, :-1])[..., None]
        change[:, 1:] = np.where(steady, own[:, 1:] - own[:, :-1], 0.0)
        past = np.concatenate((own, 5.0 * change, both[..., None]), -1, dtype=np.float32)
        kind = self.weights["class_embedding.weight"][classes]
        read = _rectify(self._apply("past_embedding", past) + kind[:, None])
        h = c = np.zeros((len(moves), self.config.hidden), dtype=np.float32)
        for step in self._read.weigh(read).transpose(1, 0, 2):
            h, c = self._read.advance(step, h, c)
        return h + _rectify(self._apply("shortcut", past.reshape(len(past), -1))), c

    def _advance(
        self,
        state: tuple[Floats, Floats],
        now: _Present,
        scene: Observed,
        step: int,
        along: Floats,
        unit: Floats,
    ) -> tuple[Floats, Floats]:
        """Memory after a look at the present: own motion, goal, neighbours."""
        parts = [_turn_back(now.move, along) / unit, now.moved[:, None]]
        if self.config.goals:
            parts.append(_compute_goal_features(now.xy, scene, step, along, unit))
        motion = self._apply("motion_embedding", np.concatenate(parts, -1, dtype=np.float32))
        read = [_rectify(motion + self.weights["class_embedding.weight"][scene.classes])]
        if self.config.pooling:
            read.append(self._pool(state[0], now, scene.classes, along, unit))
        return self._write.advance(self._write.weigh(np.concatenate(read, -1)), *state)

    def _pool(
        self, memory: Floats, now: _Present, classes: Places, along: Floats, unit: Floats
    ) -> Floats:
        """[N, pooled] the strongest impressions that the nearest neighbours make."""
        near, who = _find_nearest(now.xy, self._reach[classes], self.config.neighbours)
        messages = self._apply("memory", memory)[who]
        seen = self._apply("pair", _compute_pair_features(now, who, classes, along, unit))
        impression = _rectify(self._apply("impression", _rectify(seen + messages)))
        strongest = np.where(near[..., None], impression, np.float32(0.0)).max(axis=1, initial=0.0)
        return _rectify(self._apply("pool", strongest))

    def _limit_walking(self, change: Floats, classes: Places) -> Floats:
        """[N, stride, 2] learned changes along and across, of pedestrians as far as they count."""
        if self.config.walking is None:
            return change
        share = np.array((self.config.walking, 0.0), dtype=np.float32)
        walks = (classes == CLASSES.index("pedestrian"))[:, None, None]
        return np.where(walks, np.minimum(change, np.float32(0.0)) * share, change)

    def _compute_even_changes(self, now: _Present, scene: Observed, step: int) -> Floats:
        """[N, stride, 2] changes of the move by even acceleration to a goal that is due."""
        if not self.config.goals or scene.goal is None or scene.due is None:
            return np.zeros((len(now.xy), 1, 2), dtype=np.float32)
        goal, left = _select_next_goal(scene, step)
        n = np.nan_to_num(left, nan=1.0)
        lacking = np.nan_to_num(goal) - now.xy - n * now.move
        added = np.where(np.isnan(left) | np.isnan(goal), 0.0, 2.0 * lacking / (n * (n + 1.0)))
        k = np.arange(1, self.config.stride + 1, dtype=np.float32)
        return (np.minimum(k, n)[..., None] * added[:, None]).astype(np.float32)


class _Cell:
    """One step of an LSTM, with gates in the order input, forget, cell, output."""

    def __init__(self, weights: Mapping[str, Floats], name: str, suffix: str) -> None:
        self._input = np.ascontiguousarray(weights[f"{name}.weight_ih{suffix}"].T)
        self._memory = np.ascontiguousarray(weights[f"{name}.weight_hh{suffix}"].T)
        self._bias = weights[f"{name}.bias_ih{suffix}"] + weights[f"{name}.bias_hh{suffix}"]

    def weigh(self, x: Floats) -> Floats:
        """What the input adds to the gates, [..., 4 hidden]."""
        y: Floats = x @ self._input + self._bias
        return y

    def advance(self, weighed: Floats, h: Floats, c: Floats) -> tuple[Floats, Floats]:
        """Output and memory after the step, [N, hidden] each."""
        gates = weighed + h @ self._memory
        width = h.shape[1]
        half = np.float32(0.5)
        enter, forget, leave = (
            half + half * np.tanh(half * gates[:, k * width : (k + 1) * width]) for k in (0, 1, 3)
        )
        memory: Floats = forget * c + enter * np.tanh(gates[:, 2 * width : 3 * width])
        output: Floats = leave * np.tanh(memory)
        return output, memory


def _rectify(x: Floats) -> Floats:
    return np.maximum(x, np.float32(0.0))


def _select_latest(xy: FloatArray, steps: int) -> FloatArray:
    """The last [N, steps, 2] positions; NaN before the first."""
    kept = xy[:, -steps:]
    missing = ((0, 0), (steps - kept.shape[1], 0), (0, 0))
    return np.pad(kept, missing, constant_values=np.nan)


def _build_present(xy: Floats, seen: Flags, moves: Floats, both: Flags) -> _Present:
    early = -1 - min(LATE, moves.shape[1] - 1)
    steady = both[:, early:].all(-1, keepdims=True)
    change = np.where(steady, (moves[:, -1] - moves[:, early]) / np.float32(-1 - early), 0.0)
    past = -1 - min(BEFORE, xy.shape[1] - 1)
    return _Present(xy[:, -1], moves[:, -1], change.astype(np.float32), xy[:, past],
                    both[:, -1], seen[:, past])  # fmt: skip


def _compute_heading(xy: Floats, seen: Flags, *, back: int = 4) -> Floats:
    """[N, 2] unit vectors of each agent's motion over its last steps; +x if standing."""
    last = first = xy[:, -1]
    for k in range(2, min(back, xy.shape[1] - 1) + 2):
        first = np.where(seen[:, -k, None], xy[:, -k], first)
    way = np.where(seen[:, -1:], last - first, np.float32(0.0))
    length = np.hypot(way[:, :1], way[:, 1:])
    east = np.array([[1.0, 0.0]], dtype=np.float32)
    return np.where(length > 1e-6, way / np.maximum(length, np.float32(1e-6)), east)


def _turn(vector: Floats, along: Floats) -> Floats:
    """From an agent's own frame, in which `along` is +x, to the map's; [..., 2] both."""
    x, y = vector[..., 0], vector[..., 1]
    c, s = along[..., 0], along[..., 1]
    return np.stack((c * x - s * y, s * x + c * y), -1)


def _turn_back(vector: Floats, along: Floats) -> Floats:
    """From the map frame to an agent's own, in which `along` is +x; [..., 2] both."""
    x, y = vector[..., 0], vector[..., 1]
    c, s = along[..., 0], along[..., 1]
    return np.stack((c * x + s * y, c * y - s * x), -1)


def _find_nearest(xy: Floats, reach: Floats, most: int) -> tuple[Flags, Places]:
    """[N, K] whether there is such a neighbour within reach [N], and its place among the agents."""
    apart = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    np.fill_diagonal(apart, np.inf)
    count = min(most, max(len(xy) - 1, 1))
    who = np.argpartition(apart, count - 1, axis=1)[:, :count]
    return np.take_along_axis(apart, who, axis=1) < reach[:, None], who


def _compute_pair_features(
    now: _Present, who: Places, classes: Places, along: Floats, unit: Floats
) -> Floats:
    """[N, K, 17] what an agent notices of a neighbour, as `model.pair_features` says."""
    facing = along[:, None]
    offset = _turn_back(now.xy[who] - now.xy[:, None], facing)
    relative = _turn_back(now.move[who] - now.move[:, None], facing)
    change = _turn_back(now.change[who], facing)
    then = _turn_back(now.before[who] - now.before[:, None], facing)
    known = (now.known[who] & now.known[:, None])[..., None].astype(np.float32)
    then /= np.float32(1.0) + np.hypot(then[..., :1], then[..., 1:])
    distance = np.sqrt((offset**2).sum(-1, keepdims=True) + np.float32(1e-6))
    along_course = -(offset * relative).sum(-1, keepdims=True)
    speed = (relative**2).sum(-1, keepdims=True) + np.float32(1e-3)
    steps = np.clip(along_course / speed, 0.0, 12.0).astype(np.float32)
    closest = offset + steps * relative
    gap = np.sqrt((closest**2).sum(-1, keepdims=True) + np.float32(1e-6))
    return np.concatenate(
        (
            offset / (1.0 + distance),
            np.exp(-distance),
            np.exp(-distance / 4.0),
            relative / unit[:, None],
            steps / 12.0,
            np.exp(-2.0 * gap),
            closest / (0.5 + gap),
            now.moved[who][..., None],
            classes[who][..., None],
            5.0 * change / unit[:, None],
            known * then,
            known,
        ),
        axis=-1,
        dtype=np.float32,
    )


def _compute_goal_features(
    xy: Floats, scene: Observed, step: int, along: Floats, unit: Floats
) -> Floats:
    """[N, 7] the way to the goal, as `model.compute_goal_features` says; zeros without one."""
    if scene.goal is None:
        return np.zeros((len(xy), GOAL_FEATURES), dtype=np.float32)
    goal, left = _select_next_goal(scene, step)
    given = ~np.isnan(goal).any(-1, keepdims=True)
    way = _turn_back(np.where(given, np.nan_to_num(goal) - xy, np.float32(0.0)), along)
    distance = np.sqrt((way**2).sum(-1, keepdims=True) + np.float32(1e-6))
    timed = given & ~np.isnan(left)
    pace = np.where(timed, way / np.maximum(np.nan_to_num(left, nan=1.0), 1.0), 0.0) / unit
    features = np.concatenate(
        (way / distance, np.log1p(distance / (12 * unit)), given, np.clip(pace, -4.0, 4.0), timed),
        axis=-1,
        dtype=np.float32,
    )
    return np.where(given, features, np.float32(0.0))


def _select_next_goal(scene: Observed, step: int) -> tuple[Floats, Floats]:
    """[N, 2] the goal at a predicted step, NaN for none, and [N, 1] steps until it is due."""
    assert scene.goal is not None  # noqa: S101
    goal = scene.goal[:, step].astype(np.float32)
    if scene.due is None:
        return goal, np.full_like(goal[:, :1], np.nan)
    left = (scene.due[:, step, None] - step).astype(np.float32)
    return goal, np.where(left >= 1, left, np.float32(np.nan))
