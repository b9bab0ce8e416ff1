"""Distances of each set of scenes from each reference, with the distance expected by chance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from scenewright.evals.markdown import format_table
from scenewright.evals.realism.distances import (
    ClusterSample,
    Distance,
    DistanceGain,
    compute_chance,
    compute_distance,
    compute_gain,
    compute_wasserstein,
)
from scenewright.evals.realism.samples import UNITS, MeasuredSamples
from scenewright.scene.base import FloatArray

ALLOWED = 1.5
"""Stops should be no further from the corpus' than this times the distance of its halves."""
_QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


@dataclass(frozen=True)
class Comparison:
    """One measure of one class: a set of scenes against a reference.

    Attributes:
        scenes: name of the set; reference: `corpus` or `taf-bw`, perhaps with a remark.
        distance: between them; None where one of them has no value.
        between_means: difference of the means [unit]; no distance can be below it. The mean
            acceleration of vehicles follows from how fast they are at first and at last.
        halves: distance between the two halves of the reference.
        by_chance: mean and 95 % quantile of the distance of as many values of the reference from
            the rest of it: no set of this size can be expected nearer than the mean.
        gain: share of the first set's distance that this set has less; None for the first set.
        quantiles, reference_quantiles: 5, 25, 50, 75 and 95 % of either.
    """

    topic: str
    type: str
    measure: str
    unit: str
    scenes: str
    reference: str
    distance: Distance | None
    between_means: float | None
    halves: float | None
    by_chance: tuple[float, float] | None
    gain: DistanceGain | None
    quantiles: tuple[float, ...] | None
    reference_quantiles: tuple[float, ...] | None

    @property
    def share(self) -> float | None:
        """Distance over that of the halves."""
        if self.distance is None or not self.halves:
            return None
        return self.distance.value / self.halves

    @property
    def near_enough(self) -> bool | None:
        """Whether that share is at most 1.5; None where there is none."""
        return None if self.share is None else self.share <= ALLOWED


@dataclass(frozen=True)
class ComparisonReport:
    """All rows, and counts by name."""

    rows: tuple[Comparison, ...]
    facts: Mapping[str, Any]

    def to_json(self) -> dict[str, Any]:
        """Plain JSON."""
        rows = [
            {**asdict(row), "share_of_halves": row.share, "near_enough": row.near_enough}
            for row in self.rows
        ]
        return {"schema_version": 1, "facts": dict(self.facts), "rows": rows}

    def format_markdown(self) -> str:
        """Format one table for each topic and reference, and the facts."""
        topics = dict.fromkeys((row.topic, row.reference) for row in self.rows)
        parts = [_format_topic(topic, ref, self.rows) for topic, ref in topics]
        facts = "\n".join(f"- {name}: {value}" for name, value in self.facts.items())
        return "\n\n".join([*parts, facts]) + "\n"


def compare(
    topic: str,
    kind: str,
    sets: Mapping[str, MeasuredSamples],
    reference: MeasuredSamples,
    *,
    named: str,
    measures: Sequence[str],
    draws: int,
    seed: int,
) -> Iterator[Comparison]:
    """Compare each measure of each set with the reference."""
    for measure in measures:
        ref = reference.samples[measure]
        one, two = reference.split_halves(measure)
        first: ClusterSample | None = None
        for name, measured in sets.items():
            sample, rng = measured.samples[measure], np.random.default_rng(seed)
            yield Comparison(
                topic, kind, measure, UNITS[measure], name, named,
                distance=compute_distance(sample, ref, draws=draws, rng=rng),
                between_means=_compute_mean_difference(sample.values, ref.values),
                halves=compute_wasserstein(one.values, two.values),
                by_chance=compute_chance(sample, ref, draws=draws, rng=rng),
                gain=None if first is None
                else compute_gain(first, sample, ref, draws=draws, rng=rng),
                quantiles=_compute_quantiles(sample.values),
                reference_quantiles=_compute_quantiles(ref.values),
            )  # fmt: skip
            first = sample if first is None else first


def _compute_mean_difference(values: FloatArray, reference: FloatArray) -> float | None:
    if not len(values) or not len(reference):
        return None
    return abs(float(values.mean() - reference.mean()))


def _compute_quantiles(values: FloatArray) -> tuple[float, ...] | None:
    if len(values) == 0:
        return None
    return tuple(round(float(q), 4) for q in np.quantile(values, _QUANTILES))


def _format_topic(topic: str, reference: str, rows: Sequence[Comparison]) -> str:
    cells = [_format_cells(row) for row in rows if (row.topic, row.reference) == (topic, reference)]
    return f"### {topic}, against {reference}\n\n{format_table(_HEAD, cells)}"


_HEAD = (
    "class", "measure", "scenes", "W1", "95 %", "between means", "n / reference", "halves",
    "W1 / halves", "by chance (95 %)", "nearer than first", "median, 5–95 %", "reference",
)  # fmt: skip


def _format_cells(row: Comparison) -> list[str]:
    d = row.distance
    return [
        row.type,
        row.measure.replace("_", " "),
        row.scenes,
        "–" if d is None else f"{d.value:.3f} {row.unit}",
        "–" if d is None else f"{d.low:.3f}–{d.high:.3f}",
        "–" if row.between_means is None else f"{row.between_means:.3f}",
        "–" if d is None else f"{d.n} / {d.n_reference}",
        "–" if row.halves is None else f"{row.halves:.3f}",
        "–" if row.share is None else f"{row.share:.1f}",
        "–" if row.by_chance is None else f"{row.by_chance[0]:.3f} ({row.by_chance[1]:.3f})",
        "–"
        if row.gain is None
        else f"{row.gain.value:.0%} ({row.gain.low:.0%}–{row.gain.high:.0%})",
        _spread(row.quantiles),
        _spread(row.reference_quantiles),
    ]


def _spread(quantiles: tuple[float, ...] | None) -> str:
    if quantiles is None:
        return "–"
    return f"{quantiles[2]:.2f}, {quantiles[0]:.2f}–{quantiles[4]:.2f}"
