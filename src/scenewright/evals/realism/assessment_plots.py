"""One page of plots of an assessment: two-sample tests, street measures and likelihoods."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

from scenewright.evals.realism.assessment import (
    CLASSES,
    Assessment,
    MeasuredDistance,
    SeparationTest,
)


def draw_assessment(report: Assessment) -> bytes:
    """Draw the page as PNG: two-sample tests by class, shares, likelihoods."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    page = Figure(figsize=(13, 11), layout="constrained")
    FigureCanvasAgg(page)
    axes = page.subplots(2, 2)
    for ax, kind in zip(axes[0], CLASSES, strict=True):
        _draw_tests(ax, [t for t in report.tests if t.type == kind and t.situation == "all"])
        ax.set_title(f"{kind}s: how well they are separated (0.5: not at all)")
    _draw_measures(axes[1][0], [m for m in report.measures if m.part == "all"])
    rows = list(reversed(report.likelihoods))
    for k, each in enumerate(rows):
        color = "0.6" if each.source == "log replay" else "#3b6ea5"
        axes[1][1].barh(k, each.scores.get("all", 0.0), color=color)
    labels = [f"{r.type}s of {r.reference}\nunder {r.source}" for r in rows]
    axes[1][1].set_yticks(range(len(rows)), labels, fontsize=6)
    axes[1][1].set_title("likelihood of the reference (grey: log replay)")
    buffer = io.BytesIO()
    page.savefig(buffer, dpi=100)
    return buffer.getvalue()


def _draw_tests(ax: Any, tests: Sequence[SeparationTest]) -> None:
    """Draw a bar for each test; floors, between real tracks, are grey."""
    for k, test in enumerate(reversed(tests)):
        color = "0.6" if test.floor else "#3b6ea5"
        ax.barh(k, test.separability.auc - 0.5, left=0.5, color=color)
        ax.plot([test.separability.low, test.separability.high], [k, k], color="black", lw=1)
    labels = [
        f"{t.one}{'' if t.part == 'all' else ', ' + t.part}\nfrom {t.other} "
        f"(n = {t.separability.n})"
        for t in reversed(tests)
    ]
    ax.set_yticks(range(len(tests)), labels, fontsize=7)
    ax.set_xlim(0.4, 1.0)
    ax.axvline(0.5, color="black", lw=0.8)


def _draw_measures(ax: Any, measures: Sequence[MeasuredDistance]) -> None:
    names = list(dict.fromkeys(m.name for m in measures))
    sources = list(dict.fromkeys(m.source for m in measures))
    for j, source in enumerate(sources):
        own = [m for m in measures if m.source == source and m.share.value is not None]
        y = [len(names) - names.index(m.name) - j / (len(sources) + 1) for m in own]
        x = [m.share.value or 0.0 for m in own]
        off = [[v - (m.share.low or 0.0) for v, m in zip(x, own, strict=True)],
               [(m.share.high or 0.0) - v for v, m in zip(x, own, strict=True)]]  # fmt: skip
        ax.errorbar(x, y, xerr=off, fmt="o", ms=4, lw=1, label=source)
    ax.set_yticks([len(names) - k - 0.4 for k in range(len(names))], names, fontsize=7)
    ax.set_xlim(-0.03, 1.03)
    ax.set_title("shares, and places in p_tod")
    if sources:
        ax.legend(fontsize=7, loc="center right")
