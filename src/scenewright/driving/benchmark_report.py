"""Results of driven scenes in a few figures, for people and for continuous integration."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np

from scenewright.dataset.tables.junit import Case
from scenewright.driving.benchmark import Row
from scenewright.driving.report import Report
from scenewright.evals.bootstrap import Figure


def summarise(reports: Sequence[Report]) -> dict[str, Any]:
    """Rates with 95 % Wilson intervals, and means, of drives; at least one."""
    rows = [report.to_json() for report in reports]
    hits = [report.impact for report in reports if report.impact is not None]
    at_fault = [impact for impact in hits if impact.at_fault == "ego"]
    return {
        "drives": len(rows),
        "ends": dict(sorted(Counter(str(row["end"]) for row in rows).items())),
        "collisions": describe_rate(len(hits), len(rows)),
        "collisions_at_fault": describe_rate(len(at_fault), len(rows)),
        **_count_resolved(rows),
        "encounters": describe_rate(sum(bool(row.get("encounter")) for row in rows), len(rows)),
        "as_asked": describe_rate(sum(bool(row.get("as_asked")) for row in rows), len(rows)),
        "exposed": describe_rate(sum(row["exposed"] for row in rows), len(rows)),
        "background_collisions": sum(row.get("background_collisions", 0) for row in rows),
        "red_lights": sum(row["red_lights"] for row in rows),
        "policy_faults": sum(row["policy_fault"] is not None for row in rows),
        "nuplan": round(float(np.mean([row["nuplan"]["score"] for row in rows])), 4),
        "epdms": round(float(np.mean([row["epdms"]["score"] for row in rows])), 4),
    }


def _count_resolved(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """With re-timed others, asked encounters that came about where physics allows them."""
    asked = [each for row in rows for each in row.get("resolved", []) if "allowed" in each]
    allowed = [each["came_about"] for each in asked if each["allowed"]]
    if not asked:
        return {}
    resolved: dict[str, Any] = {"not_allowed_by_physics": len(asked) - len(allowed)}
    if allowed:
        resolved["resolved_where_allowed"] = describe_rate(sum(allowed), len(allowed))
    return resolved


def describe_rate(count: int, total: int) -> dict[str, Any]:
    """A rate with its count and, of more than one, its 95 % interval."""
    rate = {"count": count, "of": total, "rate": round(count / total, 4)}
    if total > 1:
        share = Figure.of_count(count, total)
        rate |= {"low": round(share.low or 0.0, 4), "high": round(share.high or 0.0, 4)}
    return rate


def summarise_rows(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Rates and mean scores of one policy's drives (`benchmark.build_row`), with 95 % intervals."""
    tests = {
        "failed": [row["failed"] for row in rows],
        "collisions": [row["collision"] is not None for row in rows],
        "collisions_at_fault": [(row["collision"] or {}).get("at_fault") == "ego" for row in rows],
        "red_lights": [row["red_lights"] > 0 for row in rows],
    }
    return {
        "drives": len(rows),
        **{key: describe_rate(sum(found), len(found)) for key, found in tests.items()},
        "policy_faults": sum(row["policy_fault"] is not None for row in rows),
        **{key: _describe_mean([row[key] for row in rows]) for key in ("nuplan", "epdms")},
    }


def _describe_mean(values: Sequence[float]) -> dict[str, Any]:
    """A mean score with its 95 % interval (normal)."""
    mean, deviation = float(np.mean(values)), float(np.std(values, ddof=len(values) > 1))
    half = 1.96 * deviation / len(values) ** 0.5
    low, high = max(mean - half, 0.0), min(mean + half, 1.0)
    return {"rate": round(mean, 4), "low": round(low, 4), "high": round(high, 4)}


PLOTTED = {
    "nuplan": ("nuPlan score", 1.0), "epdms": ("EPDMS", 1.0),
    "min_ttc": ("least TTC [s]", 6.0), "min_pet": ("least PET [s]", 6.0),
}  # fmt: skip
"""Figure of a drive -> what it is called, and the right end of its axis."""
SHOWN = ("scene", "kind", "others", "temperament", "seed", "end", "time", *PLOTTED)


def group_rows(rows: Sequence[Row], key: str) -> dict[str, list[Row]]:
    """Rows by what they say under a key, in the order in which that comes up."""
    return {v: [row for row in rows if row[key] == v] for v in dict.fromkeys(r[key] for r in rows)}


def summarise_policies(rows: Sequence[Row]) -> dict[str, dict[str, Any]]:
    """The summary of each policy."""
    return {name: summarise_rows(found) for name, found in group_rows(rows, "policy").items()}


