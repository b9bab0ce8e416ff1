"""Figures with their 95 % intervals: the sampled units are drawn anew with replacement."""

from __future__ import annotations

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

    def to_share(self) -> dict[str, Any]:
        """Convert percent to a share of 1 with its interval, as leaderboards have it."""
        if self.value is None or self.low is None or self.high is None:
            return {"rate": None, "interval": None, "n": self.n}
        interval = [round(each / 100, 6) for each in (self.low, self.high)]
        return {"rate": round(self.value / 100, 6), "interval": interval, "n": self.n}

    def format(self, pattern: str = "{0:.3f} [{1:.3f}, {2:.3f}]", nothing: str = "–") -> str:
        """Format value, low, high and n by a pattern; `nothing` where there is no value."""
        return nothing if self.value is None else pattern.format(*vars(self).values())


def draw_resamples(
    units: int, *, draws: int, seed: int | np.random.Generator = 0
) -> NDArray[np.int64]:
    """[draws, units] how often each unit is in each resample."""
    rng = np.random.default_rng(seed)
    return rng.multinomial(units, np.full(units, 1 / units), size=draws)


def compute_interval(values: FloatArray) -> tuple[float, float]:
    """Compute the central 95 % of the values of all resamples; NaN among them is left out."""
    low, high = np.nanpercentile(values, (2.5, 97.5)).tolist()
    return low, high


def resample_ratio(
    total: NDArray[Any], count: NDArray[Any], draws: NDArray[np.int64]
) -> FloatArray:
    """[draws] of sums [units] over counts [units]; NaN where nothing is counted."""
    with np.errstate(invalid="ignore"):
        return np.asarray((draws @ total) / (draws @ count))


def compute_ratio(total: NDArray[Any], count: NDArray[Any], draws: NDArray[np.int64]) -> Figure:
    """Compute the sum of all units over their count, with its interval."""
    if not count.sum():
        return Figure(None, None, None, 0)
    interval = compute_interval(resample_ratio(total, count, draws))
    return Figure(float(total.sum() / count.sum()), *interval, int(count.sum()))


def compute_mean(x: FloatArray, groups: NDArray[np.int64], draws: NDArray[np.int64]) -> Figure:
    """Compute the mean of values [S], NaN left out, whose groups [S] are drawn together."""
    known, units = ~np.isnan(x), draws.shape[1]
    total = np.bincount(groups[known], x[known], minlength=units)
    return compute_ratio(total, np.bincount(groups[known], minlength=units), draws)
