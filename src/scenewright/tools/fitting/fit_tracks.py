"""Priors of an imported intersection from recorded tracks, few or many.

The tracks are moved to the map's frame and matched to routes, and what they show is combined with
the map and the pool: nothing needs to be complete. Their value for p_wp is measured on tracks held
out by recording, with and without pooling.
"""

from __future__ import annotations

import csv
import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.geographic import LatLon, project_to_metres
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map import IntersectionMap
from scenewright.scene.track import STEP, Track
from scenewright.tools.fitting.derive_priors import assume_frequency, derive_counts, derive_priors
from scenewright.tools.fitting.partial_tracks import (
    compute_offset_nll,
    fit_partial_prior,
    fit_unpooled_prior,
    keep_on_line,
    pool_partial_tracks,
)
from scenewright.tools.fitting.path_frame import (
    Pool,
    classify_route,
    load_shipped_pool,
    scale_pool,
)
from scenewright.tools.fitting.route_matching import Match, Matcher
from scenewright.tools.gmm_sampler.priors import HOURS, DrivingProfilePrior, Priors, WaypointPrior
from scenewright.tools.map_import.map_parts import RouteLines
from scenewright.tools.track_io.track_files import FileTracks

_RATE_WEIGHT = 4.0
"""How many trips the assumed demand of a route weighs as much as."""
_PROFILE_WEIGHT = 10.0
"""How many tracks a borrowed driving profile weighs as much as."""
_SHARES = (0.1, 0.25, 0.5, 1.0)
_FLOWING = {"vehicle": 2.5, "pedestrian": 0.4}
_MAX_COUNT = 100_000.0
_MIN_OFFSETS = 60
_MAX_SHIFT = 3.0

LaneOffsets = Mapping[str, Sequence[FloatArray]]
"""By turn, for each lane of a place without a map [n, K] offsets from its middle [m]."""
_Pair = tuple[Match, Track]
_Offsets = Mapping[str, Sequence[FloatArray]]
"""By route, for each line [n, K] offsets of the tracks that keep to it [m]."""


@dataclass(frozen=True)
class FrameChange:
    """How positions of files get to the map's frame.

    Attributes:
        origin: of the map; track_origin: of the tracks, where their files do not state it.
        shift: added to the tracks' positions instead [m].
    """

    origin: LatLon | None = None
    track_origin: LatLon | None = None
    shift: tuple[float, float] | None = None

    def compute_shift(self, file: FileTracks) -> FloatArray:
        """[2] what is added to positions of a file [m]."""
        if self.shift is not None:
            return np.array(self.shift)
        own = self.track_origin or file.origin
        if own is None or self.origin is None:
            return np.zeros(2)
        return project_to_metres(self.origin, own)


@dataclass(frozen=True)
class HeldOutRow:
    """p_wp on tracks held out by recording, fitted on a share of the others.

    Attributes:
        tracks: fitted on; pooled, unpooled: nats per waypoint observed.
    """

    share: float
    tracks: int
    pooled: float
    unpooled: float


@dataclass(frozen=True, eq=False)
class FittedTracks:
    """Priors fitted on recorded tracks, and how.

    Attributes:
        off_route, open_route: tracks on no route, and those that end before routes part.
        heldout: empty where there were too few tracks.
        notes: what was done, one fact a line.
        positions: [T, 2] of the matched tracks in the map's frame [m]; matches: of the same.
        shifts: [2] what took each file's positions to the map's frame [m], by the file's name.
    """

    priors: Priors
    off_route: int
    open_route: int
    heldout: tuple[HeldOutRow, ...]
    notes: tuple[str, ...]
    positions: tuple[FloatArray, ...]
    matches: tuple[Match, ...]
    shifts: Mapping[str, FloatArray]

    @property
    def matched(self) -> dict[str, int]:
        """Tracks by route id."""
        return dict(Counter(match.route for match in self.matches))


