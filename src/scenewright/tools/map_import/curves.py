"""Curves of ways through a junction: none is sharper than a car can drive.

Readers join lanes and paths that do not meet in one direction, and files draw corners; both leave
kinks. A stretch that is too sharp is drawn anew, as a curve that leaves and meets the way in its
own direction, as short as its radius allows.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scenewright.geometry.polyline import measure_distances, resample_by_spacing
from scenewright.scene.base import FloatArray

LEAST_RADIUS = 4.0
"""Of the middle of a way; a passenger car's smallest is a little above that [m]."""
_STEP = 0.5
_CHORD = 2
"""Radii are measured over so many points to either side."""
_HANDLE = 0.39
"""Of a curve's handles, as a share of the distance between its ends: about a circle's."""
_FARTHEST_MOVE = 3.5
"""So far from its old place a curve is drawn at most [m]."""
_MOST_ROOM = 40
"""So many points beyond a sharp stretch at either end may be drawn anew."""


def measure_least_radius(line: FloatArray) -> float:
    """The radius of the sharpest place of a line [P, 2] with points half a metre apart [m]."""
    radii = _measure_radii(line)
    return float(radii.min(initial=np.inf))


def _measure_radii(line: FloatArray) -> FloatArray:
    """[P - 4] radius of the circle through a point and those a metre before and after it [m].

    A place at which the line turns back by more than a right angle has none at all: 0.
    """
    before, here, after = line[: -2 * _CHORD], line[_CHORD:-_CHORD], line[2 * _CHORD :]
    a, b, c = here - before, after - here, after - before
    cross = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    sides = np.hypot(*a.T) * np.hypot(*b.T) * np.hypot(*c.T)
    radii = np.divide(sides, 2 * cross, out=np.full(len(here), np.inf), where=cross > 1e-9)
    return np.asarray(np.where((a * b).sum(axis=1) < 0, 0.0, radii))


def round_curves(line: FloatArray) -> FloatArray:
    """The line [P, 2], half a metre from point to point, its sharp places drawn anew.

    What cannot be drawn with a radius of 4 m within 20 m of way, and within 3.5 m of the file's
    own line, is drawn as wide as it can be.
    """
    begin = 0
    for _ in range(_MOST_PLACES):
        sharp = _find_sharp(line)
        sharp = sharp[sharp >= begin]
        if not len(sharp):
            break
        ends = np.append(np.flatnonzero(np.diff(sharp) > 2 * _CHORD), len(sharp) - 1)
        # A place that lies too close to the next is drawn anew together with it.
        tries = (_redraw(line, int(sharp[0]), int(sharp[k])) for k in ends[:2])
        better = [made for made in tries if made is not line]
        done = [made for made in better if len(_find_sharp(made)) < len(_find_sharp(line))]
        if not done:
            begin = int(sharp[ends[0]]) + 1
        line = next(iter([*done, *better]), line)
    return line


def _find_sharp(line: FloatArray) -> Any:
    """Where along a line it is sharper than it may be."""
    return np.flatnonzero(_measure_radii(line) < LEAST_RADIUS) + _CHORD


_MOST_PLACES = 8


def _redraw(line: FloatArray, first: int, last: int) -> FloatArray:
    """The line with the shortest curve about a stretch that is wide enough, else the widest."""
    best, widest = line, float(_measure_radii(line)[first - _CHORD : last - _CHORD + 1].min())
    for room in range(_CHORD, _MOST_ROOM + 1, 2):
        a, b = max(first - room, 1), min(last + room, len(line) - 2)
        curve = draw_curve(line[a], line[a] - line[a - 1], line[b], line[b + 1] - line[b])
        if float(measure_distances(curve, line[a : b + 1]).min(axis=1).max()) > _FARTHEST_MOVE:
            break
        made = resample_by_spacing(np.concatenate([line[:a], curve, line[b + 1 :]]), _STEP)
        around = made[max(a - 2 * _CHORD, 0) : len(made) - max(len(line) - b - 2 * _CHORD - 1, 0)]
        radius = measure_least_radius(around)
        if radius > widest:
            best, widest = made, radius
        if radius >= LEAST_RADIUS:
            break
    return best


def draw_curve(
    start: FloatArray, ahead: FloatArray, end: FloatArray, onwards: FloatArray
) -> FloatArray:
    """[21, 2] a cubic Bezier curve from one place and direction to another."""
    reach = _HANDLE * float(np.hypot(*(end - start)))
    inner = start + reach * ahead / max(float(np.hypot(*ahead)), 1e-9)
    outer = end - reach * onwards / max(float(np.hypot(*onwards)), 1e-9)
    t = np.linspace(0.0, 1.0, 21)[:, None]
    weights = (1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3
    points = zip(weights, (start, inner, outer, end), strict=True)
    return np.asarray(sum(weight * point for weight, point in points))
