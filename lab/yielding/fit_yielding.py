"""Fit how agents yield, set off and brake in a corpus.

`python -m lab.yielding.fit_yielding --corpus F.npz --out manners.json` reads the fit
and validation hours alone; scenes are compared with the test hours.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from lab.yielding.stops import find_standstills, find_stop_of_yield
from scenewright.errors import InputError
from scenewright.evals.realism.sources import Stretch, cut_scenes
from scenewright.files import write_atomically
from scenewright.intersections import load_map, sign_bundle
from scenewright.scene.base import AgentClass
from scenewright.scene.events import Event
from scenewright.scene.map import IntersectionMap
from scenewright.scene.reaction_behavior import LEVELS, Quantiles, YieldingBehavior, YieldingModel
from scenewright.tools.gmm_sampler.observed_behavior import (
    AccelerationProfile,
    AccelerationProfiles,
)
from scenewright.tools.relation_checker import Trajectory, observe
from scenewright.tools.track_io import load_recordings

FEWEST = 20
"""Least number of yields of two classes for a fit."""
FEWEST_ROLLING = 5
"""Least number of rolling yields for a fit of how agents roll."""
LEAST_SPREAD = 0.05
LATEST = 3.5
"""An agent that enters longer after the other has left [s] did not roll because of it."""


@dataclass(frozen=True)
class YieldCase:
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


def find_yield_cases(
    scenes: Iterable[Stretch], *, intersection_map: IntersectionMap
) -> Iterator[YieldCase]:
    """Find every yield in which the giver enters the zone before its track ends.

    A standstill for several agents counts once, with the nearest of them: for the others alone the
    giver would have stopped further on.
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
        standing: dict[tuple[int, float], YieldCase] = {}
        rolling: dict[int, YieldCase] = {}
        for event in found.events:
            if event.type != "yielding" or event.evidence.get("entered") is None:
                continue
            case = _measure_case(event, movers, intersection_map)
            if case.stood_at is None:
                rolling.setdefault(event.from_, case)
            else:
                key = (event.from_, case.stood_at)
                known = standing.get(key)
                standing[key] = case if known is None else _merge_cases(known, case)
        stood = {giver for giver, _ in standing}
        yield from standing.values()
        yield from (case for giver, case in rolling.items() if giver not in stood)


def _merge_cases(one: YieldCase, other: YieldCase) -> YieldCase:
    """Merge two cases of one standstill: the nearer agent counts, and it is not for one alone."""
    return replace(min(one, other, key=_get_gap), alone=False)


def _get_gap(case: YieldCase) -> float:
    return np.inf if case.gap is None else case.gap


