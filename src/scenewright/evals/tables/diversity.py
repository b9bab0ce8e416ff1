"""Whether scenes differ from one another as much as real traffic does: ratios of spreads.

Taking the likeliest candidates alone (Eq. 4) would make all agents drive in the middle of the lane
at the usual speed. Each ratio is a standard deviation in the dataset over that in the corpus; the
bar is 0.8.

- lateral position: across the mean path of a route, at the stations that tracks pass; within
  routes, pooled over those that have at least five agents in the dataset;
- speed: 90 % quantile of an agent's speed while it moves, within class; of all agents, which queues
  widen, and of those never slow (3 m/s, on foot 0.5);
- place of events: distance from the mean place of its kind, in both directions;
- time of events: within the scene; and of those alone that lie between 6 and 20 s, where all
  events that are asked for have to lie (SEMANTICS section 6).

How fast people go and when events happen depends on how many are there and on how long the scene
is. The corpus is therefore cut to the dataset: beside every scene a window as long, with as many
vehicles. The ratio to its windows as they are, rush hours and all, stands beside it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from scenewright.arrays import read_arrays
from scenewright.errors import InputError
from scenewright.evals.bootstrap import Figure, build_figure, draw_weights
from scenewright.evals.realism.sources import Stretch, clip
from scenewright.evals.tables.likelihood import find_nearest_on
from scenewright.evals.tables.nearness import CLASSES, STANDING, ObservedTracks
from scenewright.geometry.kinematics import compute_kinematics
from scenewright.geometry.polyline import compute_normals
from scenewright.intersections import find_bundle_folder
from scenewright.scene.base import FloatArray
from scenewright.scene.record import SceneRecord

BAR = 0.8
FEWEST = 5
"""Agents of a route, or events of a kind, below which a spread says nothing."""
ASKED_AT = (6.0, 20.0)
UNIMPEDED = {"vehicle": 3.0, "pedestrian": 0.5}
_TOP = 0.9
_LONG = 10
"""Samples that a quantile of a speed needs."""


@dataclass(frozen=True, eq=False)
class CorpusWindows:
    """What a corpus shows.

    Attributes:
        beside: windows as long and as busy as the scenes; whole: its windows as they are.
    """

    beside: Sequence[ObservedTracks]
    whole: Sequence[ObservedTracks]


@dataclass(frozen=True)
class Spread:
    """One ratio of standard deviations, in the unit named.

    Attributes:
        what, group: such as `lateral position` of `vehicle`.
        ours, corpus: standard deviations; ratio: of the two, n values resampled; n_corpus: values
            of the corpus; enough: whether the ratio is at least 0.8.
        whole: standard deviation in the corpus' windows as they are, of whatever traffic and 30 s
            long; None where the corpus is not cut.
    """

    what: str
    group: str
    unit: str
    ours: float
    corpus: float
    n_corpus: int
    ratio: Figure
    enough: bool
    whole: float | None = None
    ratio_to_whole: float | None = None


def compare_lateral_positions(
    scenes: Iterable[SceneRecord], *, bundle: str | Path, draws: int, seed: int
) -> list[Spread]:
    """Spread across the paths of routes, against the held-out tracks of a bundle."""
    held = load_held_out(bundle)
    ours: dict[str, list[FloatArray]] = {}
    for scene in scenes:
        for agent in scene.agents:
            if agent.route in held:
                xy, drawn = np.array(agent.trajectory), np.array(agent.waypoints)
                mean, normal = held[agent.route].mean, held[agent.route].normal
                # Where the track passes the agent's own waypoints, as offsets from the mean path.
                place, passed = find_nearest_on(xy, drawn)
                off = np.where(passed, ((place - mean) * normal).sum(axis=1), np.nan)
                ours.setdefault(agent.route, []).append(off)
    kept = {route: np.array(rows) for route, rows in ours.items() if len(rows) >= FEWEST}
    found = []
    for kind in CLASSES:
        mine = {route: rows for route, rows in kept.items() if route.startswith(kind)}
        if not mine:
            continue
        # Every route weighs as much on both sides: as many agents as it has in the dataset.
        agents = sum(map(len, mine.values()))
        share = np.array([len(rows) / agents for rows in mine.values()])
        known = [held[route].offsets for route in mine]
        spread = _compute_deviation(mine.values(), share, draws=draws, seed=seed)
        # Drawing anew from few agents repeats some and narrows; the mean of the draws shows how
        # much.
        spread[1:] *= spread[0] / max(float(np.mean(spread[1:])), 1e-9)
        corpus = float(_compute_deviation(known, share)[0])
        name = ("lateral position", kind, "m")
        found.append(_build_spread(name, spread, agents, corpus, sum(map(len, known))))
    return found


def _build_spread(
    name: tuple[str, str, str],
    spread: FloatArray,
    n: int,
    corpus: float,
    n_corpus: int,
    whole: float | None = None,
) -> Spread:
    """Build the ratio of a deviation [1 + draws] in the data, then in resamples, to the corpus'."""
    ratio, ours = build_figure(spread / corpus, n), float(spread[0])
    to_whole = None if whole is None else ours / whole
    return Spread(*name, ours, corpus, n_corpus, ratio, ours / corpus >= BAR, whole, to_whole)


