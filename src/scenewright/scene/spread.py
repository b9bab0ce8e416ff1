"""Values with units, and values that a plan leaves open: ranges, distributions, lists."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, Literal

_FACTORS: dict[str, dict[str, float]] = {
    "s": {"s": 1.0, "ms": 0.001, "min": 60.0},
    "m": {"m": 1.0, "cm": 0.01, "ft": 0.3048},
    "m/s": {"m/s": 1.0, "km/h": 1 / 3.6, "mph": 0.44704},
    "m/s2": {"m/s2": 1.0, "m/s²": 1.0, "g": 9.80665},
    "%": {"%": 1.0},
}
_FACTORS["any"] = {name: own for known in _FACTORS.values() for name, own in known.items()}
_NUMBER = r"[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?"
_ONE = re.compile(rf"({_NUMBER})\s*(\S*)")
_RANGE = re.compile(rf"({_NUMBER})\s*\.\.\s*({_NUMBER})\s*(\S*)")
_DRAWN = re.compile(rf"(normal|lognormal)\(\s*({_NUMBER})\s*,\s*({_NUMBER})\s*\)\s*(\S*)")
_TIME_SPAN = re.compile(r"([01]\d|2[0-3]):([0-5]\d)-([01]\d|2[0-3]):([0-5]\d)")
_TAIL = 0.001
"""Share of a distribution beyond either of its corners."""


@dataclass(frozen=True)
class Spread:
    """What a field may be.

    Attributes:
        kind: all of a `list`; a number, evenly in a `range`, or drawn from `normal` (mean,
            standard deviation) or `lognormal` (median, standard deviation of the logarithm); or
            a clock time, evenly between two `times`.
        values: of the list; or the two numbers, in SI units; of times in minutes.
        whole: only whole numbers.
    """

    kind: Literal["list", "range", "normal", "lognormal", "times"]
    values: tuple[Any, ...]
    whole: bool = False

    def compute_value(self, share: float) -> Any:
        """The value below which lies this share of all, from 0 to 1."""
        if self.kind == "list":
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        low, high = self.values
        if self.kind == "times":
            minute = round(low + share * (high - low)) % (24 * 60)
            return f"{minute // 60:02}:{minute % 60:02}"
        if self.kind == "range" and self.whole:
            return min(int(low + share * (high - low + 1)), int(high))
        if self.kind == "range":
            return round(low + share * (high - low), 6)
        mean = low if self.kind == "normal" else math.log(low)
        drawn = NormalDist(mean, high).inv_cdf(min(max(share, _TAIL), 1 - _TAIL))
        value = drawn if self.kind == "normal" else math.exp(drawn)
        return round(value) if self.whole else round(value, 6)


def read_spread(text: str, unit: str | None, *, whole: bool) -> Spread | None:
    """The range or distribution that a text writes; None where it writes neither.

    Raises:
        ValueError: in another unit.
    """
    if found := _RANGE.fullmatch(text.strip()):
        factor = _find_factor(found[3], unit)
        return Spread("range", (float(found[1]) * factor, float(found[2]) * factor), whole)
    if found := _DRAWN.fullmatch(text.strip()):
        factor = _find_factor(found[4], unit)
        second = float(found[3]) * (factor if found[1] == "normal" else 1.0)
        kind: Literal["normal", "lognormal"] = "normal" if found[1] == "normal" else "lognormal"
        return Spread(kind, (float(found[2]) * factor, second), whole)
    return None


def check_spread(spread: Spread) -> None:
    """ValueError for a spread that cannot be drawn from."""
    if spread.kind == "list":
        plain = all(isinstance(value, str | int | float | None) for value in spread.values)
        if not (spread.values and plain):
            raise ValueError("a list of values to choose from needs some")
        return
    first, second = spread.values
    if not all(map(math.isfinite, spread.values)):
        raise ValueError("the numbers are too large")
    if spread.kind == "range" and first > second:
        raise ValueError("a range goes upwards, such as 0.4 .. 1.2 s")
    if spread.kind == "lognormal" and first <= 0:
        raise ValueError("the median of a lognormal distribution is above 0")
    if spread.kind in ("normal", "lognormal") and second <= 0:
        raise ValueError("the second number of a distribution is its spread, above 0")


def read_time_span(text: str) -> Spread | None:
    """The span between two clock times, which may go over midnight; None for another text."""
    if (found := _TIME_SPAN.fullmatch(text)) is None:
        return None
    hours, minutes, to_hours, to_minutes = map(int, found.groups())
    first, last = 60 * hours + minutes, 60 * to_hours + to_minutes
    return Spread("times", (first, last if last >= first else last + 24 * 60))


def read_number(value: Any, unit: str | None) -> Any:
    """A number in SI units from one with a unit; what is no text, or has no unit, stays.

    Raises:
        ValueError: no number, or in another unit.
    """
    if not isinstance(value, str) or unit is None:
        return value
    found = _ONE.fullmatch(value.strip())
    if found is None:
        what = "a number" if unit == "any" else f"a number in {unit}"
        quoted = "; within { } it needs quotes" if "(" in value and ")" not in value else ""
        known = "a range such as 0.4 .. 1.2, or normal(9, 1.5)"
        raise ValueError(f"{what}, {known}, not {value!r}{quoted}")
    if re.match(r",\d", found[2]):
        raise ValueError(f"decimals have a point, such as 1.2, not {value!r}")
    return float(found[1]) * _find_factor(found[2], unit)


def _find_factor(given: str, unit: str | None) -> float:
    known = _FACTORS[unit] if unit else {}
    if given and given not in known:
        raise ValueError(f"the unit is one of {', '.join(known) or 'none'}, not {given!r}")
    return known.get(given, 1.0)
