"""Who meets whom in sampled futures, and how likely each future is in that company.

Most people have nothing to do with one another: of the ways open to somebody, one that would take
it close to others is less likely than its own motion says. So every agent's futures are weighed by
how clear of everybody else they stay. For a pair, the two are weighed without one another, as what
they have to do with one another is the question.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.understanding.conflicts import Meeting, meeting
from scenewright.evals.understanding.futures import Future, Outlook
from scenewright.scene.base import FloatArray

IntArray = NDArray[np.intp]
Two = tuple[int, int]

CLOSE, CROSSING = 1.1, 0.5
"""Strangers who cross (at an angle of at least so much [rad]) are not so close in time [s]."""
_CLEAR = 0.85
"""How surely they are not."""
_ROUNDS = 2


@dataclass(frozen=True, eq=False)
class Company:
    """All meetings of a scene; agents by their place in the outlook.

    Attributes:
        free: of i and j, i < j, as they go on; late: of i as if it had not slowed down and j as it
            goes on. Pairs that never come near one another are not in it.
        kinds: [A, K] a number for what each does: its exit, and whether it goes on where it should
            stop.
        clear: [K] how likely the futures of i are when all but j are taken into account.
    """

    free: Mapping[Two, Meeting]
    late: Mapping[Two, Meeting]
    kinds: tuple[IntArray, ...]
    clear: Mapping[Two, FloatArray]


def company_of(outlook: Outlook) -> Company:
    """The company of a scene; two on foot have nothing to do with one another."""
    free: dict[Two, Meeting] = {}
    late: dict[Two, Meeting] = {}
    for i, a in enumerate(outlook.agents):
        for j, b in enumerate(outlook.agents):
            if i == j or not (a.vehicle or b.vehicle):
                continue
            if i < j:
                _note(free, (i, j), meeting((a, outlook.futures[i]), (b, outlook.futures[j])))
            if outlook.undelayed[i] is not outlook.futures[i]:
                _note(late, (i, j), meeting((a, outlook.undelayed[i]), (b, outlook.futures[j])))
    kinds = tuple(_kinds(outlook, n) for n in range(len(outlook.agents)))
    return Company(free, late, kinds, _clear(outlook.futures, free, kinds))


def _note(found: dict[Two, Meeting], pair: Two, seen: Meeting | None) -> None:
    if seen is not None:
        found[pair] = seen


def _kinds(outlook: Outlook, n: int) -> IntArray:
    future = outlook.futures[n]
    exits = [route.exit for route in outlook.fits[n].ways.routes]
    number = {side: k for k, side in enumerate(sorted(set(exits)))}
    codes = np.array([number[side] for side in exits], dtype=np.intp)
    return np.asarray(2 * codes[future.component] + future.runs)


def _clear(
    futures: tuple[Future, ...], free: Mapping[Two, Meeting], kinds: tuple[IntArray, ...]
) -> dict[Two, FloatArray]:
    """Weights of the futures of i without regard to j, from a few rounds of hearsay."""
    near = {
        pair: (np.abs(met.gap) <= CLOSE) & (met.angle >= CROSSING) for pair, met in free.items()
    }
    told: dict[Two, FloatArray] = {}
    for _ in range(_ROUNDS):
        heard = [_heard(n, told, future.weight) for n, future in enumerate(futures)]
        before, told = told, {}
        for (i, j), close in near.items():
            for n, m in ((i, j), (j, i)):
                weight = heard[m] / before.get((m, n), 1.0)
                told[n, m] = 1.0 - _CLEAR * share_by_kind(kinds[n], weight, close)
    whole = [_heard(n, told, future.weight) for n, future in enumerate(futures)]
    return {
        (n, m): _normal(whole[n] / told.get((n, m), 1.0))
        for n in range(len(futures))
        for m in range(len(futures))
    }


def _heard(n: int, told: Mapping[Two, FloatArray], weight: FloatArray) -> FloatArray:
    for (mine, _), factor in told.items():
        if mine == n:
            weight = weight * factor
    return weight


def share_by_kind(
    kinds: IntArray, weight: FloatArray, inside: NDArray[np.bool_] | FloatArray
) -> FloatArray:
    """[K] of all futures of the same kind, by weight, how many are inside."""
    part = np.bincount(kinds, weight * inside)
    whole = np.bincount(kinds, weight)
    return np.asarray((part / np.maximum(whole, 1e-12))[kinds])


def _normal(weight: FloatArray) -> FloatArray:
    return np.asarray(weight / weight.sum())
