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

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from scenewright.arrays import read_arrays
from scenewright.errors import InputError
from scenewright.evals.bootstrap import compute_interval
from scenewright.evals.tables.likelihood import find_nearest_on
from scenewright.evals.tables.nearness import CLASSES, STANDING, ObservedTracks
from scenewright.geometry.kinematics import compute_kinematics
from scenewright.intersections import find_bundle_folder
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.record import SceneRecord

BAR = 0.8
FEWEST = 5
"""Agents of a route, or events of a kind, below which a spread says nothing."""
ASKED_AT = (6.0, 20.0)
UNIMPEDED = {"vehicle": 3.0, "pedestrian": 0.5}
_Values = tuple[FloatArray, FloatArray, FloatArray]
"""Of the dataset, of windows beside its scenes, of whole windows."""
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

    def compute_values(
        self,
        ours: Sequence[ObservedTracks],
        values: Callable[[Sequence[ObservedTracks]], FloatArray],
    ) -> _Values:
        """Values of the dataset, of the windows beside it, and of the whole windows."""
        return values(ours), values(self.beside), values(self.whole)


@dataclass(frozen=True)
class Spread:
    """One ratio with its interval (95 %, resampled); spreads in the unit named.

    Attributes:
        what, group: such as `lateral position` of `vehicle`.
        ours, corpus: standard deviations; n, n_corpus: values that they are of.
        whole: standard deviation in the corpus' windows as they are, of whatever traffic and 30 s
            long; None where the corpus is not cut.
    """

    what: str
    group: str
    unit: str
    ours: float
    corpus: float
    n: int
    n_corpus: int
    low: float
    high: float
    whole: float | None = None

    @property
    def ratio(self) -> float:
        """Ours over the corpus'."""
        return self.ours / self.corpus

    @property
    def ratio_to_whole(self) -> float | None:
        """Ours over that of the corpus' windows as they are."""
        return None if self.whole is None else self.ours / self.whole

    @property
    def enough(self) -> bool:
        """Whether the ratio is at least 0.8."""
        return self.ratio >= BAR


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
    found = (_compare_lateral_position(kind, kept, held, draws, seed) for kind in CLASSES)
    return [each for each in found if each is not None]


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
    return {r: _build_held_out(t) for r, t in zip(routes, tracks, strict=True) if len(t) >= FEWEST}


def _build_held_out(tracks: FloatArray) -> HeldOutTracks:
    mean = tracks.mean(axis=0)
    along = np.gradient(mean, axis=0)
    along /= np.maximum(np.hypot(*along.T)[:, None], 1e-9)
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    return HeldOutTracks(mean, normal, ((tracks - mean) * normal).sum(axis=2))


def _compare_lateral_position(
    kind: AgentClass,
    ours: Mapping[str, FloatArray],
    held: Mapping[str, HeldOutTracks],
    draws: int,
    seed: int,
) -> Spread | None:
    routes = [route for route in ours if route.startswith(kind)]
    if not routes:
        return None
    # Every route weighs as much on both sides: as many agents as it has in the dataset.
    agents = sum(len(ours[route]) for route in routes)
    weights = [len(ours[route]) / agents for route in routes]
    spread = _pool_deviations([_compute_variance(ours[r]) for r in routes], weights)
    corpus = _pool_deviations([_compute_variance(held[r].offsets) for r in routes], weights)
    rng = np.random.default_rng(seed)
    again = [
        _pool_deviations([_compute_variance(_resample_rows(ours[r], rng)) for r in routes], weights)
        for _ in range(draws)
    ]
    # Drawing anew from few agents repeats some and narrows; the mean of the draws shows how much.
    level = spread / max(float(np.mean(again)), 1e-9)
    low, high = compute_interval(np.array(again) * level / corpus)
    count = sum(len(held[r].offsets) for r in routes)
    return Spread("lateral position", kind, "m", spread, corpus, agents, count, low, high)


def _resample_rows(rows: FloatArray, rng: np.random.Generator) -> FloatArray:
    return np.asarray(rows[rng.integers(len(rows), size=len(rows))])


def _compute_variance(offsets: FloatArray) -> float:
    """Mean over the K stations of the variance there; stations that fewer than three pass aside."""
    passed = (~np.isnan(offsets)).sum(axis=0) >= 3
    if not passed.any():
        return 0.0
    return float(np.nanvar(offsets[:, passed], axis=0, ddof=1).mean())


