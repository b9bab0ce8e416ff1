"""Reader of the Test Area Autonomous Driving Baden-Wuerttemberg data set (TAF-BW).

Real vehicles and pedestrians at two signalised intersections in Karlsruhe (Zipfl et al. 2020;
CC BY-NC-SA 4.0, for scientific research). The data are not part of this package: a path to one's
own copy is given. Read are `<site>_<date>/vehicle_tracks_NNN.csv` below that path. Speeds in the
files are not used: those of k733_2020-09-15 are 0.57 of what its positions say.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import AgentClass
from scenewright.scene.track import PEDESTRIAN, STEP, Shape, get_vehicle_shape
from scenewright.tools.track_io.cleaning import (
    CleaningReport,
    RawTrack,
    clean_track,
    measure_jitter,
)
from scenewright.tools.track_io.recording import RecordedAgent, Recording

SMOOTHING = 0.3
"""Of positions [s]: that of the simulated corpus, so that both pass the same filter."""
FINE = 0.02
"""Positions that jitter less (three in four samples) bear a second derivative [m].

At 0.02 m and 0.3 s the noise of the acceleration is 0.06 m/s^2 and that of the jerk 0.5 m/s^3 if
it is white, and a tracker's noise is not.
"""
_CLASSES: dict[str, tuple[AgentClass, str | None, Shape]] = {
    "Car": ("vehicle", "car", get_vehicle_shape("car")),
    "Truck": ("vehicle", "truck", get_vehicle_shape("truck")),
    "Bike": ("vehicle", "bicycle", Shape("vehicle", 1.8, 0.6)),
    "Pedestrian": ("pedestrian", None, PEDESTRIAN),
}
"""Sizes are ours: the files hold defaults, too."""
SETTLING: dict[str, dict[AgentClass, float]] = {
    "k729": {"vehicle": 3.0, "pedestrian": 1.5},
    "k733": {"vehicle": 1.0, "pedestrian": 1.0},
}
"""How long speeds rise from 0 after a first sample [s], by site: measured as the
median speed by time since the first sample."""


@dataclass(frozen=True, eq=False)
class RealTracks:
    """What was read.

    Attributes:
        recordings: one per file of tracks; no splits, no signals.
        removed: what cleaning took away, by site and date.
        jitter: of the positions before smoothing [m], the upper quartile, by site and date; sites
            without moving agents are not in it.
    """

    recordings: tuple[Recording, ...]
    removed: dict[str, CleaningReport]
    jitter: dict[str, float]

    @property
    def fine(self) -> tuple[Recording, ...]:
        """The recordings whose positions are good enough for accelerations."""
        good = {site for site, level in self.jitter.items() if level <= FINE}
        return tuple(r for r in self.recordings if r.name.split("/")[0] in good)


def read_taf_bw(folder: Path, *, smoothing: float = SMOOTHING) -> RealTracks:
    """All tracks below a folder, cleaned.

    Raises:
        InputError: there are none, or a file is not what it should be.
    """
    files = sorted(folder.rglob("vehicle_tracks_*.csv"))
    if not files:
        raise InputError(f"there are no vehicle_tracks_NNN.csv below {folder}")
    recordings: list[Recording] = []
    removed: dict[str, CleaningReport] = {}
    noise: dict[str, list[np.ndarray]] = {}
    for file in files:
        site = file.parent.name
        seen = list(_read_raw_tracks(file, site))
        noise.setdefault(site, []).extend(measure_jitter(each.xy) for _, each in seen)
        made, taken = _build_recording(f"{site}/{file.stem[-3:]}", seen, smoothing)
        recordings.append(made)
        removed[site] = removed.get(site, CleaningReport()) + taken
    moving = {site: np.concatenate([np.zeros(0), *parts]) for site, parts in noise.items()}
    levels = {site: float(np.quantile(n, 0.75)) for site, n in moving.items() if len(n)}
    return RealTracks(tuple(recordings), removed, levels)


def _build_recording(
    name: str, seen: list[tuple[str, RawTrack]], smoothing: float
) -> tuple[Recording, CleaningReport]:
    removed = CleaningReport()
    agents = [
        RecordedAgent(track, _CLASSES[word][2], _CLASSES[word][1], complete=False)
        for word, each in seen
        for track in clean_track(each, smoothing=smoothing, removed=removed)
    ]
    begin = min((float(each.time[0]) for _, each in seen), default=0.0)
    end = max((float(each.time[-1]) for _, each in seen), default=0.0)
    ordered = tuple(sorted(agents, key=lambda agent: agent.track.start))
    return Recording(name, begin, end, ordered), removed


def _read_raw_tracks(file: Path, site: str) -> Iterator[tuple[str, RawTrack]]:
    """Each track's class in the file and its samples, as they stand there."""
    rows: dict[str, list[dict[str, str]]] = {}
    try:
        with file.open(encoding="utf-8", newline="") as stream:
            for row in csv.DictReader(stream):
                rows.setdefault(row["track_id"], []).append(row)
        for track in rows.values():
            word = track[0]["agent_type"]
            kind = _CLASSES[word][0]
            time = np.array([int(row["timestamp_ms"]) / 1000 for row in track])
            xy = np.array([(float(row["x"]), float(row["y"])) for row in track])
            _, first = np.unique(np.rint(time / STEP), return_index=True)
            settling = SETTLING.get(site.split("_", maxsplit=1)[0], SETTLING["k733"])[kind]
            yield word, RawTrack(kind, time[first], xy[first], settling)
    except (OSError, KeyError, TypeError, ValueError) as fault:
        raise InputError(f"{file} is no file of TAF-BW tracks: {fault!r}") from fault