def fit_tracks(
    intersection_map: IntersectionMap,
    route_lines: RouteLines,
    files: Sequence[FileTracks],
    frame: FrameChange,
    *,
    begin: float | None = None,
    hourly: Mapping[str, FloatArray] | None = None,
    elsewhere: LaneOffsets | None = None,
) -> FittedTracks:
    """Priors from recorded tracks.

    Args:
        begin: time of day of recordings that state none [h].
        hourly: [24] vehicles (and pedestrians) an hour, counted elsewhere.
        elsewhere: how vehicles of another place keep to their lanes, for the pool.

    Raises:
        InputError: no track lies on the map.
    """
    notes: list[str] = []
    matcher = Matcher(intersection_map, route_lines)
    shifts = _register_files(files, matcher, frame, notes)
    recordings, reasons = _match_files(files, matcher, shifts)
    pairs = [pair for recording in recordings for pair in recording]
    if not pairs:
        raise InputError(
            "no track lies on a way through the map; are they in its frame? give --origin LAT,LON "
            "of the tracks, or --shift X,Y"
        )
    matches = tuple(match for match, _ in pairs)
    away = float(np.median([match.distance for match in matches]))
    notes.append(
        f"{len(matches)} tracks on routes (median {away:.2f} m from the middle), "
        f"{reasons['open']} end before their way parts from others, {reasons['off']} on none, "
        f"{reasons['bicycle']} bicycles left out"
    )
    if warning := _warn_if_empty(intersection_map, files, shifts, len(matches), reasons):
        notes.insert(0, warning)
    fit = WaypointFit(intersection_map, route_lines, matches, elsewhere)
    derived = derive_priors(intersection_map, route_lines)
    frequency = _fit_frequency(intersection_map, files, recordings, begin, hourly, notes)
    stay = _estimate_stay(intersection_map, pairs)
    priors = replace(
        derived,
        waypoints={**derived.waypoints, **fit.fit_priors(predictive=False)},
        frequency=frequency,
        counts=derive_counts(intersection_map, frequency, stay=stay),
        driving_profiles=_fit_profiles(intersection_map, pairs, derived.driving_profiles),
    )
    return FittedTracks(
        priors=priors,
        off_route=reasons["off"],
        open_route=reasons["open"],
        heldout=tuple(_evaluate_heldout(intersection_map, route_lines, recordings, elsewhere)),
        notes=tuple(notes),
        positions=tuple(track.xy for _, track in pairs),
        matches=matches,
        shifts=shifts,
    )


def find_shifts(
    intersection_map: IntersectionMap,
    route_lines: RouteLines,
    files: Sequence[FileTracks],
    frame: FrameChange,
) -> dict[str, FloatArray]:
    """By file, [2] what takes its positions to the map's frame [m]."""
    return _register_files(files, Matcher(intersection_map, route_lines), frame, [])


def _register_files(
    files: Sequence[FileTracks], matcher: Matcher, frame: FrameChange, notes: list[str]
) -> dict[str, FloatArray]:
    """By file, [2] what is added to its positions: as stated, and a small shift by session."""
    sessions: dict[str, list[FileTracks]] = defaultdict(list)
    for file in files:
        sessions[file.session].append(file)
    moved = {}
    for name, own in sessions.items():
        moved[name] = shift = _register_session(own, matcher, frame)
        if shift.any():
            notes.append(
                f"{name}: moved by {shift[0]:+.2f} m east, {shift[1]:+.2f} m north, on to the lanes"
            )
    return {file.name: frame.compute_shift(file) + moved[file.session] for file in files}


def _register_session(
    files: Sequence[FileTracks], matcher: Matcher, frame: FrameChange
) -> FloatArray:
    """The small shift [m] under which tracks of vehicles lie on the lanes best, on the median.

    Origins are stated to a metre or so, and maps are drawn from pictures. A small shift is found
    in a few steps of weighted least squares; none if it is too large or hardly any.
    """
    tracks = [
        (frame.compute_shift(file), track.xy)
        for file in files
        for subtype, track in file.tracks
        if subtype not in ("pedestrian", "bicycle")
    ]
    moved = np.zeros(2)
    for _ in range(4):
        found = (matcher.match(xy + (stated + moved), "vehicle") for stated, xy in tracks)
        matches = [match for match in found if isinstance(match, Match)]
        seen = [np.isfinite(match.offsets) for match in matches]
        offsets = [match.offsets[own] for match, own in zip(matches, seen, strict=True)]
        if sum(map(len, offsets)) < _MIN_OFFSETS:
            return np.zeros(2)
        normals = [matcher.compute_normals(m)[own] for m, own in zip(matches, seen, strict=True)]
        n, d = np.concatenate(normals), np.concatenate(offsets)
        weight = 1.0 / np.maximum(np.abs(d), 0.2)
        step = np.linalg.lstsq(n * weight[:, None], -d * weight, rcond=None)[0]
        moved = moved + step
        if float(np.hypot(*moved)) > _MAX_SHIFT:
            return np.zeros(2)
        if float(np.hypot(*step)) < 0.02:
            break
    return moved if float(np.hypot(*moved)) >= 0.1 else np.zeros(2)


