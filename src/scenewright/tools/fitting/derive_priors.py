"""Priors of an imported map before anything was seen there: derived from the map and the pool.

Where people drive is the middle of the lanes, with the spread of the pool; how fast, what the
shipped intersection's traffic does, scaled to the speed limit; how many, an assumed share of its
daily course for each lane. All of it gives way to tracks, simulated or recorded, as they come.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from scenewright.intersections import find_bundle_folder, load_map
from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map import IntersectionMap, Route
from scenewright.tools.fitting.path_frame import SHIPPED, Pool, moving_prior, shipped_pool
from scenewright.tools.gmm_sampler.jaywalking import build_jaywalking_mixture
from scenewright.tools.gmm_sampler.priors import (
    HOURS,
    CountPrior,
    DrivingProfilePrior,
    Priors,
    WaypointPrior,
    load_priors,
)
from scenewright.tools.simulation.demand import Demand, read_demand

geos: Any = import_module("shapely")

PER_LANE = 260.0
"""Vehicles per hour and approach lane in the busiest hour; assumed."""
WALKERS = 0.35
"""Share of the shipped intersection's pedestrians at each crosswalk; assumed."""
TURN_SHARES = {"left": 0.2, "straight": 0.6, "right": 0.2}
"""Of an approach's traffic, for the turns that it has; assumed."""
_STAY = {"vehicle": 22.0, "pedestrian": 34.0}
"""How long somebody is on the map, waiting included [s]."""
_SUBTYPES = {"car": 0.88, "truck": 0.07, "motorcycle": 0.05}
_JAYWALK_SHARE = 0.01
_WIDE, _LEAST_WAY = 13.6, 18.5
"""A street narrower than the first [m] is too short a way for a jaywalker: it is walked to and
from along the sidewalks, the second in all."""

Lines = Mapping[str, Sequence[FloatArray]]


def derived_priors(
    place: IntersectionMap,
    lines: Lines,
    *,
    tracks: Mapping[str, FloatArray] | None = None,
    pool: Pool | None = None,
) -> Priors:
    """All priors of an imported map.

    Args:
        lines: by route id, the middles of the ways that it may take [m].
        tracks: by route id, [n, K, 2] waypoints of whole tracks; none means nothing was seen.
        pool: of deviations; None takes the shipped intersection's.
    """
    frequency = assumed_frequency(place)
    counts, instants = derived_counts(place, frequency)
    return Priors(
        name=place.name,
        waypoints={r.id: _way(place, r, lines, tracks or {}, pool) for r in place.routes},
        counts=counts,
        instants=instants,
        driving_profiles={r.id: borrowed_law(place, r) for r in place.routes},
        frequency=frequency,
        subtypes={r.id: dict(_SUBTYPES) for r in place.routes if r.type == "vehicle"},
    )


def _way(
    place: IntersectionMap,
    route: Route,
    lines: Lines,
    tracks: Mapping[str, FloatArray],
    pool: Pool | None,
) -> WaypointPrior:
    if route.movement == "jaywalking":
        return _jaywalk(place, route)
    seen = tracks.get(route.id, np.zeros((0, K, 2)))
    return moving_prior(route, lines[route.id], seen, pool=pool or shipped_pool())


def _jaywalk(place: IntersectionMap, route: Route) -> WaypointPrior:
    """Crossing a leg outside its crosswalk, farther out: kerb to kerb wherever there is room."""
    crosswalk = next(c for c in place.crosswalks if c.leg == route.crosswalk)
    first, last = (np.array(point) for point in crosswalk.centreline)
    across = (last - first) / float(np.hypot(*(last - first)))
    leg = next(each for each in place.legs if each.name == route.crosswalk)
    outwards = np.array([math.cos(leg.bearing), math.sin(leg.bearing)])
    middle = (first + last) / 2
    road = geos.union_all([geos.Polygon(a.exterior, a.holes) for a in place.road])
    reach = float(np.hypot(*(last - first))) / 2
    ends = []
    for away in (7.0, 11.0, 15.0, 19.0):
        found = _kerbs(road, middle + away * outwards, across, reach, place.extent - 3.0)
        if found is not None:
            ends.append(found if crosswalk.sides[0] == route.entry else found[::-1])
    if not ends:
        both = np.array([first, last])
        ends = [both if crosswalk.sides[0] == route.entry else both[::-1]]
    wide = min(float(np.hypot(*(each[1] - each[0]))) for each in ends)
    if wide >= _WIDE:
        return build_jaywalking_mixture(route.id, ends, outwards)
    lines = [_stepping_off(each, sign * outwards) for each in ends for sign in (-1.0, 1.0)]
    none = np.zeros((0, K, 2))
    return moving_prior(route, lines, none, pool={route.movement: shipped_pool()["walking"]})


def _stepping_off(kerbs: FloatArray, along: FloatArray) -> FloatArray:
    """[P, 2] along one sidewalk, over the narrow street, on along the other; corners rounded."""
    across = (kerbs[1] - kerbs[0]) / float(np.hypot(*(kerbs[1] - kerbs[0])))
    begin, end = kerbs[0] - 1.4 * across, kerbs[1] + 1.4 * across
    beside = max((_LEAST_WAY - float(np.hypot(*(end - begin)))) / 2, 3.0)
    corners = np.array([begin - beside * along, begin, end, end + beside * along])
    for _ in range(3):  # Chaikin's corner cutting
        cut = np.stack([0.75 * corners[:-1] + 0.25 * corners[1:],
                        0.25 * corners[:-1] + 0.75 * corners[1:]], axis=1)  # fmt: skip
        corners = np.concatenate([corners[:1], cut.reshape(-1, 2), corners[-1:]])
    return corners


