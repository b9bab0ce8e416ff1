"""Recorded lights: SPaT messages as TAF-BW writes them, or a table of times and colours."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.geographic import LatLon
from scenewright.scene.base import Colour, FloatArray

_STATES: Mapping[str, Colour | None] = {
    "permissive_movement_allowed": "green", "protected_movement_allowed": "green",
    "permissive_clearance": "yellow", "protected_clearance": "yellow",
    "pre_movement": "red", "stop_and_remain": "red", "stop_then_proceed": "red",
    "green": "green", "yellow": "yellow", "amber": "yellow", "red": "red",
    "dark": None, "unavailable": None, "caution_conflicting_traffic": None,
}  # fmt: skip
_COLUMNS = ("signal_group_id", "timestamp_ms", "movement_state"), ("light", "t", "colour")
_MOST_ROWS = 2_000_000


_Line = tuple[LatLon, ...]


@dataclass(frozen=True)
class LightWay:
    """A way through the junction: lines of its lanes in degrees, from the junction outwards.

    Attributes:
        onto: of the lane that it leads to; None where the file does not say.
    """

    source: _Line
    onto: _Line | None


@dataclass(frozen=True, eq=False)
class RecordedLights:
    """What every light showed.

    Attributes:
        changes: by light, (time [s], colour) whenever it changed; lights that were dark are left
            out. The last time is `end` [s].
        ways: by light, the ways that it controls; empty where nothing says so.
    """

    changes: Mapping[str, tuple[tuple[float, Colour], ...]]
    end: float
    ways: Mapping[str, tuple[LightWay, ...]] = field(default_factory=dict)


def read_recorded_lights(file: str | Path) -> RecordedLights:
    """A recording of lights, with the lanes of a .kml file in its folder if there is one.

    Raises:
        InputError: unreadable, other columns, or a state or time that is none; one line says why.
    """
    path = Path(file)
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            rows = csv.DictReader(stream)
            names = next((c for c in _COLUMNS if set(c) <= set(rows.fieldnames or ())), None)
            if names is None:
                raise InputError(
                    f"{path} has no lights: its columns must be {', '.join(_COLUMNS[1])} "
                    f"or {', '.join(_COLUMNS[0])}"
                )
            shown = _read_rows(path, rows, names)
    except (OSError, UnicodeDecodeError, csv.Error) as fault:
        raise InputError(f"cannot read {path}: {fault}") from None
    changes = {
        light: tuple(each for k, each in enumerate(own) if k == 0 or each[1] != own[k - 1][1])
        for light, own in shown.items()
    }
    if not changes:
        raise InputError(f"{path} has no light that ever shows a colour")
    end = max(own[-1][0] for own in shown.values())
    maps = sorted(path.parent.glob("*.kml"))
    return RecordedLights(changes, end, _read_lanes(maps[0]) if len(maps) == 1 else {})


def _read_rows(
    path: Path, rows: csv.DictReader[str], names: tuple[str, ...]
) -> dict[str, list[tuple[float, Colour]]]:
    """By light, (time [s], colour) of every row, in order of time."""
    scale = 1e-3 if names[1] == "timestamp_ms" else 1.0
    found: dict[str, list[tuple[float, Colour]]] = {}
    for number, row in enumerate(rows, start=2):
        if number > _MOST_ROWS:
            raise InputError(f"{path} has more than {_MOST_ROWS:,} rows")
        light, time, state = (str(row[name] or "").strip() for name in names)
        word = state.lower().replace("-", "_")
        if word not in _STATES:
            raise InputError(f"{path}, line {number}: {state[:30]!r} is no state of a light")
        colour = _STATES[word]
        if colour is None:
            continue
        try:
            seconds = float(time) * scale
        except ValueError:
            seconds = math.nan
        if not math.isfinite(seconds):
            raise InputError(f"{path}, line {number}: {time[:30]!r} is no time")
        found.setdefault(light, []).append((seconds, colour))
    return {light: sorted(own) for light, own in sorted(found.items())}


def _read_lanes(file: Path) -> dict[str, tuple[LightWay, ...]]:
    """Ways of a MAP message in a .kml file, by the lights that control them."""
    try:
        root = ElementTree.parse(file).getroot()
    except (OSError, ElementTree.ParseError) as fault:
        raise InputError(f"cannot read {file}: {fault}") from None
    lines: dict[str, _Line] = {}
    controlled: list[tuple[str, str, str]] = []
    for place in root.findall(".//{*}Placemark"):
        data = {
            each.get("name"): (each.findtext("{*}value") or "").split(",")
            for each in place.findall(".//{*}Data")
        }
        text = place.findtext(".//{*}coordinates") or ""
        name = "".join(data.get("Source", [""])).strip()
        points = []
        for point in text.split():
            try:
                longitude, latitude = (float(part) for part in point.split(",")[:2])
            except ValueError:
                raise InputError(f"{file}: {point[:40]!r} is no place") from None
            points.append((latitude, longitude))
        lines[name] = tuple(points)
        pairs = zip(data.get("SignalGroup", []), data.get("Sink", []), strict=False)
        controlled += [(light.strip(), name, sink.strip()) for light, sink in pairs]
    lanes: dict[str, list[LightWay]] = {}
    for light, name, sink in controlled:
        onto = lines.get(sink)
        if light and len(lines[name]) > 1:
            lanes.setdefault(light, []).append(LightWay(lines[name], onto or None))
    return {light: tuple(ways) for light, ways in lanes.items()}


def sample_colours(own: tuple[tuple[float, Colour], ...], times: FloatArray) -> list[Colour]:
    """What a light shows at times [s]."""
    starts = np.array([time for time, _ in own])
    return [own[max(int(i), 0)][1] for i in np.searchsorted(starts, times, side="right") - 1]
