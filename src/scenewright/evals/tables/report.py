"""The tables as Markdown and as JSON."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from importlib.resources import files
from typing import Any

from scenewright.dataset.tables.markdown import format_table
from scenewright.evals.records import format_records
from scenewright.evals.tables.diversity import BAR, Spread
from scenewright.evals.tables.likelihood import READINGS, Fidelity
from scenewright.evals.tables.nearness import ReferenceDistance
from scenewright.evals.tables.produce import INTENT_AT, RELATION_AT, Tables
from scenewright.evals.tables.reading import RobustnessRate
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


PAPER: Mapping[str, Any] = tomllib.loads(
    files(__package__).joinpath("paper.toml").read_text(encoding="utf-8")
)
"""The paper's own numbers, as printed."""


def to_json(tables: Tables) -> dict[str, Any]:
    """Plain JSON."""
    return {"schema_version": 2, **asdict(tables), "paper": PAPER}


def format_markdown(tables: Tables) -> str:
    """One page."""
    parts = [
        "# Tables",
        *_format_about(tables),
        *_format_fidelity(tables.fidelity),
        *_format_robustness(tables.robustness),
        *_format_understanding(tables.understanding),
        *_format_distances(tables.nearness),
        *_format_diversity(tables.diversity),
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


def _format_fidelity(fidelity: Fidelity) -> Iterator[str]:
    yield "## Tables 1, 4 and 5: likelihood of tracks, and the gap to normal scenes"
    yield (
        "NLL: -log p_wp of ten waypoints in metres, given the route [nats]. S2R: Eq. 8 as printed, "
        "signed; the paper prints its size, in an unknown unit. ΔNLL: event minus normal, nats per "
        "waypoint, free of any unit. In brackets 95 %, scenes resampled. NLL in metres can be "
        "negative; a positive S2R then means *less* likely than normal."
    )
    yield f"Two readings: {'; '.join(f'*{name}*: {_READ[name]}' for name in READINGS)}."
    columns = {
        "normal scenes": "{type}", "reading": "{reading}", "agents / scenes": "{nll.n} / {scenes}",
        "NLL": "{nll:.2f}", "median": "{median:.2f}",
    }  # fmt: skip
    theirs = [
        [kind, "paper: not stated", "–", f"{nll}, unit not stated", "–", "–"]
        for kind, nll in PAPER["normal NLL"].items()
    ]
    ours = format_records(fidelity.references, columns)
    for cell, row in zip(fidelity.references, ours, strict=True):
        row.append(f"{(cell.nll.value or 0.0) + CENTIMETRES:.2f}")
    yield format_table([*columns, "NLL in centimetres"], [*ours, *theirs])
    yield _UNITS
    columns = {
        "event": "{event}", "agents": "{role}", "class": "{type}", "reading": "{reading}",
        "agents / scenes": "{nll.n} / {scenes}", "NLL": "{nll.value:.2f}", "median": "{median:.2f}",
        "S2R, signed": "{s2r:+.3f}", "ΔNLL": "{delta:+.3f}",
    }  # fmt: skip
    for backend in dict.fromkeys(cell.backend for cell in fidelity.cells):
        cells = [cell for cell in fidelity.cells if cell.backend == backend]
        rows = format_records(cells, columns)
        for cell, row in zip(cells, rows, strict=True):
            row.append("–" if cell.s2r.value is None else f"{abs(cell.s2r.value):.3f}")
            key = f"{cell.event}, {cell.role}, {cell.type}"
            row.extend(
                sizes.get(key, "–") if cell.reading == "path" else ""
                for sizes in PAPER["S2R"].values()
            )
        yield f"### Backend `{backend}`"
        yield format_table([*columns, "size of S2R", *(f"paper: {k}" for k in PAPER["S2R"])], rows)
    left = fidelity.left
    yield (
        f"Without a score: {left['assumed']} agents on routes whose prior is assumed "
        f"(jaywalking), {left['standing']} that stand all along, {left['riders']} on "
        "bicycles and e-scooters, whom the corpus does not have; "
        f"{fidelity.mixed} scenes with events of several kinds are left out."
    )


def _format_robustness(rates: Sequence[RobustnessRate]) -> Iterator[str]:
    yield "## Table 2: instruction satisfaction rate"
    yield (
        "Scenes that the checker confirms / instructions given; a refusal counts as a failure. "
        "95 % Wilson intervals. *overall* is collisions and yields, as in the paper, whose "
        "validity was judged by hand. *all* leaves out what was refused as no request for a "
        "scene, or not understood; *given* has it."
    )
    columns = {
        "backend": "{backend}", "event": "{event}",
        "verified / given": "{share.count} / {share.n}", "ISR": "{share:.2%}",
    }  # fmt: skip
    theirs = [
        [f"paper: {name}", event, "", f"{value} %"]
        for name, isr in PAPER["ISR"].items()
        for event, value in isr.items()
    ]
    yield format_table([*columns], [*format_records(rates, columns), *theirs])


def _format_understanding(rows: Mapping[str, Sequence[str]]) -> Iterator[str]:
    yield "## Table 3: understanding"
    head = [
        "method", "intent: pedestrian", "vehicle", "overall", "F1: normal", "collision",
        "yielding", "overall", "s / scene",
    ]  # fmt: skip
    if not rows:
        yield "Not measured here; `scenewright evals understanding` does that."
    else:
        yield (
            f"Test half. Exits after {INTENT_AT:g} s, relations after {RELATION_AT:g} s of "
            "observation; *overall* F1 is the mean of the three. The paper states no window, and "
            "its overall is not the mean of its columns. All windows, methods and definitions: "
            "`scenewright evals understanding`."
        )
    theirs = [[f"paper: {name}", *row] for name, row in PAPER["understanding"].items()]
    yield format_table(head, [*([name, *row] for name, row in rows.items()), *theirs])


def _format_distances(near: Sequence[ReferenceDistance]) -> Iterator[str]:
    yield "## How scenes move and keep apart"
    if not near:
        yield "Not measured: needs recorded hours (`--corpus`), of `simulate --corpus`."
        return
    yield (
        "First Wasserstein distances, 95 % over resampled scenes; *halves* is the distance between "
        "two halves of the reference. Against real tracks both sides are smoothed over 1 s. "
        "Quantiles: 5, 50 and 95 %."
    )
    columns = {
        "measure": "{measure} [{unit}]", "whose": "{group}", "against": "{reference}",
        "W1": "{distance:.3f}", "n / reference": "{distance.n} / {n_reference}",
        "halves": "{halves:.3f}", "quantiles": "{quantiles}", "reference": "{reference_quantiles}",
    }  # fmt: skip
    yield format_table([*columns], format_records(near, columns))


def _format_diversity(spreads: Sequence[Spread]) -> Iterator[str]:
    yield "## Diversity"
    yield (
        f"Standard deviation in the dataset over that in the corpus; the bar is {BAR}. 95 % over "
        "resampled agents or events. Speeds and events of the corpus are those of windows as long "
        "as the scenes and with as many vehicles; *all windows* are 30 s long, of any traffic."
    )
    columns = {
        "what": "{what}", "whose": "{group}", "dataset": "{ours:.2f} {unit}",
        "corpus": "{corpus:.2f} {unit}", "ratio": "{ratio:.2f}",
        "n / corpus": "{ratio.n} / {n_corpus}", "enough": "{enough}",
        "to all windows": "{ratio_to_whole:.2f}",
    }  # fmt: skip
    yield format_table([*columns], format_records(spreads, columns))
