"""Every comparison that was made, so that a run ends with figures and not only with dots."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

_DIFFERENCES: dict[tuple[str, str], dict[str, list[float]]] = {}
VERSIONS: dict[str, str] = {}
"""Version of each package that answered."""


def note(measure: str, package: str, traffic: str, differences: Iterable[float]) -> None:
    """Adds differences, ours minus theirs, of one measure on one kind of traffic."""
    kinds = _DIFFERENCES.setdefault((measure, package), {})
    kinds.setdefault(traffic, []).extend(float(d) for d in differences)


def lines() -> list[str]:
    """The table, one row for each measure and package, over all kinds of traffic."""
    rows = [
        "| measure | against | n | median difference | largest | traffic |",
        "|---|---|---|---|---|---|",
    ]
    for (measure, package), kinds in sorted(_DIFFERENCES.items()):
        size = np.abs(np.concatenate([np.array(values) for values in kinds.values()]))
        named = f"{package} {VERSIONS[package]}" if package in VERSIONS else package
        figures = f"{np.median(size):.2g} | {size.max():.2g}" if len(size) else "- | -"
        traffic = ", ".join(f"{kind} {len(values)}" for kind, values in kinds.items())
        rows.append(f"| {measure} | {named} | {len(size)} | {figures} | {traffic} |")
    return rows if len(rows) > 2 else []
