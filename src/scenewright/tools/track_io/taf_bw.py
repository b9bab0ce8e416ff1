"""Reader of the Test Area Autonomous Driving Baden-Wuerttemberg data set (TAF-BW).

Real vehicles and pedestrians at two signalised intersections in Karlsruhe (Zipfl et al. 2020;
CC BY-NC-SA 4.0, for scientific research). The data are not part of this package: a path to one's
own copy is given. Read are `<site>_<date>/vehicle_tracks_NNN.csv` below that path. Speeds in the
files are not used: those of k733_2020-09-15 are 0.57 of what its positions say.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import AgentClass
from scenewright.scene.track import PEDESTRIAN, STEP, Shape, get_vehicle_shape
from scenewright.tools.formats.csv_tracks import read_columns
from scenewright.tools.track_io.cleaning import CleaningReport, RawTrack, clean_track
from scenewright.tools.track_io.dataset_formats import TIMED
from scenewright.tools.track_io.recording import RecordedAgent, Recording

SMOOTHING = 0.3
"""Of positions [s]: that of the simulated corpus, so that both pass the same filter."""
_SHAPES = {each: get_vehicle_shape(each) for each in ("car", "truck")}
_SHAPES |= {"bicycle": Shape("vehicle", 1.8, 0.6), "pedestrian": PEDESTRIAN}
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
    """

    recordings: tuple[Recording, ...]
    removed: dict[str, CleaningReport]


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

    for file in files:
        site = file.parent.name
        seen = list(_read_raw_tracks(file, site))
        taken = removed.setdefault(site, CleaningReport())
        agents = [
            RecordedAgent(
                track, _SHAPES[word], None if word == "pedestrian" else word, complete=False
            )
            for word, each in seen
            for track in clean_track(each, smoothing=smoothing, removed=taken)
        ]
        begin = min((float(each.time[0]) for _, each in seen), default=0.0)
        end = max((float(each.time[-1]) for _, each in seen), default=0.0)
        ordered = tuple(sorted(agents, key=lambda agent: agent.track.start))
        recordings.append(Recording(f"{site}/{file.stem[-3:]}", begin, end, ordered))
    return RealTracks(tuple(recordings), removed)


def _read_raw_tracks(file: Path, site: str) -> Iterator[tuple[str, RawTrack]]:
    """Each track's subtype and its samples, as they stand in the file."""
    try:
        with file.open(encoding="utf-8", newline="") as stream:
            agents = read_columns(stream, name=str(file), columns=TIMED).agents
    except (OSError, UnicodeDecodeError) as fault:
        raise InputError(f"{file} is no file of TAF-BW tracks: {fault!r}") from fault
    for agent in agents:
        if agent.subtype not in _SHAPES:
            raise InputError(f"{file} is no file of TAF-BW tracks: it has a {agent.subtype}")
        kind = _SHAPES[agent.subtype].type
        _, first = np.unique(np.rint(agent.t / STEP), return_index=True)
        settling = SETTLING.get(site.split("_", maxsplit=1)[0], SETTLING["k733"])[kind]
        yield agent.subtype, RawTrack(kind, agent.t[first], agent.xy[first], settling)
