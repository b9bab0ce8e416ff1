"""Many drives in a few figures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from scenewright.driving.report import Report
from scenewright.evals.planning import PlanningShare


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
    found: dict[str, Any] = {"not_allowed_by_physics": len(asked) - len(allowed)}
    if allowed:
        found["resolved_where_allowed"] = describe_rate(sum(allowed), len(allowed))
    return found


def describe_rate(count: int, total: int) -> dict[str, Any]:
    """A rate with its count and, of more than one, its 95 % interval."""
    found = {"count": count, "of": total, "rate": round(count / total, 4)}
    if total > 1:
        low, high = PlanningShare(count, total).interval or (0.0, 1.0)
        found |= {"low": round(low, 4), "high": round(high, 4)}
    return found


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
