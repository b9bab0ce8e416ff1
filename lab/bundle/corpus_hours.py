"""The corpus that priors are fitted on: simulated days of clean trips, kept hour by hour.

Each simulated hour of each day belongs wholly to one of fit, validation and test; with three days
every hour of the day occurs once in each.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lab.bundle.four_leg_network import write_network
from lab.bundle.four_leg_plan import FourLegPlan
from lab.bundle.four_leg_traffic import simulate_hour
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.tools.simulation.corpus import (
    Progress,
    Trip,
    build_footways,
    clean_trip,
)
from scenewright.tools.simulation.sumo_run import HOURS, Demand, SumoTrack, read_collided
from scenewright.tools.track_io.recording import Split

SPLITS: tuple[Split, ...] = ("fit", "validation", "test")
DAYS = 3


@dataclass(frozen=True, eq=False)
class CorpusHour:
    """One simulated hour.

    Attributes:
        trips: complete paths through the map.
        presence: [A, 3] class (0 vehicle, 1 pedestrian), first and last time inside [s], of
            all agents, complete or not.
    """

    day: int
    hour: int
    trips: tuple[Trip, ...]
    presence: FloatArray

    @property
    def split(self) -> Split:
        """Which part of the corpus this hour belongs to."""
        return assign_split(self.day, self.hour)


def assign_split(day: int, hour: int) -> Split:
    """Which part of the corpus an hour of a day belongs to."""
    return SPLITS[(hour + day) % len(SPLITS)]


def spawn_hour_seeds(
    seed: int, *, days: int = DAYS
) -> dict[tuple[int, int], np.random.SeedSequence]:
    """The seed of every hour of every day; further days leave those of the first as they are."""
    hours = [(day, hour) for day in range(days) for hour in range(HOURS)]
    return dict(zip(hours, np.random.SeedSequence(seed).spawn(len(hours)), strict=True))


def build_corpus(
    folder: Path,
    *,
    plan: FourLegPlan,
    intersection_map: IntersectionMap,
    demand: Demand,
    seed: int = 0,
    days: int = DAYS,
    progress: Progress | None = None,
) -> list[CorpusHour]:
    """Simulate every hour of `days` days; hours already in `folder` are read, not repeated."""
    folder.mkdir(parents=True, exist_ok=True)
    corpus: list[CorpusHour] = []
    for (day, hour), child in spawn_hour_seeds(seed, days=days).items():
        file = folder / f"day{day}_hour{hour:02d}.npz"
        if not file.is_file():
            rng = np.random.default_rng(child)
            made = _simulate_and_clean_hour(
                day, hour, plan=plan, intersection_map=intersection_map, demand=demand, rng=rng
            )
            save_hour(file, made)
        corpus.append(load_hour(file))
        if progress is not None:
            progress(f"day {day + 1}, hour {hour:02d}: {len(corpus[-1].trips)} trips")
    return corpus


def _simulate_and_clean_hour(
    day: int,
    hour: int,
    *,
    plan: FourLegPlan,
    intersection_map: IntersectionMap,
    demand: Demand,
    rng: np.random.Generator,
) -> CorpusHour:
    raw, _ = simulate_raw_hour(
        hour, plan=plan, intersection_map=intersection_map, demand=demand, rng=rng
    )
    footways = build_footways(intersection_map)
    trips: list[Trip] = []
    presence: list[tuple[float, float, float]] = []
    for track in raw:
        kind = track.route.split(":")[0]
        half = plan.extent if kind == "vehicle" else plan.pedestrian_extent
        inside = track.time[np.abs(track.xy).max(axis=1) <= half]
        if len(inside):
            presence.append((float(kind == "pedestrian"), float(inside[0]), float(inside[-1])))
            trips += clean_trip(track, half, footways, rng)
    return CorpusHour(day, hour, tuple(trips), np.array(presence).reshape(-1, 3))


def save_hour(file: Path, hour: CorpusHour) -> None:
    """Keep one hour as plain arrays."""
    trips = hour.trips
    partial = file.with_suffix(".partial.npz")
    np.savez_compressed(
        partial,
        when=np.array([hour.day, hour.hour]),
        presence=hour.presence,
        route=np.array([trip.route for trip in trips], dtype=np.str_),
        subtype=np.array([trip.subtype or "" for trip in trips], dtype=np.str_),
        start=np.array([trip.start for trip in trips]),
        path=_join([trip.path for trip in trips], (0, 2)),
        path_length=np.array([len(trip.path) for trip in trips], dtype=np.int64),
        progress=_join([trip.progress for trip in trips], (0,)),
        progress_length=np.array([len(trip.progress) for trip in trips], dtype=np.int64),
    )
    partial.replace(file)


def _join(arrays: list[FloatArray], empty: tuple[int, ...]) -> NDArray[np.float32]:
    joined = np.concatenate(arrays) if arrays else np.zeros(empty)
    return joined.astype(np.float32)


def load_hour(file: Path) -> CorpusHour:
    """One hour from its file."""
    with np.load(file, allow_pickle=False) as stored:
        paths = np.split(stored["path"].astype(float), np.cumsum(stored["path_length"])[:-1])
        progress = np.split(
            stored["progress"].astype(float), np.cumsum(stored["progress_length"])[:-1]
        )
        trips = tuple(
            Trip(str(route), str(subtype) or None, path, along, float(start))
            for route, subtype, path, along, start in zip(
                stored["route"], stored["subtype"], paths, progress, stored["start"], strict=False
            )
        )
        day, hour = (int(n) for n in stored["when"])
        return CorpusHour(day, hour, trips, stored["presence"])


def simulate_raw_hour(
    hour: int,
    *,
    plan: FourLegPlan,
    intersection_map: IntersectionMap,
    demand: Demand,
    rng: np.random.Generator,
) -> tuple[list[SumoTrack], int]:
    """The tracks that SUMO records in one hour of the day, and how many agents collided."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        network = write_network(folder, plan, intersection_map)
        raw = simulate_hour(
            folder,
            network,
            plan=plan,
            intersection_map=intersection_map,
            demand=demand,
            hour=hour,
            rng=rng,
        )
        return raw, len(read_collided(folder))