def _match_files(
    files: Sequence[FileTracks], matcher: Matcher, shifts: Mapping[str, FloatArray]
) -> tuple[list[list[_Pair]], Counter[str]]:
    """By file the matched tracks in the map's frame, and why how many others are left out."""
    recordings: list[list[_Pair]] = []
    reasons: Counter[str] = Counter()
    for file in files:
        recordings.append([])
        for subtype, track in file.tracks:
            if subtype == "bicycle":
                reasons["bicycle"] += 1
                continue
            xy = track.xy + shifts[file.name]
            found = matcher.match(xy, "pedestrian" if subtype == "pedestrian" else "vehicle")
            if isinstance(found, Match):
                recordings[-1].append((found, Track(xy, track.heading, track.start)))
            else:
                reasons[found.reason] += 1
    return recordings, reasons


_FEW_TRACKS, _FEW_SHARE = 8, 0.15


def _warn_if_empty(
    intersection_map: IntersectionMap,
    files: Sequence[FileTracks],
    shifts: Mapping[str, FloatArray],
    matched: int,
    reasons: Counter[str],
) -> str | None:
    """That hardly any track was of use, and the likeliest reason; None where many were."""
    total = sum(len(file.tracks) for file in files)
    if matched >= _FEW_TRACKS and matched >= _FEW_SHARE * total:
        return None
    ends = [track.xy + shifts[file.name] for file in files for _, track in file.tracks]
    inside = sum(bool((np.abs(xy) < intersection_map.extent).all(axis=1).any()) for xy in ends)
    middle = np.median(np.concatenate(ends), axis=0)
    if inside < 0.5 * total:
        why = (
            f"{total - inside} of them lie off the map, their middle at "
            f"({middle[0]:.0f}, {middle[1]:.0f}) m: say where their frame lies with --origin or "
            "--shift"
        )
    elif reasons["open"] >= reasons["off"]:
        why = f"{reasons['open']} end before their way parts from others: they are too short"
    else:
        why = f"{reasons['off']} keep to no way of the map: another junction, or a wrong frame"
    return (
        f"this fit is nearly empty: {matched} of {total} tracks lie on a route, so the priors are "
        f"all but those derived from the map; {why}"
    )


@dataclass(frozen=True, eq=False)
class WaypointFit:
    """Matched tracks of an intersection, and the pools that they and others make.

    Attributes:
        offsets: of the tracks that keep to their line.
        pools: of every kind of route, from all the tracks of that kind.
    """

    intersection_map: IntersectionMap
    route_lines: RouteLines
    matches: Sequence[Match]
    elsewhere: LaneOffsets | None = None
    offsets: _Offsets = field(init=False)
    pools: Pool = field(init=False)

    def __post_init__(self) -> None:
        groups: dict[str, dict[int, list[FloatArray]]] = defaultdict(lambda: defaultdict(list))
        for match in self.matches:
            groups[match.route][match.line].append(match.offsets)
        offsets = {
            route.id: [
                keep_on_line(np.array(groups[route.id][n]).reshape(-1, K))
                for n in range(len(self.route_lines[route.id]))
            ]
            for route in self.intersection_map.routes
            if route.movement != "jaywalking"
        }
        shipped = load_shipped_pool()
        by_kind: dict[str, list[FloatArray]] = defaultdict(list)
        base: dict[str, FloatArray] = {}
        for route in self.intersection_map.routes:
            if route.movement != "jaywalking":
                by_kind[classify_route(route)] += offsets[route.id]
                base[classify_route(route)] = scale_pool(route, shipped)
        for turn, lanes in (self.elsewhere or {}).items():
            by_kind[turn] += lanes
            base.setdefault(turn, shipped[turn])
        pools = {**shipped, **{k: pool_partial_tracks(t, base[k]) for k, t in by_kind.items()}}
        object.__setattr__(self, "offsets", offsets)
        object.__setattr__(self, "pools", pools)

    def fit_priors(self, *, predictive: bool) -> dict[str, WaypointPrior]:
        """By route id, p_wp of all routes but jaywalking ones.

        Args:
            predictive: for tracks of another recording than the matched ones, where recordings
                differ and the map may be off (`fit_partial_prior`); not for drawing scenes.
        """
        return {
            route.id: fit_partial_prior(
                route, self.route_lines[route.id], self.offsets[route.id], pool=self.pools,
                predictive=predictive,
            )
            for route in self.intersection_map.routes
            if route.movement != "jaywalking"
        }  # fmt: skip


