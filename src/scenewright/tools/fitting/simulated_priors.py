"""A corpus for a map without data: SUMO traffic on it, and priors fitted on that.

Vehicles and pedestrians are simulated together, under the map's signals. From the vehicles come
paths, speeds and numbers; from pedestrians only how fast they walk: where they walk between two
kerbs depends on the simulator's stripes, and the map says more of it.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.polyline import measure_distances
from scenewright.geometry.spline import build_even_path
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Route
from scenewright.scene.track import STEP
from scenewright.tools.fitting.derive_priors import (
    SUBTYPE_SHARES,
    assume_demand,
    assume_frequency,
    derive_counts,
    derive_priors,
)
from scenewright.tools.fitting.path_frame import (
    build_centreline,
    classify_route,
    compute_deviations,
    load_shipped_pool,
    pool_deviations,
)
from scenewright.tools.gmm_sampler.priors import DrivingProfilePrior, Priors
from scenewright.tools.map_import.map_parts import RouteLines
from scenewright.tools.simulation.corpus import (
    Progress,
    Trip,
    build_agents,
    build_footways,
    clean_trip,
    clean_walk,
    find_jam_time,
)
from scenewright.tools.simulation.sumo_custom_network import (
    draw_walks,
    read_sidewalks,
    write_custom_network,
)
from scenewright.tools.simulation.sumo_run import (
    WARM_UP,
    Departure,
    SumoTrack,
    draw_arrivals,
    format_vehicle,
    run_sumo,
)
from scenewright.tools.track_io import Recording

_BOUNDS = {
    "vehicle": (np.array([4.0, 0.8, 1.0, 1.2]), np.array([14.0, 2.5, 3.0, 3.0])),
    "pedestrian": (np.array([0.7, 0.5, 0.5, 0.8]), np.array([2.2, 1.6, 1.6, 2.0])),
}
_ASSUMED_WALK = (1.0, 1.0, 1.3)
"""Acceleration, braking and lateral acceleration of pedestrians; the stripe model has none."""
_ASSUMED_SPREAD = 0.2
_LEAST_SPREAD = 0.05
_FLOWING = {"vehicle": 2.5, "pedestrian": 0.4}
"""A trip that is ever slower than this does not flow freely [m/s]."""
_LOW, _HIGH = 1.0, 6.0
"""Speeds between which starting and braking are measured [m/s]."""
_CURVE = 0.05
_LEAST_FLOWING = 12
"""Freely flowing tracks of one class and turn below which a profile is borrowed."""


def fit_driving_profiles(
    intersection_map: IntersectionMap,
    trips: Mapping[str, Sequence[Trip]],
    *,
    fallback: Mapping[str, DrivingProfilePrior] | None = None,
) -> dict[str, DrivingProfilePrior]:
    """The driving profile of every route; rare routes borrow from all of their class and turn.

    Args:
        fallback: by route, taken where a class and turn has too few freely flowing tracks; its
            accelerations also where no track shows them.
    """
    pooled: dict[tuple[str, str], list[Trip]] = {}
    for route in intersection_map.routes:
        pooled.setdefault(_classify(route), []).extend(trips[route.id])
    driving = [t for (kind, _), group in pooled.items() if kind == "vehicle" for t in group]
    accelerations = [_fit_lognormal(list(_measure_changes(driving, sign))) for sign in (1, -1)]
    accelerations.append(_fit_lognormal(list(_measure_laterals(driving))))
    if fallback is None:
        by_kind = {key: _fit_profile(key, group, accelerations) for key, group in pooled.items()}
        return {route.id: by_kind[_classify(route)] for route in intersection_map.routes}
    known = [pair if np.isfinite(pair).all() else None for pair in accelerations]
    found = dict(fallback)
    for route in intersection_map.routes:
        borrowed, key = fallback[route.id], _classify(route)
        usual = zip(borrowed.median[1:].tolist(), borrowed.spread[1:].tolist(), strict=True)
        rest = [pair or other for pair, other in zip(known, usual, strict=True)]
        if len(_select_flowing(pooled[key], key[0])) >= _LEAST_FLOWING:
            found[route.id] = _fit_profile(key, pooled[key], rest)
    return found


def _classify(route: Route) -> tuple[str, str]:
    """Class and turn: turns have profiles of their own; walking is walking."""
    return route.type, route.movement if route.type == "vehicle" else "walking"


def _select_flowing(trips: Sequence[Trip], kind: str) -> list[Trip]:
    return [trip for trip in trips if _measure_speeds(trip).min() > _FLOWING[kind]]


def _fit_profile(
    key: tuple[str, str], trips: Sequence[Trip], driving: list[tuple[float, float]]
) -> DrivingProfilePrior:
    """One profile; `driving` is what all vehicles share: acceleration, braking, lateral."""
    kind, turn = key
    flowing = _select_flowing(trips, kind)
    speed = _fit_lognormal([float(np.percentile(_measure_speeds(trip), 90)) for trip in flowing])
    if kind == "vehicle":
        laterals = [] if turn == "straight" else list(_measure_laterals(flowing))
        rest = [*driving[:2], _fit_lognormal(laterals)] if laterals else driving
    else:
        rest = [(median, _ASSUMED_SPREAD) for median in _ASSUMED_WALK]
    low, high = _BOUNDS[kind]
    median, spread = np.array([speed, *rest]).T
    return DrivingProfilePrior(np.clip(median, low, high), spread, low, high, len(flowing))


def _measure_speeds(trip: Trip) -> FloatArray:
    """[T] speed along the path, over half a second [m/s]."""
    window = min(5, max(len(trip.progress) - 1, 1))
    return (trip.progress[window:] - trip.progress[:-window]) / (window * STEP)


def _fit_lognormal(values: list[float]) -> tuple[float, float]:
    """Median, and standard deviation of the logarithm; NaN of nothing."""
    if not values:
        return float("nan"), float("nan")
    logs = np.log(np.maximum(values, 1e-3))
    centre = float(np.median(logs))
    spread = float(1.4826 * np.median(np.abs(logs - centre)))
    return float(np.exp(centre)), max(spread, _LEAST_SPREAD)


def _measure_changes(trips: Sequence[Trip], sign: int) -> Iterator[float]:
    """Mean acceleration (or braking) between a crawl and driving, for trips that stood."""
    for trip in trips:
        speed = _measure_speeds(trip)[::sign]
        standing = np.flatnonzero(speed < _LOW)
        if not len(standing):
            continue
        fast = np.flatnonzero(speed[standing[-1] :] > _HIGH)
        if len(fast):
            yield (_HIGH - _LOW) / (max(int(fast[0]), 1) * STEP)


def _measure_laterals(trips: Sequence[Trip]) -> Iterator[float]:
    """The most lateral acceleration of each flowing trip that turns."""
    for trip in _select_flowing(trips, "vehicle"):
        path, speed = build_even_path(trip.path), _measure_speeds(trip)
        at = trip.progress[: len(speed)] + speed * 0.25
        curvature = np.abs(np.interp(at, path.s, path.curvature))
        if curvature.max() > _CURVE:
            yield float(np.percentile(speed**2 * curvature, 97))


_HOURS_OF_DAY = (8, 18, 13, 22)
"""Whose demand is simulated, in this order and over again."""
_PIECE = 600.0
"""How long traffic is simulated at one demand [s]."""
_MAX_MINUTES = 240

_ASTRAY = 2.2
"""A pedestrian farther than this from its route on average [m] has taken another path."""


@dataclass(frozen=True, eq=False)
class SimulatedTraffic:
    """Traffic simulated on a map.

    Attributes:
        trips: whole paths of vehicles and of pedestrians.
        present: [pieces] vehicles on the map on average.
        recordings: the tracks of all agents, one for each piece; the last is for testing.
    """

    trips: tuple[Trip, ...]
    present: FloatArray
    recordings: tuple[Recording, ...]


def simulate_map(
    intersection_map: IntersectionMap,
    route_lines: RouteLines,
    *,
    minutes: int,
    seed: int,
    progress: Progress | None = None,
) -> SimulatedTraffic:
    """Traffic on a map in ten-minute pieces, each at the demand of another hour of the day.

    Raises:
        InputError: a time that cannot be, SUMO not installed, or no traffic gets through.
    """
    if not 10 <= minutes <= _MAX_MINUTES:
        raise InputError(f"simulate 10 to {_MAX_MINUTES} minutes, got {minutes}")
    trips: list[Trip] = []
    present, recordings = [], []
    hours = list_demand_hours(round(minutes * 60 / _PIECE))
    for number, child in enumerate(np.random.SeedSequence(seed).spawn(len(hours))):
        rng = np.random.default_rng(child)
        raw = _simulate_piece(intersection_map, route_lines, hours[number], rng)
        made = _extract_trips(intersection_map, route_lines, raw, rng)
        trips += made
        # Vehicles on the map on average.
        inside = [
            (np.abs(each.xy).max(axis=1) <= intersection_map.extent)
            & ((each.time >= 0) & (each.time < _PIECE))
            for each in raw
            if each.subtype is not None
        ]
        present.append(0.1 * float(sum(each.sum() for each in inside)) / _PIECE)
        testing = number == len(hours) - 1 and number > 0
        recordings.append(
            _build_recording(intersection_map, number, hours[number], raw, rng, testing=testing)
        )
        if progress is not None:
            on_foot = sum(each.subtype is None for each in made)
            progress(
                f"demand of {hours[number]:02d} h: {len(made) - on_foot} vehicles and {on_foot} "
                f"people got through, {present[-1]:.1f} vehicles at a time"
            )
    if not trips:
        raise InputError(f"no simulated vehicle got through {intersection_map.name}")
    return SimulatedTraffic(tuple(trips), np.array(present), tuple(recordings))


def list_demand_hours(pieces: int) -> list[int]:
    """The hours of the day whose demand each piece has."""
    return [_HOURS_OF_DAY[n % len(_HOURS_OF_DAY)] for n in range(pieces)]


def _simulate_piece(
    intersection_map: IntersectionMap, route_lines: RouteLines, hour: int, rng: np.random.Generator
) -> list[SumoTrack]:
    """The raw tracks of one piece."""
    rates = {name: float(each[hour]) for name, each in assume_frequency(intersection_map).items()}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        network = write_custom_network(folder, intersection_map)
        on_foot = draw_walks(
            intersection_map, route_lines, rates, read_sidewalks(network), rng, seconds=_PIECE
        )
        departures = [*_draw_departures(intersection_map, hour, rng), *on_foot]
        return run_sumo(
            folder, network, departures, seed=int(rng.integers(1 << 30)),
            half=intersection_map.extent + 8.0, seconds=_PIECE,
        )  # fmt: skip


def _extract_trips(
    intersection_map: IntersectionMap,
    route_lines: RouteLines,
    raw: Sequence[SumoTrack],
    rng: np.random.Generator,
) -> list[Trip]:
    """Whole paths: of vehicles from edge to edge, of pedestrians from end to end of their route."""
    footways, trips = build_footways(intersection_map), []
    for track in raw:
        if track.subtype is None:
            line = np.asarray(route_lines[track.route][0])
            walked = clean_walk(track, footways[track.route.split(":")[1]], rng)
            away = ((each, measure_distances(each.path, line).min(axis=1)) for each in walked)
            trips += [each for each, distance in away if float(distance.mean()) < _ASTRAY]
        elif (np.abs(track.xy).max(axis=1) <= intersection_map.extent).sum() > 2:
            trips += list(clean_trip(track, intersection_map.extent, {}, rng))
    return trips


def _build_recording(
    intersection_map: IntersectionMap,
    number: int,
    hour: int,
    raw: Sequence[SumoTrack],
    rng: np.random.Generator,
    *,
    testing: bool,
) -> Recording:
    """All agents of a piece that were on the map, up to where traffic jams for good."""
    agents = build_agents(
        intersection_map,
        raw,
        half={"vehicle": intersection_map.extent, "pedestrian": intersection_map.extent},
        rng=rng,
    )
    end = min(find_jam_time(agents), _PIECE)
    return Recording(
        name=f"{intersection_map.name} piece {number} hour {hour:02d}",
        begin=0.0,
        end=end,
        agents=tuple(sorted(agents, key=lambda each: each.track.start)),
        split="test" if testing else "fit",
        signal_time=None
        if intersection_map.signals is None
        else WARM_UP % intersection_map.signals.cycle,
    )


def _draw_departures(
    intersection_map: IntersectionMap, hour: int, rng: np.random.Generator
) -> list[Departure]:
    rates = assume_frequency(intersection_map)
    movements = {m.id: m for m in intersection_map.movements}
    lane = min(x.width for x in intersection_map.lanelets if x.kind != "connector")
    made = []
    for number, route in enumerate(r for r in intersection_map.routes if r.type == "vehicle"):
        for count, time in enumerate(
            draw_arrivals(float(rates[route.id][hour]), rng, seconds=_PIECE)
        ):
            subtype = str(rng.choice(list(SUBTYPE_SHARES), p=list(SUBTYPE_SHARES.values())))
            agent = f"v_{number}_{count}"
            text = format_vehicle(
                movements[str(route.movement_id)], lane=max(lane, 2.8), agent=agent,
                subtype=subtype, time=float(time), rng=rng,
            )  # fmt: skip
            made.append(Departure(float(time), text, agent, route.id, subtype))
    return made


def fit_simulated_priors(
    intersection_map: IntersectionMap,
    route_lines: RouteLines,
    trips: Sequence[Trip],
    present: FloatArray,
) -> Priors:
    """All priors of a map from simulated trips; what they do not show is derived."""
    by_route: dict[str, list[Trip]] = {route.id: [] for route in intersection_map.routes}
    for trip in trips:
        by_route[trip.route].append(trip)
    tracks = {
        name: np.array([t.waypoints for t in own if t.subtype is not None]).reshape(-1, K, 2)
        for name, own in by_route.items()
    }
    # The pool of the intersection's own tracks, pulled towards the shipped one.
    groups: dict[str, list[FloatArray]] = {}
    for route in intersection_map.routes:
        if len(own := tracks[route.id]) and route.movement != "jaywalking":
            lines = [build_centreline(line) for line in route_lines[route.id]]
            away, _ = compute_deviations(own, lines)
            groups.setdefault(classify_route(route), []).append(away - away.mean(axis=0))
    pool = pool_deviations(groups, load_shipped_pool())
    base = derive_priors(intersection_map, route_lines, tracks=tracks, pool=pool)
    fitted = fit_driving_profiles(intersection_map, by_route, fallback=base.driving_profiles)
    laws = {name: law for name, law in fitted.items() if law.tracks}
    demand = assume_demand(intersection_map)
    hourly = np.array([sum(demand.vehicles[leg][h] for leg in demand.vehicles) for h in range(24)])
    simulated = hourly[list_demand_hours(len(present))]
    stay = float(np.sum(present) * 3600.0 / max(float(simulated.sum()), 1e-9))
    return replace(
        base,
        driving_profiles={**base.driving_profiles, **laws},
        counts=derive_counts(intersection_map, base.frequency, stay=stay),
    )
