"""Clock times and ranges out of clean text; the words for times of day."""

from __future__ import annotations

import re
from collections.abc import Callable

from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.reader.words import VOCABULARY, Patterns

_PATTERNS = Patterns("clock")

_DAY = 24 * 60
_HOUR_WORDS = "one two three four five six seven eight nine ten eleven twelve"
_HOURS = {word: number for number, word in enumerate(_HOUR_WORDS.split(), start=1)}
_MINUTES = {
    "quarter": 15, "a quarter": 15, "half": 30, "five": 5, "ten": 10, "twenty": 20,
    "fifteen": 15, "thirty": 30, "forty": 40, "fifty": 50, "forty five": 45,
    "twenty five": 25, "thirty five": 35, "fifty five": 55,
}  # fmt: skip
_NUMBER = r"(?:\d{1,2}|" + "|".join(_HOURS) + r")"
_PART = r"(?:in the (?:early |late )?(?:morning|afternoon|evening)|at night|tonight)"
_SUFFIX = (
    rf"(?:\s*(?:o ?'? ?clock)?\s*(am|pm)\b|\s*(?:o ?'? ?clock)?\s*({_PART})|\s*(o ?'? ?clock))"
)
_CLOCK = rf"({_NUMBER})(?:\s*[:.h]\s*(\d\d)| (thirty|fifteen|forty five|twenty|ten|forty|fifty))?"
_LEAD = r"(?:\b(?:at|around|about|approximately|exactly|roughly|by|circa|near)\s+)*"
_RANGE = re.compile(
    rf"(?:between|from)?\s*\b{_CLOCK}{_SUFFIX}?\s*(?:-|–|to|and|until|"
    rf"till)\s*{_CLOCK}{_SUFFIX}?(?!\w)"
)
_PAST = re.compile(
    rf"{_LEAD}\b(a quarter|quarter|half|five|ten|twenty five|twenty|\d{{1,2}})(?: minutes?)?"
    rf" (past|to|after|before|till) ({_NUMBER})\b{_SUFFIX}?"
)
_COUNTED = r"(?!\s+(?:other |more |background )*(?:cars?|vehicles?|people|ped|trucks?|bus|lanes?))"
_TO = re.compile(
    rf"(?<!from )(?<!between )(\b(?:at|around|about|by|before|nearly|almost)\s+(?:\w+ly |about )?)?"
    rf"\b(a quarter|quarter|five|ten|twenty five|twenty|5|10|15|20|25)( minutes?)?"
    rf" (?:to|till|before) ({_NUMBER})\b{_COUNTED}{_SUFFIX}?"
)
_HALF_PAST = re.compile(
    r"\b(a quarter|quarter|half|five|ten|twenty five|twenty|5|10|15|20|25)(?: minutes?)?"
    rf"(?: past| after|(?<=half)) ({_NUMBER})\b{_COUNTED}"
)
_MILITARY = re.compile(
    r"(?:\bat\s+)?\b([01]\d|2[0-3])([0-5]\d)\s*(?:hours|hrs|hr|h)?\b(?!\s*(?:m|km|kg|lb|lbs|n|cc|rpm|t)\b)"
)
_HOUR = re.compile(
    r"(?:\bat\s+)?(?<![\d.])\b([01]?\d|2[0-3]) ?h(?:rs?)?\b(?! ?\d)"
    r"|(?:\bat|\baround|\babout|\btime:?)\s+([01]?\d|2[0-3])\.([0-5]\d)\b"
    r"(?!\s*(?:m\b|s\b|sec|met|km|mph|m/s|%|am\b|pm\b|in the\b|at night))"
)
_PLAIN = re.compile(
    rf"{_LEAD}\b(?:({_NUMBER})\s*[:h]\s*([0-5]\d)(?::[0-5]\d)?{_SUFFIX}?(?!\w)"
    rf"|({_NUMBER})(?:[.: ]\s*(\d\d)| (thirty|fifteen|forty five|twenty|ten|forty|fifty))?"
    rf"{_SUFFIX}(?!\w))"
)


def read_clock(text: str) -> str | None:
    """The time in the text as HH:MM or HH:MM-HH:MM; Refused where two clock times differ."""
    text = _PATTERNS.undivided.sub(r"\1:\2 \3", _PATTERNS.midnight.sub(r"\1 12 at night", text))
    text = _HALF_PAST.sub(_write_in_digits, re.sub(r"(?<=\d)ish\b", "", text))
    times: list[str] = []
    for pattern, read in _FORMS:
        at = 0
        while match := pattern.search(text, at):
            time = read(match)
            if time is None:
                at = max(match.end(), at + 1)
                continue
            times.append(time)
            text, at = f"{text[: match.start()]} {text[match.end() :]}", match.start()
    if impossible := _PATTERNS.off_clock.search(text):
        raise Refused("impossible", f"{impossible[0]} is no time of day; use 00:00 to 23:59.")
    if len(set(times)) > 1:
        raise Refused(
            "contradictory", f"The text names several times ({', '.join(times)}); keep one."
        )
    return times[0] if times else None


