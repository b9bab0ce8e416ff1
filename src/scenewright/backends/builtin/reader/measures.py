"""Measures in words: a number with a unit, in SI units."""

from __future__ import annotations

import re
from dataclasses import dataclass

from scenewright.backends.builtin.reader.numbers import TENS, TO_TWENTY
from scenewright.backends.builtin.reader.words import WORDS, Patterns

_PATTERNS = Patterns("measures")

_FRACTIONS = {"half": 0.5, "quarter": 0.25, "three quarters": 0.75}
_WORDS = {word: float(number) for number, word in enumerate(TO_TWENTY)}
_WORDS |= {word: 10.0 * tens for tens, word in enumerate(TENS[1:7], start=3)}
_SPELT = re.compile(r"\b(" + "|".join(_WORDS) + r")(?:[- ](" + "|".join(_WORDS) + r"))?\b")
_PER_SECOND = (
    (re.compile(r"km\s*/?\s*h|kph|kmh|kilomet\w+ (?:an|per) hour|\bklicks|\bk's\b"), 1 / 3.6),
    (re.compile(r"\bmph\b|miles? (?:an|per) hour|mph"), 0.44704),
    (re.compile(r"m\s*/\s*s(?!\s*(?:2|²|\^))|met\w+ (?:a|per) second|mps\b"), 1.0),
)
_METRES = (
    (re.compile(r"\bcm\b|centimet|(?<=\d)cm"), 0.01),
    (re.compile(r"\bft\b|feet|foot|(?<=\d)ft"), 0.3048),
    (re.compile(r"inch|(?<=\d)\""), 0.0254),
    (re.compile(r"\bm\b|met(?:re|er)s?\b|(?<=\d)m\b"), 1.0),
)
_AROUND = 0.5
"""How far from a speed asked for an agent may be [m/s] (SEMANTICS 8)."""

_SPEEDS = {
    "vehicle": (5.0, 14.0), "pedestrian": (1.0, 1.7), "cyclist": (2.5, 7.4), "scooter": (2.5, 5.9),
}  # fmt: skip
"""Free speeds by class [m/s]."""


@dataclass(frozen=True)
class MeasureMention:
    """A value in SI units; `unit` is m/s, m, s, m/s2, or empty where none is said."""

    value: float
    unit: str


def measure_in(words: str) -> MeasureMention | None:
    """The measure that some words hold; None without a number."""
    low = words.lower()
    number = _number(low)
    if number is None:
        return None
    if _PATTERNS.acceleration.search(low):
        return MeasureMention(number, "m/s2")
    if _PATTERNS.gravity.search(low):
        return MeasureMention(number * 9.81, "m/s2")
    for pattern, factor in _PER_SECOND:
        if pattern.search(low):
            return MeasureMention(number * factor, "m/s")
    if _PATTERNS.milliseconds.search(low):
        return MeasureMention(number / 1000, "s")
    for pattern, factor in _METRES:
        if pattern.search(low):
            return MeasureMention(number * factor, "m")
    return MeasureMention(number, "s" if _PATTERNS.seconds.search(low) else "")


_BOUNDS = [(re.compile(words), least) for least, words in WORDS["measures"]["bounds"]]
"""Words that make a number a lower bound (True) or an upper one."""


def parse_range(
    words: str, before: str, tolerance: float
) -> tuple[float, float | None, str] | None:
    """The bounds that words give a figure, in SI units, and its unit; None without a number.

    Args:
        before: the words just before, in which a bound such as "at least" may stand.
        tolerance: how far from a plain number the figure may be, in SI units.

    Returns:
        low, high (None: as high as can be) and the unit: m/s, m, s, m/s2, % or empty.
    """
    low = words.lower()
    measure = measure_in(low)
    if measure is None:
        return (50.0 - tolerance, 50.0 + tolerance, "%") if _PATTERNS.middle.search(low) else None
    if _PATTERNS.percent.search(low):
        measure = MeasureMention(measure.value, "%")
    if (two := _PATTERNS.two.search(low)) is not None and measure.unit:
        figure = float(two[1].replace(",", "."))
        scale = measure.value / figure if figure else 1.0
        first, second = sorted((measure.value, float(two[2].replace(",", ".")) * scale))
        return first, second, measure.unit
    around = " ".join(f"{before.lower()} {low}".split())
    found = [(m, least) for bound, least in _BOUNDS for m in bound.finditer(around)]
    if found:  # the last words decide, "minimum time to collision under 1 s"; "no more than" is one
        _, least = max(found, key=lambda each: (each[0].end(), -each[0].start()))
        ends = (measure.value, None) if least else (0.0, measure.value)
        return *ends, measure.unit
    return max(measure.value - tolerance, 0.0), measure.value + tolerance, measure.unit


def parse_speed_range(words: str, agent: str) -> tuple[float, float] | None:
    """The speeds [m/s] that words such as "at 30 km/h" allow an agent; None where they give none.

    A speed that no agent of the class drives or walks at, and a bound ("over 30 km/h") are none.
    """
    measure = measure_in(words)
    if measure is None or measure.unit != "m/s" or _PATTERNS.bound.search(words.lower()):
        return None
    slowest, fastest = _SPEEDS[agent.partition("-")[0]]
    if not slowest <= measure.value <= fastest:
        return None
    return round(measure.value - _AROUND, 2), round(measure.value + _AROUND, 2)


def _number(low: str) -> float | None:
    if match := _PATTERNS.figure.search(low):
        value = float(match[1].replace(",", "."))
        return value + (0.5 if "and a half" in low else 0.0)
    for words, value in _FRACTIONS.items():
        if words in low and "and a half" not in low:
            return value
    if match := _SPELT.search(low):
        tens = _WORDS[match[1]] + (_WORDS[match[2]] if match[2] else 0.0)
        return tens + (0.5 if "and a half" in low else 0.0)
    return 1.0 if _PATTERNS.one_unit.search(low) else None
