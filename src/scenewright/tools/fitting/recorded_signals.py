"""A map's signal programme from recorded lights: one whole recorded cycle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.geographic import LatLon, project_mercator
from scenewright.geometry.polyline import resample_by_spacing
from scenewright.scene.base import Colour, Compass
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import SignalGroup, SignalPhase, SignalProgram
from scenewright.tools.track_io.signal_files import RecordedLights, sample_colours

_CYCLES = (20.0, 240.0)
"""Shortest and longest cycle of a junction [s]."""
_STEP = 0.1
_NEAR = 2.5
"""From a recorded lane to the end of the approach that it is [m]."""
_ALONG = 0.8
"""Cosine of the angle between both."""
_CLEARANCE = 8.0
"""How long before traffic comes people may no longer begin to cross [s]."""


def fit_recorded_program(
    intersection_map: IntersectionMap,
    lights: RecordedLights,
    *,
    origin: LatLon | None,
    groups: Mapping[str, str] | None,
) -> tuple[IntersectionMap, list[str]]:
    """The map with the recorded programme, and what was taken.

    Args:
        origin: of the map, where the recording's lanes say which light is whose.
        groups: by light, the leg that it controls, or `walk_` and the leg for its crosswalk; None
            takes lights named so, else the lanes beside the recording.

    Raises:
        InputError: lights of no leg, a leg without one, or no whole cycle.
    """
    own = _assign_lights(intersection_map, lights, origin, groups)
    entries = list(dict.fromkeys(m.entry for m in intersection_map.movements))
    if missing := [leg for leg in entries if leg not in own]:
        raise InputError(
            f"no recorded light is that of the {', '.join(missing)} leg; name them with "
            f"--light-legs, lights are {', '.join(lights.changes)[:200]}"
        )
    # Of a leg's lights that with the most green, which is that of its straightest way.
    seconds = np.arange(0.0, lights.end, 1.0)
    green = {
        light: sample_colours(lights.changes[light], seconds).count("green")
        for some in own.values()
        for light in some
    }
    chosen = {name: max(sorted(some), key=green.__getitem__) for name, some in own.items()}
    start, end = _find_cycle(chosen, entries, lights)
    times = np.arange(start, end - _STEP / 2, _STEP)
    shown = {name: sample_colours(lights.changes[light], times) for name, light in chosen.items()}
    shown |= {
        f"walk_{walk.leg}": _derive_walk(walk.leg, shown, intersection_map)
        for walk in intersection_map.crosswalks
        if f"walk_{walk.leg}" not in shown
    }
    program = _build_program(intersection_map, entries, shown)
    names = ", ".join(f"{light} for {name}" for name, light in sorted(chosen.items()))
    derived = [
        f"walk_{w.leg}" for w in intersection_map.crosswalks if f"walk_{w.leg}" not in chosen
    ]
    notes = [
        f"lights: a recorded cycle of {program.cycle:.1f} s, from {start:.1f} s on; {names}",
        *([f"lights: derived from those of traffic: {', '.join(derived)}"] if derived else []),
    ]
    lit = {m: g.id for g in program.groups for m in g.movements}
    movements = tuple(
        m.model_copy(update={"signal_group": lit.get(m.id)}) for m in intersection_map.movements
    )
    update = {"signals": program, "movements": movements}
    return intersection_map.model_copy(update=update), notes


def _assign_lights(
    intersection_map: IntersectionMap,
    lights: RecordedLights,
    origin: LatLon | None,
    groups: Mapping[str, str] | None,
) -> dict[str, list[str]]:
    """By signal group of ours, the recorded lights that may be its."""
    ours: set[str] = {leg.name for leg in intersection_map.legs}
    ours |= {f"walk_{walk.leg}" for walk in intersection_map.crosswalks}
    if groups is not None:
        if strange := sorted(set(groups.values()) - ours | set(groups) - set(lights.changes)):
            raise InputError(
                f"--light-legs names {', '.join(strange)}: legs and crosswalks are "
                f"{', '.join(sorted(ours))}, lights {', '.join(lights.changes)[:200]}"
            )
        pairs = [(name, light) for light, name in groups.items()]
    elif named := ours & set(lights.changes):
        pairs = [(name, name) for name in named]
    else:
        pairs = _match_lanes(intersection_map, lights, origin)
    found: dict[str, list[str]] = {}
    for name, light in sorted(pairs):
        found.setdefault(name, []).append(light)
    return found


def _match_lanes(
    intersection_map: IntersectionMap, lights: RecordedLights, origin: LatLon | None
) -> list[tuple[str, str]]:
    """(leg, light) for lights whose lanes lie on approaches of the map.

    Of a leg's lights those of its way straight on count alone, where it has one.
    """
    if origin is None:
        return []
    straight = {(m.entry, m.exit) for m in intersection_map.movements if m.turn == "straight"}
    lanes: dict[str, list[tuple[bool, str]]] = {}
    for light in lights.changes:
        for way in lights.ways.get(light, ()):
            entry = _find_leg(intersection_map, way.source, origin, "approach")
            onto = way.onto
            exit_ = None if onto is None else _find_leg(intersection_map, onto, origin, "exit")
            if entry is not None:
                lanes.setdefault(entry, []).append(((entry, exit_) in straight, light))
    return [
        (leg, light)
        for leg, own in lanes.items()
        for goes_on, light in own
        if goes_on or not any(first for first, _ in own)
    ]


def _find_leg(
    intersection_map: IntersectionMap, places: Sequence[LatLon], origin: LatLon, kind: str
) -> Compass | None:
    """The leg on one of whose lanes a recorded line lies."""
    line = np.array([project_mercator(origin, place) for place in places])
    if len(line) < 2:
        return None
    near = resample_by_spacing(line, 1.0)
    for lane in intersection_map.lanelets:
        if lane.kind != kind:
            continue
        # Both from the junction outwards: the line passes the beginning of the lane.
        outwards = np.array(lane.centreline)[:: -1 if kind == "approach" else 1]
        away = np.hypot(*(near - outwards[0]).T)
        k = int(np.clip(away.argmin(), 1, len(near) - 1))
        step, way = near[k] - near[k - 1], outwards[-1] - outwards[0]
        along = float(step @ way) / float(np.hypot(*step) * np.hypot(*way))
        if away.min() < _NEAR and along > _ALONG:
            return lane.leg
    return None


def _find_cycle(
    chosen: Mapping[str, str], entries: Sequence[str], lights: RecordedLights
) -> tuple[float, float]:
    """Begin and end [s] of the recorded cycle nearest to the median length.

    A cycle goes from one begin of a leg's green to the next; every leg has green in it.
    """
    cycles = []
    for leg in entries:
        begins = [t for t, colour in lights.changes[chosen[leg]][1:] if colour == "green"]
        cycles += [(a, b) for a, b in pairwise(begins) if _CYCLES[0] <= b - a <= _CYCLES[1]]
    whole = [
        (a, b)
        for a, b in cycles
        if all(
            "green" in sample_colours(lights.changes[chosen[leg]], np.arange(a, b, 1.0))
            for leg in entries
        )
    ]
    if not whole:
        raise InputError(
            f"the recording of {lights.end:.0f} s has no whole cycle: every leg must turn green "
            f"between two begins of one leg's green, {_CYCLES[0]:g} to {_CYCLES[1]:g} s apart"
        )
    middle = float(np.median([b - a for a, b in whole]))
    return min(whole, key=lambda each: (abs(each[1] - each[0] - middle), each))


def _derive_walk(
    leg: Compass, shown: Mapping[str, Sequence[Colour]], place: IntersectionMap
) -> list[Colour]:
    """A crosswalk's lights: green while its own leg is red and no vehicle drives straight over it.

    Where that is never long enough, while its own leg is red: traffic onto it gives way.
    """
    over = [m.entry for m in place.movements if m.exit == leg and m.turn == "straight"]
    count = max(len(own) for own in shown.values())
    colours: list[Colour] = []
    for names in ([leg, *over], [leg]):
        blocking = [shown[name] for name in names if name in shown]
        free = [all(own[i] == "red" for own in blocking) for i in range(count)]
        # Green while there is time left to cross, then yellow.
        late = range(round(_CLEARANCE / _STEP))
        lasts = [all(free[(i + k) % count] for k in late) for i in range(count)]
        colours = [
            "red" if not now else "green" if long else "yellow"
            for now, long in zip(free, lasts, strict=True)
        ]
        if "green" in colours:
            break
    return colours


def _build_program(
    place: IntersectionMap, entries: Sequence[str], shown: Mapping[str, Sequence[Colour]]
) -> SignalProgram:
    """Phases between any two changes; crosswalks that never have green have no light."""
    walks = [w for w in place.crosswalks if "green" in shown[f"walk_{w.leg}"]]
    groups = [
        SignalGroup(id=leg, movements=tuple(m.id for m in place.movements if m.entry == leg))
        for leg in entries
    ]
    groups += [SignalGroup(id=f"walk_{w.leg}", crosswalks=(w.id,)) for w in walks]
    columns = list(zip(*(shown[group.id] for group in groups), strict=True))
    edges = [0, *(i for i in range(1, len(columns)) if columns[i] != columns[i - 1]), len(columns)]
    phases = tuple(
        SignalPhase(
            duration=round((b - a) * _STEP, 3),
            colours=dict(zip((group.id for group in groups), columns[a], strict=True)),
        )
        for a, b in pairwise(edges)
    )
    return SignalProgram(groups=tuple(groups), phases=phases)
