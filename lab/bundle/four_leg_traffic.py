"""One hour of traffic at a four-leg plan in SUMO, after its demand by leg."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lab.bundle.four_leg_network import REACH
from lab.bundle.four_leg_plan import FourLegPlan
from scenewright.errors import InputError
from scenewright.scene.base import Compass
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Route
from scenewright.tools.map_import.compass import rotate_compass
from scenewright.tools.simulation.sumo_network import name_edge
from scenewright.tools.simulation.sumo_run import (
    Demand,
    Departure,
    SumoTrack,
    draw_arrivals,
    format_pedestrian,
    format_vehicle,
    run_sumo,
)

_TURNS = ("left", "straight", "right")
_WALK_START = 34.0
"""Where walks begin and end, from the middle [m]."""


def simulate_hour(
    folder: Path,
    network: Path,
    *,
    plan: FourLegPlan,
    intersection_map: IntersectionMap,
    demand: Demand,
    hour: int,
    rng: np.random.Generator,
) -> list[SumoTrack]:
    """Simulate one hour of the day and read back every agent's positions near the middle."""
    departures = [
        *_draw_vehicle_departures(plan, intersection_map, demand, hour, rng),
        *_draw_pedestrian_departures(intersection_map, demand, hour, rng),
    ]
    return run_sumo(folder, network, departures, seed=int(rng.integers(1 << 30)))


def _draw_day_factor(spread: float, rng: np.random.Generator) -> float:
    """How busy this hour is against the mean, as days differ."""
    return float(np.exp(rng.normal(-(spread**2) / 2, spread)))


def _draw_vehicle_departures(
    plan: FourLegPlan,
    intersection_map: IntersectionMap,
    demand: Demand,
    hour: int,
    rng: np.random.Generator,
) -> Iterator[Departure]:
    for leg, rates in demand.vehicles.items():
        rate = rates[hour] * _draw_day_factor(demand.day_spread[leg], rng)
        for number, time in enumerate(draw_arrivals(rate, rng)):
            turn = str(rng.choice(_TURNS, p=demand.turn_shares[leg]))
            subtype = _draw_subtype(demand, leg, turn, rng)
            movement = next(
                m for m in intersection_map.movements if m.entry == leg and m.turn == turn
            )
            agent = f"v_{leg}_{number}"
            xml = format_vehicle(
                movement,
                lane=min(plan.get_road(leg).lanes),
                agent=agent,
                subtype=subtype,
                time=float(time),
                rng=rng,
            )
            yield Departure(float(time), xml, agent, f"vehicle:{movement.id}", subtype)


def _draw_subtype(demand: Demand, leg: Compass, turn: str, rng: np.random.Generator) -> str:
    names = list(demand.subtype_shares)
    subtype = str(rng.choice(names, p=[demand.subtype_shares[name] for name in names]))
    on_avenue = leg in ("north", "south") and turn == "straight"
    return "car" if subtype == "bus" and not on_avenue else subtype


def _draw_pedestrian_departures(
    intersection_map: IntersectionMap, demand: Demand, hour: int, rng: np.random.Generator
) -> Iterator[Departure]:
    for route in intersection_map.routes:
        if route.side is None:
            continue
        rate = demand.pedestrians[hour] / 2 * demand.side_shares[route.side]
        for number, time in enumerate(draw_arrivals(rate * _draw_day_factor(0.2, rng), rng)):
            agent = f"p_{route.id.replace(':', '_').replace('>', '_')}_{number}"
            xml = _format_walk(agent, route, float(time), rng)
            yield Departure(float(time), xml, agent, route.id, None)


def find_sidewalk_edge(route: Route, *, at_entry: bool) -> str:
    """The SUMO road whose sidewalk a crossing route uses before or after the crosswalk."""
    sides = (route.side or "").split(">")
    corner_side = route.entry if at_entry else route.exit
    leg = route.crosswalk
    if leg is None or len(sides) != 2:
        raise InputError(f"route {route.id} crosses no crosswalk")
    on_leg = sides[0 if at_entry else 1] == "leg"
    road, beside = (leg, corner_side) if on_leg else (corner_side, leg)
    return name_edge(road, inwards=beside == rotate_compass(road, -2))


def _format_walk(agent: str, route: Route, time: float, rng: np.random.Generator) -> str:
    start, end = find_sidewalk_edge(route, at_entry=True), find_sidewalk_edge(route, at_entry=False)
    return format_pedestrian(
        agent,
        (start, _locate_along(start, _WALK_START)),
        (end, _locate_along(end, _WALK_START + 2.0)),
        time=time,
        rng=rng,
    )


def _locate_along(edge: str, distance: float) -> float:
    """A place `distance` from the middle as a position along a road; approaches end there."""
    return round(REACH - distance if edge.endswith("_in") else distance - 16.0, 1)
