"""Instruction satisfaction as figures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from scenewright.evals.markdown import format_table
from scenewright.evals.planning import PlanningShare
from scenewright.evals.satisfaction.judge import Verdict

RATES: Mapping[str, str] = {
    "satisfied": "instruction satisfaction rate: scenes that show what was said and nothing else",
    "false": "scenes that show something else than was said, of all that were submitted",
    "refused": "instructions without a scene although one could show them",
    "rightly refused": "instructions that no scene can show, and without one",
}
"""Figure -> what it is."""


def count_verdicts(
    verdicts: Sequence[Verdict], rows: Sequence[Mapping[str, Any]]
) -> dict[str, PlanningShare]:
    """The figures of `RATES`, each with its n."""
    counts = Counter(each.outcome for each in verdicts)
    impossible = sum(bool(row["expected"]["refused"]) for row in rows)
    possible, made = len(rows) - impossible, counts["satisfied"] + counts["wrong"]
    return {
        "satisfied": PlanningShare(counts["satisfied"], possible),
        "false": PlanningShare(counts["wrong"], made),
        "refused": PlanningShare(counts["refused"], possible),
        "rightly refused": PlanningShare(counts["rightly_refused"], impossible),
    }


def to_json(shares: Mapping[str, PlanningShare]) -> dict[str, Any]:
    """Plain JSON of the figures."""
    return {name: _to_figure(share) for name, share in shares.items()}


def _to_figure(share: PlanningShare) -> dict[str, Any]:
    return {"right": share.right, "n": share.n, "rate": share.rate, "interval": share.interval}


def to_markdown(shares: Mapping[str, PlanningShare], verdicts: Sequence[Verdict]) -> str:
    """The figures, and why scenes are wrong."""
    rows = [[RATES[name], f"{s.right} / {s.n}", format_share(_to_figure(s))]
            for name, s in shares.items()]  # fmt: skip
    reasons = Counter[str]()
    for each in verdicts:
        if each.outcome == "wrong":  # counted without numbers, names and quotes
            words = (each.reason or "").split()
            reasons[" ".join(words[: 2 if words[:1] == ["unasked"] else 4])] += 1
    parts = [format_table(["figure", "count", "share [95 %]"], rows)]
    if reasons:
        parts.append(format_table(["why scenes are wrong", "scenes"],
                                  [[k, str(n)] for k, n in reasons.most_common()]))  # fmt: skip
    return "\n\n".join(parts) + "\n"


def format_share(figure: Mapping[str, Any]) -> str:
    """Format `rate` and `interval` in percent."""
    if figure["rate"] is None:
        return "–"
    low, high = figure["interval"]
    return f"{100 * figure['rate']:.1f} % [{100 * low:.1f}, {100 * high:.1f}]"
