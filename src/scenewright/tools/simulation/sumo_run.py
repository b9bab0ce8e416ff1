"""One simulated hour: demand, departures, SUMO's run, and the raw positions that it recorded.

Drivers differ: every vehicle has its own type with its own speed, braking, attention, place in the
lane. SUMO's settings are those under which tracks spread as real ones do: sublane model, numeric
lateral alignment, narrow pedestrian stripes.
"""

from __future__ import annotations

import math
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from pydantic import Field, ValidationError

from scenewright.errors import InputError
from scenewright.scene.base import Compass, FloatArray, Model
from scenewright.scene.map_elements import VehicleMovement
from scenewright.scene.track import VEHICLE_SIZES
from scenewright.tools.simulation.sumo_network import find_sumo, format_tag, name_edge

HOUR = 3600.0
WARM_UP = 150.0
"""Simulated before the hour begins, with the signal programme from its beginning [s]."""
_DRAIN = 60.0
_RECORD = 58.0
"""Half the side of the square in which positions are recorded [m]."""


@dataclass(frozen=True, eq=False)
class SumoTrack:
    """What SUMO recorded of one agent.

    Attributes:
        xy: [T, 2] front bumper (vehicle) or middle (pedestrian) [m]; angle: [T] heading [rad].
        time: [T] seconds since the hour began, 0.1 s apart.
        subtype: of vehicles.
    """

    route: str
    subtype: str | None
    xy: FloatArray
    angle: FloatArray
    time: FloatArray


@dataclass(frozen=True)
class Departure:
    """An agent that departs: when [s], SUMO's XML, its id, route and subtype."""

    time: float
    xml: str
    agent: str
    route: str
    subtype: str | None


def draw_arrivals(rate: float, rng: np.random.Generator, *, seconds: float = HOUR) -> FloatArray:
    """Times of chance arrivals at `rate` per hour, warm-up included [s since the hour began]."""
    span = seconds + WARM_UP
    return np.sort(rng.uniform(-WARM_UP, seconds, rng.poisson(rate * span / HOUR)))


_DRIVING = {
    "car": ("passenger", 2.0, 3.0, 0.88),
    "truck": ("truck", 1.3, 2.6, 0.80),
    "bus": ("bus", 1.1, 2.2, 0.76),
    "motorcycle": ("motorcycle", 2.4, 3.2, 0.92),
}
"""SUMO class, mean acceleration and braking [m/s^2], mean share of the speed limit driven."""


def format_vehicle(
    movement: VehicleMovement,
    *,
    lane: float,
    agent: str,
    subtype: str,
    time: float,
    rng: np.random.Generator,
) -> str:
    """A driver and its trip as SUMO's XML; `lane` is the width of the narrowest lane [m]."""
    leg = movement.entry
    length, width = VEHICLE_SIZES[subtype]
    kind, accel, decel, share = _DRIVING[subtype]
    room = (lane - width) / 2 - 0.1
    aside = float(np.clip(rng.normal(0.0, 0.35), -room, room))
    driver = format_tag(
        "vType",
        id=f"t_{agent}",
        vClass=kind,
        length=length,
        width=width,
        accel=_draw_about(accel, 0.15, rng),
        decel=_draw_about(decel, 0.12, rng),
        emergencyDecel=8.0,
        sigma=round(float(rng.uniform(0.1, 0.6)), 2),
        tau=round(float(np.clip(rng.normal(1.3, 0.25), 0.9, 2.0)), 2),
        minGap=round(float(np.clip(rng.normal(2.0, 0.4), 1.2, 3.2)), 2),
        speedFactor=round(float(np.clip(rng.normal(share, 0.10), 0.6, 1.15)), 3),
        latAlignment=round(aside, 3),
        lcSigma=round(float(rng.uniform(0.05, 0.25)), 3),
        lcKeepRight=0.05,
        lcSpeedGain=0.4,
        maxSpeedLat=0.8,
        lcMaxSpeedLatStanding=0,
        lcMaxSpeedLatFactor=0.25,
    )
    start, end = name_edge(leg, inwards=True), name_edge(movement.exit, inwards=False)
    head = format_tag(
        "vehicle",
        id=agent,
        type=f"t_{agent}",
        depart=round(time + WARM_UP, 1),
        departLane="best",
        departSpeed="desired",
        departPos=round(float(rng.uniform(10.0, 40.0)), 1),
    )
    return (
        driver
        + head.replace("/>", ">")
        + format_tag("route", edges=f"{start} {end}")
        + "</vehicle>"
    )


