"""Priors of an imported intersection from recorded tracks, few or many.

The tracks are put in the map's frame, matched to routes, and what they tell is mixed with what the
map and the pool tell: nothing needs to be complete. What they tell of p_wp is measured on tracks
held out by recording, with and without pooling.
"""

from __future__ import annotations

import csv
import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map import IntersectionMap
from scenewright.scene.track import STEP, Track
from scenewright.tools.fitting.derive_priors import (
    Lines,
    assumed_frequency,
    derived_counts,
    derived_priors,
)
from scenewright.tools.fitting.partial_tracks import (
    kept,
    offset_nll,
    partial_prior,
    pooled_partial,
    unpooled_prior,
)
from scenewright.tools.fitting.path_frame import Pool, kind_of, narrow_to_route, shipped_pool
from scenewright.tools.fitting.route_matching import Match, Matcher
from scenewright.tools.gmm_sampler.priors import HOURS, DrivingProfilePrior, Priors, WaypointPrior
from scenewright.tools.track_io.track_files import FileTracks

_EARTH = 6_378_137.0
_RATE_WEIGHT = 4.0
"""How many trips the assumed demand of a route weighs as much as."""
_LAW_WEIGHT = 10.0
"""How many tracks a borrowed time law weighs as much as."""
_SHARES = (0.1, 0.25, 0.5, 1.0)
_FLOWING = {"vehicle": 2.5, "pedestrian": 0.4}
_MOST_COUNT = 100_000.0
_LEAST_OFFSETS = 30
_FARTHEST_SHIFT = 3.0

