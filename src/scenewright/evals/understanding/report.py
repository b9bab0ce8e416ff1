"""Figures as Markdown: one table per task, one row per method and window."""

from __future__ import annotations

from collections.abc import Sequence

from scenewright.evals.markdown import format_table
from scenewright.evals.understanding.evaluate import Evaluated
from scenewright.evals.understanding.scoring import CLASSES, DEFINITION, KINDS, LEADS, Figure, Row

_PAPER = """The paper's Table 3 (its window is not stated, its scenes are others): exits, GMM 0.39
pedestrian, 30.72 vehicle, 12.76 overall; Qwen2.5-7B 6.64, 33.73, 21.94. Relations, TrajNet++ 98.49
normal, 9.84 collision, 6.49 yielding, 31.65 overall; Qwen2.5-7B 84.57, 20.00, 9.43, 48.20 in 3.54 s
a scene."""
_INTENT = (*CLASSES, "overall")
_RELATIONS = (*KINDS, "macro", "macro 4", "micro")


def markdown(found: Sequence[Evaluated], *, scenes: int, split: str, where: str) -> str:
    """The whole report."""
    parts = [
        f"# Understanding, {where}",
        f"{scenes} scenes of the {split} half. Intervals are 95 %, from a bootstrap over scenes.",
    ]
    intent = [(each, row) for each in found for row in each.rows if row.intent]
    if intent:
        parts += ["## Exits: accuracy [%]", format_table(
            ("method", "window [s]", "agents", *_INTENT, "s a scene"),
            [[_name(e), f"{r.window:g}", str(r.agents), *(_cell(r.intent[c]) for c in _INTENT),
              _seconds(r)] for e, r in intent],
        )]  # fmt: skip
    related = [(each, row) for each in found for row in each.rows if row.relations]
    if related:
        parts += ["## Relations: agent-level F1 [%]", DEFINITION, _relations(related)]
        parts += ["### Strict: events count before everybody has been seen", _strict(related)]
        parts += ["### Found by how long before the event", _leads(related)]
    return "\n\n".join([*parts, _PAPER]) + "\n"


def _relations(related: Sequence[tuple[Evaluated, Row]]) -> str:
    return format_table(
        ("method", "window [s]", *_RELATIONS, "later", "s a scene"),
        [
            [
                _name(e), f"{r.window:g}", *(_cell(r.relations[c]) for c in _RELATIONS),
                str(r.later), _seconds(r),
            ]
            for e, r in related
        ],
    )  # fmt: skip


def _strict(related: Sequence[tuple[Evaluated, Row]]) -> str:
    return format_table(
        ("method", "window [s]", *_RELATIONS),
        [[_name(e), f"{r.window:g}", *(_cell(r.strict[c]) for c in _RELATIONS)]
         for e, r in related],
    )  # fmt: skip


def _leads(related: Sequence[tuple[Evaluated, Row]]) -> str:
    heads = [
        f"{low:g} s and more" if high > 1e6 else f"{low:g} to {high:g} s" for low, high in LEADS
    ]
    return format_table(
        ("method", "window [s]", "relation", *heads),
        [
            [_name(e), f"{r.window:g}", kind, *(f"{k} of {n}" for k, n in found)]
            for e, r in related
            for kind, found in r.leads.items()
        ],
    )


def _name(found: Evaluated) -> str:
    return found.method if found.predictor is None else f"{found.method} ({found.predictor})"


def _cell(figure: Figure) -> str:
    if figure.value is None:
        return "none"
    return f"{figure.value:.1f} [{figure.low:.1f}, {figure.high:.1f}]"


def _seconds(row: Row) -> str:
    return "" if row.seconds is None else f"{row.seconds:.3f}"
