"""The held-out figures are recomputed from the bundle alone, and mean what they say."""

import math

import numpy as np
import pytest

from lab.bundle.held_out_priors import _compute_poisson_nll, evaluate_priors
from scenewright.errors import InputError


@pytest.fixture(scope="module")
def report():
    return evaluate_priors("amsterdam_120")


def test_every_class_and_movement_has_a_row_with_its_count(report):
    rows = {row.group: row for row in report.waypoints}
    wanted = {"vehicle", "vehicle, left", "vehicle, right", "vehicle, straight", "pedestrian"}
    assert wanted <= set(rows)
    parts = [r.tracks for g, r in rows.items() if g.startswith("vehicle, ")]
    assert sum(parts) == rows["vehicle"].tracks > 1000


def test_the_mixture_beats_one_gaussian_where_there_are_two_lanes(report):
    straight = next(row for row in report.waypoints if row.group == "vehicle, straight")
    assert straight.gaussian - straight.nll > 10 * straight.error


def test_counts_are_no_worse_than_poisson_over_the_day(report):
    day = report.counts[-1]
    assert day.hours == "all"
    assert day.nll < day.poisson + 2 * day.error


def test_poisson_is_the_closed_form():
    nll = _compute_poisson_nll(np.array([3.0, 1.0]), np.array([[2, 0]]))
    assert nll == pytest.approx([-math.log(9 / 2 * math.exp(-3)) + 1.0])


def test_tables_carry_counts_and_errors(report):
    text = report.format_markdown()
    assert "test tracks" in text
    assert "±" in text


def test_a_bundle_without_held_out_part_is_one_clear_line(tmp_path):
    with pytest.raises(InputError):
        evaluate_priors(tmp_path)
    with pytest.raises(InputError, match="nowhere"):
        evaluate_priors("nowhere")