Matched = Mapping[str, Mapping[int, list[FloatArray]]]
"""Offsets [K] of tracks, by route and line."""
Lanes = Mapping[str, Sequence[FloatArray]]
"""By turn, for each lane of a place without a map [n, K] offsets from its middle [m]."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """What recorded tracks gave.

    Attributes:
        priors: the whole set; matched: tracks by route id; off, open_: tracks on no route, and
            tracks that end before their way parts from others.
        heldout: rows of (share of the tracks, tracks, pooled, unpooled) of p_wp, in nats per
            waypoint seen; empty where there were too few.
        lines: what was done, for people.
        seen: [T, 2] positions of the matched tracks in the map's frame [m].
        matches: of the same tracks.
        moved: [2] what took each file's positions to the map's frame [m], by the file's name.
    """

    priors: Priors
    matched: Mapping[str, int]
    off: int
    open_: int
    heldout: tuple[tuple[float, int, float, float], ...]
    lines: tuple[str, ...]
    seen: tuple[FloatArray, ...]
    matches: tuple[Match, ...]
    moved: Mapping[str, FloatArray]


def fit_tracks(
    place: IntersectionMap,
    ways: Lines,
    files: Sequence[FileTracks],
    *,
    origin: tuple[float, float] | None,
    track_origin: tuple[float, float] | None = None,
    shift: tuple[float, float] | None = None,
    begin: float | None = None,
    hourly: Mapping[str, FloatArray] | None = None,
    elsewhere: Lanes | None = None,
) -> Fitted:
    """Priors from recorded tracks.

    Args:
        origin: latitude and longitude of the map's origin [deg]; track_origin: of the tracks'.
        shift: added to the tracks' positions instead [m].
        begin: time of day of recordings that state none [h].
        hourly: [24] vehicles (and pedestrians) an hour, counted elsewhere.
        elsewhere: how drivers of another place keep to their lanes, for the pool.

    Raises:
        InputError: no track lies on the map.
    """
    matcher = Matcher(place, ways)
    lines: list[str] = []
    sessions: dict[str, list[FileTracks]] = defaultdict(list)
    for file in files:
        sessions[file.session].append(file)
    base = {
        name: _registered(name, own, matcher, origin, track_origin, shift, lines)
        for name, own in sessions.items()
    }
    kinds = {route.id: route.type for route in place.routes}
    moved = {
        file.name: frame_shift(file, origin, track_origin, shift) + base[file.session]
        for file in files
    }
    by_file: list[tuple[FileTracks, list[tuple[Match, Track]]]] = []
    reasons: Counter[str] = Counter()
    for file in files:
        found = []
        for subtype, track in file.tracks:
            if subtype == "bicycle":
                reasons["bicycle"] += 1
                continue
            kind = "pedestrian" if subtype == "pedestrian" else "vehicle"
            xy = track.xy + moved[file.name]
            result = matcher.match(xy, kind)
            if isinstance(result, Match):
                found.append((result, Track(xy, track.heading, track.start)))
            else:
                reasons[result.reason] += 1
        by_file.append((file, found))
    every = [pair for _, found in by_file for pair in found]
    if not every:
        raise InputError(
            "no track lies on a way through the map; are they in its frame? give --origin LAT,LON "
            "of the tracks, or --shift X,Y"
        )
    matched = Counter(match.route for match, _ in every)
    lines.append(_counted(every, reasons))
    priors = _priors(place, ways, _grouped(m for m, _ in every), elsewhere)
    frequency = _frequency(place, by_file, begin, hourly, lines)
    counts, instants = derived_counts(place, frequency, stay=_stay(every, kinds))
    laws = _laws(place, every, priors.driving_profiles)
    priors = replace(
        priors, frequency=frequency, counts=counts, instants=instants, driving_profiles=laws
    )
    heldout = tuple(heldout_table(place, ways, [found for _, found in by_file], elsewhere))
    return Fitted(
        priors,
        dict(matched),
        reasons["off"],
        reasons["open"],
        heldout,
        tuple(lines),
        tuple(track.xy for _, track in every),
        tuple(match for match, _ in every),
        moved,
    )


def _registered(
    name: str,
    files: Sequence[FileTracks],
    matcher: Matcher,
    origin: tuple[float, float] | None,
    track_origin: tuple[float, float] | None,
    shift: tuple[float, float] | None,
    lines: list[str],
) -> FloatArray:
    """The small shift [m] under which tracks of vehicles lie on the lanes best, on the median.

    Origins are stated to a metre or so, and maps are drawn from pictures. A shift of up to
    _FARTHEST_SHIFT is looked for, in a few steps of weighted least squares.
    """
    moved = np.zeros(2)
    for _ in range(4):
        normals, offsets = [], []
        for file in files:
            own = frame_shift(file, origin, track_origin, shift) + moved
            for subtype, track in file.tracks:
                found = (
                    matcher.match(track.xy + own, "vehicle")
                    if subtype not in ("pedestrian", "bicycle")
                    else None
                )
                if isinstance(found, Match):
                    seen = np.isfinite(found.beside)
                    normals += list(matcher.normals(found)[seen])
                    offsets += list(found.beside[seen])
        if len(offsets) < 2 * _LEAST_OFFSETS:
            return np.zeros(2)
        n, d = np.array(normals), np.array(offsets)
        weight = 1.0 / np.maximum(np.abs(d), 0.2)
        step = np.linalg.lstsq(n * weight[:, None], -d * weight, rcond=None)[0]
        moved = moved + step
        if float(np.hypot(*moved)) > _FARTHEST_SHIFT:
            return np.zeros(2)
        if float(np.hypot(*step)) < 0.02:
            break
    if float(np.hypot(*moved)) < 0.1:
        return np.zeros(2)
    lines.append(
        f"{name}: moved by {moved[0]:+.2f} m east, {moved[1]:+.2f} m north, on to the lanes"
    )
    return moved


def _counted(every: Sequence[tuple[Match, Track]], reasons: Counter[str]) -> str:
    away = float(np.median([match.away for match, _ in every]))
    return (
        f"{len(every)} tracks on routes (median {away:.2f} m from the middle), "
        f"{reasons['open']} end before their way parts from others, {reasons['off']} on none, "
        f"{reasons['bicycle']} bicycles left out"
    )


def frame_shift(
    file: FileTracks,
    origin: tuple[float, float] | None,
    track_origin: tuple[float, float] | None = None,
    shift: tuple[float, float] | None = None,
) -> FloatArray:
    """What is stated to take positions of a file to the map's frame [m]; see `fit_tracks`."""
    if shift is not None:
        return np.array(shift)
    own = track_origin or file.origin
    if own is None or origin is None:
        return np.zeros(2)
    east = _EARTH * math.cos(math.radians(origin[0])) * math.radians(own[1] - origin[1])
    return np.array([east, _EARTH * math.radians(own[0] - origin[0])])


