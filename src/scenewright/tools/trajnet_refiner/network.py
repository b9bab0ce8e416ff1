"""The network of the refiner for inference, as machine code (paper Eq. 7).

It computes what `model.Refiner` learns, for the agents of one scene: each has an LSTM that reads
its motion so far, pools what its nearest neighbours do, sees the way to its goal, and changes its
velocity. All of it is expressed in the frame of the agent itself, in which it came along +x.

No product is left to BLAS: for matrices as small as these its threads cost many times what they
save, and what it rounds depends on the machine.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled, compiled_to_write
from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.tools.trajnet_refiner.config import (
    BEFORE,
    CLASSES,
    LATE,
    OUTPUTS,
    PAIR_FEATURES,
    RefinerConfig,
)

Floats = NDArray[np.float32]
Flags = NDArray[np.bool_]
Places = NDArray[np.int64]

_PEDESTRIAN = CLASSES.index("pedestrian")
_HEADING_STEPS = 4
"""Steps of which the direction of an agent is taken."""
_BEYOND = np.float32(7.905)
"""Where the hyperbolic tangent is 1 in single precision."""
_ODD = tuple(np.array([-2.76076847742355e-16, 2.00018790482477e-13, -8.60467152213735e-11,
    5.12229709037114e-08, 1.48572235717979e-05, 6.37261928875436e-04, 4.89352455891786e-03],
    np.float32))  # fmt: skip
_EVEN = tuple(np.array([1.19825839466702e-06, 1.18534705686654e-04, 2.26843463243900e-03,
    4.89352518554385e-03], np.float32))  # fmt: skip
"""Coefficients of x^13, x^11, ... above and x^6, x^4, ... below the line (those of Eigen)."""


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
        xy: [N, P, 2] mean positions [m]; NaN of agents that are not seen now, or not wanted.
        spread: [N, P, 3] of the Gaussian in the agent's own frame: log standard deviations along
            and across its direction [log m], and the correlation.
        along: [N, 2] unit vector of that direction in the map frame.
    """

    xy: Floats
    spread: Floats
    along: Floats


class _Linear(NamedTuple):
    """A linear map: [in, out] weights and [out] what is added."""

    weight: Floats
    bias: Floats


class _Layers(NamedTuple):
    """The weights, those of pooling empty in a network without it.

    Attributes:
        unit: [C] usual distance in a step [m] by class; reach: [C] to neighbours [m].
        walking: see `RefinerConfig`; NaN for None.
        kind: [C, embedding] what is added for each class.
        encoder, decoder: LSTMs that read input and output, gates input, forget, cell, output.
    """

    unit: Floats
    reach: Floats
    neighbours: int
    walking: float
    kind: Floats
    past: _Linear
    shortcut: _Linear
    motion: _Linear
    memory: _Linear
    pair: _Linear
    impression: _Linear
    pool: _Linear
    output: _Linear
    encoder: _Linear
    decoder: _Linear


