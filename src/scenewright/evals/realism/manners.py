"""How people give way in a corpus: quantiles for the solver, from hours that judge nothing.

`python -m scenewright.evals.realism.manners --corpus F.npz --out manners.json` looks at the fit and
validation hours alone; what scenes are compared with are the test hours.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenewright.errors import InputError
from scenewright.evals.realism.scenes import Played, cut_scenes
from scenewright.evals.realism.stops import given_way, standstills
from scenewright.graph.atomic import write_atomically
from scenewright.intersections import load_map
from scenewright.scene.base import AgentClass
from scenewright.scene.events import Event
from scenewright.scene.manners import LEVELS, Habits, Manners, Quantiles
from scenewright.scene.map import IntersectionMap
from scenewright.tools.gmm_sampler.manners import to_json
from scenewright.tools.recordings import load_recordings
from scenewright.tools.relation_checker import Mover, observe

FEWEST = 20
"""Yields of two classes below which their habits are not told."""
FEWEST_ROLLING = 5
"""Of those who do not stand: fewer say nothing about how it is done."""
LATEST = 3.5
"""Who enters longer after the other has left [s] did not roll for its sake."""


@dataclass(frozen=True)
class Case:
    """One yield that was seen whole; measures as in `Manners`, None where there is none."""

    pair: tuple[AgentClass, AgentClass]
    stood: bool
    pace: float | None = None
    place: float | None = None
    margin: float | None = None
    gap: float | None = None
    stands: float | None = None
    reacts: float | None = None


def cases(scenes: Iterable[Played], *, on: IntersectionMap) -> Iterator[Case]:
    """Every yield in which the giver enters the zone before its track ends."""
    for scene in scenes:
        found = observe(scene.users, ground=on, signals=scene.signals, asked=(), detailed=())
        movers = {mover.id: mover for mover in found.movers}
        for event in found.events:
            if event.type == "yielding" and event.evidence.get("entered") is not None:
                yield _case(event, movers, scene, on)


def _case(event: Event, movers: dict[int, Mover], scene: Played, on: IntersectionMap) -> Case:
    giver, seen = movers[event.from_], event.evidence
    pair = (giver.type, movers[event.to].type)
    begin, entered = float(seen["begins_to_slow"]), float(seen["entered"])
    cleared = float(seen["other_cleared"])
    stop = given_way(giver, event, scene, on, tuple(movers.values()))
    if stop is None:
        part = slice(giver.index(begin), giver.index(entered) + 1)
        low = part.start + int(np.argmin(giver.speed[part]))
        at = float(np.interp(entered, giver.times, giver.s)) - float(giver.s[low])
        pace = float(giver.speed[low]) / float(seen["approach_speed"])
        return Case(pair, False, pace=pace, place=at, margin=entered - cleared)
    stands = [s for s in standstills(giver) if begin <= giver.times[s.start] <= entered]
    started = float(giver.times[stands[-1].stop - 1])
    whole = stop.duration is not None
    return Case(
        pair, True, gap=stop.gap, stands=stop.duration, reacts=started - cleared if whole else None
    )


def habits(seen: Sequence[Case]) -> Habits:
    """The quantiles of every pair of classes that gives way often enough."""
    pairs = sorted({each.pair for each in seen})
    of = {pair: [each for each in seen if each.pair == pair] for pair in pairs}
    return {pair: _manners(found) for pair, found in of.items() if len(found) >= FEWEST}


def _manners(found: Sequence[Case]) -> Manners:
    rolling = [c for c in found if c.margin is not None and c.margin <= LATEST]
    rolling = rolling if len(rolling) >= FEWEST_ROLLING else []
    standing = [each for each in found if each.stood]
    return Manners(
        rolls=round(len(rolling) / (len(rolling) + len(standing)), 3),
        **{name: _quantiles(rolling, name) for name in ("pace", "place", "margin")},
        **{name: _quantiles(standing, name) for name in ("gap", "stands", "reacts")},
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
        on = load_map(told.intersection)
        hours = [r for s in ("fit", "validation") for r in load_recordings(told.corpus, split=s)]
        seen = list(cases((scene for _, scene in cut_scenes(hours, on=on)), on=on))
        found = habits(seen)
        if not found:
            raise InputError(f"{told.corpus} shows too few yields in its fit hours: {len(seen)}")
        write_atomically(told.out, to_json(found).encode("utf-8"))
    except InputError as fault:
        print(fault, file=sys.stderr)
        return fault.exit_code
    print(f"{told.out}: {len(seen)} yields", file=sys.stderr)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
