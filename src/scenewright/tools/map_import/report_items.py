"""One item of the report on an import."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ReportItem:
    """One item of the report.

    Attributes:
        state: `read`, `partly read`, `derived`, `assumed` or `none`.
        score: how much of it is the file's, from 0 to 1; None where that cannot be said.
    """

    item: str
    state: str
    score: float | None
    detail: str