def _measure_case(
    event: Event,
    movers: dict[int, Trajectory],
    intersection_map: IntersectionMap,
) -> YieldCase:
    giver, seen = movers[event.from_], event.evidence
    pair = (giver.type, movers[event.to].type)
    begin, entered = float(seen["begins_to_slow"]), float(seen["entered"])
    cleared = float(seen["other_cleared"])
    stop = find_stop_of_yield(giver, event, intersection_map, tuple(movers.values()))
    if stop is None:
        part = slice(giver.index(begin), giver.index(entered) + 1)
        low = part.start + int(np.argmin(giver.speed[part]))
        at = float(np.interp(entered, giver.times, giver.s)) - float(giver.s[low])
        pace = float(giver.speed[low]) / float(seen["approach_speed"])
        return YieldCase(pair, None, pace=pace, place=at, margin=entered - cleared)
    stands = [s for s in find_standstills(giver) if begin <= giver.times[s.start] <= entered]
    started = float(giver.times[stands[-1].stop - 1])
    whole = stop.duration is not None
    return YieldCase(
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
    """Compute the even rate equivalent to a start or a braking [m/s^2].

    For vehicles halfway between the strongest and the mean. Pedestrians reach their pace within a
    second, so that a mean over two seconds measures walking speed; the strongest counts.
    """
    if most is None or mean is None or kind == "pedestrian":
        return most
    return (most + mean) / 2.0


def fit_yielding_model(seen: Sequence[YieldCase]) -> YieldingModel:
    """Fit the quantiles of every pair of classes with enough yields."""
    pairs = sorted({each.pair for each in seen})
    of = {pair: [each for each in seen if each.pair == pair] for pair in pairs}
    return {
        pair: _fit_yielding_behavior(found) for pair, found in of.items() if len(found) >= FEWEST
    }


def fit_acceleration_profiles(seen: Sequence[YieldCase]) -> AccelerationProfiles:
    """Fit how strongly agents of each class with enough yields set off and brake."""
    kinds: tuple[AgentClass, ...] = ("vehicle", "pedestrian")
    found: dict[AgentClass, AccelerationProfile] = {}
    for kind in kinds:
        own = [each for each in seen if each.pair[0] == kind]
        starts = [each.starts for each in own if each.starts is not None]
        brakes = [each.brakes for each in own if each.brakes is not None]
        if min(len(starts), len(brakes)) >= FEWEST:
            found[kind] = AccelerationProfile(_fit_lognormal(starts), _fit_lognormal(brakes))
    return found


def _fit_lognormal(values: Sequence[float]) -> tuple[float, float]:
    """Return the median, and the logarithm's standard deviation from its median deviation."""
    logs = np.log(np.maximum(values, 0.05))
    centre = float(np.median(logs))
    spread = 1.4826 * float(np.median(np.abs(logs - centre)))
    return round(float(np.exp(centre)), 3), round(max(spread, LEAST_SPREAD), 3)


def _fit_yielding_behavior(found: Sequence[YieldCase]) -> YieldingBehavior:
    rolling = [c for c in found if c.margin is not None and c.margin <= LATEST]
    rolling = rolling if len(rolling) >= FEWEST_ROLLING else []
    standing = [each for each in found if each.stood_at is not None]
    # A relation is between two agents alone: a giver that lets several pass in one standstill
    # waits longer than any giver of a generated scene.
    alone = [each for each in standing if each.alone]
    alone = alone if len(alone) >= FEWEST else standing
    return YieldingBehavior(
        rolls=round(len(rolling) / (len(rolling) + len(standing)), 3),
        **{name: _compute_quantiles(rolling, name) for name in ("pace", "place", "margin")},
        **{name: _compute_quantiles(alone, name) for name in ("gap", "stands", "reacts")},
    )


def _compute_quantiles(found: Sequence[YieldCase], name: str) -> Quantiles:
    values = [v for v in (getattr(each, name) for each in found) if v is not None]
    if not values:
        return (0.0,) * len(LEVELS)
    return tuple(round(float(q), 3) for q in np.quantile(values, LEVELS))


def format_yielding_model(
    model: YieldingModel, profiles: AccelerationProfiles | None = None
) -> str:
    """The text of `manners.json`."""
    pairs = {f"{yielding} to {other}": asdict(each) for (yielding, other), each in model.items()}
    rates = {name: asdict(profile) for name, profile in (profiles or {}).items()}
    return json.dumps({**pairs, **rates}, indent=1) + "\n"


def main(argv: Sequence[str] | None = None) -> int:
    """Measure the corpus and write the file."""
    parser = argparse.ArgumentParser(
        prog="python -m lab.yielding.fit_yielding", description=__doc__
    )
    parser.add_argument("--intersection", default="amsterdam_120")
    parser.add_argument("--corpus", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args(argv)
    try:
        intersection_map = load_map(arguments.intersection)
        hours = [
            r for s in ("fit", "validation") for r in load_recordings(arguments.corpus, split=s)
        ]
        seen = list(
            find_yield_cases(
                cut_scenes(hours, intersection_map=intersection_map),
                intersection_map=intersection_map,
            )
        )
        found = fit_yielding_model(seen)
        if not found:
            raise InputError(
                f"{arguments.corpus} shows too few yields in its fit hours: {len(seen)}"
            )
        write_atomically(
            arguments.out,
            format_yielding_model(found, fit_acceleration_profiles(seen)).encode("utf-8"),
        )
        sign_bundle(arguments.out.parent, arguments.out.name)
    except InputError as fault:
        print(fault, file=sys.stderr)
        return fault.exit_code
    print(f"{arguments.out}: {len(seen)} yields", file=sys.stderr)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
