"""Signal programmes of imported maps: as the file has them, assumed, or none."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

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
_CLEARANCE = 8.0
"""How long before the end of its phase a crosswalk's light is to begin with nobody [s]."""

_Ways = set[tuple[Compass, Compass]]


def programme(
    survey: Survey,
    *,
    legs: Sequence[Compass],
    straight: _Ways,
    movements: Sequence[VehicleMovement],
    lights: Mapping[str, Sequence[str]],
    crosswalks: Sequence[Crosswalk],
    mode: str,
    note: Callable[[str], None],
) -> SignalProgram | None:
    """One group of lights for every leg's traffic and one for every crosswalk.

    Args:
        straight: entry and exit of movements that do not turn.
        lights: by entry leg, the survey's lights of its straightest ways, which rule it here.
        mode: `keep`, `assume` or `none`.
    """
    entries = [leg for leg in legs if any(m.entry == leg for m in movements)]
    steps = _surveyed(survey, entries, lights) if mode != "none" else []
    if steps:
        note("signals are the file's; each leg has one light, that of its straightest way")
    elif mode == "assume" or (mode == "keep" and survey.signalised):
        steps = _assumed(entries, straight)
        note(f"the signal programme is assumed: {_GREEN:g} s green for each pair of opposite legs")
    elif mode == "keep" and survey.signalised is None:
        note("the file says nothing of signals: none (--signals assume gives it a programme)")
    if not steps:
        return None
    free = {each.id: _free(each.leg, steps, straight) for each in crosswalks}
    crosswalks = [
        each
        for each in crosswalks
        if any(f and step[2] for f, step in zip(free[each.id], steps, strict=True))
    ]
    phases = tuple(_phase(*step, crosswalks, free, n) for n, step in enumerate(steps))
    groups = [
        SignalGroup(id=f"{leg}", movements=tuple(m.id for m in movements if m.entry == leg))
        for leg in entries
    ]
    groups += [SignalGroup(id=f"walk_{c.leg}", crosswalks=(c.id,)) for c in crosswalks]
    return SignalProgram(groups=tuple(groups), phases=phases)


def _surveyed(
    survey: Survey, entries: Sequence[Compass], lights: Mapping[str, Sequence[str]]
) -> list[tuple[float, dict[Compass, Colour], bool]]:
    """(duration, colour by leg, whether walking may begin) of the file's programme."""
    if not survey.phases or any(leg not in lights for leg in entries):
        return []
    steps = []
    for duration, colours in survey.phases:
        shown = {leg: _together([colours[light] for light in lights[leg]]) for leg in entries}
        steps.append((duration, shown))
    if any(all(shown[leg] != "green" for _, shown in steps) for leg in entries):
        return []
    return list(_with_clearance(steps))


def _together(colours: Sequence[Colour]) -> Colour:
    return "green" if "green" in colours else "yellow" if "yellow" in colours else "red"


def _assumed(
    entries: Sequence[Compass], straight: _Ways
) -> list[tuple[float, dict[Compass, Colour], bool]]:
    """A phase for each pair of legs that face one another, and for each leg that faces none."""
    left = list(entries)
    pairs: list[tuple[Compass, ...]] = []
    while left:
        leg = left.pop(0)
        other = next((o for o in left if (leg, o) in straight or (o, leg) in straight), None)
        if other is not None:
            left.remove(other)
        pairs.append((leg,) if other is None else (leg, other))
    steps: list[tuple[float, dict[Compass, Colour]]] = []
    for pair in pairs:
        for duration, colour in ((_GREEN, "green"), (_YELLOW, "yellow"), (_ALL_RED, "red")):
            shown: dict[Compass, Colour] = dict.fromkeys(entries, "red")
            for leg in pair:
                shown[leg] = colour  # type: ignore[assignment]
            steps.append((duration, shown))
    return list(_with_clearance(steps))


def _with_clearance(
    steps: Sequence[tuple[float, dict[Compass, Colour]]],
) -> Iterator[tuple[float, dict[Compass, Colour], bool]]:
    """Green steps in two: in the second, nobody begins to cross any more."""
    for duration, shown in steps:
        green = "green" in shown.values()
        if green and duration > _CLEARANCE + 4.0:
            yield duration - _CLEARANCE, shown, True
            yield _CLEARANCE, shown, False
        else:
            yield duration, shown, False


def _free(
    leg: Compass, steps: Sequence[tuple[float, Mapping[Compass, Colour], bool]], straight: _Ways
) -> list[bool]:
    """In which steps a leg may be crossed: nobody drives straight over it; turns give way.

    Where that is never, whenever the leg itself has red: who drives straight into it gives way.
    """
    going = [{other for other, c in shown.items() if c == "green"} for _, shown, _ in steps]
    beside = [bool(each) and leg not in each for each in going]
    strict = [
        ok and not any((other, leg) in straight for other in each)
        for ok, each in zip(beside, going, strict=True)
    ]
    begun = [ok and step[2] for ok, step in zip(strict, steps, strict=True)]
    return strict if any(begun) else beside


def _phase(
    duration: float,
    shown: Mapping[Compass, Colour],
    may_begin: bool,
    crosswalks: Sequence[Crosswalk],
    free: Mapping[str, Sequence[bool]],
    number: int,
) -> SignalPhase:
    colours: dict[str, Colour] = {str(leg): colour for leg, colour in shown.items()}
    for each in crosswalks:
        begin: Colour = "green" if may_begin else "yellow"
        colours[f"walk_{each.leg}"] = begin if free[each.id][number] else "red"
    return SignalPhase(duration=duration, colours=colours)
