"""Priors of an imported map without observations: derived from the map and the pool.

Where traffic drives is the middle of the lanes, with the spread of the pool; how fast, what the
shipped intersection's traffic does, scaled to the speed limit; how many, an assumed share of its
daily course for each lane. All of it gives way to tracks, simulated or recorded, as they come.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from scenewright.geometry.map_areas import merge_areas
from scenewright.intersections import SHIPPED, find_bundle_folder, load_map
from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Route
from scenewright.tools.fitting.path_frame import Pool, build_pooled_prior, load_shipped_pool
from scenewright.tools.gmm_sampler.assumed_priors import build_jaywalking_mixture
from scenewright.tools.gmm_sampler.prior_files import load_priors
from scenewright.tools.gmm_sampler.priors import (
    HOURS,
    CountPrior,
    DrivingProfilePrior,
    Priors,
    WaypointPrior,
)
from scenewright.tools.map_import.map_parts import RouteLines, geos, list_lines
from scenewright.tools.simulation.sumo_run import Demand, read_demand

_PER_LANE = 260.0
"""Vehicles per hour and approach lane in the busiest hour; assumed."""
_PEDESTRIANS = 0.35
"""Share of the shipped intersection's pedestrians at each crosswalk; assumed."""
_TURN_SHARES = {"left": 0.2, "straight": 0.6, "right": 0.2}
"""Of an approach's traffic, for the turns that it has; assumed."""
_STAY = {"vehicle": 22.0, "pedestrian": 34.0}
"""How long an agent is on the map, waiting included [s]."""
SUBTYPE_SHARES = {"car": 0.88, "truck": 0.07, "motorcycle": 0.05}
"""Of vehicles; assumed."""
_JAYWALK_SHARE = 0.01
_WIDE, _SHORTEST = 13.6, 18.5
"""A street narrower than the first [m] is too short a path for a jaywalker: it is walked to and
from along the sidewalks, the second in all."""


def derive_priors(
    intersection_map: IntersectionMap,
    route_lines: RouteLines,
    *,
    tracks: Mapping[str, FloatArray] | None = None,
    pool: Pool | None = None,
) -> Priors:
    """All priors of an imported map.

    Args:
        tracks: by route id, [n, K, 2] waypoints of whole tracks [m]; None for none.
        pool: of deviations; None takes the shipped intersection's.
    """
    frequency = assume_frequency(intersection_map)
    routes, none = intersection_map.routes, np.zeros((0, K, 2))
    waypoints = {
        r.id: _derive_jaywalking(intersection_map, r)
        if r.movement == "jaywalking"
        else build_pooled_prior(
            r, route_lines[r.id], (tracks or {}).get(r.id, none), pool=pool or load_shipped_pool()
        )
        for r in routes
    }
    return Priors(
        name=intersection_map.name,
        waypoints=waypoints,
        counts=derive_counts(intersection_map, frequency),
        driving_profiles={r.id: _borrow_profile(intersection_map, r) for r in routes},
        frequency=frequency,
        subtypes={r.id: dict(SUBTYPE_SHARES) for r in routes if r.type == "vehicle"},
    )


def _derive_jaywalking(intersection_map: IntersectionMap, route: Route) -> WaypointPrior:
    """Crossing a leg outside its crosswalk, farther out: kerb to kerb wherever there is room."""
    crosswalk = next(c for c in intersection_map.crosswalks if c.leg == route.crosswalk)
    leg = next(each for each in intersection_map.legs if each.name == route.crosswalk)
    outwards = np.array([math.cos(leg.bearing), math.sin(leg.bearing)])
    kerbs = np.array(crosswalk.centreline)
    across = (kerbs[1] - kerbs[0]) / float(np.hypot(*(kerbs[1] - kerbs[0])))
    reach = float(np.hypot(*(kerbs[1] - kerbs[0]))) / 2
    road = merge_areas(intersection_map.road)
    middle, limit = (kerbs[0] + kerbs[1]) / 2, intersection_map.extent - 3.0
    across = [
        _cut_road(road, middle + away * outwards, across, reach, limit)
        for away in (7.0, 11.0, 15.0, 19.0)
    ]
    ends = [line for line in across if line is not None] or [kerbs]
    ends = [end if crosswalk.sides[0] == route.entry else end[::-1] for end in ends]
    if min(float(np.hypot(*(end[1] - end[0]))) for end in ends) >= _WIDE:
        return build_jaywalking_mixture(route.id, ends, outwards)
    lines = [_walk_along(each, sign * outwards) for each in ends for sign in (-1.0, 1.0)]
    pool: Pool = {str(route.movement): load_shipped_pool()["walking"]}
    return build_pooled_prior(route, lines, np.zeros((0, K, 2)), pool=pool)


def _walk_along(kerbs: FloatArray, along: FloatArray) -> FloatArray:
    """[P, 2] along one sidewalk, over the narrow street, on along the other; corners rounded."""
    across = (kerbs[1] - kerbs[0]) / float(np.hypot(*(kerbs[1] - kerbs[0])))
    begin, end = kerbs[0] - 1.4 * across, kerbs[1] + 1.4 * across
    beside = max((_SHORTEST - float(np.hypot(*(end - begin)))) / 2, 3.0)
    corners = np.array([begin - beside * along, begin, end, end + beside * along])
    for _ in range(3):  # Chaikin's corner cutting
        cut = np.stack([0.75 * corners[:-1] + 0.25 * corners[1:],
                        0.25 * corners[:-1] + 0.75 * corners[1:]], axis=1)  # fmt: skip
        corners = np.concatenate([corners[:1], cut.reshape(-1, 2), corners[-1:]])
    return corners


