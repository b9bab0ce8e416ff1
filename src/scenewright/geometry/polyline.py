"""Polylines [P, 2] in metres: length, resampling, directions and smoothing."""

from __future__ import annotations

import math

import numpy as np

from scenewright.scene.base import FloatArray


def measure_arc_lengths(line: FloatArray) -> FloatArray:
    """[P] arc length from the first point to each point [m]."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])


def measure_length(line: FloatArray) -> float:
    """Length of a line [m]."""
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def interpolate_points(s: FloatArray | float, known: FloatArray, line: FloatArray) -> FloatArray:
    """[N, 2] points at arc lengths [m], or [2] at one, where the points [P, 2] lie at `known`."""
    return np.stack([np.interp(s, known, line[:, axis]) for axis in (0, 1)], axis=-1)


def find_point(line: FloatArray, distance: float) -> FloatArray:
    """[2] the point at a distance along a line [m], held at its ends."""
    return interpolate_points(distance, measure_arc_lengths(line), line)


def resample_to_count(line: FloatArray, count: int) -> FloatArray:
    """[count, 2] points at equal arc length along a line, both ends included."""
    s = measure_arc_lengths(line)
    return interpolate_points(np.linspace(0.0, s[-1], count), s, line)


def resample_by_spacing(line: FloatArray, spacing: float) -> FloatArray:
    """Three or more points about `spacing` [m] apart, both ends kept; doubled points dropped."""
    line = drop_doubled_points(line)
    return resample_to_count(line, max(round(measure_arc_lengths(line)[-1] / spacing), 2) + 1)


def drop_doubled_points(line: FloatArray) -> FloatArray:
    """The line without points that lie within a micrometre of the one before."""
    kept = np.concatenate([[True], np.hypot(*np.diff(line, axis=0).T) > 1e-6])
    return np.asarray(line[kept])


def smooth_gaussian(values: FloatArray, sigma: float) -> FloatArray:
    """Values [N, ...] under a Gaussian of `sigma` samples along the first axis, ends held.

    It reaches four standard deviations to either side, as that of scipy, whose sums it repeats.
    """
    reach = int(4.0 * sigma + 0.5)
    weights = np.exp(-0.5 / sigma**2 * np.arange(-reach, reach + 1) ** 2)
    weights = (weights / weights.sum())[reach:]
    padded = np.pad(values, [(reach, reach), *[(0, 0)] * (values.ndim - 1)], mode="edge")
    total = weights[0] * values
    for k in range(reach, 0, -1):
        before, after = padded[reach - k : -reach - k], padded[reach + k :]
        total = total + weights[k] * (before + after[: len(values)])
    return np.asarray(total)


def compute_tangents(line: FloatArray) -> FloatArray:
    """[P, 2] unit vectors along a line, at its points."""
    ahead = np.gradient(line, axis=0)
    return np.asarray(ahead / np.maximum(np.hypot(*ahead.T), 1e-9)[:, None])


def compute_normals(line: FloatArray) -> FloatArray:
    """[P, 2] unit vectors to the left of a line, at its points."""
    return rotate_left(compute_tangents(line))


def rotate_left(vectors: FloatArray) -> FloatArray:
    """[..., 2] vectors turned by a quarter to the left."""
    return np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)


def measure_turn(ahead: FloatArray, onwards: FloatArray) -> float:
    """How far one vector [2] lies to the left of another [rad]."""
    turn = math.atan2(onwards[1], onwards[0]) - math.atan2(ahead[1], ahead[0])
    return math.remainder(turn, math.tau)


def measure_courses(line: FloatArray) -> FloatArray:
    """[P - 1] direction of each step of a line, without jumps [rad]."""
    step = np.diff(line, axis=0)
    return np.unwrap(np.arctan2(step[:, 1], step[:, 0]))


def measure_distances(points: FloatArray, line: FloatArray) -> FloatArray:
    """[N, P] distance of each of points [N, 2] from each point of a line [m]."""
    return np.asarray(np.hypot(*(points[:, None] - line[None]).transpose(2, 0, 1)))