@dataclass(frozen=True, eq=False)
class HeldOutTracks:
    """Held-out tracks of one route.

    Attributes:
        mean: [K, 2] mean waypoints [m]; normal: [K, 2] unit vectors across the mean path.
        offsets: [n, K] of each track from it, to the left [m].
    """

    mean: FloatArray
    normal: FloatArray
    offsets: FloatArray


def load_held_out(bundle: str | Path) -> dict[str, HeldOutTracks]:
    """The held-out tracks of a bundle by route; none if it keeps none."""
    file = (bundle if isinstance(bundle, Path) else find_bundle_folder(bundle)) / "heldout.npz"
    if not file.is_file():
        return {}
    stored = read_arrays(file, what="the held-out tracks")
    try:
        ends = np.cumsum(stored["test_tracks"])[:-1]
        tracks = np.split(stored["waypoints"].astype(np.float64), ends)
        routes = [str(name) for name in stored["routes"]]
    except (KeyError, TypeError, ValueError) as fault:
        raise InputError(f"cannot read the held-out tracks {file}: {fault}") from None
    found = {}
    for route, own in zip(routes, tracks, strict=True):
        if len(own) >= FEWEST:
            mean = own.mean(axis=0)
            normal = compute_normals(mean)
            found[route] = HeldOutTracks(mean, normal, ((own - mean) * normal).sum(axis=2))
    return found


