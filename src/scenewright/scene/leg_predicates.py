"""Legs of an intersection by what they have, such as `has left-turn lane and crosswalk`."""

from __future__ import annotations

import re
from collections.abc import Callable

from scenewright.scene.map import IntersectionMap

LEG_FIELDS = ("entry", "exit", "crosswalk", "leg")
"""Fields of a plan that name a leg."""
_LANES = re.compile(r"(\d+) (entry|exit) lanes?")
_Facts = Callable[[IntersectionMap, str], bool]


def _has_turn(turn: str) -> _Facts:
    return lambda place, leg: any(m.entry == leg and m.turn == turn for m in place.movements)


def _has_turn_lane(turn: str) -> _Facts:
    """Whether an approach lane serves this turn alone."""

    def find(place: IntersectionMap, leg: str) -> bool:
        turns: dict[str, set[str]] = {}
        for movement in place.movements:
            if movement.entry == leg:
                turns.setdefault(movement.lanelets[0], set()).add(movement.turn)
        return {turn} in turns.values()

    return find


_PREDICATES: dict[str, _Facts] = {
    "left-turn lane": _has_turn_lane("left"),
    "right-turn lane": _has_turn_lane("right"),
    "left turn": _has_turn("left"),
    "right turn": _has_turn("right"),
    "way straight on": _has_turn("straight"),
    "U-turn": _has_turn("uturn"),
    "entry": lambda place, leg: any(m.entry == leg for m in place.movements),
    "exit": lambda place, leg: any(m.exit == leg for m in place.movements),
    "crosswalk": lambda place, leg: any(c.leg == leg for c in place.crosswalks),
    "traffic light": lambda place, leg: any(
        m.entry == leg and m.signal_group is not None for m in place.movements
    ),
    "parking": lambda place, leg: any(
        lane.leg == leg and lane.kind == "parking" for lane in place.lanelets
    ),
}


def is_predicate(value: object) -> bool:
    """Whether a value says what a leg has."""
    return isinstance(value, str) and re.match(r"\s*has\s", value) is not None


def check_predicate(predicate: str) -> None:
    """ValueError, with the words there are, for a predicate with another one."""
    _list_tests(predicate)


def find_legs(predicate: str, place: IntersectionMap) -> tuple[str, ...]:
    """The names of the legs that have all of it, in the order of the map.

    Raises:
        ValueError: an unknown word; says which there are.
    """
    tests = _list_tests(predicate)
    return tuple(
        leg.name
        for leg in place.legs
        if all(test(place, leg.name) == wanted for wanted, test in tests)
    )


def _list_tests(predicate: str) -> list[tuple[bool, _Facts]]:
    """What to test, and what shall come of it, for each part."""
    parts = re.split(r"\s+and\s+|\s*,\s*", predicate.strip().removeprefix("has").strip())
    return [(not p.startswith("no "), _find_test(re.sub(r"^(?:no|an?) ", "", p))) for p in parts]


def _find_test(words: str) -> _Facts:
    if counted := _LANES.fullmatch(words):
        kind = "approach" if counted[2] == "entry" else "exit"
        return lambda place, leg: (
            sum(lane.leg == leg and lane.kind == kind for lane in place.lanelets) == int(counted[1])
        )
    if words not in _PREDICATES:
        known = ", ".join(_PREDICATES)
        raise ValueError(f"a leg has {known}, 2 entry lanes or 1 exit lane, not {words!r}")
    return _PREDICATES[words]