def _grouped(matches: Iterable[Match]) -> dict[str, dict[int, list[FloatArray]]]:
    groups: dict[str, dict[int, list[FloatArray]]] = defaultdict(lambda: defaultdict(list))
    for match in matches:
        groups[match.route][match.line].append(match.beside)
    return groups


def _stacked(groups: Matched, route: str, count: int) -> list[FloatArray]:
    """By line, [n, K] offsets of the tracks that keep to it."""
    own = groups.get(route, {})
    return [kept(np.array(own.get(n, [])).reshape(-1, K)) for n in range(count)]


def pools_of(
    place: IntersectionMap, ways: Lines, groups: Matched, elsewhere: Lanes | None = None
) -> dict[str, FloatArray]:
    """The pools of every kind of route from all the tracks of that kind.

    Args:
        elsewhere: by turn, for each lane of another place [n, K] offsets from its middle [m].
    """
    shipped = shipped_pool()
    by_kind: dict[str, list[FloatArray]] = defaultdict(list)
    base: dict[str, FloatArray] = {}
    for route in place.routes:
        if route.movement != "jaywalking":
            by_kind[kind_of(route)] += _stacked(groups, route.id, len(ways[route.id]))
            base[kind_of(route)] = narrow_to_route(route, shipped)
    for turn, lanes in (elsewhere or {}).items():
        by_kind[turn] += lanes
        base.setdefault(turn, shipped[turn])
    return {**shipped, **{kind: pooled_partial(t, base[kind]) for kind, t in by_kind.items()}}


def _priors(
    place: IntersectionMap, ways: Lines, groups: Matched, elsewhere: Lanes | None
) -> Priors:
    pools = pools_of(place, ways, groups, elsewhere)
    derived = derived_priors(place, ways)
    fitted = _waypoints(place, ways, groups, pools, predictive=False)
    return replace(derived, waypoints={**derived.waypoints, **fitted})


def _waypoints(
    place: IntersectionMap, ways: Lines, groups: Matched, pools: Pool, *, predictive: bool
) -> dict[str, WaypointPrior]:
    """By route id, p_wp of those that were matched or could have been."""
    return {
        route.id: partial_prior(
            route,
            ways[route.id],
            _stacked(groups, route.id, len(ways[route.id])),
            pool=pools,
            predictive=predictive,
        )
        for route in place.routes
        if route.movement != "jaywalking"
    }


def heldout_table(
    place: IntersectionMap,
    ways: Lines,
    recordings: Sequence[Sequence[tuple[Match, Track]]],
    elsewhere: Lanes | None = None,
) -> list[tuple[float, int, float, float]]:
    """p_wp on tracks held out by recording (one recording: by time), as fewer tracks are fitted on.

    Rows of (share, tracks fitted on, pooled, unpooled) in nats per waypoint seen; None if the
    tracks are too few to hold any out.
    """
    folds = _folds(recordings)
    if folds is None:
        return []
    rows = []
    for share in _SHARES:
        pooled_nll: list[float] = []
        own_nll: list[float] = []
        sizes = []
        for n in range(len(folds)):
            train = [pair for k, fold in enumerate(folds) if k != n for pair in fold]
            train = train[:: max(round(1.0 / share), 1)]
            sizes.append(len(train))
            groups = _grouped(m for m, _ in train)
            pools = pools_of(place, ways, groups, elsewhere)
            for route in place.routes:
                tests = [m for m, _ in folds[n] if m.route == route.id]
                if not tests:
                    continue
                lines = ways[route.id]
                beside = _stacked(groups, route.id, len(lines))
                both = (
                    partial_prior(route, lines, beside, pool=pools, predictive=True),
                    unpooled_prior(route, lines, beside),
                )
                for match in tests:
                    if not len(kept(match.beside[None])):
                        continue
                    row = match.beside[None]
                    line = lines[match.line]
                    only = [_one(prior, match.line) for prior in both]
                    pooled_nll.append(float(offset_nll(only[0], line, row)[0]))
                    own_nll.append(float(offset_nll(only[1], line, row)[0]))
        if pooled_nll:
            rows.append(
                (share, int(np.mean(sizes)), float(np.mean(pooled_nll)), float(np.mean(own_nll)))
            )
    return rows