class _Present(NamedTuple):
    """Agents at one step: [N, 2] places, moves, late changes of the move and places before [m].

    Attributes:
        moved, known: [N] 1 where the move, or the place before, is known, else 0.
    """

    xy: Floats
    move: Floats
    change: Floats
    before: Floats
    moved: Floats
    known: Floats


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

    def predict(
        self, scene: Observed, *, steps: int | None = None, wanted: Flags | None = None
    ) -> Prediction:
        """The mean motion of all agents seen now.

        Args:
            steps: how many are predicted; as many as the configuration says if None.
            wanted: [N] whose motion is asked for, of no more than one stride; of all if None.
        """
        c = self.config
        steps = steps or c.predicted
        count = len(scene.xy)
        here = np.flatnonzero(np.isfinite(scene.xy[:, -1]).all(axis=1))
        past = np.full((len(here), c.observed, 2), np.nan, dtype=np.float32)
        kept = scene.xy[here, -c.observed :]
        past[:, c.observed - kept.shape[1] :] = kept
        aims = np.full((len(here), steps, 3), np.nan, dtype=np.float32)
        if c.goals and scene.goal is not None:
            aims[..., :2] = scene.goal[here, :steps]
            if scene.due is not None:
                aims[..., 2] = scene.due[here, :steps]
        own = np.arange(len(here)) if wanted is None else np.flatnonzero(wanted[here])
        xy = np.full((count, steps, 2), np.nan, dtype=np.float32)
        spread = np.zeros((count, steps, 3), dtype=np.float32)
        along = np.zeros((count, 2), dtype=np.float32)
        if len(own):
            xy[here], spread[here], along[here] = _predict(
                past, scene.classes[here], aims, own, self._layers
            )
        return Prediction(xy, spread, along)

    @cached_property
    def _layers(self) -> _Layers:
        c, weights = self.config, self.weights
        pairs = []
        for name in ("past_embedding", "shortcut", "motion_embedding", "memory", "pair",
                     "impression", "pool", "output"):  # fmt: skip
            weight = weights.get(f"{name}.weight", np.zeros((0, 0), np.float32)).T
            pairs.append((weight, weights.get(f"{name}.bias", np.zeros(weight.shape[1], "f4"))))
        for name, end in (("encoder", "_l0"), ("decoder", "")):
            read, memory = (weights[f"{name}.weight_{part}{end}"].T for part in ("ih", "hh"))
            bias = weights[f"{name}.bias_ih{end}"] + weights[f"{name}.bias_hh{end}"]
            pairs.append((np.concatenate((read, memory)), bias))
        return _Layers(
            np.array(c.pace, dtype=np.float32) * np.float32(c.step),
            np.array(c.reach, dtype=np.float32),
            c.neighbours,
            np.nan if c.walking is None else c.walking,
            weights["class_embedding.weight"],
            *(_Linear(np.ascontiguousarray(weight), bias) for weight, bias in pairs),
        )


# ---- as machine code ----------------------------------------------------------------------------


@compiled
def _predict(
    xy: Floats, classes: Places, aims: Floats, wanted: Places, layers: _Layers
) -> tuple[Floats, Floats, Floats]:
    """Positions [N, P, 2] [m], their spread [N, P, 3] and directions [N, 2] of agents seen now.

    Args:
        xy: [N, T, 2] past positions [m]; NaN where unseen.
        aims: [N, P, 3] goals [m] and the predicted steps at which they are due; NaN for none.
        wanted: [W] who is predicted, all if for more than a stride.
    """
    steps, stride = aims.shape[1], len(layers.output.bias) // OUTPUTS
    out = np.full((len(xy), steps, 2), np.nan, np.float32)
    spread = np.zeros((len(xy), steps, 3), np.float32)
    along, past, now = _observe(xy, classes, layers.unit)
    near = _find_nearest(now.xy, wanted, classes, layers)
    slot, h, c = _encode(past, classes, wanted, near, layers)
    for step in range(0, steps, stride):
        if step > 0:
            near = _find_nearest(now.xy, wanted, classes, layers)
        read = _look(now, aims, step, along, classes, wanted, layers)
        if len(layers.pool.bias):
            seen = _pool(now, along, classes, wanted, near, slot, h, layers)
            read = np.concatenate((read, seen), axis=1)
        h, c = h[slot[wanted]], c[slot[wanted]]
        slot[wanted] = np.arange(len(wanted))
        _advance(layers.decoder, read, h, c)
        learned = _apply(layers.output, h)
        for w, i in enumerate(wanted):
            _move(
                now, i, learned[w], aims[i], step, along[i], classes[i], layers, out[i], spread[i]
            )
    return out, spread, along


