"""A corpus for a map without data: SUMO traffic on it, and priors fitted on that.

Vehicles and people on foot are simulated together, under the map's signals. From the vehicles come
paths, speeds and numbers; from people only how fast they walk: where they walk between two kerbs is
a matter of the simulator's stripes, of which the map says more.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map import IntersectionMap
from scenewright.tools.fitting.derive_priors import (
    Lines,
    assumed_demand,
    assumed_frequency,
    derived_counts,
    derived_priors,
)
from scenewright.tools.fitting.fit_driving_profiles import fit_time_laws
from scenewright.tools.fitting.path_frame import (
    centreline,
    deviations,
    kind_of,
    pooled,
    shipped_pool,
)
from scenewright.tools.gmm_sampler.priors import Priors
from scenewright.tools.simulation.corpus import (
    Progress,
    Trip,
    cleaned_trip,
    footways_of,
    walked_trip,
)
from scenewright.tools.simulation.corpus_recordings import agents_of, flows_until
from scenewright.tools.simulation.sumo_custom_network import write_place
from scenewright.tools.simulation.sumo_pedestrians import sidewalks_of, walkers
from scenewright.tools.simulation.sumo_run import (
    WARM_UP,
    Departure,
    RawTrack,
    arrivals,
    read_tracks,
    run_sumo,
    vehicle_lines,
)
from scenewright.tools.track_io import Recording

HOURS_OF_DAY = (8, 18, 13, 22)
"""Whose demand is simulated, in this order and over again."""
PIECE = 600.0
"""How long traffic is simulated at one demand [s]."""
MOST_MINUTES = 240
_SUBTYPES = {"car": 0.88, "truck": 0.07, "motorcycle": 0.05}


_ASTRAY = 2.2
"""Who walks farther than this from the route on average [m] has taken another way."""


@dataclass(frozen=True, eq=False)
class SimulatedTraffic:
    """What a simulation on a map gave.

    Attributes:
        trips: whole ways of vehicles and of people on foot.
        present: [pieces] vehicles on the map on average.
        recordings: everybody's tracks, a recording for each piece; the last is for testing.
    """

    trips: tuple[Trip, ...]
    present: FloatArray
    recordings: tuple[Recording, ...]


def simulate_place(
    place: IntersectionMap,
    lines: Lines,
    *,
    minutes: int,
    seed: int,
    progress: Progress | None = None,
) -> SimulatedTraffic:
    """Traffic on a map in ten-minute pieces, each at the demand of another hour of the day.

    Args:
        lines: by route id, the middles of the ways that it may take [m].

    Raises:
        InputError: a time that cannot be, SUMO not installed, or no traffic gets through.
    """
    if not 10 <= minutes <= MOST_MINUTES:
        raise InputError(f"simulate 10 to {MOST_MINUTES} minutes, got {minutes}")
    trips: list[Trip] = []
    present, recordings = [], []
    hours = demand_hours(round(minutes * 60 / PIECE))
    for number, child in enumerate(np.random.SeedSequence(seed).spawn(len(hours))):
        rng = np.random.default_rng(child)
        raw = _piece(place, lines, hours[number], rng)
        made = _trips(place, lines, raw, rng)
        trips += made
        present.append(_present(place, raw))
        testing = number == len(hours) - 1 and number > 0
        recordings.append(_recording(place, number, hours[number], raw, rng, testing=testing))
        if progress is not None:
            on_foot = sum(each.subtype is None for each in made)
            progress(
                f"demand of {hours[number]:02d} h: {len(made) - on_foot} vehicles and {on_foot} "
                f"people got through, {present[-1]:.1f} vehicles at a time"
            )
    if not trips:
        raise InputError(f"no simulated vehicle got through {place.name}")
    return SimulatedTraffic(tuple(trips), np.array(present), tuple(recordings))


def demand_hours(pieces: int) -> list[int]:
    """The hours of the day whose demand each piece has."""
    return [HOURS_OF_DAY[n % len(HOURS_OF_DAY)] for n in range(pieces)]


def _piece(
    place: IntersectionMap, lines: Lines, hour: int, rng: np.random.Generator
) -> list[RawTrack]:
    """The raw tracks of one piece."""
    rates = {name: float(each[hour]) for name, each in assumed_frequency(place).items()}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        network = write_place(folder, place)
        on_foot = walkers(place, lines, rates, sidewalks_of(network), rng, seconds=PIECE)
        departures = [*_departures(place, hour, rng), *on_foot]
        departures.sort(key=lambda each: each.time)
        body = "\n".join(each.lines for each in departures)
        (folder / "agents.rou.xml").write_text(f"<routes>\n{body}\n</routes>\n", encoding="utf-8")
        crashed = run_sumo(
            folder, network, seed=int(rng.integers(1 << 30)), half=place.extent + 8.0, seconds=PIECE
        )
        return list(read_tracks(folder, {d.agent: d for d in departures}, crashed))


def _trips(
    place: IntersectionMap, lines: Lines, raw: Sequence[RawTrack], rng: np.random.Generator
) -> list[Trip]:
    """Whole ways: of vehicles from edge to edge, of people from end to end of their route."""
    footways, trips = footways_of(place), []
    for track in raw:
        if track.subtype is None:
            line = np.asarray(lines[track.route][0])
            walked = walked_trip(track, footways[track.route.split(":")[1]], rng)
            trips += [each for each in walked if _away(each.path, line) < _ASTRAY]
        elif (np.abs(track.xy).max(axis=1) <= place.extent).sum() > 2:
            trips += list(cleaned_trip(track, place.extent, {}, rng))
    return trips


def _away(path: FloatArray, line: FloatArray) -> float:
    """Mean distance of a path [P, 2] from a line [Q, 2] [m]."""
    return float(np.hypot(*(path[:, None] - line[None]).transpose(2, 0, 1)).min(axis=1).mean())


def _present(place: IntersectionMap, raw: Sequence[RawTrack]) -> float:
    """Vehicles on the map on average."""
    inside = [
        (np.abs(each.xy).max(axis=1) <= place.extent) & (each.time >= 0) & (each.time < PIECE)
        for each in raw
        if each.subtype is not None
    ]
    return 0.1 * float(sum(each.sum() for each in inside)) / PIECE


def _recording(
    place: IntersectionMap,
    number: int,
    hour: int,
    raw: Sequence[RawTrack],
    rng: np.random.Generator,
    *,
    testing: bool,
) -> Recording:
    """Everybody of a piece who was on the map, up to where traffic jams for good."""
    agents = agents_of(
        place, raw, half={"vehicle": place.extent, "pedestrian": place.extent}, rng=rng
    )
    end = min(flows_until(agents), PIECE)
    return Recording(
        name=f"{place.name} piece {number} hour {hour:02d}",
        begin=0.0,
        end=end,
        agents=tuple(sorted(agents, key=lambda each: each.track.start)),
        split="test" if testing else "fit",
        signal_time=None if place.signals is None else WARM_UP % place.signals.cycle,
    )


def _departures(place: IntersectionMap, hour: int, rng: np.random.Generator) -> list[Departure]:
    rates = assumed_frequency(place)
    movements = {m.id: m for m in place.movements}
    lane = min(x.width for x in place.lanelets if x.kind != "connector")
    made = []
    for number, route in enumerate(r for r in place.routes if r.type == "vehicle"):
        for count, time in enumerate(arrivals(float(rates[route.id][hour]), rng, seconds=PIECE)):
            subtype = str(rng.choice(list(_SUBTYPES), p=list(_SUBTYPES.values())))
            agent = f"v_{number}_{count}"
            lines = vehicle_lines(
                movements[str(route.movement_id)],
                lane=max(lane, 2.8),
                agent=agent,
                subtype=subtype,
                time=float(time),
                rng=rng,
            )
            made.append(Departure(float(time), lines, agent, route.id, subtype))
    return made


def fitted_priors(
    place: IntersectionMap, lines: Lines, trips: Sequence[Trip], present: FloatArray
) -> Priors:
    """All priors of a map from simulated trips; what they do not tell is derived."""
    by_route: dict[str, list[Trip]] = {route.id: [] for route in place.routes}
    for trip in trips:
        by_route[trip.route].append(trip)
    tracks = {
        name: np.array([t.waypoints() for t in own if t.subtype is not None]).reshape(-1, K, 2)
        for name, own in by_route.items()
    }
    base = derived_priors(place, lines, tracks=tracks, pool=own_pool(place, lines, tracks))
    laws = {
        name: law
        for name, law in fit_time_laws(place, by_route, fallback=base.driving_profiles).items()
        if law.tracks
    }
    demand = assumed_demand(place)
    hourly = np.array([sum(demand.vehicles[leg][h] for leg in demand.vehicles) for h in range(24)])
    simulated = hourly[demand_hours(len(present))]
    stay = float(np.sum(present) * 3600.0 / max(float(simulated.sum()), 1e-9))
    counts, instants = derived_counts(place, base.frequency, stay=stay)
    return replace(
        base,
        driving_profiles={**base.driving_profiles, **laws},
        counts=counts,
        instants=instants,
    )


def own_pool(
    place: IntersectionMap, lines: Lines, tracks: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    """The pool of an intersection's own tracks, leaning on the shipped one."""
    groups: dict[str, list[FloatArray]] = {}
    for route in place.routes:
        own = tracks.get(route.id)
        if own is None or not len(own) or route.movement == "jaywalking":
            continue
        away, _ = deviations(own, [centreline(line) for line in lines[route.id]])
        groups.setdefault(kind_of(route), []).append(away - away.mean(axis=0))
    return pooled(groups, shipped_pool())