def foretelling(
    place: IntersectionMap, ways: Lines, matches: Sequence[Match]
) -> dict[str, WaypointPrior]:
    """By route id, p_wp for tracks of another recording than the matched ones.

    Unlike the priors that scenes are drawn from, these know that recordings differ and that a map
    may be off (`partial_prior`).
    """
    groups = _grouped(matches)
    return _waypoints(place, ways, groups, pools_of(place, ways, groups), predictive=True)


def foretold(
    place: IntersectionMap, ways: Lines, matches: Sequence[Match], *, pool: Pool
) -> list[float]:
    """How a pool foretells the tracks of a place none of which it has seen [nats per waypoint].

    Each track's line is known; lower is better.
    """
    found = []
    for route in place.routes:
        mine = [m for m in matches if m.route == route.id and len(kept(m.beside[None]))]
        if not mine:
            continue
        lines = ways[route.id]
        nothing = [np.zeros((0, K))] * len(lines)
        prior = partial_prior(route, lines, nothing, pool=pool, predictive=True)
        for match in mine:
            only, row = _one(prior, match.line), match.beside[None]
            found.append(float(offset_nll(only, lines[match.line], row)[0]))
    return found


def _one(prior: WaypointPrior, line: int) -> WaypointPrior:
    """The component of one line alone: which line a track keeps to is known here."""
    return replace(
        prior,
        weights=np.ones(1),
        means=prior.means[line : line + 1],
        cholesky=prior.cholesky[line : line + 1],
        base=prior.base[line : line + 1],
    )


def _folds(
    recordings: Sequence[Sequence[tuple[Match, Track]]],
) -> list[list[tuple[Match, Track]]] | None:
    """Four groups of recordings, or of stretches of time of the only one."""
    full = [list(r) for r in recordings if r]
    if len(full) >= 4:
        return [[pair for r in full[n::4] for pair in r] for n in range(4)]
    if len(full) >= 2:
        return full
    tracks = sorted(full[0], key=lambda pair: pair[1].start) if full else []
    if len(tracks) < 16:
        return None
    return [list(part) for part in np.array_split(np.array(tracks, dtype=object), 4)]


def _stay(every: Sequence[tuple[Match, Track]], kinds: Mapping[str, str]) -> float | None:
    """How long vehicles are on the map [s], from those seen along most of their way."""
    seen = [
        len(track.xy) * STEP / max(float(np.isfinite(match.beside).mean()), 0.1)
        for match, track in every
        if kinds[match.route] == "vehicle" and np.isfinite(match.beside).mean() > 0.3
    ]
    return float(np.clip(np.mean(seen), 8.0, 90.0)) if len(seen) >= 5 else None


def _frequency(
    place: IntersectionMap,
    by_file: Sequence[tuple[FileTracks, list[tuple[Match, Track]]]],
    begin: float | None,
    hourly: Mapping[str, FloatArray] | None,
    lines: list[str],
) -> dict[str, FloatArray]:
    """[24] trips an hour by route: the assumed demand, scaled by what was counted."""
    frequency = assumed_frequency(place)
    if hourly is not None:
        frequency = _to_table(place, frequency, hourly)
        lines.append("how many come by at which hour: from the table")
    expected: dict[str, float] = dict.fromkeys(frequency, 0.0)
    seen: Counter[str] = Counter()
    seconds = 0.0
    for file, found in by_file:
        at = file.begin if file.begin is not None else begin
        if at is None:
            continue
        hour = int(at) % HOURS
        seconds += file.span
        for route, rate in frequency.items():
            expected[route] += float(rate[hour]) * file.span / 3600.0
        seen.update(match.route for match, _ in found)
    if not seconds:
        lines.append("no recording states its time of day (--start HH:MM): p_tod keeps the demand")
        return frequency
    scale = {
        route: (seen[route] + _RATE_WEIGHT) / (expected[route] + _RATE_WEIGHT)
        for route in frequency
    }
    lines.append(f"p_tod scaled by {sum(seen.values())} trips in {seconds / 60:.1f} min")
    return {route: rate * scale[route] for route, rate in frequency.items()}