@compiled
def _observe(xy: Floats, classes: Places, unit: Floats) -> tuple[Floats, Floats, _Present]:
    """Directions [N, 2], past moves as the network reads them [N, T - 1, 5], and the present."""
    n, last = len(xy), xy.shape[1] - 1
    early, then = last - min(LATE, last - 1), last - min(BEFORE, last)
    along, past = np.zeros((n, 2), np.float32), np.zeros((n, last, 5), np.float32)
    both, move = np.zeros(last + 1, np.bool_), np.zeros((last + 1, 2), np.float32)
    change, before = np.zeros((n, 2), np.float32), np.zeros((n, 2), np.float32)
    now = _Present(xy[:, last].copy(), change.copy(), change, before,
                   np.zeros(n, np.float32), np.zeros(n, np.float32))  # fmt: skip
    for i in range(n):
        first = last
        for k in range(last - 1, max(last - 1 - _HEADING_STEPS, -1), -1):
            first = first if np.isnan(xy[i, k, 0]) else k
        x, y = xy[i, last] - xy[i, first]
        length = np.sqrt(x * x + y * y)
        along[i, 0] = x / length if length > 1e-6 else 1.0
        along[i, 1] = y / length if length > 1e-6 else 0.0
        for k in range(1, last + 1):
            both[k] = not np.isnan(xy[i, k, 0] - xy[i, k - 1, 0])
            move[k] = xy[i, k] - xy[i, k - 1] if both[k] else np.zeros(2, np.float32)
            x, y = _turn_back(move[k], along[i])
            past[i, k - 1, 0], past[i, k - 1, 1] = x / unit[classes[i]], y / unit[classes[i]]
            past[i, k - 1, 4] = both[k]
            if both[k] and both[k - 1]:
                past[i, k - 1, 2:4] = np.float32(5.0) * (past[i, k - 1, :2] - past[i, k - 2, :2])
        if both[early:].all():
            change[i] = (move[last] - move[early]) / np.float32(last - early)
        now.move[i], now.moved[i] = move[last], both[last]
        if not np.isnan(xy[i, then, 0]):
            before[i], now.known[i] = xy[i, then], 1.0
    return along, past, now


@compiled
def _find_nearest(xy: Floats, wanted: Places, classes: Places, layers: _Layers) -> Places:
    """[R, 2] places in `wanted`, and of their nearest neighbours within reach among all agents."""
    most = min(layers.neighbours, len(xy) - 1)
    pairs, count = np.empty((len(wanted) * most, 2), np.int64), 0
    for w, i in enumerate(wanted):
        away = xy - xy[i]
        apart = np.sqrt(away[:, 0] * away[:, 0] + away[:, 1] * away[:, 1])
        apart[i] = np.inf
        for _ in range(most):
            j = np.argmin(apart)
            if apart[j] >= layers.reach[classes[i]]:
                break
            pairs[count, 0], pairs[count, 1], apart[j] = w, j, np.inf
            count += 1
    return pairs[:count]