def tabulate(rows: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    """Titles, and of each policy a line of figures with their intervals."""
    told = summarise_policies(rows)
    titles = ["ego", *(key.replace("_", " ") for key in next(iter(told.values()), {}))]
    return titles, [[policy, *map(_format, said.values())] for policy, said in told.items()]


def _format(figure: Any) -> str:
    """A number; or a rate in percent, with its interval where it has one."""
    if not isinstance(figure, dict):
        return str(figure)
    ends = f" [{100 * figure['low']:.0f}, {100 * figure['high']:.0f}]" if "low" in figure else ""
    return f"{100 * figure['rate']:.1f} %{ends}"


def list_test_cases(rows: Sequence[Row]) -> dict[str, list[Case]]:
    """A test of each drive, by policy; a failure says what happened."""
    return {
        f"ego {policy}": [
            Case(
                f"{policy}.{row['kind'] or 'drive'}", row["scene"],
                row["why"] if row["failed"] else None, row["time"],
            )
            for row in drives
        ]
        for policy, drives in group_rows(rows, "policy").items()
    }  # fmt: skip


def build_page(rows: Sequence[Row]) -> bytes:
    """All figures, plots and drives as one HTML file without scripts; all words are escaped."""
    policies = group_rows(rows, "policy")
    titles, lines = tabulate(rows)
    draw = [_draw_rate(said["failed"]) for said in summarise_policies(rows).values()]
    shares = [
        [name or "drive", *(_format(summarise_rows(group_rows(found, key)[name])["failed"])
                            for found in policies.values())]
        for key in ("kind", "temperament") for name in group_rows(rows, key)
    ]  # fmt: skip
    page = files("scenewright.driving").joinpath("benchmark_page.html").read_text("utf-8")
    return Template(page).substitute(
        result=_write_table([*titles, "failed, 0 to 100 %"], lines, draw),
        groups=_write_table(["", *policies], shares),
        plots="".join(_plot(policy, found) for policy, found in policies.items()),
        scenes="".join(_list_drives(policy, found) for policy, found in policies.items()),
    ).encode()  # fmt: skip


def _write_table(
    titles: Sequence[str], lines: Sequence[Sequence[Any]], last: Sequence[str] | None = None
) -> str:
    """A table; the cells of the last column may be HTML."""
    cells = ["".join(f"<td>{escape('–' if c is None else str(c))}" for c in row) for row in lines]
    ends = [f"<td>{each}" for each in last] if last is not None else [""] * len(cells)
    rows = "".join(f"<tr>{row}{end}" for row, end in zip(cells, ends, strict=True))
    return f"<table><tr>{''.join(f'<th>{escape(title)}' for title in titles)}{rows}</table>"


def _draw_rate(rate: dict[str, Any]) -> str:
    """A rate as a dot on a line from 0 to 1, with its interval."""
    low, at, high = (180 * rate.get(key, rate["rate"]) + 5 for key in ("low", "rate", "high"))
    return (
        '<svg class="rate" viewBox="0 0 190 16"><path class="axis" d="M5 8h180"/>'
        f'<path class="whisker" d="M{low:.1f} 8H{high:.1f}"/>'
        f'<circle class="dot" cx="{at:.1f}" cy="8" r="4"/></svg>'
    )


def _plot(policy: str, rows: Sequence[Row]) -> str:
    """Histograms of the figures of one policy; what lies beyond an axis is in its last bar."""
    drawn = f'<h3>{escape(policy)}</h3><div class="plots">'
    for key, (name, end) in PLOTTED.items():
        values = [min(row[key], end) for row in rows if row[key] is not None]
        counts = np.histogram(values, bins=20, range=(0.0, end))[0]
        high = 60 * counts / max(int(counts.max()), 1)
        bars = "".join(
            f'<rect class="bar" x="{10 * k + 1}" y="{70 - h:.1f}" width="8" height="{h:.1f}"/>'
            for k, h in enumerate(high)
        )
        drawn += (
            f"<figure><figcaption>{name}, {len(values)} drives</figcaption>"
            f'<svg viewBox="0 0 200 84">{bars}<path class="axis" d="M0 70.5h200"/>'
            f'<text y="81">0</text><text x="200" y="81" text-anchor="end">{end:g}</text>'
            f'<text x="200" y="9" text-anchor="end">{counts.max()}</text></svg></figure>'
        )
    return drawn + "</div>"


def _list_drives(policy: str, rows: Sequence[Row]) -> str:
    told = [
        f'<span class="bad">{escape(row["why"])}</span>' if row["failed"] else "passed"
        for row in rows
    ]
    titles = [*(each.replace("_", " ") for each in SHOWN), "result"]
    table = _write_table(titles, [[row[key] for key in SHOWN] for row in rows], told)
    failed = sum(row["failed"] for row in rows)
    return (
        f"<details{' open' if len(rows) < 30 else ''}><summary>{escape(policy)}: {failed} of "
        f'{len(rows)} failed</summary><div class="wide">{table}</div></details>'
    )
