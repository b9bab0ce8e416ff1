"""Tracks of one's own: TAF-BW, inD-style, SUMO FCD, TrajNet++, VTP-TL, simulators', any CSV.

Whatever the format, what comes out are rows of one agent each, at 10 Hz, cleaned like any real
tracks. Columns, classes and units are stated by the format or by the user; nothing is guessed but
the class synonyms below.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.track import STEP, Track
from scenewright.tools.formats.csv_tracks import read_columns
from scenewright.tools.formats.registry import find_reader, read_scenarios
from scenewright.tools.formats.sample_table import SampleTable
from scenewright.tools.formats.sampled_recording import SUBTYPES, AgentSamples, find_subtype
from scenewright.tools.track_io.cleaning import CleaningReport, RawTrack, clean_track
from scenewright.tools.track_io.dataset_formats import (
    PATTERNS,
    TIMED,
    DatasetFormat,
    find_columns,
    find_partner,
    get_format,
)
from scenewright.tools.track_io.taf_bw import SETTLING

MOST_BYTES = 400_000_000
SMOOTHING = 0.3
"""Of positions [s], as for every real track."""
_KNOWN = (
    *PATTERNS, "vehicle_tracks_*.csv", "*_tracks.csv", "*.ndjson", "*fcd*.xml", "DJI_*.txt",
    "*.xosc", "*.cr.xml", "sd_*.pkl", "*.tfrecord*", "scenario_*.parquet", "*.mcap",
)  # fmt: skip
"""Names of the files of tracks in a folder."""
_LONGEST_GAP = 0.6
"""Samples farther apart are a gap [s]; 2.5 Hz, the coarsest of the formats, is 0.4."""


@dataclass(frozen=True, eq=False)
class FileTracks:
    """What was read of one file.

    Attributes:
        tracks: (subtype, track), cleaned, in the frame of the file [m].
        removed: what cleaning took away.
        begin: time of day at time 0 [h]; None where the file does not say.
        origin: latitude and longitude of the file's frame [deg]; None where it does not say.
        span: time from the first to the last sample [s].
    """

    name: str
    tracks: tuple[tuple[str, Track], ...]
    removed: CleaningReport
    begin: float | None
    origin: tuple[float, float] | None
    span: float

    @property
    def session(self) -> str:
        """What files of one recording have in common: the name up to its last slash."""
        return self.name.rsplit("/", 1)[0]


def read_track_files(
    paths: Sequence[str | Path],
    *,
    columns: Mapping[str, str] | None = None,
    scale: float | None = None,
    named: str | None = None,
) -> list[FileTracks]:
    """The tracks of files, or of every file of a known kind in folders.

    Args:
        columns: for a CSV of any kind: its columns by our names t, id, class, x, y; `class` may be
            missing or be a constant such as `=car`, `t` may be a frame as `frame/25`.
        named: the data set that the files are of, where their names do not show it (`FORMATS`).
        scale: metres per pixel, where positions are pixels of an image whose y points down.

    Raises:
        InputError: nothing there, or a file that cannot be read; the line is named.
    """
    if scale is not None and not 1e-4 < scale < 10.0:
        raise InputError(f"a scale is metres per pixel, such as 0.06, got {scale:g}")
    dataset = None if named is None else get_format(named)
    patterns = _KNOWN if dataset is None else [glob for glob, _ in dataset.files]
    files: list[Path] = []
    for path in map(Path, paths):
        if not path.exists():
            raise InputError(f"cannot read {path}: there is no such file or folder")
        inside = {file for pattern in patterns for file in path.rglob(pattern)}
        files += [path] if path.is_file() else sorted(inside)
    # Pedestrians whose file lies beside that of the vehicles belong to the same recording.
    beside = {find_partner(file) for file in files}
    files = [file for file in files if file not in beside]
    if not files:
        raise InputError(f"no tracks in {', '.join(map(str, paths))[:200]}")
    return [tracks for file in files for tracks in _read(file, columns, scale, dataset)]


def _read(
    file: Path,
    columns: Mapping[str, str] | None,
    scale: float | None,
    dataset: DatasetFormat | None = None,
) -> Iterator[FileTracks]:
    """The tracks of a file; one entry for each scenario of a simulator's file."""
    if file.stat().st_size > MOST_BYTES:
        raise InputError(f"{file} is larger than {MOST_BYTES / 1e6:.0f} MB; cut it into parts")
    settling: Mapping[AgentClass, float] = {"vehicle": 0.0, "pedestrian": 0.0}
    begin: float | None = None
    origin: tuple[float, float] | None = None
    agents: Sequence[AgentSamples]
    try:
        if columns is None and file.suffix != ".csv" and find_reader(file.name) is not None:
            yield from _read_scenarios(file)
            return
        mapping = find_columns(file, dataset) if columns is None else columns
        if mapping is not None:
            agents = _read_mapped_csv(file, mapping)
        elif file.name.startswith("vehicle_tracks_"):
            agents = _read_mapped_csv(file, TIMED)
            site, begin, origin = _read_taf_meta(file)
            settling = SETTLING.get(site, SETTLING["k733"])
        elif file.name.endswith("_tracks.csv"):
            agents, begin, origin = _read_ind(file)
        elif file.suffix == ".txt":
            agents = _read_vtp(file)
        elif file.suffix == ".csv":
            agents = _read_mapped_csv(file, None)
        else:
            raise InputError(
                f"{file} is of no kind that is known; name its --columns if it is a CSV"
            )
    except UnicodeDecodeError:
        raise InputError(f"{file} is no UTF-8 text") from None
    except OSError as fault:
        raise InputError(f"cannot read {file}: {fault.strerror or fault}") from None
    agents = agents if columns is not None else _add_partner(agents, file, dataset)
    if scale is not None:
        agents = [replace(agent, xy=agent.xy * [scale, -scale]) for agent in agents]
    elif columns is None and file.suffix == ".txt":
        raise InputError(
            f"positions of {file} are pixels; say metres per pixel with --scale, or --pool-scale"
        )
    yield _clean(file, agents, settling, begin, origin)


