"""A corpus for a map without data: SUMO traffic on it, and priors fitted on that.

Vehicles are simulated. People on foot keep the priors derived from the map: what a simulated
walker does between two kerbs says nothing that the map does not.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map import IntersectionMap
from scenewright.tools.gmm_sampler.corpus import Progress, Trip, cleaned_trip
from scenewright.tools.gmm_sampler.derived import (
    Lines,
    assumed_demand,
    assumed_frequency,
    derived_counts,
    derived_priors,
)
from scenewright.tools.gmm_sampler.moving import (
    centreline,
    deviations,
    kind_of,
    pooled,
    shipped_pool,
)
from scenewright.tools.gmm_sampler.priors import Priors
from scenewright.tools.gmm_sampler.simulate import (
    Departure,
    arrivals,
    read_tracks,
    run_sumo,
    vehicle_lines,
)
from scenewright.tools.gmm_sampler.sumo_place import write_place
from scenewright.tools.gmm_sampler.time_law_fit import fit_time_laws

HOURS_OF_DAY = (8, 18, 13, 22)
"""Whose demand is simulated, in this order and over again."""
PIECE = 600.0
"""How long traffic is simulated at one demand [s]."""
MOST_MINUTES = 240
_SUBTYPES = {"car": 0.88, "truck": 0.07, "motorcycle": 0.05}


def simulated_trips(
    place: IntersectionMap, *, minutes: int, seed: int, progress: Progress | None = None
) -> tuple[list[Trip], FloatArray]:
    """Complete trips of vehicles, and [pieces] vehicles present on average, in ten-minute pieces.

    Raises:
        InputError: a time that cannot be, SUMO not installed, or no traffic gets through.
    """
    if not 10 <= minutes <= MOST_MINUTES:
        raise InputError(f"simulate 10 to {MOST_MINUTES} minutes, got {minutes}")
    trips: list[Trip] = []
    present = []
    hours = demand_hours(round(minutes * 60 / PIECE))
    for hour, child in zip(hours, np.random.SeedSequence(seed).spawn(len(hours)), strict=True):
        made, mean = _piece(place, hour, np.random.default_rng(child))
        trips += made
        present.append(mean)
        if progress is not None:
            progress(f"demand of {hour:02d} h: {len(made)} trips, {mean:.1f} vehicles at a time")
    if not trips:
        raise InputError(f"no simulated vehicle got through {place.name}")
    return trips, np.array(present)


def demand_hours(pieces: int) -> list[int]:
    """The hours of the day whose demand each piece has."""
    return [HOURS_OF_DAY[n % len(HOURS_OF_DAY)] for n in range(pieces)]


def _piece(place: IntersectionMap, hour: int, rng: np.random.Generator) -> tuple[list[Trip], float]:
    departures = list(_departures(place, hour, rng))
    departures.sort(key=lambda each: each.time)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        network = write_place(folder, place)
        body = "\n".join(each.lines for each in departures)
        (folder / "agents.rou.xml").write_text(f"<routes>\n{body}\n</routes>\n", encoding="utf-8")
        crashed = run_sumo(
            folder, network, seed=int(rng.integers(1 << 30)), half=place.extent + 8.0, seconds=PIECE
        )
        raw = list(read_tracks(folder, {d.agent: d for d in departures}, crashed))
    trips: list[Trip] = []
    seconds = 0.0
    for track in raw:
        inside = (np.abs(track.xy).max(axis=1) <= place.extent) & (track.time >= 0)
        seconds += 0.1 * float((inside & (track.time < PIECE)).sum())
        if inside.sum() > 2:
            trips += list(cleaned_trip(track, place.extent, {}, rng))
    return trips, seconds / PIECE


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
        name: np.array([t.waypoints() for t in own]).reshape(-1, K, 2)
        for name, own in by_route.items()
    }
    base = derived_priors(place, lines, tracks=tracks, pool=own_pool(place, lines, tracks))
    laws = {
        name: law
        for name, law in fit_time_laws(place, by_route, fallback=base.time_laws).items()
        if law.tracks
    }
    demand = assumed_demand(place)
    hourly = np.array([sum(demand.vehicles[leg][h] for leg in demand.vehicles) for h in range(24)])
    simulated = hourly[demand_hours(len(present))]
    stay = float(np.sum(present) * 3600.0 / max(float(simulated.sum()), 1e-9))
    counts, instants = derived_counts(place, base.frequency, stay=stay)
    return replace(
        base,
        time_laws={**base.time_laws, **laws},
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
