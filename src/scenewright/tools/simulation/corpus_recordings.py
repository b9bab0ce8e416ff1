"""The corpus with all agents in it: recordings of whole hours, from which scenes can be cut.

The priors need trips one by one. A refiner needs scenes, and an evaluation of realism needs stops
with their cause: which agents were there together, and when. The hours are those of the corpus,
with the same seeds and in the same splits, and every trip of the corpus is here with its times.
Agents without a trip are here too, marked as not complete: still under way when the hour began, or
removed by the cleaning.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.polyline import interpolate_points, smooth_gaussian
from scenewright.intersections import find_bundle_folder, load_map
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap, Route
from scenewright.scene.track import PEDESTRIAN, STEP, Shape, Track, get_vehicle_shape
from scenewright.tools.simulation.corpus import (
    DAYS,
    SPACING,
    SPLITS,
    TIME_BLUR,
    Progress,
    Trip,
    assign_split,
    build_footways,
    clean_trip,
    compute_centres,
    simulate_raw_hour,
    spawn_hour_seeds,
)
from scenewright.tools.simulation.demand import HOURS, Demand, read_demand
from scenewright.tools.simulation.four_leg_plan import PLANS, FourLegPlan
from scenewright.tools.simulation.sumo_run import HOUR, WARM_UP, SumoTrack
from scenewright.tools.track_io import RecordedAgent, Recording, Split, save_recordings

_MIN_HOURS, _MAX_HOURS = len(SPLITS), HOURS * DAYS
_JAMMED = 180.0
"""No vehicle waits that long in one place [s], more than two cycles, while traffic flows."""
_CREEP = 0.15
"""Less progress than this in _JAMMED is none [m]."""


def record_traffic(
    name: str, *, out: Path, hours: int = 15, seed: int = 0, progress: Progress | None = None
) -> tuple[Recording, ...]:
    """Simulate hours of an intersection's corpus and write the tracks of all agents to `out`.

    Args:
        hours: how many, spread over the day; about half of them for fitting, a quarter each for
            validation (a little less) and test (a little more).
        seed: of the simulation; the bundle's own corpus has the one its `bundle.toml` names.

    Raises:
        InputError: unknown name, a number of hours that cannot be, SUMO not installed, or a place
            that cannot be written.
    """
    if name not in PLANS:
        raise InputError(f"no plan to build {name!r} from; there are: {', '.join(sorted(PLANS))}")
    plan, intersection_map = PLANS[name], load_map(name)
    demand = read_demand(find_bundle_folder(name) / "demand.json")
    seeds = spawn_hour_seeds(seed)
    recordings = []
    for day, hour in spread_hours(hours):
        rng = np.random.default_rng(seeds[day, hour])
        made = record_hour(
            day, hour, plan=plan, intersection_map=intersection_map, demand=demand, rng=rng
        )
        recordings.append(made)
        if progress is not None:
            progress(f"{made.name}: {len(made.agents)} agents, {made.split}")
    save_recordings(out, recordings)
    return tuple(recordings)


def spread_hours(count: int) -> list[tuple[int, int]]:
    """Days and hours of a corpus of `count` hours: each split's spread evenly over the day.

    Raises:
        InputError: fewer hours than splits, or more than there are.
    """
    if not _MIN_HOURS <= count <= _MAX_HOURS:
        raise InputError(f"a corpus has {_MIN_HOURS} to {_MAX_HOURS} hours, got {count}")
    chosen = [
        (_find_day(split, hour), hour)
        for split, share in _share_hours(count).items()
        for hour in _spread_evenly(share)
    ]
    return sorted(chosen)


def _share_hours(count: int) -> Mapping[Split, int]:
    """Hours of each split; none has more than the day has."""
    test = max(1, round(0.27 * count))
    validation = max(1, round(0.2 * count))
    fit = min(count - test - validation, HOURS)
    test = min(max(test, (count - fit + 1) // 2), HOURS)
    return {"fit": fit, "validation": count - fit - test, "test": test}


def _spread_evenly(count: int) -> list[int]:
    return [int((k + 0.5) * HOURS / count) for k in range(count)]


def _find_day(split: Split, hour: int) -> int:
    """The day on which an hour belongs to a split."""
    return next(day for day in range(DAYS) if assign_split(day, hour) == split)


def record_hour(
    day: int,
    hour: int,
    *,
    plan: FourLegPlan,
    intersection_map: IntersectionMap,
    demand: Demand,
    rng: np.random.Generator,
) -> Recording:
    """One hour of the corpus with all agents inside the map."""
    raw, unseen = simulate_raw_hour(
        hour, plan=plan, intersection_map=intersection_map, demand=demand, rng=rng
    )
    half = {"vehicle": plan.extent, "pedestrian": plan.pedestrian_extent}
    agents = build_agents(intersection_map, raw, half=half, rng=rng)
    end = find_jam_time(agents)
    before = [agent for agent in agents if agent.track.start <= end]
    return Recording(
        name=f"{plan.name} day {day} hour {hour:02d}",
        begin=0.0,
        end=end,
        agents=tuple(sorted(before, key=lambda agent: agent.track.start)),
        split=assign_split(day, hour),
        unseen=unseen,
        signal_time=None
        if intersection_map.signals is None
        else WARM_UP % intersection_map.signals.cycle,
    )


def build_agents(
    intersection_map: IntersectionMap,
    raw: Sequence[SumoTrack],
    *,
    half: Mapping[str, float],
    rng: np.random.Generator,
) -> list[RecordedAgent]:
    """All agents inside the map: cleaned trips, and the pieces of other tracks.

    Args:
        half: by class, half the side of the square that counts [m].
    """
    routes, footways = (
        {route.id: route for route in intersection_map.routes},
        build_footways(intersection_map),
    )
    agents: list[RecordedAgent] = []
    for track in raw:
        route = routes[track.route]
        trips = list(clean_trip(track, half[route.type], footways, rng))
        tracks = [build_track(trip) for trip in trips] or list(_cut_tracks(track, half[route.type]))
        agents += [
            _build_agent(each, track.subtype, route, complete=bool(trips)) for each in tracks
        ]
    return agents


def find_jam_time(agents: Sequence[RecordedAgent]) -> float:
    """When the first vehicle comes to a standstill that does not end [s].

    Two vehicles that block one another in the simulation never move again, nor does the traffic
    behind them: of such an hour only the time before counts.
    """
    stuck = [start for agent in agents if (start := _find_standstill(agent)) is not None]
    return min([HOUR, *stuck])


def _find_standstill(agent: RecordedAgent) -> float | None:
    span, xy = round(_JAMMED / STEP), agent.track.xy
    if agent.shape.type != "vehicle" or len(xy) <= span:
        return None
    held = np.linalg.norm(xy[span:] - xy[:-span], axis=1) < _CREEP
    return float(agent.track.times[int(np.argmax(held))]) if held.any() else None


def build_track(trip: Trip) -> Track:
    """The track of a trip: its progress mapped to its path."""
    at = np.asarray(SPACING * np.arange(len(trip.path)), dtype=np.float64)
    tangent = np.gradient(trip.path, axis=0)
    course = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    heading = np.interp(trip.progress, at, course)
    return Track(interpolate_points(trip.progress, at, trip.path), heading, round(trip.start, 1))


def _cut_tracks(track: SumoTrack, half: float) -> Iterator[Track]:
    """The stretches of an uncleaned track inside the map and the hour, two samples or longer."""
    kind = track.route.split(":")[0]
    xy: FloatArray = smooth_gaussian(compute_centres(track), TIME_BLUR[kind])
    inside = (np.abs(xy).max(axis=1) <= half) & (track.time >= 0.0) & (track.time <= HOUR)
    edges = np.flatnonzero(np.diff(inside.astype(np.int8), prepend=0, append=0))
    for first, end in edges.reshape(-1, 2):
        if end - first >= 2:
            start = round(round(float(track.time[first]) / STEP) * STEP, 1)
            yield Track(xy[first:end], track.angle[first:end], start)


def _build_agent(
    track: Track, subtype: str | None, route: Route, *, complete: bool
) -> RecordedAgent:
    shape: Shape = PEDESTRIAN if subtype is None else get_vehicle_shape(subtype)
    return RecordedAgent(
        track, shape, subtype, route.entry, route.exit, route.crosswalk, route.id, complete
    )
