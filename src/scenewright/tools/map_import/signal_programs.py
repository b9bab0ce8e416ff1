"""Lights of imported maps: which legs have some; programmes as in the file, assumed, or none."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from scenewright.geometry.polyline import resample_by_spacing
from scenewright.scene.base import Colour, Compass
from scenewright.scene.map_elements import (
    Crosswalk,
    SignalGroup,
    SignalPhase,
    SignalProgram,
    VehicleMovement,
)
from scenewright.tools.map_import.legs import SurveyLeg
from scenewright.tools.map_import.mapped_crosswalks import CrossingChoice
from scenewright.tools.map_import.survey import ReportItem, Survey

_GREEN, _YELLOW, _ALL_RED = 22.0, 3.0, 2.0
_ASSUMED: tuple[tuple[float, Colour], ...] = (
    (_GREEN, "green"), (_YELLOW, "yellow"), (_ALL_RED, "red"),
)  # fmt: skip
_PLAN = f"{_GREEN:g} s green in turn, ways straight on that cross never together"
_CLEARANCE = 8.0
"""How long before the end of its phase pedestrians may no longer begin to cross [s]."""

_LEAST_LIT = 2
"""So many legs with lights make a signalised junction."""

_FARTHEST = 40.0
"""A light farther out along a lane is another junction's [m]."""
_BESIDE = 6.0
"""From a lane to its light [m]."""

LegPairs = set[tuple[Compass, Compass]]


class _Step(NamedTuple):
    """A part of the programme.

    Attributes:
        duration: [s]; colours: of each leg's light; lights: colours of the file's lights, by name.
        may_begin: whether walks may begin.
    """

    duration: float
    colours: Mapping[Compass, Colour]
    lights: Mapping[str, Colour] = {}
    may_begin: bool = False


@dataclass(frozen=True)
class SignalInput:
    """What a programme is built from.

    Attributes:
        straight: entry and exit of movements that do not turn; clashes: legs whose ways straight
            on cross.
        lights: by entry leg, the survey's lights of its straightest connections; walks: by
            crosswalk, the survey's lights of its stages.
        groups: by lit leg, the file's group of lights, empty if unknown.
    """

    straight: LegPairs
    clashes: LegPairs
    lights: Mapping[Compass, Sequence[str]]
    walks: Mapping[str, Sequence[str]]
    groups: Mapping[Compass, str]


def build_signal_program(
    survey: Survey,
    given: SignalInput,
    *,
    movements: Sequence[VehicleMovement],
    crosswalks: Sequence[Crosswalk],
    mode: str,
    add_note: Callable[[str], None],
) -> tuple[SignalProgram | None, ReportItem]:
    """One group of lights for every leg's traffic and one for every crosswalk, and its account.

    Args:
        mode: `keep`, `assume` or `none`.
    """
    entries = list(dict.fromkeys(m.entry for m in movements))
    steps, item = _choose_steps(survey, entries, given, mode)
    add_note(f"signals: {item.detail}")
    if not steps:
        return None, item
    for a, b in sorted(given.clashes):
        if any(step.colours.get(a) == step.colours.get(b) == "green" for step in steps):
            add_note(
                f"signals: {a} and {b} have green together although their ways straight on cross"
            )
    free = {crosswalk.id: _find_free_steps(crosswalk, steps, given) for crosswalk in crosswalks}
    crosswalks = [
        crosswalk
        for crosswalk in crosswalks
        if any(f and step.may_begin for f, step in zip(free[crosswalk.id], steps, strict=True))
    ]
    groups = [
        SignalGroup(id=f"{leg}", movements=tuple(m.id for m in movements if m.entry == leg))
        for leg in entries
    ]
    groups += [SignalGroup(id=f"walk_{c.leg}", crosswalks=(c.id,)) for c in crosswalks]
    phases = []
    for n, step in enumerate(steps):
        colours: dict[str, Colour] = {str(leg): colour for leg, colour in step.colours.items()}
        walk: Colour = "green" if step.may_begin else "yellow"
        colours |= {f"walk_{c.leg}": walk if free[c.id][n] else "red" for c in crosswalks}
        phases.append(SignalPhase(duration=step.duration, colours=colours))
    return SignalProgram(groups=tuple(groups), phases=tuple(phases)), item


def _choose_steps(
    survey: Survey, entries: Sequence[Compass], given: SignalInput, mode: str
) -> tuple[list[_Step], ReportItem]:
    if mode == "none":
        return [], ReportItem("signals", "none", None, "none, as asked")
    if steps := list(_read_steps(survey, entries, given.lights)):
        detail = "the file's programme; each leg has one light, that of its straightest way"
        return steps, ReportItem("signals", "read", 1.0, detail)
    lit = [leg for leg in entries if leg in given.groups]
    is_lit = survey.is_signalised or len(lit) >= _LEAST_LIT or len(lit) * 2 > len(entries)
    if is_lit:
        return _plan_lit(entries, lit, given)
    if mode == "assume":
        steps = list(_split_clearance(_assume_steps(entries, given)))
        return steps, ReportItem("signals", "assumed", 0.0, f"assumed, as asked; {_PLAN}")
    if lit:
        detail = f"none; the file has a light on {lit[0]} only"
        return [], ReportItem("signals", "none", 0.5, detail)
    if survey.is_signalised is None and survey.lights:
        detail = "none; the file's lights stand at no stop line of these legs"
        return [], ReportItem("signals", "none", 0.5, detail)
    if survey.is_signalised is None:
        detail = "the file says nothing of them: none (--signals assume gives it a programme)"
        return [], ReportItem("signals", "none", None, detail)
    return [], ReportItem("signals", "read", 1.0, "the file has none here")


