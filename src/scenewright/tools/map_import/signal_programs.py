"""Signal programmes of imported maps: as the file has them, assumed, or none."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from scenewright.scene.base import Colour, Compass
from scenewright.scene.map import (
    Crosswalk,
    SignalGroup,
    SignalPhase,
    SignalProgram,
    VehicleMovement,
)
from scenewright.tools.map_import.survey import Survey

_GREEN, _YELLOW, _ALL_RED = 22.0, 3.0, 2.0
_ASSUMED: tuple[tuple[float, Colour], ...] = (
    (_GREEN, "green"), (_YELLOW, "yellow"), (_ALL_RED, "red"),
)  # fmt: skip
_CLEARANCE = 8.0
"""How long before the end of its phase pedestrians may no longer begin to cross [s]."""

LegPairs = set[tuple[Compass, Compass]]


class _Step(NamedTuple):
    """A part of the programme: how long [s], the light of each leg, and whether walks may begin."""

    duration: float
    colours: Mapping[Compass, Colour]
    may_begin: bool


def build_signal_program(
    survey: Survey,
    *,
    straight: LegPairs,
    movements: Sequence[VehicleMovement],
    lights: Mapping[Compass, Sequence[str]],
    crosswalks: Sequence[Crosswalk],
    mode: str,
    add_note: Callable[[str], None],
) -> SignalProgram | None:
    """One group of lights for every leg's traffic and one for every crosswalk.

    Args:
        straight: entry and exit of movements that do not turn.
        lights: by entry leg, the survey's lights of its straightest connections.
        mode: `keep`, `assume` or `none`.
    """
    entries = list(dict.fromkeys(m.entry for m in movements))
    steps = _choose_steps(survey, entries, straight, lights, mode, add_note)
    if not steps:
        return None
    free = {each.id: _find_free_steps(each.leg, steps, straight) for each in crosswalks}
    crosswalks = [
        each
        for each in crosswalks
        if any(f and step.may_begin for f, step in zip(free[each.id], steps, strict=True))
    ]
    groups = [
        SignalGroup(id=f"{leg}", movements=tuple(m.id for m in movements if m.entry == leg))
        for leg in entries
    ]
    groups += [SignalGroup(id=f"walk_{c.leg}", crosswalks=(c.id,)) for c in crosswalks]
    phases = tuple(_build_phase(step, n, crosswalks, free) for n, step in enumerate(steps))
    return SignalProgram(groups=tuple(groups), phases=phases)


def _choose_steps(
    survey: Survey,
    entries: Sequence[Compass],
    straight: LegPairs,
    lights: Mapping[Compass, Sequence[str]],
    mode: str,
    add_note: Callable[[str], None],
) -> list[_Step]:
    if mode != "none" and (steps := list(_read_steps(survey, entries, lights))):
        add_note("signals are the file's; each leg has one light, that of its straightest way")
        return steps
    if mode == "assume" or (mode == "keep" and survey.is_signalised):
        add_note(
            f"the signal programme is assumed: {_GREEN:g} s green for each pair of opposite legs"
        )
        return list(_split_clearance(_assume_steps(entries, straight)))
    if mode == "keep" and survey.is_signalised is None:
        add_note("the file says nothing of signals: none (--signals assume gives it a programme)")
    return []


def _read_steps(
    survey: Survey, entries: Sequence[Compass], lights: Mapping[Compass, Sequence[str]]
) -> Iterator[_Step]:
    """The file's programme; nothing where a leg has no light or never has green."""
    if any(leg not in lights for leg in entries):
        return
    steps = []
    for duration, colours in survey.phases:
        shown = {leg: {colours[light] for light in lights[leg]} for leg in entries}
        steps.append((duration, {leg: _merge_colours(own) for leg, own in shown.items()}))
    if all(any(shown[leg] == "green" for _, shown in steps) for leg in entries):
        yield from _split_clearance(steps)


def _merge_colours(colours: set[Colour]) -> Colour:
    return "green" if "green" in colours else "yellow" if "yellow" in colours else "red"


def _assume_steps(
    entries: Sequence[Compass], straight: LegPairs
) -> Iterator[tuple[float, Mapping[Compass, Colour]]]:
    """Green, yellow and red for each pair of opposite legs, and for each leg without opposite."""
    left = list(entries)
    while left:
        pair = [left.pop(0)]
        opposite = (o for o in left if (pair[0], o) in straight or (o, pair[0]) in straight)
        if (other := next(opposite, None)) is not None:
            left.remove(other)
            pair.append(other)
        for duration, colour in _ASSUMED:
            red: dict[Compass, Colour] = dict.fromkeys(entries, "red")
            yield duration, red | dict.fromkeys(pair, colour)


def _split_clearance(
    steps: Iterable[tuple[float, Mapping[Compass, Colour]]],
) -> Iterator[_Step]:
    """Green steps in two: in the second, no walk begins any more."""
    for duration, shown in steps:
        if "green" in shown.values() and duration > _CLEARANCE + 4.0:
            yield _Step(duration - _CLEARANCE, shown, True)
            yield _Step(_CLEARANCE, shown, False)
        else:
            yield _Step(duration, shown, False)


def _find_free_steps(leg: Compass, steps: Sequence[_Step], straight: LegPairs) -> list[bool]:
    """In which steps a leg may be crossed: no traffic drives straight over it; turns give way.

    Where that is never, whenever the leg itself has red: traffic straight into it gives way.
    """
    going = [{other for other, c in step.colours.items() if c == "green"} for step in steps]
    red = [bool(each) and leg not in each for each in going]
    strict = [
        ok and not any((other, leg) in straight for other in each)
        for ok, each in zip(red, going, strict=True)
    ]
    begins = any(ok and step.may_begin for ok, step in zip(strict, steps, strict=True))
    return strict if begins else red


def _build_phase(
    step: _Step, number: int, crosswalks: Sequence[Crosswalk], free: Mapping[str, Sequence[bool]]
) -> SignalPhase:
    colours: dict[str, Colour] = {str(leg): colour for leg, colour in step.colours.items()}
    walk: Colour = "green" if step.may_begin else "yellow"
    colours |= {f"walk_{c.leg}": walk if free[c.id][number] else "red" for c in crosswalks}
    return SignalPhase(duration=step.duration, colours=colours)