def _kerbs(
    road: Any, at: FloatArray, across: FloatArray, reach: float, extent: float
) -> FloatArray | None:
    """[2, 2] both kerbs at a place on a leg; None where the leg is not like at its crosswalk."""
    line = geos.LineString([at - (reach + 8.0) * across, at + (reach + 8.0) * across])
    cut = line.intersection(road)
    parts = [p for p in getattr(cut, "geoms", [cut]) if p.geom_type == "LineString" and p.length]
    if not parts:
        return None
    points = np.concatenate([np.array(p.coords) for p in parts])
    ends = points[np.argsort(points @ across)[[0, -1]]]
    narrow = float(np.hypot(*(ends[1] - ends[0]))) < 2 * reach + 4.0
    return ends if narrow and np.abs(ends).max() < extent else None


def borrowed_law(place: IntersectionMap, route: Route) -> DrivingProfilePrior:
    """The shipped intersection's time law of the same turn, scaled to the speed limit."""
    shipped = load_priors(SHIPPED).driving_profiles
    known = load_map(SHIPPED)
    turn = "left" if route.movement == "uturn" else route.movement
    like = next(r for r in known.routes if r.type == route.type and r.movement == turn)
    law = shipped[like.id]
    if route.type == "pedestrian":
        return law
    scale = float(np.clip(_limit(place, route.entry) / _limit(known, "north"), 0.6, 1.25))
    median = law.median.copy()
    median[0] = np.clip(median[0] * scale, law.low[0], law.high[0])
    return DrivingProfilePrior(median, law.spread, law.low, law.high, 0)


def _limit(place: IntersectionMap, leg: Compass) -> float:
    speeds = [x.speed_limit for x in place.lanelets if x.kind == "approach" and x.leg == leg]
    return float(np.mean(speeds)) if speeds else 11.18


def assumed_demand(place: IntersectionMap) -> Demand:
    """Hourly arrivals by leg and at the crosswalks: the shipped course of the day, scaled."""
    known = read_demand(find_bundle_folder(SHIPPED) / "demand.json")
    course = np.mean(list(known.vehicles.values()), axis=0)
    course = course / course.max()
    lanes = {
        leg.name: sum(x.kind == "approach" and x.leg == leg.name for x in place.lanelets)
        for leg in place.legs
    }
    vehicles = {leg: tuple(np.round(PER_LANE * n * course, 1)) for leg, n in lanes.items() if n}
    return Demand(
        vehicles=vehicles,
        day_spread=dict.fromkeys(vehicles, 0.1),
        pedestrians=tuple(round(WALKERS * n, 2) for n in known.pedestrians),
        turn_shares={leg: _shares(place, leg) for leg in vehicles},
        sources=("Assumed: no count of this intersection is known.",),
    )


def _shares(place: IntersectionMap, leg: Compass) -> tuple[float, float, float]:
    turns = {m.turn for m in place.movements if m.entry == leg}
    raw = [TURN_SHARES[t] if t in turns else 0.0 for t in ("left", "straight", "right")]
    return tuple(each / sum(raw) for each in raw)  # type: ignore[return-value]


def assumed_frequency(
    place: IntersectionMap, demand: Demand | None = None
) -> dict[str, FloatArray]:
    """By route id, [24] trips per hour of a demand; jaywalking a small share of its crosswalk's."""
    demand = demand or assumed_demand(place)
    return {route.id: _rate(place, route, demand) for route in place.routes}


def _rate(place: IntersectionMap, route: Route, demand: Demand) -> FloatArray:
    walkers = np.array(demand.pedestrians) / 2
    if route.movement == "jaywalking":
        return np.asarray(_JAYWALK_SHARE * walkers)
    if route.type == "pedestrian":
        return np.asarray(walkers * demand.side_shares[str(route.side)])
    left, straight, right = demand.turn_shares[route.entry]
    shares = {"left": left, "straight": straight, "right": right, "uturn": 0.0}
    alike = sum(
        r.entry == route.entry and r.movement == route.movement
        for r in place.routes
        if r.type == "vehicle"
    )
    return np.array(demand.vehicles[route.entry]) * shares[route.movement] / alike


def derived_counts(
    place: IntersectionMap,
    frequency: Mapping[str, FloatArray],
    *,
    stay: float | None = None,
) -> tuple[tuple[CountPrior, ...], tuple[CountPrior, ...]]:
    """p_tod of every hour over 30 s and at an instant, of chance arrivals that stay a while.

    Args:
        stay: how long a vehicle is on the map, waiting included [s]; None takes a usual one.
    """
    stays = dict(_STAY) | ({} if stay is None else {"vehicle": stay})
    made = [
        tuple(_counts(place, frequency, hour, window, stays) for hour in range(HOURS))
        for window in (30.0, 0.0)
    ]
    return made[0], made[1]


def _counts(
    place: IntersectionMap,
    frequency: Mapping[str, FloatArray],
    hour: int,
    window: float,
    stays: Mapping[str, float],
) -> CountPrior:
    rates = {
        kind: sum(float(frequency[r.id][hour]) for r in place.routes if r.type == kind)
        for kind in stays
    }
    mean = np.array([rates[kind] * (stays[kind] + window) / 3600.0 for kind in stays])
    # Days differ, so that counts spread a little more than chance arrivals alone.
    return CountPrior(np.ones(1), mean[None], np.diag(1.2 * mean + 0.15)[None])
