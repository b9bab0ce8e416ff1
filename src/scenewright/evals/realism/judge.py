"""Sets of scenes judged against a corpus and, where they are at hand, real tracks."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from scenewright.evals.realism.report import Report, Row, compare
from scenewright.evals.realism.samples import (
    MOTION,
    Agents,
    Doing,
    Measured,
    Part,
    Sieve,
    in_shares,
    motion,
    moving_shares,
    of_recordings,
    of_scenes,
    steady,
    stopping,
)
from scenewright.evals.realism.scenes import Played, cut_scenes
from scenewright.evals.realism.stops import MEASURES, Stop, Yields, all_stops, yield_stops
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
class Seen:
    """A set of scenes with its stops.

    Attributes:
        scenes: the scenes; side: which half each belongs to.
        stops: of those who yield, by scene; any: of everybody, by scene; yields: counts by scene.
    """

    scenes: tuple[Played, ...]
    side: tuple[bool, ...]
    stops: tuple[tuple[Stop, ...], ...]
    any: tuple[tuple[Stop, ...], ...]
    yields: tuple[Yields, ...]


def judge(
    sets: Mapping[str, Sequence[Played]],
    corpus: Sequence[Recording],
    *,
    intersection_map: IntersectionMap,
    real: RealTracks | None = None,
    draws: int = 200,
    seed: int = 0,
) -> Report:
    """Every measure of every set against the corpus and the real tracks.

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
    known = seen([scene for _, scene in cut], intersection_map=intersection_map, side=side)
    made = {name: seen(scenes, intersection_map=intersection_map) for name, scenes in sets.items()}
    options: dict[str, Any] = {"draws": draws, "seed": seed}
    rows = list(_motion_rows(made, known, options))
    rows += _alike_shares(
        "corpus", of_scenes(known.scenes), known.side, Sieve("vehicle"), made, options
    )
    rows += [*_stop_rows(made, known, options)]
    rows += _alike_rows(made, known, options)
    if real is not None:
        rows += _real_rows(made, known, real, options)
    return Report(tuple(rows), _facts(made, known, hours, real))


def seen(
    scenes: Sequence[Played],
    *,
    intersection_map: IntersectionMap,
    side: Sequence[bool] | None = None,
) -> Seen:
    """Scenes with their stops measured."""
    measured = [yield_stops(scene, intersection_map=intersection_map) for scene in scenes]
    halves = side if side is not None else [k % 2 == 0 for k in range(len(scenes))]
    anybody = (
        tuple(all_stops(build_trajectories(list(scene.users)), intersection_map=intersection_map))
        for scene in scenes
    )
    return Seen(
        tuple(scenes),
        tuple(halves),
        tuple(stops for stops, _ in measured),
        tuple(anybody),
        tuple(yields for _, yields in measured),
    )


_NEVER_SLOW: Doing = "is never slow"
_OF_VEHICLES: tuple[Doing, ...] = (
    "slows down", "comes to stand", "sets off", "stops and sets off",
)  # fmt: skip
"""What else vehicles do while they are seen; who stands hardly moves."""
_OF_NO_USE = {False: ("spread of speed",), True: ("speed, standing too",)}
"""Measures that say nothing about everybody, and about who is never slow."""


def _motion_rows(
    made: Mapping[str, Seen], known: Seen, options: Mapping[str, Any]
) -> Iterator[Row]:
    apart: list[tuple[AgentClass, Doing | None]] = [
        *itertools.product(CLASSES, (None, _NEVER_SLOW)),
        *itertools.product(CLASSES[:1], _OF_VEHICLES),
    ]
    for kind, doing in apart:
        sieve = Sieve(kind, doing=doing)
        topic = f"Motion of who {doing}" if doing else "Motion"
        reference = motion(of_scenes(known.scenes), sieve, side=known.side)
        for part in PARTS[:1] if doing else PARTS:
            sets = {
                name if part == "all" else f"{name}, {part}": motion(
                    of_scenes(each.scenes, part=part), sieve, side=each.side
                )
                for name, each in made.items()
            }
            measures = [m for m in MOTION if m not in _OF_NO_USE[doing is not None]]
            if doing in _OF_VEHICLES:
                measures = ["acceleration", "jerk"]
            yield from compare(
                topic, kind, sets, reference, named="corpus", measures=measures, **options
            )


def _alike_shares(
    named: str,
    reference: Sequence[Agents],
    side: Sequence[bool],
    sieve: Sieve,
    made: Mapping[str, Seen],
    options: Mapping[str, Any],
) -> Iterator[Row]:
    """Vehicles in the shares of what those of the reference do in view."""
    whole = replace(sieve, within=None)
    shares = moving_shares(reference, whole)
    sought = {each: shares[each] or 0.0 for each in (_NEVER_SLOW, *_OF_VEHICLES)}

    def alike(clusters: Sequence[Agents], sieve: Sieve, side: Sequence[bool]) -> Measured:
        rng = np.random.default_rng(options["seed"])
        return in_shares(clusters, sought, sieve, side=side, rng=rng)

    yield from compare(
        "Motion in the shares of the reference", "vehicle",
        {name: alike(of_scenes(each.scenes), sieve, each.side) for name, each in made.items()},
        alike(reference, whole, side), named=named,
        measures=("acceleration", "jerk"), **options,
    )  # fmt: skip