def _plan_lit(
    entries: Sequence[Compass], lit: Sequence[Compass], given: SignalInput
) -> tuple[list[_Step], ReportItem]:
    """An assumed programme for lights that the file has."""
    where = f"the file has lights on {', '.join(lit)}" if lit else "the file has lights here"
    missing = [leg for leg in entries if leg not in lit] if lit else []
    also = f"; {', '.join(missing)} get some as well" if missing else ""
    by = " by its controllers" if _has_groups(entries, given) else ""
    detail = f"{where}{also}, its programme is assumed{by}; {_PLAN}"
    steps = list(_split_clearance(_assume_steps(entries, given)))
    return steps, ReportItem("signals", "partly read", 0.5, detail)


def _read_steps(
    survey: Survey, entries: Sequence[Compass], lights: Mapping[Compass, Sequence[str]]
) -> Iterator[_Step]:
    """The file's programme; nothing where a leg has no light or never has green."""
    if any(leg not in lights for leg in entries):
        return
    steps = []
    for duration, colours in survey.phases:
        shown = {leg: {colours[light] for light in lights[leg]} for leg in entries}
        merged: dict[Compass, Colour] = {
            leg: "green" if "green" in own else "yellow" if "yellow" in own else "red"
            for leg, own in shown.items()
        }
        steps.append(_Step(duration, merged, colours))
    if all(any(step.colours[leg] == "green" for step in steps) for leg in entries):
        yield from _split_clearance(steps)


def _has_groups(entries: Sequence[Compass], given: SignalInput) -> bool:
    """Whether the file says of every leg which lights change with its own, and not all at once."""
    names = {given.groups.get(leg, "") for leg in entries}
    return "" not in names and len(names) > 1


def _assume_steps(entries: Sequence[Compass], given: SignalInput) -> Iterator[_Step]:
    """Green, yellow and red for each stage in turn."""
    for stage in _list_stages(entries, given):
        for duration, colour in _ASSUMED:
            red: dict[Compass, Colour] = dict.fromkeys(entries, "red")
            yield _Step(duration, red | dict.fromkeys(stage, colour))


def _list_stages(entries: Sequence[Compass], given: SignalInput) -> Iterator[list[Compass]]:
    """Legs that have green together: those of one group of the file, else opposite ones."""
    if _has_groups(entries, given):
        names = list(dict.fromkeys(given.groups[leg] for leg in entries))
        found = [[leg for leg in entries if given.groups[leg] == name] for name in names]
    else:
        found = list(_pair_opposite(entries, given.straight))
    for stage in found:
        clash = any((a, b) in given.clashes for a in stage for b in stage)
        yield from ([leg] for leg in stage) if clash else [stage]


def _pair_opposite(entries: Sequence[Compass], straight: LegPairs) -> Iterator[list[Compass]]:
    left = list(entries)
    while left:
        pair = [left.pop(0)]
        opposite = (o for o in left if (pair[0], o) in straight or (o, pair[0]) in straight)
        if (other := next(opposite, None)) is not None:
            left.remove(other)
            pair.append(other)
        yield pair


def _split_clearance(steps: Iterable[_Step]) -> Iterator[_Step]:
    """Green steps in two: in the second, no walk begins any more."""
    for step in steps:
        if "green" in step.colours.values() and step.duration > _CLEARANCE + 4.0:
            yield step._replace(duration=step.duration - _CLEARANCE, may_begin=True)
            yield step._replace(duration=_CLEARANCE)
        else:
            yield step


def _find_free_steps(
    crosswalk: Crosswalk, steps: Sequence[_Step], given: SignalInput
) -> list[bool]:
    """In which steps a leg may be crossed: as the file says, else by the traffic's lights.

    Else no traffic drives straight over it, and turns give way; where that is never, whenever
    the leg itself has red: traffic straight into it gives way.
    """
    leg = crosswalk.leg
    own = given.walks.get(crosswalk.id, ())
    shows_green = [bool(own) and all(step.lights.get(x) == "green" for x in own) for step in steps]
    if any(ok and step.may_begin for ok, step in zip(shows_green, steps, strict=True)):
        return shows_green
    going = [{other for other, c in step.colours.items() if c == "green"} for step in steps]
    red = [bool(each) and leg not in each for each in going]
    strict = [
        ok and not any((other, leg) in given.straight for other in each)
        for ok, each in zip(red, going, strict=True)
    ]
    begins = any(ok and step.may_begin for ok, step in zip(strict, steps, strict=True))
    return strict if begins else red


def find_lit_legs(
    survey: Survey, legs: Sequence[SurveyLeg], crossings: CrossingChoice
) -> dict[int, str]:
    """By leg with lights at its stop line or crosswalk: the file's group of them, or ``."""
    found: dict[int, str] = {}
    # The last stretch of every approach, a point every metre; and the first half of the ways on:
    # before a stop line a slip lane may have left, with which the junction begins.
    near = [
        (k, resample_by_spacing(lane.line, 1.0)[-round(_FARTHEST) :])
        for k, leg in enumerate(legs)
        for lane in leg.approaches
    ]
    leg_of = {lane.id: k for k, leg in enumerate(legs) for lane in leg.approaches}
    for way in survey.connections:
        line = resample_by_spacing(way.line, 1.0)
        near.append((leg_of[way.approach], line[: len(line) // 2 + 1]))
    for light in survey.lights:
        away = [
            (round(float(np.hypot(*(stretch - light.place).T).min()), 3), k) for k, stretch in near
        ]
        nearest, k = min(away, default=(np.inf, -1))
        if nearest < _BESIDE and not found.get(k):
            found[k] = light.group
    for k, mapped in crossings.by_leg.items():
        if legs[k].approaches and any(x.crossing.is_signalised for x in mapped.stages):
            found.setdefault(k, "")
    return dict(sorted(found.items()))
