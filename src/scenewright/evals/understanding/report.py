"""Scores as Markdown: one table per task, one row per method and window."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from scenewright.evals.bootstrap import Figure
from scenewright.evals.markdown import format_table
from scenewright.evals.understanding.evaluate import MethodScores
from scenewright.evals.understanding.scoring import (
    AGENT_CLASSES,
    DEFINITION,
    KINDS,
    LEADS,
    WindowScores,
)

_PAPER = """The paper's Table 3 (its window is not stated, its scenes are others): exits, GMM 0.39
pedestrian, 30.72 vehicle, 12.76 overall; Qwen2.5-7B 6.64, 33.73, 21.94. Relations, TrajNet++ 98.49
normal, 9.84 collision, 6.49 yielding, 31.65 overall; Qwen2.5-7B 84.57, 20.00, 9.43, 48.20 in 3.54 s
a scene."""
_INTENT = (*AGENT_CLASSES, "overall")
_RELATIONS = (*KINDS, "macro", "macro 4", "micro")

_Scored = Sequence[tuple[MethodScores, WindowScores]]


def format_report(found: Sequence[MethodScores], *, scenes: int, split: str, where: str) -> str:
    """Format the whole report."""
    parts = [
        f"# Understanding, {where}",
        f"{scenes} clips of the {split} half (or whole scenes). Intervals are 95 %, from a "
        "bootstrap over them.",
    ]
    exits = [(each, row) for each in found for row in each.rows if row.intent]
    if exits:
        parts += ["## Exits: accuracy [%]", _format_scores(
            exits, ("agents", *_INTENT, "s a scene"),
            lambda r: [r.agents, *_format_figures(r.intent, _INTENT), _format_time(r)],
        )]  # fmt: skip
    related = [(each, row) for each in found for row in each.rows if row.relations]
    if related:
        parts += ["## Relations: strict agent-level F1 [%]", DEFINITION, _format_scores(
            related, (*_RELATIONS, "later", "s a scene"),
            lambda r: [*_format_figures(r.strict, _RELATIONS), r.later, _format_time(r)],
        )]  # fmt: skip
        parts += ["### Events count once both agents have been seen", _format_scores(
            related, _RELATIONS, lambda r: _format_figures(r.relations, _RELATIONS)
        )]  # fmt: skip
        heads = [f"{low:g} s and more" if high > 1e6 else f"{low:g} to {high:g} s"
                 for low, high in LEADS]  # fmt: skip
        rows = [
            (_format_name(method), f"{row.window:g}", kind, *(f"{k} of {n}" for k, n in own))
            for method, row in related
            for kind, own in row.leads.items()
        ]
        table = format_table(("method", "window [s]", "relation", *heads), rows)
        parts += ["### Found by how long before the event", table]
    return "\n\n".join([*parts, _PAPER]) + "\n"


def _format_scores(
    scored: _Scored, columns: Sequence[str], cells: Callable[[WindowScores], Sequence[object]]
) -> str:
    rows = [(_format_name(method), f"{row.window:g}", *cells(row)) for method, row in scored]
    return format_table(("method", "window [s]", *columns), rows)


def _format_name(scores: MethodScores) -> str:
    return f"{scores.method} ({scores.predictor})" if scores.predictor else scores.method


def _format_figures(figures: Mapping[str, Figure], names: Sequence[str]) -> list[str]:
    return [figures[name].format("{0:.1f} [{1:.1f}, {2:.1f}]", "none") for name in names]


def _format_time(row: WindowScores) -> str:
    return "" if row.seconds is None else f"{row.seconds:.3f}"