def _pool_deviations(variances: Sequence[float], weights: Sequence[float]) -> float:
    return float(np.sqrt(np.dot(variances, weights)))


def compare_speeds(
    ours: Sequence[ObservedTracks], corpus: CorpusWindows, *, draws: int, seed: int
) -> list[Spread]:
    """Spread of how fast agents go where nothing keeps them."""
    found = []
    for kind in CLASSES:
        for what, least in (("speed", 0.0), ("speed of who is never slow", UNIMPEDED[kind])):
            parts = corpus.compute_values(ours, partial(_list_top_speeds, kind=kind, least=least))
            found += _compare_spread(what, kind, "m/s", parts, draws, seed)
    return found


def _list_top_speeds(
    scenes: Sequence[ObservedTracks], *, kind: AgentClass, least: float
) -> FloatArray:
    parts = [_compute_top_speeds(each, kind, least) for each in scenes]
    return np.concatenate([np.zeros(0), *parts])[:, None]


def _compute_top_speeds(watched: ObservedTracks, kind: AgentClass, least: float) -> FloatArray:
    done = (
        compute_kinematics(u.track.xy).speed for u in watched.scene.users if u.shape.type == kind
    )
    kept = (speed for speed in done if len(speed) >= _LONG and speed.min() >= least)
    moving = (speed[speed > STANDING] for speed in kept)
    return np.array([np.quantile(speed, _TOP) for speed in moving if len(speed) >= _LONG])


def compare_events(
    ours: Sequence[ObservedTracks], corpus: CorpusWindows, *, draws: int, seed: int
) -> list[Spread]:
    """Spread of where and when events happen; kinds that the corpus does not know are left out."""
    found = []
    within = f"time of events, {ASKED_AT[0]:g} to {ASKED_AT[1]:g} s"
    for kind in ("yielding", "near_miss", "follow"):
        for what, unit, part in (
            ("place of events", "m", _list_event_places),
            ("time of events", "s", _list_event_times),
            (within, "s", _list_requested_times),
        ):
            parts = corpus.compute_values(ours, partial(part, kind=kind))
            found += _compare_spread(what, kind, unit, parts, draws, seed)
    return found


def _list_event_places(scenes: Sequence[ObservedTracks], *, kind: str) -> FloatArray:
    """[n, 2] places of the events of a kind [m]."""
    return _list_events(scenes, kind)[:, :2]


def _list_event_times(scenes: Sequence[ObservedTracks], *, kind: str) -> FloatArray:
    """[n, 1] their times [s]."""
    return _list_events(scenes, kind)[:, 2:]


def _list_requested_times(scenes: Sequence[ObservedTracks], *, kind: str) -> FloatArray:
    """[n, 1] times of those that lie where events that are asked for do [s]."""
    times = _list_event_times(scenes, kind=kind)
    inside = (times[:, 0] >= ASKED_AT[0]) & (times[:, 0] <= ASKED_AT[1])
    return np.asarray(times[inside])


def _list_events(scenes: Sequence[ObservedTracks], kind: str) -> FloatArray:
    """[n, 3] x, y [m] and time [s] of every event of a kind, asked for or not."""
    rows = [
        (*event.location, event.time)
        for each in scenes
        for event in each.seen.events
        if event.type == kind
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def _compare_spread(
    what: str, group: str, unit: str, values: _Values, draws: int, seed: int
) -> list[Spread]:
    ours, beside, whole = values
    if min(len(ours), len(beside)) < FEWEST:
        return []
    rng = np.random.default_rng(seed)
    base = _compute_deviation(beside)
    again = [_compute_deviation(_resample_rows(ours, rng)) / base for _ in range(draws)]
    low, high = compute_interval(np.array(again))
    return [
        Spread(
            what, group, unit, _compute_deviation(ours), base, len(ours), len(beside),
            low, high, _compute_deviation(whole) if len(whole) >= FEWEST else None,
        )
    ]  # fmt: skip


def _compute_deviation(values: FloatArray) -> float:
    """Root of the summed variances of all columns."""
    return float(np.sqrt(values.var(axis=0, ddof=1).sum()))