def _stop_rows(made: Mapping[str, Seen], known: Seen, options: Mapping[str, Any]) -> Iterator[Row]:
    for topic, attribute in (("Stops of who yields", "stops"), ("Stops of anybody", "any")):
        measures = MEASURES if attribute == "stops" else [m for m in MEASURES if m != "gap"]
        for kind in CLASSES:
            reference = stopping(getattr(known, attribute), kind, side=known.side)
            sets = {
                name: stopping(getattr(each, attribute), kind, side=each.side)
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


def _alike_rows(made: Mapping[str, Seen], known: Seen, options: Mapping[str, Any]) -> Iterator[Row]:
    """Stops for one other alone, by whom it was for.

    In a corpus people often let several pass in one standstill. A scene asks for one yield, between
    classes that the request names and not the corpus' streets.
    """
    for kind, other in PAIRS:
        sides: dict[str, Measured] = {}
        for name, each in {**made, "": known}.items():
            chosen = [[s for s in stops if s.alone and s.to == other] for stops in each.stops]
            sides[name] = stopping(chosen, kind, side=each.side)
        reference = sides.pop("")
        topic = f"Stops of who lets one {other} pass"
        yield from compare(
            topic, kind, sides, reference, named="corpus", measures=MEASURES, **options
        )


def _real_rows(
    made: Mapping[str, Seen], known: Seen, real: RealTracks, options: Mapping[str, Any]
) -> Iterator[Row]:
    """Real tracks: fine ones as they are, all of them under a heavier smoothing of both sides."""
    fine, rough = of_recordings(real.fine), of_recordings(real.recordings)
    for kind in CLASSES:
        yield from _against_real(
            "taf-bw, fine tracks within 25 m", Sieve(kind, within=NEAR_MIDDLE),
            fine, made, known, options,
        )  # fmt: skip
        if kind == "vehicle":
            yield from _against_real(
                "taf-bw, all tracks, both sides smoothed over 1 s",
                Sieve(kind, smoothing=ROUGH_SMOOTHING), rough, made, known, options,
            )  # fmt: skip


def _against_real(
    named: str,
    sieve: Sieve,
    real: Sequence[Agents],
    made: Mapping[str, Seen],
    known: Seen,
    options: Mapping[str, Any],
) -> Iterator[Row]:
    # Real tracks are in frames of their own: what of them lies near a middle is all of the fine.
    side = [k % 2 == 0 for k in range(len(real))]
    reference = motion(real, replace(sieve, within=None), side=side)
    sets: dict[str, Measured] = {
        name: motion(of_scenes(each.scenes), sieve, side=each.side)
        for name, each in {**made, "corpus": known}.items()
    }
    yield from compare(
        "Motion", sieve.type, sets, reference, named=named, measures=MOTION,
        **options,
    )  # fmt: skip
    if sieve.type == "vehicle":
        yield from _alike_shares(named, real, side, sieve, {**made, "corpus": known}, options)


def _facts(
    made: Mapping[str, Seen], known: Seen, hours: Sequence[str], real: RealTracks | None
) -> dict[str, Any]:
    facts: dict[str, Any] = {"corpus hours": ", ".join(hours)}
    for name, each in {**made, "corpus": known}.items():
        facts[f"{name}: scenes"] = len(each.scenes)
        facts[f"{name}: agents"] = sum(len(scene.users) for scene in each.scenes)
        facts[f"{name}: who yields"] = sum(yields.seen for yields in each.yields)
        facts[f"{name}: of these come to stand"] = sum(yields.stood for yields in each.yields)
        for doing, share in moving_shares(of_scenes(each.scenes)).items():
            facts[f"{name}: share of moving vehicle samples of who {doing}"] = _rounded(share)
        for kind in CLASSES:
            facts[f"{name}: share of {kind} samples standing"] = _rounded(_standing(each, kind))
            even = steady(of_scenes(each.scenes), Sieve(kind))
            facts[f"{name}: share of moving {kind} samples without acceleration"] = _rounded(even)
    if real is not None:
        for kind in CLASSES:
            even = steady(of_recordings(real.fine), Sieve(kind))
            facts[f"taf-bw, fine: share of moving {kind} samples without acceleration"] = _rounded(
                even
            )
        for site, removed in real.removed.items():
            jitter = real.jitter[site]
            facts[f"taf-bw {site}"] = f"jitter {jitter:.3f} m; " + "; ".join(removed.format_lines())
    return facts


def _standing(each: Seen, kind: AgentClass) -> float | None:
    samples = motion(of_scenes(each.scenes), Sieve(kind), side=each.side).samples
    every = len(samples["speed, standing too"])
    return 1 - len(samples["speed"]) / every if every else None


def _rounded(share: float | None) -> float | None:
    return None if share is None else round(share, 4)