def _add_partner(
    agents: Sequence[AgentSamples], file: Path, dataset: DatasetFormat | None
) -> Sequence[AgentSamples]:
    """The agents of a file of vehicles, with those of the pedestrians' file beside it."""
    partner = find_partner(file)
    if partner is None:
        return agents
    return [*agents, *_read_mapped_csv(partner, find_columns(partner, dataset) or TIMED)]


def _read_scenarios(file: Path) -> Iterator[FileTracks]:
    """The scenarios of a file of a simulator or motion dataset; its clock is no time of day."""
    more = {"predictions": "leave out"} if file.suffix == ".ndjson" else {}
    for recording in read_scenarios(file.read_bytes(), name=str(file), **more):
        agents = [replace(agent, t=agent.t * recording.unit) for agent in recording.agents]
        tracks = _clean(file, agents, {"vehicle": 0.0, "pedestrian": 0.0}, None, None)
        yield replace(tracks, name=f"{tracks.name}:{recording.name}".rstrip(":"))


_VTP_RATE = 30.0
"""Frames a second of VTP-TL; assumed, as its authors do not state it."""


def _read_vtp(file: Path) -> Sequence[AgentSamples]:
    """VTP-TL: rows of frame, agent, x and y in pixels, and more that says nothing of motion."""
    table = SampleTable(str(file))
    with file.open(encoding="utf-8") as stream:
        for number, line in enumerate(stream, start=1):
            if not line.strip():
                continue
            try:
                frame, name, x, y = (float(word) for word in line.split()[:4])
                if not all(map(math.isfinite, (frame, name, x, y))):
                    raise ValueError
            except ValueError:
                raise InputError(
                    f"{file}, line {number}: expected frame, agent, x, y, got {line[:40].strip()!r}"
                ) from None
            table.add(number, str(name), "car", {"t": frame / _VTP_RATE, "x": x, "y": y})
    return table.list_agents()