def _evaluate_heldout(
    intersection_map: IntersectionMap,
    route_lines: RouteLines,
    recordings: Sequence[Sequence[_Pair]],
    elsewhere: LaneOffsets | None,
) -> Iterable[HeldOutRow]:
    """p_wp on held-out tracks as fewer tracks are fitted on; nothing where they are too few."""
    folds = _split_folds(recordings)
    for share in _SHARES if folds else ():
        pooled: list[float] = []
        unpooled: list[float] = []
        sizes = []
        for n, test in enumerate(folds):
            train = [match for k, fold in enumerate(folds) if k != n for match in fold]
            train = train[:: max(round(1.0 / share), 1)]
            sizes.append(len(train))
            fit = WaypointFit(intersection_map, route_lines, train, elsewhere)
            tested = {match.route for match in test}
            own = {
                r.id: fit_unpooled_prior(r, route_lines[r.id], fit.offsets[r.id])
                for r in intersection_map.routes
                if r.id in tested
            }
            pooled += _compute_nlls(fit.fit_priors(predictive=True), route_lines, test)
            unpooled += _compute_nlls(own, route_lines, test)
        if pooled:
            means = float(np.mean(pooled)), float(np.mean(unpooled))
            yield HeldOutRow(share, int(np.mean(sizes)), *means)


def _compute_nlls(
    priors: Mapping[str, WaypointPrior], route_lines: RouteLines, matches: Sequence[Match]
) -> list[float]:
    """Of each track that keeps to its line, which is known, by route [nats per waypoint]."""
    nlls = []
    for route, prior in priors.items():
        for match in matches:
            offsets = match.offsets[None]
            if match.route == route and len(keep_on_line(offsets)):
                line, only = route_lines[route][match.line], slice(match.line, match.line + 1)
                own = replace(
                    prior, weights=np.ones(1), means=prior.means[only],
                    cholesky=prior.cholesky[only], base=prior.base[only],
                )  # fmt: skip
                nlls.append(float(compute_offset_nll(own, line, offsets)[0]))
    return nlls


def _split_folds(recordings: Sequence[Sequence[_Pair]]) -> list[list[Match]]:
    """Four groups of recordings, or of stretches of time of the only one; none of few tracks."""
    full = [[match for match, _ in recording] for recording in recordings if recording]
    if len(full) >= 4:
        return [[match for recording in full[n::4] for match in recording] for n in range(4)]
    if len(full) >= 2:
        return full
    pairs = [pair for recording in recordings for pair in recording]
    ordered = [match for match, _ in sorted(pairs, key=lambda pair: pair[1].start)]
    if len(ordered) < 16:
        return []
    parts = np.array_split(np.arange(len(ordered)), 4)
    return [[ordered[i] for i in part] for part in parts]


def _estimate_stay(intersection_map: IntersectionMap, pairs: Sequence[_Pair]) -> float | None:
    """How long vehicles are on the map [s], from those observed along most of their path."""
    kinds = {route.id: route.type for route in intersection_map.routes}
    shares = [(track, float(np.isfinite(match.offsets).mean())) for match, track in pairs
              if kinds[match.route] == "vehicle"]  # fmt: skip
    seen = [len(track.xy) * STEP / max(share, 0.1) for track, share in shares if share > 0.3]
    return float(np.clip(np.mean(seen), 8.0, 90.0)) if len(seen) >= 5 else None


