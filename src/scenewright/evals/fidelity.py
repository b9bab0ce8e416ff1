"""How likely agents' paths are where something happens, next to normal scenes (paper 4.1, Eq. 8).

`python -m scenewright.evals.fidelity FOLDER…` reads the scenes below folders. NLL is -log p_wp of
an agent's ten waypoints, in metres [nats]. By relation, class and role it prints S2R as printed in
the paper, which is signed, its magnitude, and dNLL: nats per waypoint, event minus normal scenes.
Routes differ in how widely people spread on them, and events prefer some routes; so dNLL is also
given against what each agent's own route leads to expect, an average over draws from its prior.
Waypoints are those drawn and selected; `evals tables` reads the final tracks.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from scenewright.errors import InputError
from scenewright.evals.tables.likelihood import AgentScore, Gap, compute_gap, score_drawn
from scenewright.graph.run import load_scene
from scenewright.scene.candidates import K
from scenewright.scene.record import SceneRecord
from scenewright.tools.gmm_sampler import load_priors

_DRAWS = 1000


class FidelityLine(NamedTuple):
    """One row of the table.

    Attributes:
        n: agents; nll: their mean [nats]; gap: to normal scenes, None for these themselves.
        of_route: nats per waypoint more than the agents' own routes lead to expect.
    """

    relation: str
    type: str
    role: str
    n: int
    nll: float
    gap: Gap | None
    of_route: float


def weigh(scenes: Iterable[SceneRecord]) -> Iterator[AgentScore]:
    """Every agent whose route has a fitted prior, grouped by all that its scene was made for."""
    for number, scene in enumerate(scenes):
        kinds = sorted({str(relation.type) for relation in scene.relations})
        priors = load_priors(scene.meta.intersection)
        yield from score_drawn(scene, priors, number=number, group=" + ".join(kinds or ["normal"]))


def compute_lines(agents: Sequence[AgentScore]) -> Iterator[FidelityLine]:
    """The table; normal scenes are the reference, foreground and background together."""
    groups = sorted({(a.group != "normal", a.group, a.type, a.role) for a in agents})
    for event, relation, kind, role in groups:
        here = [a for a in agents if (a.group, a.type, a.role) == (relation, kind, role)]
        normal = [a for a in agents if a.group == "normal" and a.type == kind]
        rng = np.random.default_rng(0)
        found = compute_gap(here, normal, "drawn", draws=_DRAWS, rng=rng) if event else None
        nll = [a.nll["drawn"] for a in here]
        beyond = [a.nll["drawn"] - (a.expected or 0.0) for a in here]
        yield FidelityLine(
            relation, kind, role, len(here), float(np.mean(nll)), found, float(np.mean(beyond)) / K
        )


def format_markdown(rows: Iterable[FidelityLine]) -> str:
    """The table as Markdown."""
    head = (
        "| scenes | class | role | agents | NLL [nats] | S2R, signed | S2R, size "
        "| dNLL per waypoint, 95 % | dNLL against own route |\n" + "|---" * 9 + "|"
    )
    return "\n".join([head, *map(_format_row, rows)]) + "\n"


def _format_row(line: FidelityLine) -> str:
    s2r = size = delta = "–"
    if line.gap is not None:
        s2r, size = f"{line.gap.s2r:+.3f}", f"{abs(line.gap.s2r):.3f}"
        low, high = line.gap.delta_interval
        delta = f"{line.gap.delta:+.3f} [{low:+.3f}, {high:+.3f}]"
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
    options = words.parse_args(argv)
    try:
        sys.stdout.write(format_markdown(compute_lines(list(weigh(read(options.folders))))))
    except InputError as fault:
        print(fault, file=sys.stderr)
        return fault.exit_code
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