def _draw_about(mean: float, relative: float, rng: np.random.Generator) -> float:
    return round(float(mean * np.clip(rng.normal(1.0, relative), 0.6, 1.4)), 2)


def format_pedestrian(
    agent: str,
    start: tuple[str, float],
    end: tuple[str, float],
    *,
    time: float,
    rng: np.random.Generator,
) -> str:
    """A pedestrian with a speed of its own and the walk, as SUMO's XML.

    Args:
        start, end: a road and a position along its sidewalk [m].
    """
    pace = round(float(np.clip(rng.normal(1.36, 0.20), 0.85, 1.95)), 2)
    kind = format_tag(
        "vType",
        id=f"t_{agent}",
        vClass="pedestrian",
        width=0.5,
        length=0.3,
        minGap=0.25,
        maxSpeed=pace,
        desiredMaxSpeed=pace,
        speedFactor=1,
    )
    walk = format_tag(
        "walk",
        edges=" ".join(dict.fromkeys((start[0], end[0]))),
        departPosLat=round(float(np.clip(rng.normal(0.0, 0.5), -1.2, 1.2)), 2),
        arrivalPos=end[1],
    )
    head = format_tag(
        "person",
        id=agent,
        type=f"t_{agent}",
        depart=round(time + WARM_UP, 1),
        departPos=start[1],
    )
    return kind + head.replace("/>", ">") + walk + "</person>"


def run_sumo(
    folder: Path,
    network: Path,
    departures: Sequence[Departure],
    *,
    seed: int,
    half: float = _RECORD,
    seconds: float = HOUR,
) -> list[SumoTrack]:
    """Simulate departures; every agent's recorded positions, without agents that collided.

    Args:
        half: half the side of the square in which positions are recorded [m].
        seconds: how long, without warm-up.

    Raises:
        InputError: SUMO is not installed, or stops.
    """
    body = "\n".join(each.xml for each in sorted(departures, key=lambda each: each.time))
    (folder / "agents.rou.xml").write_text(f"<routes>\n{body}\n</routes>\n", encoding="utf-8")
    box = f"-{half},-{half} {half},-{half} {half},{half} -{half},{half}"
    area = format_tag("poly", id="view", type="view", color="1,1,1", shape=box)
    (folder / "view.add.xml").write_text(f"<additional>{area}</additional>", encoding="utf-8")
    extra = f"{folder / 'signals.add.xml'},{folder / 'view.add.xml'}"
    command = [
        str(find_sumo() / "bin" / "sumo"),
        *("-n", str(network), "-r", str(folder / "agents.rou.xml"), "-a", extra),
        *("--step-length", "0.1", "--step-method.ballistic", "true"),
        *("--lateral-resolution", "0.2", "--time-to-teleport", "-1"),
        *("--collision.action", "warn", "--collision.check-junctions", "true"),
        *("--collision.mingap-factor", "0"),
        *("--collision-output", str(folder / "collisions.xml")),
        *("--pedestrian.model", "striping", "--pedestrian.striping.stripe-width", "0.65"),
        *("--pedestrian.striping.walkingarea-detail", "8"),
        *("--fcd-output", str(folder / "vehicles.parquet")),
        *("--person-fcd-output", str(folder / "people.parquet")),
        *("--fcd-output.attributes", "x,y,angle", "--fcd-output.filter-shapes", "view"),
        *("--end", str(WARM_UP + seconds + _DRAIN), "--seed", str(seed)),
        *("--no-step-log", "true", "--no-warnings", "true", "--xml-validation", "never"),
        *("--precision", "3"),
    ]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    if finished.returncode != 0:
        raise InputError(f"SUMO stopped: {finished.stderr.strip()[:300]}")
    crashed = read_collided(folder)
    known = {
        departure.agent: departure for departure in departures if departure.agent not in crashed
    }
    return [
        SumoTrack(
            route=known[agent].route,
            subtype=known[agent].subtype,
            xy=columns[:, 1:3],
            angle=np.unwrap(math.pi / 2 - np.radians(columns[:, 3])),
            time=columns[:, 0] - WARM_UP,
        )
        for name in ("vehicles.parquet", "people.parquet")
        for agent, columns in _read_by_agent(folder / name)
        if agent in known
    ]


