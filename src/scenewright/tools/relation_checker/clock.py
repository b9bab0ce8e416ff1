"""Clock times of scenes and spans of the day."""

from __future__ import annotations

import re

_CLOCK = re.compile(r"([0-9]{2}):([0-9]{2})(:[0-9]{2})?")
_DAY = 24 * 60


def parse_clock(text: str) -> int | None:
    """HH:MM or HH:MM:SS as minutes since midnight; None where the text is no clock time."""
    found = _CLOCK.fullmatch(text)
    return 60 * int(found[1]) + int(found[2]) if found else None


def is_within(time: str, span: str) -> bool:
    """Whether HH:MM lies in HH:MM or HH:MM-HH:MM, which may pass midnight.

    >>> is_within("23:40", "23:30-00:30"), is_within("08:00", "08:00"), is_within("09:00", "08:00")
    (True, True, False)
    """
    first, _, last = span.partition("-")
    own, start, end = (parse_clock(each) for each in (time, first, last or first))
    if own is None or start is None or end is None:
        return False
    return (own - start) % _DAY <= (end - start) % _DAY
