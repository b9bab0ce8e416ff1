"""The corpus with everybody in it: recordings of whole hours, from which scenes can be cut.

The priors need trips one by one. A refiner needs scenes, and a judge of realism needs stops with
their cause: who was there together, and when. The hours are those of the corpus, with the same
seeds and in the same splits, and every trip of the corpus is here with its times. Beside the trips
stands whoever was there without making one, marked as not complete: still on the way when the hour
began, or cleaned away.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from scenewright.errors import InputError
from scenewright.intersections import find_bundle_folder, load_map
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap, Route
from scenewright.scene.track import PEDESTRIAN, STEP, Shape, Track, vehicle_shape
from scenewright.tools.map_import.four_leg_map import PLANS, FourLegPlan
from scenewright.tools.simulation.corpus import (
    DAYS,
    SPACING,
    SPLITS,
    TIME_BLUR,
    Progress,
    Trip,
    centres,
    cleaned_trip,
    footways_of,
    hour_seeds,
    raw_hour,
    smoothed,
    split_of,
)
from scenewright.tools.simulation.demand import HOURS, Demand, read_demand
from scenewright.tools.simulation.sumo_run import HOUR, WARM_UP, RawTrack
from scenewright.tools.track_io import RecordedAgent, Recording, Split, save_recordings

FEWEST_HOURS, MOST_HOURS = len(SPLITS), HOURS * DAYS
JAMMED = 180.0
"""No vehicle waits that long in one place [s], more than two cycles, while traffic flows."""
_CREEP = 0.15
"""Less progress than this in JAMMED is none [m]."""


def record_traffic(
    name: str, *, out: Path, hours: int = 15, seed: int = 0, progress: Progress | None = None
) -> tuple[Recording, ...]:
    """Simulate hours of an intersection's corpus and keep everybody's tracks in the file `out`.

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
    plan, place = PLANS[name], load_map(name)
    demand = read_demand(find_bundle_folder(name) / "demand.json")
    seeds = hour_seeds(seed)
    recordings = []
    for day, hour in spread_hours(hours):
        rng = np.random.default_rng(seeds[day, hour])
        made = record_hour(day, hour, plan=plan, place=place, demand=demand, rng=rng)
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
    if not FEWEST_HOURS <= count <= MOST_HOURS:
        raise InputError(f"a corpus has {FEWEST_HOURS} to {MOST_HOURS} hours, got {count}")
    chosen = [
        (_day_of(split, hour), hour)
        for split, share in _shares(count).items()
        for hour in _spread(share)
    ]
    return sorted(chosen)


def _shares(count: int) -> Mapping[Split, int]:
    """Hours of each split; none has more than the day has."""
    test = max(1, round(0.27 * count))
    validation = max(1, round(0.2 * count))
    fit = min(count - test - validation, HOURS)
    test = min(max(test, (count - fit + 1) // 2), HOURS)
    return {"fit": fit, "validation": count - fit - test, "test": test}


def _spread(count: int) -> list[int]:
    return [int((k + 0.5) * HOURS / count) for k in range(count)]


def _day_of(split: Split, hour: int) -> int:
    """The day on which an hour belongs to a split."""
    return next(day for day in range(DAYS) if split_of(day, hour) == split)


def record_hour(
    day: int,
    hour: int,
    *,
    plan: FourLegPlan,
    place: IntersectionMap,
    demand: Demand,
    rng: np.random.Generator,
) -> Recording:
    """One hour of the corpus with everybody who was inside the map."""
    raw, unseen = raw_hour(hour, plan=plan, place=place, demand=demand, rng=rng)
    half = {"vehicle": plan.extent, "pedestrian": plan.pedestrian_extent}
    agents = agents_of(place, raw, half=half, rng=rng)
    end = flows_until(agents)
    before = [agent for agent in agents if agent.track.start <= end]
    return Recording(
        name=f"{plan.name} day {day} hour {hour:02d}",
        begin=0.0,
        end=end,
        agents=tuple(sorted(before, key=lambda agent: agent.track.start)),
        split=split_of(day, hour),
        unseen=unseen,
        signal_time=None if place.signals is None else WARM_UP % place.signals.cycle,
    )


def agents_of(
    place: IntersectionMap,
    raw: Sequence[RawTrack],
    *,
    half: Mapping[str, float],
    rng: np.random.Generator,
) -> list[RecordedAgent]:
    """Everybody inside the map: cleaned trips, and what is there of tracks that are none.

    Args:
        half: by class, half the side of the square that counts [m].
    """
    routes, footways = {route.id: route for route in place.routes}, footways_of(place)
    agents: list[RecordedAgent] = []
    for track in raw:
        route = routes[track.route]
        trips = list(cleaned_trip(track, half[route.type], footways, rng))
        tracks = [track_of_trip(trip) for trip in trips] or list(
            _tracks_inside(track, half[route.type])
        )
        agents += [_agent(each, track.subtype, route, complete=bool(trips)) for each in tracks]
    return agents


def flows_until(agents: Sequence[RecordedAgent]) -> float:
    """When the first vehicle comes to a standstill from which it does not get away [s].

    Two vehicles that hook into one another in the simulation stand for good, and everybody behind
    them: of such an hour only what came before counts.
    """
    stuck = [start for agent in agents if (start := _stuck_from(agent)) is not None]
    return min([HOUR, *stuck])


def _stuck_from(agent: RecordedAgent) -> float | None:
    span, xy = round(JAMMED / STEP), agent.track.xy
    if agent.shape.type != "vehicle" or len(xy) <= span:
        return None
    held = np.linalg.norm(xy[span:] - xy[:-span], axis=1) < _CREEP
    return float(agent.track.times[int(np.argmax(held))]) if held.any() else None


def track_of_trip(trip: Trip) -> Track:
    """Where a trip is over time: its progress carried on to its path."""
    at = SPACING * np.arange(len(trip.path))
    xy = [np.interp(trip.progress, at, trip.path[:, axis]) for axis in (0, 1)]
    tangent = np.gradient(trip.path, axis=0)
    course = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    heading = np.interp(trip.progress, at, course)
    return Track(np.stack(xy, axis=1), heading, round(trip.start, 1))


def _tracks_inside(track: RawTrack, half: float) -> Iterator[Track]:
    """The stretches of an uncleaned track inside the map and the hour, two samples or longer."""
    kind = track.route.split(":")[0]
    xy: FloatArray = smoothed(centres(track), TIME_BLUR[kind])
    inside = (np.abs(xy).max(axis=1) <= half) & (track.time >= 0.0) & (track.time <= HOUR)
    edges = np.flatnonzero(np.diff(inside.astype(np.int8), prepend=0, append=0))
    for first, end in edges.reshape(-1, 2):
        if end - first >= 2:
            start = round(round(float(track.time[first]) / STEP) * STEP, 1)
            yield Track(xy[first:end], track.angle[first:end], start)


def _agent(track: Track, subtype: str | None, route: Route, *, complete: bool) -> RecordedAgent:
    shape: Shape = PEDESTRIAN if subtype is None else vehicle_shape(subtype)
    return RecordedAgent(
        track, shape, subtype, route.entry, route.exit, route.crosswalk, route.id, complete
    )