@compiled
def _encode(
    past: Floats, classes: Places, wanted: Places, near: Places, layers: _Layers
) -> tuple[Places, Floats, Floats]:
    """Rows [N] of agents in the memory [M, hidden] of their past, and that memory twice.

    Who is neither wanted nor near to such a one is left out. All that stand have one row.
    """
    asked, rows = np.zeros(len(past), np.bool_), np.empty(len(past), np.int64)
    asked[wanted] = True
    asked[near[:, 1]] = True
    slot, stand, count = np.full(len(past), -1), np.full(len(CLASSES), -1), 0
    for i in np.flatnonzero(asked):
        stands = past[i, :, 4].all() and not past[i, :, :2].any()
        slot[i] = stand[classes[i]] if stands else -1
        if slot[i] < 0:
            slot[i], rows[count] = count, i
            stand[classes[i]] = count if stands else stand[classes[i]]
            count += 1
    own, kinds = past[rows[:count]], classes[rows[:count]]
    h = np.zeros((count, len(layers.encoder.bias) // 4), np.float32)
    c = np.zeros_like(h)
    for k in range(past.shape[1]):
        _advance(layers.encoder, _embed(layers.past, own[:, k].copy(), kinds, layers), h, c)
    h += _rectify(_apply(layers.shortcut, own.reshape(count, -1)))
    return slot, h, c


@compiled
def _look(
    now: _Present, aims: Floats, step: int, along: Floats, classes: Places, wanted: Places,
    layers: _Layers,
) -> Floats:  # fmt: skip
    """[W, embedding] what each reads of its own motion, and of its goal."""
    motion = np.zeros((len(wanted), len(layers.motion.weight)), np.float32)
    for w, i in enumerate(wanted):
        unit, own = layers.unit[classes[i]], motion[w]
        x, y = _turn_back(now.move[i], along[i])
        own[0], own[1], own[2] = x / unit, y / unit, now.moved[i]
        if len(own) > 3 and not np.isnan(aims[i, step, 0]):
            x, y = _turn_back(aims[i, step, :2] - now.xy[i], along[i])
            distance = np.sqrt(x * x + y * y + 1e-6)
            own[3], own[4], own[6] = x / distance, y / distance, 1.0
            own[5] = np.log1p(distance / (12.0 * unit))
            left = aims[i, step, 2] - step
            if left >= 1.0:
                own[7] = min(max(x / left / unit, -4.0), 4.0)
                own[8] = min(max(y / left / unit, -4.0), 4.0)
                own[9] = 1.0
    return _embed(layers.motion, motion, classes[wanted], layers)


@compiled
def _pool(
    now: _Present, along: Floats, classes: Places, wanted: Places, near: Places, slot: Places,
    memory: Floats, layers: _Layers,
) -> Floats:  # fmt: skip
    """[W, pooled] the strongest impressions that the nearest neighbours make."""
    pairs = np.empty((len(near), PAIR_FEATURES), np.float32)
    for p, (w, j) in enumerate(near):
        i = wanted[w]
        _compare(now, i, j, along[i], layers.unit[classes[i]], classes[j], pairs[p])
    seen, messages = _apply(layers.pair, pairs), _apply(layers.memory, memory)
    for p, (_, j) in enumerate(near):
        seen[p] += messages[slot[j]]
    impressions = _rectify(_apply(layers.impression, _rectify(seen)))
    strongest = np.zeros((len(wanted), impressions.shape[1]), np.float32)
    for p, (w, _) in enumerate(near):
        strongest[w] = np.maximum(strongest[w], impressions[p])
    return _rectify(_apply(layers.pool, strongest))


@compiled_to_write
def _compare(
    now: _Present, i: int, j: int, along: Floats, unit: float, kind: int, out: Floats
) -> None:
    """Write [17] what agent i notices of agent j, as `model.pair_features` says."""
    x, y = _turn_back(now.xy[j] - now.xy[i], along)
    dx, dy = _turn_back(now.move[j] - now.move[i], along)
    distance = np.sqrt(x * x + y * y + 1e-6)
    steps = min(max(-(x * dx + y * dy) / (dx * dx + dy * dy + 1e-3), 0.0), 12.0)
    near_x, near_y = x + steps * dx, y + steps * dy
    gap = np.sqrt(near_x * near_x + near_y * near_y + 1e-6)
    out[0], out[1] = x / (1.0 + distance), y / (1.0 + distance)
    out[2], out[3] = np.exp(-distance), np.exp(-distance / 4.0)
    out[4], out[5], out[6] = dx / unit, dy / unit, steps / 12.0
    out[7] = np.exp(-2.0 * gap)
    out[8], out[9] = near_x / (0.5 + gap), near_y / (0.5 + gap)
    out[10], out[11] = now.moved[j], kind
    x, y = _turn_back(now.change[j], along)
    out[12], out[13] = 5.0 * x / unit, 5.0 * y / unit
    out[16] = now.known[i] * now.known[j]
    x, y = _turn_back(now.before[j] - now.before[i], along)
    share = out[16] / (1.0 + np.sqrt(x * x + y * y))
    out[14], out[15] = share * x, share * y


@compiled_to_write
def _move(
    now: _Present, i: int, learned: Floats, aims: Floats, step: int, along: Floats, kind: int,
    layers: _Layers, places: Floats, spread: Floats,
) -> None:  # fmt: skip
    """Write the places [P, 2] and spread [P, 3] of an agent from a step on, and move it there.

    Args:
        learned: [5 strides] changes of its move and their spread, in its own frame.
        aims: [P, 3] as `_predict` has them.
    """
    ahead = aims[step, :2] - now.xy[i]
    left = aims[step, 2] - step
    timed = left >= 1.0 and not np.isnan(ahead[0])
    added = 2.0 * (ahead - left * now.move[i]) / (left * (left + 1.0))
    change, place = np.zeros(2), now.xy[i].astype(np.float64)
    for k in range(len(learned) // OUTPUTS):
        own = learned[OUTPUTS * k : OUTPUTS * (k + 1)]
        x, y = own[0], own[1]
        if kind == _PEDESTRIAN and not np.isnan(layers.walking):
            x, y = min(x, 0.0) * layers.walking, 0.0
        x, y = 0.5 * layers.unit[kind] * x, 0.5 * layers.unit[kind] * y
        change[0], change[1] = along[0] * x - along[1] * y, along[1] * x + along[0] * y
        if timed:
            change += min(k + 1.0, left) * added
        place += now.move[i] + change
        if step + k < len(places):
            places[step + k] = place
            spread[step + k, 0] = min(max(own[2], -6.0), 4.0)
            spread[step + k, 1] = min(max(own[3], -6.0), 4.0)
            spread[step + k, 2] = 0.95 * np.tanh(own[4])
    now.xy[i], now.moved[i] = place, 1.0
    now.move[i] += change
    now.change[i] = change / (len(learned) // OUTPUTS)


@compiled
def _turn_back(vector: Floats, along: Floats) -> tuple[float, float]:
    """From the map frame to an agent's own, in which `along` is +x."""
    x, y, c, s = vector[0], vector[1], along[0], along[1]
    return c * x + s * y, c * y - s * x


@compiled_to_write
def _advance(cell: _Linear, read: Floats, h: Floats, c: Floats) -> None:
    """Advance output h and memory c of an LSTM [M, hidden] by a step."""
    gates, width = _apply(cell, np.concatenate((read, h), axis=1)), h.shape[1]
    for r in range(len(h)):
        enter, forget = gates[r, :width], gates[r, width : 2 * width]
        fresh, leave = gates[r, 2 * width : 3 * width], gates[r, 3 * width :]
        memory, output = c[r], h[r]
        for j in range(width):
            memory[j] = _squash(forget[j]) * memory[j] + _squash(enter[j]) * _tanh(fresh[j])
            output[j] = _squash(leave[j]) * _tanh(memory[j])


@compiled
def _embed(layer: _Linear, x: Floats, kinds: Places, layers: _Layers) -> Floats:
    y = _apply(layer, x)
    for r in range(len(y)):
        y[r] += layers.kind[kinds[r]]
    return _rectify(y)


@compiled
def _squash(x: np.float32) -> np.float32:
    half = np.float32(0.5)
    return half + half * _tanh(half * x)


@compiled
def _tanh(x: np.float32) -> np.float32:
    """The hyperbolic tangent in single precision, of which loops become vectors."""
    x = min(max(x, -_BEYOND), _BEYOND)
    t, above, below = x * x, _ODD[0], _EVEN[0]
    for each in _ODD[1:]:
        above = above * t + each
    for each in _EVEN[1:]:
        below = below * t + each
    y: np.float32 = x * above / below
    return y


@compiled
def _apply(layer: _Linear, x: Floats) -> Floats:
    y = np.empty((len(x), len(layer.bias)), np.float32)
    y[:] = layer.bias
    _multiply(x, layer.weight, y)
    return y


@compiled_to_write
def _multiply(x: Floats, weight: Floats, out: Floats) -> None:
    """Add the product of x [M, I] and weight [I, O] to out [M, O].

    Eight rows of the weights are used for all of x while they are at hand.
    """
    whole = len(weight) - len(weight) % 8
    for k in range(0, whole, 8):
        a, b, c, d = weight[k], weight[k + 1], weight[k + 2], weight[k + 3]
        e, f, g, h = weight[k + 4], weight[k + 5], weight[k + 6], weight[k + 7]
        for r in range(len(x)):
            s, t, u, v = x[r, k], x[r, k + 1], x[r, k + 2], x[r, k + 3]
            w, p, q, z = x[r, k + 4], x[r, k + 5], x[r, k + 6], x[r, k + 7]
            y = out[r]
            for j in range(len(y)):
                y[j] += ((s * a[j] + t * b[j]) + (u * c[j] + v * d[j])) + (
                    (w * e[j] + p * f[j]) + (q * g[j] + z * h[j])
                )
    for k in range(whole, len(weight)):
        for r in range(len(x)):
            out[r] += x[r, k] * weight[k]


@compiled_to_write
def _rectify(x: Floats) -> Floats:
    """Set what is less than 0 to 0."""
    flat = x.reshape(-1)
    for k in range(len(flat)):
        flat[k] = max(flat[k], np.float32(0.0))
    return x