def _fit_frequency(
    intersection_map: IntersectionMap,
    files: Sequence[FileTracks],
    recordings: Sequence[Sequence[_Pair]],
    begin: float | None,
    hourly: Mapping[str, FloatArray] | None,
    notes: list[str],
) -> dict[str, FloatArray]:
    """[24] trips an hour by route: the assumed demand, scaled by what was counted."""
    frequency = assume_frequency(intersection_map)
    if hourly is not None:
        for kind, wanted in hourly.items():
            own = [route.id for route in intersection_map.routes if route.type == kind]
            total = np.maximum(np.sum([frequency[name] for name in own], axis=0), 1e-9)
            frequency |= {name: frequency[name] / total * wanted for name in own}
        notes.append("how many come by at which hour: from the table")
    expected: dict[str, float] = dict.fromkeys(frequency, 0.0)
    seen: Counter[str] = Counter()
    seconds = 0.0
    for file, recording in zip(files, recordings, strict=True):
        start = file.begin if file.begin is not None else begin
        if start is not None:
            seconds += file.span
            for route, rate in frequency.items():
                expected[route] += float(rate[int(start) % HOURS]) * file.span / 3600.0
            seen.update(match.route for match, _ in recording)
    if not seconds:
        notes.append("no recording states its time of day (--start HH:MM): p_tod keeps the demand")
        return frequency
    notes.append(f"p_tod scaled by {sum(seen.values())} trips in {seconds / 60:.1f} min")
    return {
        route: rate * ((seen[route] + _RATE_WEIGHT) / (expected[route] + _RATE_WEIGHT))
        for route, rate in frequency.items()
    }


def read_hourly_counts(file: str | Path) -> dict[str, FloatArray]:
    """[24] vehicles and pedestrians an hour from a CSV with columns hour, vehicles[, pedestrians].

    Raises:
        InputError: unreadable, an hour missing or twice, a count that is none.
    """
    try:
        with Path(file).open(encoding="utf-8-sig", newline="") as stream:
            rows = list(csv.DictReader(stream))
    except (OSError, UnicodeDecodeError, csv.Error) as fault:
        reason = getattr(fault, "strerror", None) or fault
        raise InputError(f"cannot read {file}: {reason}") from None
    hourly_counts = {
        kind: _read_column(file, rows, column)
        for column, kind in (("vehicles", "vehicle"), ("pedestrians", "pedestrian"))
        if rows and column in rows[0]
    }
    if not hourly_counts:
        raise InputError(f"{file} has no column vehicles or pedestrians beside hour")
    return hourly_counts


def _read_column(file: str | Path, rows: Sequence[dict[str, str]], column: str) -> FloatArray:
    counts = np.full(HOURS, np.nan)
    for number, row in enumerate(rows, start=2):
        try:
            hour, count = int(row["hour"] or ""), float(row[column] or "")
        except (KeyError, ValueError):
            raise InputError(f"{file}, line {number}: hour and {column} are numbers") from None
        if not (0 <= hour < HOURS and 0 <= count < _MAX_COUNT and math.isnan(counts[hour])):
            raise InputError(f"{file}, line {number}: each hour 0 to 23 once, counts from 0")
        counts[hour] = count
    if missing := int(np.isnan(counts).sum()):
        raise InputError(f"{file} lacks {missing} of the 24 hours")
    return counts


def _fit_profiles(
    intersection_map: IntersectionMap,
    pairs: Sequence[_Pair],
    borrowed: Mapping[str, DrivingProfilePrior],
) -> dict[str, DrivingProfilePrior]:
    """Borrowed driving profiles, their free speeds pulled to those observed, by class and turn."""
    speeds: dict[str, list[float]] = defaultdict(list)
    routes = {route.id: route for route in intersection_map.routes}
    for match, track in pairs:
        route = routes[match.route]
        speed = np.hypot(*(track.xy[5:] - track.xy[:-5]).T) / (5 * STEP)
        if len(speed) and float(speed.min()) > _FLOWING[route.type]:
            speeds[classify_route(route)].append(float(np.quantile(speed, 0.9)))
    found = {}
    for name, route in routes.items():
        found[name] = profile = borrowed[name]
        if seen := speeds[classify_route(route)]:
            logs = np.log(np.clip(seen, profile.low[0], profile.high[0]))
            share = len(logs) / (len(logs) + _PROFILE_WEIGHT)
            median, spread = profile.median.copy(), profile.spread.copy()
            speed = math.exp(share * float(np.median(logs)) + (1 - share) * math.log(median[0]))
            median[0] = float(np.clip(speed, profile.low[0], profile.high[0]))
            own = float(1.4826 * np.median(np.abs(logs - np.median(logs))))
            spread[0] = max(share * own + (1 - share) * spread[0], 0.05)
            found[name] = replace(profile, median=median, spread=spread, tracks=len(seen))
    return found
