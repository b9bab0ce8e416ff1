"""SUMO floating car data (FCD): per time step every vehicle's front and every person.

Angles run clockwise from north in degrees. `length` and `width` are attributes of our own, which
SUMO's tools ignore.
"""

from __future__ import annotations

import io
import math
from xml.etree import ElementTree

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.track import VEHICLE_SIZES
from scenewright.tools.formats.exported_scene import ExportedScene
from scenewright.tools.formats.sample_table import SampleTable
from scenewright.tools.formats.sampled_recording import (
    SUBTYPE_OF_WORD,
    SampledRecording,
    describe_rides,
    find_road_user,
)
from scenewright.tools.formats.xml import add, walk_xml, write_bytes

_LENGTHS = {name: size[0] for name, size in VEHICLE_SIZES.items()} | {"bicycle": 1.8}


def write(scene: ExportedScene) -> dict[str, bytes]:
    """One `timestep` per 0.1 s, vehicles before persons as SUMO's schema wants them."""
    agents = sorted(scene.agents, key=lambda each: not each.names.is_vehicle)
    root = ElementTree.Element("fcd-export")
    for k, time in enumerate(scene.times.tolist()):
        step = add(root, "timestep", time=f"{time:.2f}")
        for agent in agents:
            if not agent.first <= k <= agent.last:
                continue
            n, vehicle = k - agent.first, agent.names.is_vehicle
            turn = float(agent.heading[n])
            forward = agent.length / 2 * vehicle
            x, y = (agent.xy[n] + forward * np.array([math.cos(turn), math.sin(turn)])).tolist()
            add(
                step, "vehicle" if vehicle else "person", id=agent.name,
                x=round(x, 4), y=round(y, 4), angle=round(90.0 - math.degrees(turn), 4) % 360.0,
                type=agent.names.sumo, speed=round(float(agent.speed[n]), 3),
                length=agent.length, width=agent.width,
            )  # fmt: skip
    return {f"{scene.name}.fcd.xml": write_bytes(root)}


def read(data: bytes, *, name: str) -> list[SampledRecording]:
    """Vehicles and persons of an FCD file; persons not while they ride in a vehicle.

    Raises:
        InputError: not well-formed, with a document type, or a row without usable numbers.
    """
    table = SampleTable(name, one_class=False)
    rides: dict[str, str] = {}
    now = 0.0

    def start(tag: str, row: dict[str, str]) -> None:
        nonlocal now
        try:
            if tag == "timestep":
                now = float(row["time"])
            elif tag == "person" and row.get("vehicle"):
                rides[f"person {row['id']}"] = f"vehicle {row['vehicle']}"
            elif tag in ("vehicle", "person"):
                _add_row(table, tag, row, now)
        except (KeyError, ValueError):
            raise InputError(f"{name} has a {tag} without usable id, time, x, y") from None

    walk_xml(io.BytesIO(data), start, name=name)
    return [SampledRecording("", table.list_agents(), notes=describe_rides(rides))]


def _add_row(table: SampleTable, tag: str, row: dict[str, str], now: float) -> None:
    x, y = float(row["x"]), float(row["y"])
    word = "pedestrian"
    if tag == "vehicle":
        # The class that the type's name speaks of; a car where it speaks of none.
        said = row.get("type", "")
        words = (w for w, s in SUBTYPE_OF_WORD.items() if w in said.lower() and s != "pedestrian")
        word = find_road_user(said) or SUBTYPE_OF_WORD[next(words, "car")]
    values: dict[str, float] = {k: float(row[k]) for k in ("length", "width") if k in row}
    if "angle" in row:
        values["heading"] = turn = math.radians(90.0 - float(row["angle"]))
        back = values.get("length", _LENGTHS.get(word, 4.6)) / 2 if tag == "vehicle" else 0.0
        x, y = x - back * math.cos(turn), y - back * math.sin(turn)
    table.add(None, f"{tag} {row['id']}", word, {"t": now, "x": x, "y": y} | values)
