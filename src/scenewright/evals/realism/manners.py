"""How people give way, set off and brake in a corpus, from hours that judge nothing.

`python -m scenewright.evals.realism.manners --corpus F.npz --out manners.json` looks at the fit and
validation hours alone; what scenes are compared with are the test hours.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from scenewright.errors import InputError
from scenewright.evals.realism.scenes import Played, cut_scenes
from scenewright.evals.realism.stops import given_way, standstills
from scenewright.files import write_atomically
from scenewright.intersections import load_map, sign_bundle
from scenewright.scene.base import AgentClass
from scenewright.scene.events import Event
from scenewright.scene.map import IntersectionMap
from scenewright.scene.yielding_behavior import LEVELS, Quantiles, YieldingBehavior, YieldingModel
from scenewright.tools.gmm_sampler.yielding_files import (
    AccelerationProfile,
    AccelerationProfiles,
    format_yielding_model,
)
from scenewright.tools.relation_checker import Trajectory, observe
from scenewright.tools.track_io import load_recordings

FEWEST = 20
"""Yields of two classes below which their habits are not told."""
FEWEST_ROLLING = 5
"""Of those who do not stand: fewer say nothing about how it is done."""
LEAST_SPREAD = 0.05
LATEST = 3.5
"""Who enters longer after the other has left [s] did not roll for its sake."""


@dataclass(frozen=True)
class Case:
    """One yield that was seen whole; measures as in `YieldingBehavior`, None where there is none.

    Attributes:
        stood_at: when its standstill began [s]; None if it never stood.
        alone: it stood for one other alone.
        starts, brakes: how it set off and braked [m/s^2], as `AccelerationProfile` has it.
    """

    pair: tuple[AgentClass, AgentClass]
    stood_at: float | None
    alone: bool = False
    pace: float | None = None
    place: float | None = None
    margin: float | None = None
    gap: float | None = None
    stands: float | None = None
    reacts: float | None = None
    starts: float | None = None
    brakes: float | None = None


def cases(scenes: Iterable[Played], *, intersection_map: IntersectionMap) -> Iterator[Case]:
    """Every yield in which the giver enters the zone before its track ends.

    Who stands once for several counts once, with the nearest of them: the others are waited for
    from further off than anybody would for their sake.
    """
    for scene in scenes:
        found = observe(
            scene.users,
            intersection_map=intersection_map,
            signals=scene.signals,
            asked=(),
            detailed=(),
        )
        movers = {mover.id: mover for mover in found.tracks}
        standing: dict[tuple[int, float], Case] = {}
        rolling: dict[int, Case] = {}
        for event in found.events:
            if event.type != "yielding" or event.evidence.get("entered") is None:
                continue
            case = _case(event, movers, scene, intersection_map)
            if case.stood_at is None:
                rolling.setdefault(event.from_, case)
            else:
                key = (event.from_, case.stood_at)
                known = standing.get(key)
                standing[key] = case if known is None else _together(known, case)
        stood = {giver for giver, _ in standing}
        yield from standing.values()
        yield from (case for giver, case in rolling.items() if giver not in stood)


def _together(one: Case, other: Case) -> Case:
    """Who stands for two stands for the nearer of them, and not for one alone."""
    return replace(min(one, other, key=_distance), alone=False)


def _distance(case: Case) -> float:
    return np.inf if case.gap is None else case.gap


def _case(
    event: Event, movers: dict[int, Trajectory], scene: Played, intersection_map: IntersectionMap
) -> Case:
    giver, seen = movers[event.from_], event.evidence
    pair = (giver.type, movers[event.to].type)
    begin, entered = float(seen["begins_to_slow"]), float(seen["entered"])
    cleared = float(seen["other_cleared"])
    stop = given_way(giver, event, scene, intersection_map, tuple(movers.values()))
    if stop is None:
        part = slice(giver.index(begin), giver.index(entered) + 1)
        low = part.start + int(np.argmin(giver.speed[part]))
        at = float(np.interp(entered, giver.times, giver.s)) - float(giver.s[low])
        pace = float(giver.speed[low]) / float(seen["approach_speed"])
        return Case(pair, None, pace=pace, place=at, margin=entered - cleared)
    stands = [s for s in standstills(giver) if begin <= giver.times[s.start] <= entered]
    started = float(giver.times[stands[-1].stop - 1])
    whole = stop.duration is not None
    return Case(
        pair,
        float(giver.times[stands[-1].start]),
        alone=stop.alone,
        gap=stop.gap,
        stands=stop.duration,
        reacts=started - cleared if whole else None,
        starts=_rate(giver.type, stop.starting, stop.mean_starting),
        brakes=_rate(giver.type, stop.braking, stop.mean_braking),
    )


def _rate(kind: AgentClass, most: float | None, mean: float | None) -> float | None:
    """The even rate that stands for a start or a braking [m/s^2].

    Halfway between the strongest and the mean for vehicles. People on foot have their pace after
    less than a second, so that a mean over two says how fast they walk; the strongest counts.
    """
    if most is None or mean is None or kind == "pedestrian":
        return most
    return (most + mean) / 2.0


def habits(seen: Sequence[Case]) -> YieldingModel:
    """The quantiles of every pair of classes that gives way often enough."""
    pairs = sorted({each.pair for each in seen})
    of = {pair: [each for each in seen if each.pair == pair] for pair in pairs}
    return {pair: _manners(found) for pair, found in of.items() if len(found) >= FEWEST}


def paces(seen: Sequence[Case]) -> AccelerationProfiles:
    """How briskly those of each class set off and brake who gave way often enough."""
    kinds: tuple[AgentClass, ...] = ("vehicle", "pedestrian")
    found: dict[AgentClass, AccelerationProfile] = {}
    for kind in kinds:
        own = [each for each in seen if each.pair[0] == kind]
        starts = [each.starts for each in own if each.starts is not None]
        brakes = [each.brakes for each in own if each.brakes is not None]
        if min(len(starts), len(brakes)) >= FEWEST:
            found[kind] = AccelerationProfile(_lognormal(starts), _lognormal(brakes))
    return found


def _lognormal(values: Sequence[float]) -> tuple[float, float]:
    """Median, and standard deviation of the logarithm from the median deviation."""
    logs = np.log(np.maximum(values, 0.05))
    centre = float(np.median(logs))
    spread = 1.4826 * float(np.median(np.abs(logs - centre)))
    return round(float(np.exp(centre)), 3), round(max(spread, LEAST_SPREAD), 3)


def _manners(found: Sequence[Case]) -> YieldingBehavior:
    rolling = [c for c in found if c.margin is not None and c.margin <= LATEST]
    rolling = rolling if len(rolling) >= FEWEST_ROLLING else []
    standing = [each for each in found if each.stood_at is not None]
    # A relation is between two, and nothing else happens beside it: whoever lets several pass in
    # one standstill waits longer than anybody does in a scene.
    alone = [each for each in standing if each.alone]
    alone = alone if len(alone) >= FEWEST else standing
    return YieldingBehavior(
        rolls=round(len(rolling) / (len(rolling) + len(standing)), 3),
        **{name: _quantiles(rolling, name) for name in ("pace", "place", "margin")},
        **{name: _quantiles(alone, name) for name in ("gap", "stands", "reacts")},
    )


def _quantiles(found: Sequence[Case], name: str) -> Quantiles:
    values = [v for v in (getattr(each, name) for each in found) if v is not None]
    if not values:
        return (0.0,) * len(LEVELS)
    return tuple(round(float(q), 3) for q in np.quantile(values, LEVELS))


def main(argv: Sequence[str] | None = None) -> int:
    """Measure the corpus and write the file."""
    words = argparse.ArgumentParser(
        prog="python -m scenewright.evals.realism.manners", description=__doc__
    )
    words.add_argument("--intersection", default="amsterdam_120")
    words.add_argument("--corpus", type=Path, required=True)
    words.add_argument("--out", type=Path, required=True)
    told = words.parse_args(argv)
    try:
        intersection_map = load_map(told.intersection)
        hours = [r for s in ("fit", "validation") for r in load_recordings(told.corpus, split=s)]
        seen = list(
            cases(
                (scene for _, scene in cut_scenes(hours, intersection_map=intersection_map)),
                intersection_map=intersection_map,
            )
        )
        found = habits(seen)
        if not found:
            raise InputError(f"{told.corpus} shows too few yields in its fit hours: {len(seen)}")
        write_atomically(told.out, format_yielding_model(found, paces(seen)).encode("utf-8"))
        sign_bundle(told.out.parent, told.out.name)
    except InputError as fault:
        print(fault, file=sys.stderr)
        return fault.exit_code
    print(f"{told.out}: {len(seen)} yields", file=sys.stderr)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
