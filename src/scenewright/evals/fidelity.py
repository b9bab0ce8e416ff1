"""How likely agents' paths are where something happens, next to normal scenes (paper 4.1, Eq. 8).

`python -m scenewright.evals.fidelity FOLDER…` reads the scenes below folders. NLL is -log p_wp of
an agent's ten waypoints, in metres [nats]. By relation, class and role it prints S2R as printed in
the paper, which is signed, its magnitude, and dNLL: nats per waypoint, event minus normal scenes.
Routes differ in how widely people spread on them, and events prefer some routes; so dNLL is also
given against what each agent's own route leads to expect, an average over draws from its prior.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from scenewright.errors import InputError
from scenewright.graph.run import load_scene
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.record import SceneRecord
from scenewright.tools.gmm_sampler import (
    WaypointPrior,
    load_priors,
    sample_waypoints,
    waypoint_nll,
)

_EXPECTED_OF, _DRAWS = 2000, 1000


class Weighed(NamedTuple):
    """One agent: what happens in its scene, what it is, its NLL and that of its route [nats]."""

    scene: int
    relation: str
    type: str
    role: str
    nll: float
    expected: float


class Line(NamedTuple):
    """One row of the table.

    Attributes:
        n: agents; nll: their mean [nats]; s2r: Eq. 8, None for normal scenes.
        delta, low, high: nats per waypoint more than in normal scenes, and 95 % over scenes.
        of_route: nats per waypoint more than the agents' own routes lead to expect.
    """

    relation: str
    type: str
    role: str
    n: int
    nll: float
    s2r: float | None
    delta: float | None
    low: float | None
    high: float | None
    of_route: float


def weigh(scenes: Iterable[SceneRecord]) -> Iterator[Weighed]:
    """Every agent whose route has a fitted prior."""
    for number, scene in enumerate(scenes):
        kinds = sorted({str(relation.type) for relation in scene.relations})
        relation = " + ".join(kinds or ["normal"])
        for agent in scene.agents:
            prior = load_priors(scene.meta.intersection).waypoints.get(agent.route or "")
            if prior is None or prior.tracks == 0 or len(agent.waypoints) != K:
                continue
            xy = np.array(agent.waypoints)[None]
            yield Weighed(
                number, relation, agent.type, agent.role or "background",
                float(waypoint_nll(prior, xy)[0]), _expected(prior),
            )  # fmt: skip


@lru_cache(maxsize=256)
def _expected(prior: WaypointPrior) -> float:
    """The mean NLL of draws from a prior [nats]."""
    drawn = sample_waypoints(prior, np.random.default_rng(0), size=_EXPECTED_OF)
    return float(waypoint_nll(prior, drawn).mean())


def lines(agents: Sequence[Weighed]) -> Iterator[Line]:
    """The table; normal scenes are the reference, foreground and background together."""
    groups = sorted({(a.relation != "normal", a.relation, a.type, a.role) for a in agents})
    for event, relation, kind, role in groups:
        here = [a for a in agents if (a.relation, a.type, a.role) == (relation, kind, role)]
        normal = [a for a in agents if a.relation == "normal" and a.type == kind]
        nll = float(np.mean([a.nll for a in here]))
        of_route = float(np.mean([a.nll - a.expected for a in here])) / K
        if not event or not normal:
            yield Line(relation, kind, role, len(here), nll, None, None, None, None, of_route)
            continue
        base = float(np.mean([a.nll for a in normal]))
        low, high = np.quantile(_differences(here, normal), [0.025, 0.975]) / K
        yield Line(
            relation, kind, role, len(here), nll, (base - nll) / base, (nll - base) / K,
            float(low), float(high), of_route,
        )  # fmt: skip


def _differences(here: Sequence[Weighed], normal: Sequence[Weighed]) -> FloatArray:
    """[draws] differences of means, scenes resampled with replacement on both sides."""
    rng = np.random.default_rng(0)
    return _means(here, rng) - _means(normal, rng)


def _means(agents: Sequence[Weighed], rng: np.random.Generator) -> FloatArray:
    scene = np.unique([a.scene for a in agents], return_inverse=True)[1]
    total = np.bincount(scene, weights=[a.nll for a in agents])
    count = np.bincount(scene).astype(np.float64)
    drawn = rng.integers(0, len(count), (_DRAWS, len(count)))
    return np.asarray(total[drawn].sum(axis=1) / count[drawn].sum(axis=1))


def markdown(rows: Iterable[Line]) -> str:
    """The table as Markdown."""
    head = (
        "| scenes | class | role | agents | NLL [nats] | S2R, signed | S2R, size "
        "| dNLL per waypoint, 95 % | dNLL against own route |\n" + "|---" * 9 + "|"
    )
    return "\n".join([head, *map(_row, rows)]) + "\n"


def _row(line: Line) -> str:
    s2r = "–" if line.s2r is None else f"{line.s2r:+.3f}"
    size = "–" if line.s2r is None else f"{abs(line.s2r):.3f}"
    delta = "–"
    if line.delta is not None:
        delta = f"{line.delta:+.3f} [{line.low:+.3f}, {line.high:+.3f}]"
    return (
        f"| {line.relation} | {line.type} | {line.role} | {line.n} | {line.nll:.2f} | {s2r} "
        f"| {size} | {delta} | {line.of_route:+.3f} |"
    )


def read(folders: Iterable[Path]) -> Iterator[SceneRecord]:
    """The scenes below folders, in order of their names.

    Raises:
        InputError: there are none, or one cannot be read.
    """
    for folder in folders:
        files = sorted(folder.rglob("scene.json"))
        if not files:
            raise InputError(f"there is no scene.json below {folder}")
        yield from map(load_scene, files)


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table."""
    words = argparse.ArgumentParser(prog="python -m scenewright.evals.fidelity",
                                    description=__doc__)  # fmt: skip
    words.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    told = words.parse_args(argv)
    try:
        sys.stdout.write(markdown(lines(list(weigh(read(told.folders))))))
    except InputError as fault:
        print(fault, file=sys.stderr)
        return fault.exit_code
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