def _cut_road(
    road: Any, middle: FloatArray, across: FloatArray, reach: float, extent: float
) -> FloatArray | None:
    """[2, 2] both kerbs at a place on a leg; None where it is wider than at its crosswalk."""
    half = (reach + 8.0) * across
    parts = list_lines(geos.LineString([middle - half, middle + half]).intersection(road))
    if not parts:
        return None
    points = np.concatenate([np.array(p.coords) for p in parts])
    ends = points[np.argsort(points @ across)[[0, -1]]]
    narrow = float(np.hypot(*(ends[1] - ends[0]))) < 2 * reach + 4.0
    return ends if narrow and np.abs(ends).max() < extent else None


def _borrow_profile(intersection_map: IntersectionMap, route: Route) -> DrivingProfilePrior:
    """The shipped intersection's driving profile of the same turn, scaled to the speed limit."""
    shipped = load_map(SHIPPED)
    turn = "left" if route.movement == "uturn" else route.movement
    like = next(r for r in shipped.routes if r.type == route.type and r.movement == turn)
    profile = load_priors(SHIPPED).driving_profiles[like.id]
    if route.type == "pedestrian":
        return profile
    limits = _find_speed_limit(intersection_map, route.entry), _find_speed_limit(shipped, "north")
    scale = float(np.clip(limits[0] / limits[1], 0.6, 1.25))
    median = profile.median.copy()
    median[0] = np.clip(median[0] * scale, profile.low[0], profile.high[0])
    return DrivingProfilePrior(median, profile.spread, profile.low, profile.high, 0)


def _find_speed_limit(intersection_map: IntersectionMap, leg: Compass) -> float:
    """Of the approaches of a leg, on average [m/s]."""
    lanes = [x for x in intersection_map.lanelets if x.kind == "approach" and x.leg == leg]
    return float(np.mean([lane.speed_limit for lane in lanes])) if lanes else 11.18


def assume_demand(intersection_map: IntersectionMap) -> Demand:
    """Hourly arrivals by leg and at the crosswalks: the shipped course of the day, scaled."""
    shipped = read_demand(find_bundle_folder(SHIPPED) / "demand.json")
    course = np.mean(list(shipped.vehicles.values()), axis=0)
    course = course / course.max()
    lanes = [x.leg for x in intersection_map.lanelets if x.kind == "approach"]
    vehicles = {
        leg.name: tuple(np.round(_PER_LANE * n * course, 1))
        for leg in intersection_map.legs
        if (n := lanes.count(leg.name))
    }
    shares = {}
    for leg in vehicles:
        turns = {m.turn for m in intersection_map.movements if m.entry == leg}
        raw = [_TURN_SHARES[t] if t in turns else 0.0 for t in ("left", "straight", "right")]
        shares[leg] = (raw[0] / sum(raw), raw[1] / sum(raw), raw[2] / sum(raw))
    return Demand(
        vehicles=vehicles,
        day_spread=dict.fromkeys(vehicles, 0.1),
        pedestrians=tuple(round(_PEDESTRIANS * n, 2) for n in shipped.pedestrians),
        turn_shares=shares,
        sources=("Assumed: no count of this intersection is known.",),
    )


def assume_frequency(intersection_map: IntersectionMap) -> dict[str, FloatArray]:
    """By route id, [24] trips per hour; jaywalking a small share of its crosswalk's."""
    demand = assume_demand(intersection_map)
    pedestrians = np.array(demand.pedestrians) / 2
    turns = [(m.entry, m.turn) for m in intersection_map.movements]
    found = {}
    for route in intersection_map.routes:
        if route.movement == "jaywalking":
            found[route.id] = _JAYWALK_SHARE * pedestrians
        elif route.type == "pedestrian":
            found[route.id] = pedestrians * demand.side_shares[str(route.side)]
        else:
            left, straight, right = demand.turn_shares[route.entry]
            shares = {"left": left, "straight": straight, "right": right, "uturn": 0.0}
            alike = sum(turn == (route.entry, route.movement) for turn in turns)
            arrivals = np.array(demand.vehicles[route.entry])
            found[route.id] = arrivals * shares[route.movement] / alike
    return found


def derive_counts(
    intersection_map: IntersectionMap,
    frequency: Mapping[str, FloatArray],
    *,
    stay: float | None = None,
) -> tuple[CountPrior, ...]:
    """p_tod of every hour over 30 s, of chance arrivals that stay a while.

    Args:
        stay: how long a vehicle is on the map, waiting included [s]; None takes a usual one.
    """
    stays = dict(_STAY) | ({} if stay is None else {"vehicle": stay})
    rates = {
        kind: [frequency[r.id] for r in intersection_map.routes if r.type == kind] for kind in stays
    }
    counts = []
    for hour in range(HOURS):
        totals = {kind: sum(float(rate[hour]) for rate in own) for kind, own in rates.items()}
        mean = np.array([totals[kind] * (stays[kind] + 30.0) / 3600.0 for kind in stays])
        # Days differ, so that counts spread a little more than chance arrivals alone.
        counts.append(CountPrior(np.ones(1), mean[None], np.diag(1.2 * mean + 0.15)[None]))
    return tuple(counts)