def _clean(
    file: Path,
    agents: Sequence[AgentSamples],
    settling: Mapping[AgentClass, float],
    begin: float | None,
    origin: tuple[float, float] | None,
) -> FileTracks:
    removed = CleaningReport()
    found: list[tuple[str, Track]] = []
    for agent in agents:
        kind: AgentClass = "pedestrian" if agent.subtype == "pedestrian" else "vehicle"
        for time, xy in _resample(agent):
            seen = RawTrack(kind, time, xy, settling[kind])
            found += [
                (agent.subtype, t) for t in clean_track(seen, smoothing=SMOOTHING, removed=removed)
            ]
    times = [t for agent in agents for t in (float(agent.t.min()), float(agent.t.max()))]
    span = max(times) - min(times) if times else 0.0
    first = None if begin is None or not times else begin
    return FileTracks(f"{file.parent.name}/{file.name}", tuple(found), removed, first, origin, span)


def _resample(agent: AgentSamples) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Stretches without a gap, at multiples of 0.1 s; a second sample at one time is dropped."""
    order = np.argsort(agent.t, kind="stable")
    t, xy = agent.t[order], agent.xy[order]
    kept = np.concatenate([[True], np.diff(t) > 1e-4])
    t, xy = t[kept], xy[kept]
    for part in np.split(np.arange(len(t)), np.flatnonzero(np.diff(t) > _LONGEST_GAP) + 1):
        if len(part) < 4:
            continue
        grid = np.arange(
            math.ceil(t[part[0]] / STEP - 1e-6), math.floor(t[part[-1]] / STEP + 1e-6) + 1
        )
        grid = grid * STEP
        if len(grid) >= 4:
            even = [np.interp(grid, t[part], xy[part, axis]) for axis in (0, 1)]
            yield grid, np.stack(even, axis=1)


def _read_mapped_csv(file: Path, columns: Mapping[str, str] | None) -> tuple[AgentSamples, ...]:
    """Rows of a CSV whose columns are named; `name/25` divides, `=word` is a constant."""
    if columns is not None and (missing := {"t", "id", "x", "y"} - columns.keys()):
        raise InputError(
            f"--columns lacks {', '.join(sorted(missing))}: name t, id, class, x and y"
        )
    with file.open(encoding="utf-8-sig", newline="") as stream:
        return read_columns(stream, name=str(file), columns=columns).agents


def _read_taf_meta(file: Path) -> tuple[str, float | None, tuple[float, float] | None]:
    """Site, time of day [h] and origin of one TAF-BW file, from the meta data beside it."""
    meta = file.parent / "meta_data.csv"
    if not meta.is_file():
        return "", None, None
    with meta.open(encoding="utf-8-sig", newline="") as stream:
        for row in csv.DictReader(stream):
            if row.get("id") == file.stem.rsplit("_", 1)[-1]:
                origin = (float(row["originLat"]), float(row["originLon"]))
                site = (row.get("locationId") or "").lower()
                clock = re.match(r"(\d+):(\d+)", row.get("startTime") or "")
                return site, int(clock[1]) + int(clock[2]) / 60 if clock else None, origin
    return "", None, None


def _read_ind(file: Path) -> tuple[Sequence[AgentSamples], float | None, None]:
    """inD-style: `NN_tracks.csv` with `NN_tracksMeta.csv` and `NN_recordingMeta.csv` beside it."""
    stem = file.name.removesuffix("_tracks.csv")
    meta, about = (file.with_name(f"{stem}_{each}Meta.csv") for each in ("tracks", "recording"))
    for each in (meta, about):
        if not each.is_file():
            raise InputError(f"{file} needs {each.name} beside it")
    with about.open(encoding="utf-8-sig", newline="") as stream:
        facts = next(csv.DictReader(stream), {})
    try:
        rate = float(facts["frameRate"])
    except (KeyError, TypeError, ValueError):
        raise InputError(f"{about} states no frameRate") from None
    with meta.open(encoding="utf-8-sig", newline="") as stream:
        words = {row["trackId"]: row["class"] for row in csv.DictReader(stream)}
    columns = {"t": f"frame/{rate}", "id": "trackId", "x": "xCenter", "y": "yCenter"}
    agents = []
    for agent in _read_mapped_csv(file, columns):
        subtype = find_subtype(words.get(agent.name, ""))
        if subtype is None:
            known = ", ".join(sorted(SUBTYPES))
            raise InputError(f"{meta}: class {words.get(agent.name, '')[:30]!r} is none of {known}")
        agents.append(replace(agent, subtype=subtype))
    hour = facts.get("startTime")
    return agents, None if hour in (None, "") else float(hour), None
