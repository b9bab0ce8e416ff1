"""Judge sets of scenes against a corpus and, where available, real tracks."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from scenewright.evals.realism.report import Comparison, ComparisonReport, compare
from scenewright.evals.realism.samples import (
    MOTION,
    Agents,
    MeasuredSamples,
    MotionFilter,
    MotionKind,
    Part,
    compute_moving_shares,
    compute_steady_share,
    list_recorded_agents,
    list_scene_agents,
    measure_motion,
    measure_stops,
    sample_in_shares,
)
from scenewright.evals.realism.scenes import SceneTracks, cut_scenes
from scenewright.evals.realism.stops import (
    MEASURES,
    ObservedStop,
    YieldCounts,
    find_all_stops,
    find_yield_stops,
)
from scenewright.scene.base import AgentClass
from scenewright.scene.map import IntersectionMap
from scenewright.tools.relation_checker import build_trajectories
from scenewright.tools.track_io import Recording
from scenewright.tools.track_io.taf_bw import RealTracks

CLASSES: tuple[AgentClass, ...] = ("vehicle", "pedestrian")
PARTS: tuple[Part, ...] = ("all", "foreground", "background")
NEAR_MIDDLE = 25.0
"""Half the side of the square that the sensors of the finest real tracks see [m]."""
ROUGH_SMOOTHING = 1.0
"""Smoothing under which positions that jitter by 0.15 m bear an acceleration [s]."""


@dataclass(frozen=True, eq=False)
class MeasuredScenes:
    """A set of scenes with its stops.

    Attributes:
        scenes: the scenes; side: which half each belongs to.
        stops: of yielding agents, by scene; any: of all agents, by scene; yields: counts by scene.
    """

    scenes: tuple[SceneTracks, ...]
    side: tuple[bool, ...]
    stops: tuple[tuple[ObservedStop, ...], ...]
    any: tuple[tuple[ObservedStop, ...], ...]
    yields: tuple[YieldCounts, ...]


def judge(
    sets: Mapping[str, Sequence[SceneTracks]],
    corpus: Sequence[Recording],
    *,
    intersection_map: IntersectionMap,
    real: RealTracks | None = None,
    draws: int = 200,
    seed: int = 0,
) -> ComparisonReport:
    """Compare every measure of every set with the corpus and the real tracks.

    Args:
        sets: scenes by name; later sets are compared with the first one, too.
        corpus: recordings that nothing was fitted to (test hours).
        intersection_map: the map of the scenes and the corpus.
        real: real tracks; None where they are not at hand.
        draws: resamplings for the intervals; seed: of their random numbers.
    """
    cut = list(cut_scenes(corpus, intersection_map=intersection_map))
    hours = list(dict.fromkeys(name for name, _ in cut))
    side = [hours.index(name) % 2 == 0 if len(hours) > 1 else k % 2 == 0
            for k, (name, _) in enumerate(cut)]  # fmt: skip
    known = measure_scenes(
        [scene for _, scene in cut], intersection_map=intersection_map, side=side
    )
    made = {
        name: measure_scenes(scenes, intersection_map=intersection_map)
        for name, scenes in sets.items()
    }
    options: dict[str, Any] = {"draws": draws, "seed": seed}
    rows = list(_compare_motion(made, known, options))
    rows += _compare_in_shares(
        "corpus",
        list_scene_agents(known.scenes),
        known.side,
        MotionFilter("vehicle"),
        made,
        options,
    )
    rows += [*_compare_stops(made, known, options)]
    rows += _compare_lone_stops(made, known, options)
    if real is not None:
        rows += _compare_real(made, known, real, options)
    return ComparisonReport(tuple(rows), _collect_facts(made, known, hours, real))


def measure_scenes(
    scenes: Sequence[SceneTracks],
    *,
    intersection_map: IntersectionMap,
    side: Sequence[bool] | None = None,
) -> MeasuredScenes:
    """Measure the stops of scenes."""
    measured = [find_yield_stops(scene, intersection_map=intersection_map) for scene in scenes]
    halves = side if side is not None else [k % 2 == 0 for k in range(len(scenes))]
    every_stop = (
        tuple(
            find_all_stops(build_trajectories(list(scene.users)), intersection_map=intersection_map)
        )
        for scene in scenes
    )
    return MeasuredScenes(
        tuple(scenes),
        tuple(halves),
        tuple(stops for stops, _ in measured),
        tuple(every_stop),
        tuple(yields for _, yields in measured),
    )


_NEVER_SLOW: MotionKind = "is never slow"
_OF_VEHICLES: tuple[MotionKind, ...] = (
    "slows down", "comes to stand", "sets off", "stops and sets off",
)  # fmt: skip
"""The other kinds of motion of vehicles; standing ones hardly move."""
_OF_NO_USE = {False: ("spread of speed",), True: ("speed, standing too",)}
"""Measures without meaning for all agents, and for unimpeded ones."""


def _compare_motion(
    made: Mapping[str, MeasuredScenes], known: MeasuredScenes, options: Mapping[str, Any]
) -> Iterator[Comparison]:
    apart: list[tuple[AgentClass, MotionKind | None]] = [
        *itertools.product(CLASSES, (None, _NEVER_SLOW)),
        *itertools.product(CLASSES[:1], _OF_VEHICLES),
    ]
    for kind, doing in apart:
        sieve = MotionFilter(kind, doing=doing)
        topic = f"Motion of who {doing}" if doing else "Motion"
        reference = measure_motion(list_scene_agents(known.scenes), sieve, side=known.side)
        for part in PARTS[:1] if doing else PARTS:
            sets = {
                name if part == "all" else f"{name}, {part}": measure_motion(
                    list_scene_agents(each.scenes, part=part), sieve, side=each.side
                )
                for name, each in made.items()
            }
            measures = [m for m in MOTION if m not in _OF_NO_USE[doing is not None]]
            if doing in _OF_VEHICLES:
                measures = ["acceleration", "jerk"]
            yield from compare(
                topic, kind, sets, reference, named="corpus", measures=measures, **options
            )


def _compare_in_shares(
    named: str,
    reference: Sequence[Agents],
    side: Sequence[bool],
    sieve: MotionFilter,
    made: Mapping[str, MeasuredScenes],
    options: Mapping[str, Any],
) -> Iterator[Comparison]:
    """Compare vehicles, their kinds of motion in the shares of the reference."""
    whole = replace(sieve, within=None)
    shares = compute_moving_shares(reference, whole)
    sought = {each: shares[each] or 0.0 for each in (_NEVER_SLOW, *_OF_VEHICLES)}

    def sample(
        clusters: Sequence[Agents], sieve: MotionFilter, side: Sequence[bool]
    ) -> MeasuredSamples:
        rng = np.random.default_rng(options["seed"])
        return sample_in_shares(clusters, sought, sieve, side=side, rng=rng)

    yield from compare(
        "Motion in the shares of the reference", "vehicle",
        {name: sample(list_scene_agents(each.scenes), sieve, each.side)
         for name, each in made.items()},
        sample(reference, whole, side), named=named,
        measures=("acceleration", "jerk"), **options,
    )  # fmt: skip


def _compare_stops(
    made: Mapping[str, MeasuredScenes], known: MeasuredScenes, options: Mapping[str, Any]
) -> Iterator[Comparison]:
    for topic, attribute in (("Stops of yielding agents", "stops"), ("Stops of any agent", "any")):
        measures = MEASURES if attribute == "stops" else [m for m in MEASURES if m != "gap"]
        for kind in CLASSES:
            reference = measure_stops(getattr(known, attribute), kind, side=known.side)
            sets = {
                name: measure_stops(getattr(each, attribute), kind, side=each.side)
                for name, each in made.items()
            }
            yield from compare(
                topic, kind, sets, reference, named="corpus", measures=measures, **options
            )


PAIRS: tuple[tuple[AgentClass, AgentClass], ...] = (
    ("vehicle", "pedestrian"),
    ("vehicle", "vehicle"),
    ("pedestrian", "vehicle"),
)


def _compare_lone_stops(
    made: Mapping[str, MeasuredScenes], known: MeasuredScenes, options: Mapping[str, Any]
) -> Iterator[Comparison]:
    """Compare stops for one other agent alone, by its class.

    In a corpus agents often let several pass in one standstill. A scene asks for one yield, between
    the classes that the request names.
    """
    for kind, other in PAIRS:
        sides: dict[str, MeasuredSamples] = {}
        for name, each in {**made, "": known}.items():
            chosen = [[s for s in stops if s.alone and s.to == other] for stops in each.stops]
            sides[name] = measure_stops(chosen, kind, side=each.side)
        reference = sides.pop("")
        topic = f"Stops of who lets one {other} pass"
        yield from compare(
            topic, kind, sides, reference, named="corpus", measures=MEASURES, **options
        )


def _compare_real(
    made: Mapping[str, MeasuredScenes],
    known: MeasuredScenes,
    real: RealTracks,
    options: Mapping[str, Any],
) -> Iterator[Comparison]:
    """Compare with real tracks: fine ones as they are, all with both sides smoothed more."""
    fine, rough = list_recorded_agents(real.fine), list_recorded_agents(real.recordings)
    for kind in CLASSES:
        yield from _compare_with_real(
            "taf-bw, fine tracks within 25 m", MotionFilter(kind, within=NEAR_MIDDLE),
            fine, made, known, options,
        )  # fmt: skip
        if kind == "vehicle":
            yield from _compare_with_real(
                "taf-bw, all tracks, both sides smoothed over 1 s",
                MotionFilter(kind, smoothing=ROUGH_SMOOTHING), rough, made, known, options,
            )  # fmt: skip


def _compare_with_real(
    named: str,
    sieve: MotionFilter,
    real: Sequence[Agents],
    made: Mapping[str, MeasuredScenes],
    known: MeasuredScenes,
    options: Mapping[str, Any],
) -> Iterator[Comparison]:
    # Real tracks are in frames of their own: what of them lies near a middle is all of the fine.
    side = [k % 2 == 0 for k in range(len(real))]
    reference = measure_motion(real, replace(sieve, within=None), side=side)
    sets: dict[str, MeasuredSamples] = {
        name: measure_motion(list_scene_agents(each.scenes), sieve, side=each.side)
        for name, each in {**made, "corpus": known}.items()
    }
    yield from compare(
        "Motion", sieve.type, sets, reference, named=named, measures=MOTION,
        **options,
    )  # fmt: skip
    if sieve.type == "vehicle":
        yield from _compare_in_shares(named, real, side, sieve, {**made, "corpus": known}, options)


def _collect_facts(
    made: Mapping[str, MeasuredScenes],
    known: MeasuredScenes,
    hours: Sequence[str],
    real: RealTracks | None,
) -> dict[str, Any]:
    facts: dict[str, Any] = {"corpus hours": ", ".join(hours)}
    for name, each in {**made, "corpus": known}.items():
        facts[f"{name}: scenes"] = len(each.scenes)
        facts[f"{name}: agents"] = sum(len(scene.users) for scene in each.scenes)
        facts[f"{name}: who yields"] = sum(yields.seen for yields in each.yields)
        facts[f"{name}: of these come to stand"] = sum(yields.stood for yields in each.yields)
        for doing, share in compute_moving_shares(list_scene_agents(each.scenes)).items():
            facts[f"{name}: share of moving vehicle samples of who {doing}"] = _round_share(share)
        for kind in CLASSES:
            facts[f"{name}: share of {kind} samples standing"] = _round_share(
                _compute_standing_share(each, kind)
            )
            even = compute_steady_share(list_scene_agents(each.scenes), MotionFilter(kind))
            facts[f"{name}: share of moving {kind} samples without acceleration"] = _round_share(
                even
            )
    if real is not None:
        for kind in CLASSES:
            even = compute_steady_share(list_recorded_agents(real.fine), MotionFilter(kind))
            facts[f"taf-bw, fine: share of moving {kind} samples without acceleration"] = (
                _round_share(even)
            )
        for site, removed in real.removed.items():
            jitter = real.jitter[site]
            facts[f"taf-bw {site}"] = f"jitter {jitter:.3f} m; " + "; ".join(removed.format_lines())
    return facts


def _compute_standing_share(each: MeasuredScenes, kind: AgentClass) -> float | None:
    samples = measure_motion(
        list_scene_agents(each.scenes), MotionFilter(kind), side=each.side
    ).samples
    every = len(samples["speed, standing too"])
    return 1 - len(samples["speed"]) / every if every else None


def _round_share(share: float | None) -> float | None:
    return None if share is None else round(share, 4)