def read_collided(folder: Path) -> set[str]:
    """Ids of the agents that collided in the simulation that ran in a folder."""
    collided: set[str] = set()
    for element in ElementTree.parse(folder / "collisions.xml").getroot().iter("collision"):
        collided |= {element.attrib["collider"], element.attrib["victim"]}
    return collided


def _read_by_agent(path: Path) -> Iterator[tuple[str, FloatArray]]:
    """Each agent's [T, 4] time, x, y, angle. Column names begin with either class's word."""
    from pyarrow import parquet

    reader: Any = parquet
    table = reader.read_table(path)
    by_end = {str(name).split("_")[-1]: table[name] for name in table.column_names}
    if "id" not in by_end:
        return  # no agent of that class was there
    named = by_end["id"].is_valid()
    agents = by_end["id"].filter(named).combine_chunks().dictionary_encode()
    ids, names = np.asarray(agents.indices), agents.dictionary.to_pylist()
    columns = [by_end[key].filter(named).to_numpy() for key in ("time", "x", "y", "angle")]
    values = np.stack(columns, axis=1).astype(np.float64)
    order = np.lexsort((values[:, 0], ids))
    starts = np.flatnonzero(np.diff(ids[order], prepend=-1))
    for rows in np.split(order, starts[1:]):
        yield str(names[ids[rows[0]]]), values[rows]


HOURS = 24

Hourly = tuple[float, ...]


class Demand(Model):
    """Mean hourly arrivals and the shares that split them.

    Attributes:
        vehicles: [24] vehicles per hour by entry leg, mean of the counted working days.
        day_spread: relative standard deviation of an hour's count between days, by entry leg.
        pedestrians: [24] pedestrians per hour and crosswalk, both directions together.
        turn_shares: (left, straight, right) by entry leg; assumed.
        subtype_shares: of vehicles; assumed. Buses keep to the avenue, straight on.
        side_shares: of the pairs of sidewalks that pedestrians use; assumed.
        pedestrian_level: factor from the mean of the ten busiest counted signals to this one;
            assumed, as pedestrians were not counted here.
        sources: where the numbers come from, and under which terms.
    """

    vehicles: dict[Compass, Hourly]
    day_spread: dict[Compass, float]
    pedestrians: Hourly
    turn_shares: dict[Compass, tuple[float, float, float]] = Field(
        default={
            "north": (0.10, 0.78, 0.12),
            "south": (0.10, 0.78, 0.12),
            "east": (0.30, 0.36, 0.34),
            "west": (0.30, 0.36, 0.34),
        }
    )
    subtype_shares: dict[str, float] = Field(
        default={"car": 0.86, "truck": 0.07, "bus": 0.03, "motorcycle": 0.04}
    )
    side_shares: dict[str, float] = Field(
        default={"along>along": 0.40, "along>leg": 0.22, "leg>along": 0.22, "leg>leg": 0.16}
    )
    pedestrian_level: float = 2.0
    sources: tuple[str, ...] = (
        "Entry south and north: NYC DOT Traffic Volume Counts (NYC Open Data), Amsterdam Avenue "
        "between West 118 and West 119 Street, NB and SB, working days of 2012 and 2017.",
        "Entry east and west (assumed equal in shape and size): the same source, Morningside "
        "Drive between West 120 and West 121 Street, WB and EB, working days of 2015; West 120 "
        "Street itself was not counted.",
        "Pedestrians: mean hourly crossings at the ten busiest signals of ped-signal-data "
        "(Utah State University, Apache-2.0), times pedestrian_level.",
    )


def read_demand(path: Path) -> Demand:
    """The demand kept in a bundle's `demand.json`; InputError where it cannot be read."""
    try:
        return Demand.model_validate_json(path.read_bytes())
    except (OSError, ValidationError) as fault:
        raise InputError(
            f"cannot read demand {path.name!r}: {str(fault).splitlines()[0]}"
        ) from None