def read_time_words(words: list[str], *, clock: str | None) -> str | None:
    """The time that clock and words agree on; Refused where they exclude one another."""
    names = list(dict.fromkeys(words))
    if clock is None and not names:
        return None
    allowed = set(range(0, _DAY, 5))
    for name in names:
        allowed &= _list_minutes(name)
    if clock is not None:
        start = _parse_minute(clock[:5])
        if names and not any(
            (start + d) % _DAY in allowed for d in range(-90, 91) if (start + d) % 5 == 0
        ):
            raise Refused("contradictory", f"{clock} is not {names[0]}; name one time of day.")
        return clock
    if not allowed:
        raise Refused(
            "contradictory", f"{' and '.join(names)} exclude one another; name one time of day."
        )
    narrow = min(names, key=lambda name: len(_list_minutes(name)))
    typical = _parse_minute(VOCABULARY["times_of_day"][narrow]["typical"])
    best = min(allowed, key=lambda m: (min((m - typical) % _DAY, (typical - m) % _DAY), m))
    return _format_minute(best)


def is_pronoun(text: str, start: int) -> bool:
    """Whether a number at this place stands for a scene, not an hour: "make one in the evening"."""
    low = text.lower()
    return low.startswith("one ", start) and _PATTERNS.pronoun.search(low[:start]) is not None


def _rewrite_range(match: re.Match[str]) -> str | None:
    first, second = match.groups()[:6], match.groups()[6:]
    if " and " in match[0] and "between" not in match[0]:
        return None
    second_suffix = second[3] or second[4] or second[5]
    if not (second_suffix or (first[1] and second[1])):
        return None
    end = _compute_minute(*second[:5])
    if first[3] or first[4] or first[5]:
        start = _compute_minute(*first[:5])
    else:
        start = _compute_minute(first[0], first[1], first[2], second[3], second[4])
        if start >= end:
            start = _compute_minute(first[0], first[1], first[2], "am", None)
    return f"{_format_minute(start)}-{_format_minute(end)}"


def _write_in_digits(match: re.Match[str]) -> str:
    """ "half past four" -> "4:30", so that it can begin or end a range."""
    hour = int(match[2]) if match[2].isdigit() else _HOURS[match[2]]
    minute = _MINUTES.get(match[1]) or int(match[1])
    return f"{hour}:{minute:02d}"


def _rewrite_to(match: re.Match[str]) -> str | None:
    """ "ten to nine" is a clock time where a preposition or a part of the day says so."""
    lead, amount, minutes, hour = match.groups()[:4]
    suffix = match.groups()[4:7]
    if not (lead or minutes or (not amount.isdigit() and any(suffix))):
        return None
    before = _MINUTES.get(amount) or int(amount)
    return _format_minute((_compute_minute(hour, None, None, *suffix[:2]) - before) % _DAY)


def _rewrite_past(match: re.Match[str]) -> str | None:
    amount = _MINUTES.get(match[1]) or (int(match[1]) if match[1].isdigit() else 0)
    hour = _compute_minute(match[3], None, None, match[4], match[5])
    sign = 1 if match[2] in {"past", "after"} else -1
    return _format_minute((hour + sign * amount) % _DAY) if 0 < amount <= 59 else None


def _rewrite_plain(match: re.Match[str]) -> str | None:
    g = match.groups()
    parts = (g[0], g[1], None, g[2], g[3]) if g[0] is not None else g[5:10]
    pronoun = is_pronoun(match.string, match.start(6))
    return None if pronoun else _format_minute(_compute_minute(*parts))


def _rewrite_military(match: re.Match[str]) -> str | None:
    year = match[1] in {"19", "20"} and _PATTERNS.year.search(match.string[: match.start()])
    odd = not match[1].startswith("0") and int(match[2]) % 5
    is_number = match[0].strip().isdigit() and (year or odd)
    return None if is_number else f"{match[1]}:{match[2]}"


def _rewrite_bare(match: re.Match[str]) -> str | None:
    hour = int(match[1])
    return _format_minute((hour if hour >= 6 else hour + 12) * 60) if 0 < hour <= 23 else None


def _compute_minute(
    hour: str, digits: str | None, words: str | None, half: str | None, part: str | None
) -> int:
    """The minute of the day; `half` is am or pm, `part` such as "in the morning"."""
    number = int(hour) if hour.isdigit() else _HOURS[hour]
    minute = int(digits) if digits else _MINUTES[words] if words else 0
    if number > 24 or minute > 59 or (number == 24 and minute):
        raise Refused(
            "impossible", f"{hour}:{digits or '00'} is no time of day; use 00:00 to 23:59."
        )
    if (half or part) and number <= 12:
        night = part is not None and "night" in part and number in (0, 1, 2, 3, 4, 5, 12)
        late = half == "pm" or (part is not None and "morning" not in part and not night)
        number = number % 12 + (12 if late else 0)
    return number % 24 * 60 + minute


_FORMS: tuple[tuple[re.Pattern[str], Callable[[re.Match[str]], str | None]], ...] = (
    (_TO, _rewrite_to), (_RANGE, _rewrite_range), (_PAST, _rewrite_past), (_PLAIN, _rewrite_plain),
    (_MILITARY, _rewrite_military), (_HOUR, lambda m: f"{int(m[1] or m[2]):02d}:{m[3] or '00'}"),
    (_PATTERNS.bare, _rewrite_bare),
)  # fmt: skip
"""Forms of clock times; what one of them takes is not looked at by the next."""


def _list_minutes(name: str) -> set[int]:
    result: set[int] = set()
    for span in VOCABULARY["times_of_day"][name]["ranges"]:
        first, last = _parse_minute(span[:5]), _parse_minute(span[6:])
        result |= {m % _DAY for m in range(first, (last if last >= first else last + _DAY) + 1, 5)}
    return result


def _parse_minute(text: str) -> int:
    return int(text[:2]) * 60 + int(text[3:5])


def _format_minute(minute: int) -> str:
    return f"{minute // 60 % 24:02d}:{minute % 60:02d}"