def _to_table(
    place: IntersectionMap, frequency: Mapping[str, FloatArray], hourly: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    result = dict(frequency)
    for kind, wanted in hourly.items():
        own = [r.id for r in place.routes if r.type == kind]
        total = np.maximum(np.sum([frequency[name] for name in own], axis=0), 1e-9)
        for name in own:
            result[name] = frequency[name] / total * wanted
    return result


def read_hourly(file: str | Path) -> dict[str, FloatArray]:
    """[24] vehicles and pedestrians an hour from a CSV with columns hour, vehicles[, pedestrians].

    Raises:
        InputError: unreadable, an hour missing or twice, a count that is none.
    """
    found: dict[str, FloatArray] = {}
    try:
        with Path(file).open(encoding="utf-8-sig", newline="") as stream:
            rows = list(csv.DictReader(stream))
    except (OSError, UnicodeDecodeError, csv.Error) as fault:
        raise InputError(
            f"cannot read {file}: {getattr(fault, 'strerror', None) or fault}"
        ) from None
    for column, kind in (("vehicles", "vehicle"), ("pedestrians", "pedestrian")):
        if not rows or column not in rows[0]:
            continue
        counts = np.full(HOURS, np.nan)
        for number, row in enumerate(rows, start=2):
            try:
                hour, count = int(row["hour"] or ""), float(row[column] or "")
            except (KeyError, ValueError):
                raise InputError(f"{file}, line {number}: hour and {column} are numbers") from None
            if not (0 <= hour < HOURS and 0 <= count < _MOST_COUNT and math.isnan(counts[hour])):
                raise InputError(f"{file}, line {number}: each hour 0 to 23 once, counts from 0")
            counts[hour] = count
        if np.isnan(counts).any():
            raise InputError(f"{file} lacks {int(np.isnan(counts).sum())} of the 24 hours")
        found[kind] = counts
    if not found:
        raise InputError(f"{file} has no column vehicles or pedestrians beside hour")
    return found


def _laws(
    place: IntersectionMap,
    every: Sequence[tuple[Match, Track]],
    borrowed: Mapping[str, DrivingProfilePrior],
) -> dict[str, DrivingProfilePrior]:
    """Borrowed time laws whose free speed leans on the speeds that were seen, by class and turn."""
    speeds: dict[str, list[float]] = defaultdict(list)
    routes = {route.id: route for route in place.routes}
    for match, track in every:
        route = routes[match.route]
        speed = np.hypot(*(track.xy[5:] - track.xy[:-5]).T) / (5 * STEP)
        if len(speed) and float(speed.min()) > _FLOWING[route.type]:
            speeds[kind_of(route)].append(float(np.quantile(speed, 0.9)))
    return {
        route.id: _leaning(borrowed[route.id], speeds[kind_of(route)]) for route in place.routes
    }


def _leaning(law: DrivingProfilePrior, speeds: Sequence[float]) -> DrivingProfilePrior:
    if not speeds:
        return law
    logs = np.log(np.clip(speeds, law.low[0], law.high[0]))
    share = len(logs) / (len(logs) + _LAW_WEIGHT)
    median, spread = law.median.copy(), law.spread.copy()
    median[0] = math.exp(share * float(np.median(logs)) + (1 - share) * math.log(median[0]))
    own = float(1.4826 * np.median(np.abs(logs - np.median(logs))))
    spread[0] = max(share * own + (1 - share) * spread[0], 0.05)
    median[0] = float(np.clip(median[0], law.low[0], law.high[0]))
    return DrivingProfilePrior(median, spread, law.low, law.high, len(speeds))