def _compute_variances(
    values: FloatArray, *, draws: int = 0, seed: int | np.random.Generator = 0
) -> FloatArray:
    """[1 + draws, D] variances of columns [n, D] of the data, then of resamples; NaN is left out.

    NaN also where fewer than three rows are known.
    """
    weights, known = draw_weights(len(values), draws=draws, seed=seed), ~np.isnan(values)
    middle = np.where(known, values, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    away = np.where(known, values - middle, 0.0)
    count = np.where(weights @ known >= 3, weights @ known, np.nan)
    return np.asarray((weights @ away**2 - (weights @ away) ** 2 / count) / (count - 1))


def _compute_deviation(
    routes: Iterable[FloatArray], share: FloatArray, *, draws: int = 0, seed: int = 0
) -> FloatArray:
    """[1 + draws] root of the weighed mean over routes of the variance of offsets [n, K].

    Of a route it is the mean over the K stations, without those that fewer than three pass.
    """
    rng = np.random.default_rng(seed)
    means = []
    for offsets in routes:
        variances = _compute_variances(offsets, draws=draws, seed=rng)
        passed = (~np.isnan(variances)).sum(axis=1)
        means.append(np.nansum(variances, axis=1) / np.maximum(passed, 1))
    return np.asarray(np.sqrt(share @ means))


def compare_speeds(
    ours: Sequence[ObservedTracks], corpus: CorpusWindows, *, draws: int, seed: int
) -> list[Spread]:
    """Spread of how fast agents go where nothing keeps them."""
    found = []
    for kind in CLASSES:
        for what, least in (("speed", 0.0), ("speed of who is never slow", UNIMPEDED[kind])):
            values = []
            for scenes in (ours, corpus.beside, corpus.whole):
                users = (u for s in scenes for u in s.scene.users if u.shape.type == kind)
                done = (compute_kinematics(user.track.xy).speed for user in users)
                kept = (speed for speed in done if len(speed) >= _LONG and speed.min() >= least)
                moving = (speed[speed > STANDING] for speed in kept)
                top = [np.quantile(speed, _TOP) for speed in moving if len(speed) >= _LONG]
                values.append(np.array(top, dtype=np.float64).reshape(-1, 1))
            found += _compare_spread(what, kind, "m/s", values, draws, seed)
    return found


def compare_events(
    ours: Sequence[ObservedTracks], corpus: CorpusWindows, *, draws: int, seed: int
) -> list[Spread]:
    """Spread of where and when events happen; kinds that the corpus does not know are left out."""
    found = []
    first, last = ASKED_AT
    for kind in ("yielding", "near_miss", "follow"):
        # [n, 3] x, y [m] and time [s] of every event of the kind, asked for or not.
        rows = []
        for scenes in (ours, corpus.beside, corpus.whole):
            events = (e for each in scenes for e in each.seen.events if e.type == kind)
            own = [(*event.location, event.time) for event in events]
            rows.append(np.array(own, dtype=np.float64).reshape(-1, 3))
        times = [row[:, 2:] for row in rows]
        asked = [time[(time[:, 0] >= first) & (time[:, 0] <= last)] for time in times]
        for what, unit, values in (
            ("place of events", "m", [row[:, :2] for row in rows]),
            ("time of events", "s", times),
            (f"time of events, {first:g} to {last:g} s", "s", asked),
        ):
            found += _compare_spread(what, kind, unit, values, draws, seed)
    return found


def _compare_spread(
    what: str, group: str, unit: str, values: Sequence[FloatArray], draws: int, seed: int
) -> list[Spread]:
    """The ratio of values [n, D] of the dataset, windows beside its scenes, and whole windows."""
    ours, beside, whole = values
    if min(len(ours), len(beside)) < FEWEST:
        return []

    def compute_deviation(rows: FloatArray, draws: int = 0) -> FloatArray:
        return np.asarray(np.sqrt(_compute_variances(rows, draws=draws, seed=seed).sum(axis=1)))

    of_whole = float(compute_deviation(whole)[0]) if len(whole) >= FEWEST else None
    spread, corpus = compute_deviation(ours, draws), float(compute_deviation(beside)[0])
    return [_build_spread((what, group, unit), spread, len(ours), corpus, len(beside), of_whole)]


def match_windows(
    scenes: Sequence[Stretch], windows: Sequence[Stretch], *, least: int
) -> list[Stretch]:
    """Find for every scene a window with as many vehicles, cut to the scene's length.

    Where no window has as many, one whose number is nearest; of several, the one that was taken
    least often. Few scenes get several windows each, so that there are at least `least` in all.
    """
    if not (scenes and windows):
        return []
    starts = [_list_starts(window) for window in windows]
    taken = np.zeros(len(windows), dtype=np.intp)
    found = []
    for scene in [*scenes] * -(-least // len(scenes)):
        length = max((user.track.end for user in scene.users), default=0.0)
        seen = np.array([np.searchsorted(start, length) for start in starts])
        number = int(np.lexsort((taken, np.abs(seen - len(_list_starts(scene)))))[0])
        taken[number] += 1
        found.append(shorten_scene(windows[number], length))
    return found


def shorten_scene(scene: Stretch, length: float) -> Stretch:
    """Cut a scene to its first seconds; agents with less than two samples are left out."""
    cut = ((user, clip(user.track, 0.0, length + 2e-6, fewest=2)) for user in scene.users)
    users = (replace(user, track=track) for user, track in cut if track is not None)
    return replace(scene, users=tuple(users))


def _list_starts(scene: Stretch) -> FloatArray:
    """List when each vehicle is first seen [s], sorted."""
    first = [user.track.start for user in scene.users if user.shape.type == "vehicle"]
    return np.sort(np.array(first, dtype=np.float64))
