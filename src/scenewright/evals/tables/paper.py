"""The paper's own numbers, as printed.

Table 1 shows sizes of gaps, in an unknown unit of length; 56.83 in Table 2 should be 56.67 (51 of
90), and 9.43 in the text on Table 3 is 6.64 in the table.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

NORMAL_NLL: Mapping[str, float] = {"pedestrian": 96.8, "vehicle": 170.9}
"""Table 1, first row: mean NLL of 100 normal scenes."""

_CELLS = tuple(
    product(("collision", "yielding"), ("foreground", "background"), ("pedestrian", "vehicle"))
)
GAPS: Mapping[str, Mapping[tuple[str, str, str], str]] = {
    backend: dict(zip(_CELLS, cells, strict=True))
    for backend, *cells in (
        ("Claude3.5-Sonnet (Table 1)", "0.43", "0.01", "0.02", "< 0.01", "0.65", "2.19", "0.03",
         "< 0.01"),
        ("Qwen2.5-7B (Table 4)", "–", "< 0.01", "0.02", "< 0.01", "0.72", "0.14", "0.02", "< 0.01"),
        ("Qwen2.5-3B (Table 5)", "–", "0.12", "0.06", "0.01", "0.32", "0.12", "< 0.01", "< 0.01"),
    )
}  # fmt: skip
"""|S2R| by backend, then (event, role, class)."""

SATISFIED: Mapping[str, Mapping[str, str]] = {
    "Claude3.5-Sonnet": {"collision": "90.0", "yielding": "80.0", "overall": "84.44"},
    "Qwen2.5-7B": {"collision": "72.5", "yielding": "62.0", "overall": "66.66"},
    "Qwen2.5-3B": {"collision": "57.5", "yielding": "56.0", "overall": "56.83"},
}
"""Table 2: ISR [%], validity judged by hand."""

UNDERSTANDING: Mapping[str, tuple[str, ...]] = {
    "GMM": ("0.39", "30.72", "12.76", "–", "–", "–", "–", "< 0.01"),
    "TrajNet++": ("–", "–", "–", "98.49", "9.84", "6.49", "31.65", "0.03"),
    "Qwen2.5-1.5B": ("7.03", "15.36", "11.73", "62.59", "10.96", "2.47", "33.89", "0.76"),
    "Qwen2.5-7B": ("6.64", "33.73", "21.94", "84.57", "20.00", "9.43", "48.20", "3.54"),
}
"""Table 3: intent accuracy of pedestrians, vehicles, overall; F1 of normal, collision, yielding,
overall; seconds a scene."""
