"""Edits of one value: where an agent stops, how long, how fast, when, how many others."""

from __future__ import annotations

import re

from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.reader.words import WORDS
from scenewright.backends.builtin.references import People
from scenewright.scene.edits import AgentView, ComeLater, Edit, MoveStop, SetPace, WaitLonger

_NUMBERS: dict[str, float] = WORDS["dials"]["numbers"]
_AMOUNT = (
    r"(?P<amount>\d+(?:\.\d+)?|"
    + "|".join(sorted(map(re.escape, _NUMBERS), key=len, reverse=True))
    + r")"
)
_METRES = r"(?:m|metres?|meters?)\b"
_SECONDS = r"(?:s|secs?|seconds?)\b"
_ONWARD = r"(?:later|further|farther|ahead|closer|nearer|forward|beyond|past)"
_BACK = r"(?:earlier|sooner|before|back|short|behind|shorter)"
_STOPS = r"\b(?:stops?|stopping|stopped|halts?|stands?|standing|waits?|waiting|pulls? up|brakes?)\b"

_DEFAULT_STANDSTILL = 2.0
"""Default time that an agent that slowed down stands [s]."""

_FASTEST_SHARE, _SLOWEST_SHARE = 2.0, 0.3


def build_motion_edit(text: str, people: People, agent: AgentView | None) -> Edit | None:
    """The edit of one agent's motion that the words amount to; None if no rule matches.

    Args:
        text: the words, in lower case.
        agent: the agent that they name; None if none.
    """
    for pattern, make in _EDIT_RULES:
        found = re.search(pattern, text)
        if found is not None:
            return make(found, text, people, agent)
    return None


def number(word: str) -> float:
    """The value of a number in figures or in words."""
    return _NUMBERS[word] if word in _NUMBERS else float(word)


def _parse_amount(found: re.Match[str], default: float, most: float, unit: str) -> float:
    groups = found.groupdict()
    word = groups.get("amount") or groups.get("by")
    amount = default if word is None else number(word)
    if amount > most:
        raise Refused("impossible", f"{amount:g} {unit} is too much at once; at most {most:g}.")
    return amount


def _edit_stop_point(
    found: re.Match[str], text: str, people: People, agent: AgentView | None
) -> Edit:
    metres = _parse_amount(found, 1.0, 15.0, "m")
    back = re.search(rf"\b{_BACK}\b", text) is not None
    chosen = agent or _find_stopping(people)
    return MoveStop(agent=chosen.id, metres=-metres if back else metres)


def _edit_wait(found: re.Match[str], text: str, people: People, agent: AgentView | None) -> Edit:
    seconds = _parse_amount(found, 1.0, 20.0, "s")
    less = re.search(r"\b(?:less|shorter)\b", text) is not None
    chosen = agent or _find_stopping(people)
    return WaitLonger(agent=chosen.id, seconds=-seconds if less else seconds)


def _edit_time(found: re.Match[str], text: str, people: People, agent: AgentView | None) -> Edit:
    seconds = _parse_amount(found, 1.0, 20.0, "s")
    sooner = re.search(r"\b(?:earlier|sooner|before)\b", text) is not None
    chosen = agent or people.pick(people.list_foreground(), "agent")
    return ComeLater(agent=chosen.id, seconds=-seconds if sooner else seconds)


def _edit_pace(found: re.Match[str], text: str, people: People, agent: AgentView | None) -> Edit:
    chosen = agent or _find_driving(people)
    slower = found.group("slower") is not None
    percent = re.search(r"(\d+(?:\.\d+)?) ?(?:%|percent|per cent)", text)
    if percent is not None:
        share = float(percent[1]) / 100.0
        factor = 1.0 - share if slower else 1.0 + share
    elif re.search(r"\b(?:a (?:little |tiny )?bit|slightly|a little|a touch|somewhat)\b", text):
        factor = 0.9 if slower else 1.1
    elif re.search(
        r"\b(?:a lot|(?:much|far|way) (?:\w+er|more|less|too)\b|much|considerably)\b", text
    ):
        factor = 0.6 if slower else 1.5
    elif re.search(r"\b(?:half|twice|double)\b", text):
        factor = 0.5 if slower or "half" in text else 2.0
    else:
        factor = 0.8 if slower else 1.25
    return SetPace(agent=chosen.id, factor=_check_speed_factor(factor))


