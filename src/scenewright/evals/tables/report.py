"""The tables as Markdown and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from scenewright.dataset.tables.markdown import format_table
from scenewright.evals.tables import paper
from scenewright.evals.tables.diversity import BAR, Spread
from scenewright.evals.tables.likelihood import READINGS
from scenewright.evals.tables.nearness import UNITS, ReferenceDistance
from scenewright.evals.tables.produce import INTENT_AT, RELATION_AT, Tables
from scenewright.scene.candidates import K

_READ = {
    "track": "ten waypoints of the final track as it is, cut short or not",
    "path": "the drawn waypoints, each where the final track passes it",
}


CENTIMETRES = 2 * K * math.log(100.0)
"""What NLL grows by where the lengths of ten waypoints are in centimetres [nats]."""
_UNITS = (
    "The paper states neither its unit of length nor how many waypoints it takes. A change of unit "
    f"moves both classes by one constant (metres to centimetres: {CENTIMETRES:.1f} for ten "
    "waypoints), and the paper's two figures lie 74.1 apart, so levels are not compared, only "
    "differences (S2R, ΔNLL) are. Where *track* is in the thousands, tracks that the end of a "
    "scene or a collision cut short are held against a prior of the whole route, whose waypoints "
    "spread by decimetres: a point 20 m early counts half the square of a hundred standard "
    "deviations. *path* asks where agents went, and is the one beside which the paper's S2R stands."
)


def to_json(tables: Tables) -> dict[str, Any]:
    """Plain JSON."""
    return {
        "schema_version": 1,
        "about": dict(tables.about),
        "fidelity": {
            "references": [asdict(each) for each in tables.fidelity.references],
            "cells": [asdict(each) for each in tables.fidelity.cells],
            "agents without a score": dict(tables.fidelity.left),
            "scenes of several kinds": tables.fidelity.mixed,
        },
        "robustness": [
            {
                "backend": each.backend,
                "event": each.event,
                "verified": each.share.right,
                "n": each.share.n,
                "rate": each.share.rate,
                "interval": each.share.interval,
            }
            for each in tables.rates
        ],
        "understanding": dict(tables.understanding),
        "nearness": [{**asdict(each), "unit": UNITS[each.measure]} for each in tables.near],
        "diversity": [
            {
                **asdict(each),
                "ratio": each.ratio,
                "enough": each.enough,
                "ratio to whole windows": each.ratio_to_whole,
            }
            for each in tables.spreads
        ],
        "paper": {
            "normal NLL": dict(paper.NORMAL_NLL),
            "S2R": {
                name: {", ".join(key): value for key, value in gaps.items()}
                for name, gaps in paper.GAPS.items()
            },
            "ISR": {name: dict(rates) for name, rates in paper.SATISFIED.items()},
            "understanding": {name: list(row) for name, row in paper.UNDERSTANDING.items()},
        },
    }


def format_markdown(tables: Tables) -> str:
    """One page."""
    parts = [
        "# Tables",
        *_format_about(tables),
        *_format_fidelity(tables),
        *_format_robustness(tables),
        *_format_understanding(tables),
        *_format_distances(tables.near),
        *_format_diversity(tables.spreads),
    ]
    return "\n\n".join(parts) + "\n"


def _format_about(tables: Tables) -> Iterator[str]:
    lines = []
    for key, value in tables.about.items():
        parts = value if isinstance(value, dict) else {}
        short = {k: v if len(str(v)) <= 60 else f"{str(v)[:12]}…" for k, v in parts.items()}
        text = ", ".join(f"{k} {v}" for k, v in short.items())
        lines.append(f"- {key}: {text or ('–' if value is None else value)}")
    yield "\n".join(lines)


def _format_fidelity(tables: Tables) -> Iterator[str]:
    found = tables.fidelity
    yield "## Tables 1, 4 and 5: likelihood of tracks, and the gap to normal scenes"
    yield (
        "NLL: -log p_wp of ten waypoints in metres, given the route [nats]. S2R: Eq. 8 as printed, "
        "signed; the paper prints its size, in an unknown unit. ΔNLL: event minus normal, nats per "
        "waypoint, free of any unit. In brackets 95 %, scenes resampled. NLL in metres can be "
        "negative; a positive S2R then means *less* likely than normal."
    )
    yield f"Two readings: {'; '.join(f'*{name}*: {_READ[name]}' for name in READINGS)}."
    rows = [
        [r.type, r.reading, f"{r.agents} / {r.scenes}",
         f"{r.nll:.2f} {_format_interval(r.interval)}",
         f"{r.median:.2f}", f"{r.nll + CENTIMETRES:.2f}"]
        for r in found.references
    ]  # fmt: skip
    rows += [
        [kind, "paper: not stated", "–", f"{nll}, unit not stated", "–", "–"]
        for kind, nll in paper.NORMAL_NLL.items()
    ]
    yield format_table(
        ["normal scenes", "reading", "agents / scenes", "NLL", "median", "NLL in centimetres"], rows
    )
    yield _UNITS
    for backend in dict.fromkeys(cell.backend for cell in found.cells):
        rows = []
        for cell in (each for each in found.cells if each.backend == backend):
            key, gap = (cell.event, cell.role, cell.type), cell.gap
            theirs = [
                each.get(key, "–") if cell.reading == "path" else "" for each in paper.GAPS.values()
            ]
            role = {"foreground": "FG", "background": "BG"}[cell.role]
            figures = ["0", *["–"] * 5] if gap is None else [
                f"{gap.agents} / {gap.scenes}", f"{gap.nll:.2f}", f"{gap.median:.2f}",
                f"{gap.s2r:+.3f} {_format_interval(gap.s2r_interval, 3)}", f"{abs(gap.s2r):.3f}",
                f"{gap.delta:+.3f} {_format_interval(gap.delta_interval, 3)}",
            ]  # fmt: skip
            rows.append([cell.event, role, cell.type, cell.reading, *figures, *theirs])
        yield f"### Backend `{backend}`"
        yield format_table(
            ["event", "agents", "class", "reading", "agents / scenes", "NLL", "median",
             "S2R, signed", "size of S2R", "ΔNLL", *(f"paper: {name}" for name in paper.GAPS)],
            rows,
        )  # fmt: skip
    left = found.left
    yield (
        f"Without a score: {left['assumed']} agents on routes whose prior is assumed "
        f"(jaywalking), {left['standing']} that stand all along, {left['riders']} on "
        "bicycles and e-scooters, whom the corpus does not have; "
        f"{found.mixed} scenes with events of several kinds are left out."
    )


def _format_interval(interval: tuple[float, float], digits: int = 2) -> str:
    return f"[{interval[0]:.{digits}f}, {interval[1]:.{digits}f}]"


def _format_robustness(tables: Tables) -> Iterator[str]:
    yield "## Table 2: instruction satisfaction rate"
    yield (
        "Scenes that the checker confirms / instructions given; a refusal counts as a failure. "
        "95 % Wilson intervals. *overall* is collisions and yields, as in the paper, whose "
        "validity was judged by hand. *all* leaves out what was refused as no request for a "
        "scene, or not understood; *given* has it."
    )
    rows = [
        [
            rate.backend, rate.event, f"{rate.share.right} / {rate.share.n}",
            f"{100 * (rate.share.rate or 0.0):.2f}",
            "[{:.1f}, {:.1f}]".format(*(100 * each for each in rate.share.interval or ())),
        ]
        for rate in tables.rates
    ]  # fmt: skip
    rows += [
        [f"paper: {name}", event, "", value, ""]
        for name, rates in paper.SATISFIED.items()
        for event, value in rates.items()
    ]
    yield format_table(["backend", "event", "verified / given", "ISR [%]", "95 %"], rows)


def _format_understanding(tables: Tables) -> Iterator[str]:
    yield "## Table 3: understanding"
    head = [
        "method", "intent: pedestrian", "vehicle", "overall", "F1: normal", "collision",
        "yielding", "overall", "s / scene",
    ]  # fmt: skip
    ours = [[name, *map(str, row)] for name, row in tables.understanding.items()]
    rows = [[f"paper: {name}", *row] for name, row in paper.UNDERSTANDING.items()]
    if not ours:
        yield "Not measured here; `scenewright evals understanding` does that."
    else:
        yield (
            f"Test half. Exits after {INTENT_AT:g} s, relations after {RELATION_AT:g} s of "
            "observation; *overall* F1 is the mean of the three. The paper states no window, and "
            "its overall is not the mean of its columns. All windows, methods and definitions: "
            "`scenewright evals understanding`."
        )
    yield format_table(head, [*ours, *rows])


def _format_distances(near: Sequence[ReferenceDistance]) -> Iterator[str]:
    yield "## How scenes move and keep apart"
    if not near:
        yield "Not measured: needs recorded hours (`--corpus`), of `simulate --corpus`."
        return
    yield (
        "First Wasserstein distances, 95 % over resampled scenes; *halves* is the distance between "
        "two halves of the reference. Against real tracks both sides are smoothed over 1 s."
    )
    rows = []
    for each in near:
        d, spans = each.distance, (each.quantiles, each.reference_quantiles)
        figures = ["–"] * 3 if d is None else [
            f"{d.value:.3f} {UNITS[each.measure]}", _format_interval((d.low, d.high), 3),
            f"{d.n} / {d.n_reference}",
        ]  # fmt: skip
        rows.append([
            each.measure, each.group, each.reference, *figures,
            "–" if each.halves is None else f"{each.halves:.3f}",
            *("–" if v is None else f"{v[1]:.2f}, {v[0]:.2f}–{v[2]:.2f}" for v in spans),
        ])  # fmt: skip
    yield format_table(
        ["measure", "whose", "against", "W1", "95 %", "n / reference", "halves",
         "median, 5–95 %", "reference"],
        rows,
    )  # fmt: skip


def _format_diversity(spreads: Sequence[Spread]) -> Iterator[str]:
    yield "## Diversity"
    yield (
        f"Standard deviation in the dataset over that in the corpus; the bar is {BAR}. 95 % over "
        "resampled agents or events. Speeds and events of the corpus are those of windows as long "
        "as the scenes and with as many vehicles; *all windows* are 30 s long, of any traffic."
    )
    rows = [
        [
            each.what, each.group, f"{each.ours:.2f} {each.unit}", f"{each.corpus:.2f} {each.unit}",
            f"{each.ratio:.2f} {_format_interval((each.low, each.high))}",
            f"{each.n} / {each.n_corpus}", "yes" if each.enough else "**no**",
            "–" if each.ratio_to_whole is None else f"{each.ratio_to_whole:.2f}",
        ]
        for each in spreads
    ]  # fmt: skip
    yield format_table(
        ["what", "whose", "dataset", "corpus", "ratio", "n / corpus", "enough", "to all windows"],
        rows,
    )
