"""Figures with their 95 % intervals: Wilson's of counts, else the sampled units are drawn anew."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenewright.scene.base import FloatArray


@dataclass(frozen=True)
class Figure:
    """A value, its 95 % interval, and of how many; None of none."""

    value: float | None
    low: float | None
    high: float | None
    n: int

    @classmethod
    def of_count(cls, count: int, n: int) -> Figure:
        """Build the share of a count in n with its score interval (Wilson 1927)."""
        if not n:
            return cls(None, None, None, 0)
        from scipy.stats import binomtest

        interval = binomtest(count, n).proportion_ci(method="wilson")
        return cls(count / n, float(interval.low), float(interval.high), n)

    @classmethod
    def of_share(cls, share: Mapping[str, Any]) -> Figure:
        """Build a figure from what `to_share` gives."""
        low, high = share["interval"] or (None, None)
        return cls(share["rate"], low, high, share.get("n", 0))

    @property
    def count(self) -> int:
        """What a share is a share of, as a number."""
        return round((self.value or 0.0) * self.n)

    def to_share(self, *, whole: float = 100.0) -> dict[str, Any]:
        """Convert to a share of 1 with its interval, as leaderboards have it; `whole` is all."""
        if self.value is None or self.low is None or self.high is None:
            return {"rate": None, "interval": None, "n": self.n}
        interval = [round(end / whole, 6) for end in (self.low, self.high)]
        return {"rate": round(self.value / whole, 6), "interval": interval, "n": self.n}

    def __format__(self, spec: str) -> str:
        """Format value and interval by the spec of a number: `0.12 [0.10, 0.15]`."""
        scale, unit = (100.0, " %") if spec.endswith("%") else (1.0, "")
        number = spec.replace("%", "f")
        if self.value is None or self.low is None or self.high is None:
            return "–"
        value, low, high = (format(scale * x, number) for x in (self.value, self.low, self.high))
        return f"{value}{unit} [{low}, {high}]"

    def format(self, pattern: str, nothing: str = "–") -> str:
        """Format value, low, high and n by a pattern; `nothing` where there is no value."""
        return nothing if self.value is None else pattern.format(*vars(self).values())


def draw_resamples(
    units: int, *, draws: int, seed: int | np.random.Generator = 0
) -> NDArray[np.int64]:
    """[draws, units] how often each unit is in each resample."""
    rng = np.random.default_rng(seed)
    return rng.multinomial(units, np.full(units, 1 / units), size=draws)


def draw_weights(
    units: int, *, draws: int, seed: int | np.random.Generator = 0
) -> NDArray[np.int64]:
    """[1 + draws, units] how often each unit counts: once in the data, then in each resample."""
    once = np.ones((1, units), dtype=np.int64)
    return np.concatenate([once, draw_resamples(units, draws=draws, seed=seed)])


def compute_interval(values: FloatArray) -> tuple[float, float]:
    """Compute the central 95 % of the values of all resamples; NaN among them is left out."""
    low, high = np.nanpercentile(values, (2.5, 97.5)).tolist()
    return low, high


def build_figure(values: FloatArray, n: int) -> Figure:
    """Build the figure of a statistic [1 + draws] of the data, then of each resample."""
    if not n or np.isnan(values[0]):
        return Figure(None, None, None, 0)
    return Figure(float(values[0]), *compute_interval(values[1:]), n)


def resample_ratio(
    total: NDArray[Any],
    count: NDArray[Any],
    units: NDArray[Any],
    *,
    draws: int,
    seed: int | np.random.Generator = 0,
) -> FloatArray:
    """[1 + draws] of sums [S] over counts [S]; what belongs to one unit [S] is drawn together."""
    names, number = np.unique(units, return_inverse=True)
    weights = draw_weights(max(len(names), 1), draws=draws, seed=seed)
    above, below = (np.bincount(number, part, weights.shape[1]) for part in (total, count))
    with np.errstate(invalid="ignore"):
        return np.asarray((weights @ above) / (weights @ below))


def compute_mean(
    x: FloatArray,
    units: NDArray[Any],
    *,
    draws: int = 1000,
    seed: int | np.random.Generator = 0,
) -> Figure:
    """Compute the mean of values [S], NaN left out; those of one unit [S] are drawn together."""
    known = ~np.isnan(x)
    values = resample_ratio(x[known], known[known], units[known], draws=draws, seed=seed)
    return build_figure(values, int(known.sum()))