def _edit_speed(found: re.Match[str], text: str, people: People, agent: AgentView | None) -> Edit:
    del text
    chosen = agent or _find_driving(people)
    unit = found.group("unit")
    scale = 1.0 if unit.startswith("m/") or unit.startswith("met") else 1 / 3.6
    scale = 0.44704 if unit.startswith(("mph", "mile")) else scale
    wanted = float(found.group("speed")) * scale
    return SetPace(agent=chosen.id, factor=_check_speed_factor(wanted / max(chosen.speed, 0.1)))


def _check_speed_factor(factor: float) -> float:
    if not _SLOWEST_SHARE <= factor <= _FASTEST_SHARE:
        raise Refused(
            "impossible",
            f"That is {factor:.2g} times the current speed; ask for {_SLOWEST_SHARE:g} to "
            f"{_FASTEST_SHARE:g} times.",
        )
    return round(factor, 3)


def _edit_stop(found: re.Match[str], text: str, people: People, agent: AgentView | None) -> Edit:
    """An agent that slows down shall stand."""
    del text
    chosen = agent or _find_stopping(people)
    seconds = _parse_amount(found, _DEFAULT_STANDSTILL, 20.0, "s")
    if chosen.stops:
        raise Refused(
            "no_change",
            f"{chosen.id} stands already; say how much longer, or how far from there.",
        )
    if chosen.slows_to is None:
        raise Refused(
            "impossible",
            f"{chosen.id} gives way to no agent here; say which one it shall yield to.",
        )
    return WaitLonger(agent=chosen.id, seconds=seconds)


def _find_stopping(people: People) -> AgentView:
    here = people.list_foreground()
    stopping = [each for each in here if each.stops] or [e for e in here if e.slows_to is not None]
    if not stopping:
        raise Refused(
            "impossible", "None of the agents named stops in this scene; say which one shall."
        )
    return people.pick(stopping, "agent")


def _find_driving(people: People) -> AgentView:
    here = people.list_foreground()
    vehicles = [each for each in here if each.type == "vehicle"]
    if not here:
        raise Refused("impossible", "There is no foreground agent; say which agent you mean.")
    return people.pick(vehicles or here, "vehicle" if vehicles else "pedestrian")


_EDIT_RULES = (
    (
        r"\b(?:stop|halt|stand(?: still)?|standstill)"
        r"(?: (?:completely|fully|there|properly|altogether|instead|first|dead))*"
        rf"(?: for {_AMOUNT} {_SECONDS})?[.!]?$",
        _edit_stop,
    ),
    (rf"{_STOPS}.*?\b{_AMOUNT} {_METRES}.*?\b(?:{_ONWARD}|{_BACK})\b", _edit_stop_point),
    (rf"\b{_AMOUNT} {_METRES} (?:{_ONWARD}|{_BACK})\b", _edit_stop_point),
    (
        r"\b(?:waits?|waiting|stands?|standing|stays?|pauses?|holds?)\b.*?"
        rf"(?:\b{_AMOUNT} {_SECONDS} (?:longer|more|less|shorter)|\b(?:longer|less|shorter)"
        rf"(?: by {_AMOUNT.replace('amount', 'by')} {_SECONDS})?)",
        _edit_wait,
    ),
    (
        rf"\b{_AMOUNT} {_SECONDS} (?:later|earlier|sooner|before)\b"
        rf"|\b(?:delay|postpone)\b.*?\bby {_AMOUNT.replace('amount', 'by')} {_SECONDS}",
        _edit_time,
    ),
    (rf"{_STOPS} (?:a (?:little |bit )?)?(?:{_ONWARD}|{_BACK})\b(?! than)", _edit_stop_point),
    (
        r"\b(?:driv\w*|go(?:es|ing)?|travel\w*|mov\w*|walk\w*|run(?:s|ning)?|speed\w*|slow\w*)\b"
        r".*?\b(?:at|to|with) (?P<speed>\d+(?:\.\d+)?) ?"
        r"(?P<unit>km/?h|kmh|kph|kilomet\w+ per hour|mph|miles per hour|m/s|met\w+ per second)",
        _edit_speed,
    ),
    (
        r"\b(?:(?P<slower>slow(?:er|s|ed)?\b(?:.*?\bdown\b)?|less fast|half the speed|"
        r"half as fast)|(?P<faster>fast(?:er)?\b|speeds?\b.*?\bup\b|quicker\b|hurr(?:y|ies)"
        r"\b|twice the speed))",
        _edit_pace,
    ),
)
