"""An observation as a bird's-eye picture."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from scenewright.scene.base import FloatArray

PIXELS, METRES_PER_PIXEL = 96, 0.75
RASTER_SHAPE = (3, PIXELS, PIXELS)
"""Lanes and crosswalks, route, road users; the ego in the middle, ahead is up (the first row)."""

_BODY = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 17), np.linspace(-0.5, 0.5, 7)), -1)
_BODY = _BODY.reshape(-1, 2)
"""Points of a body, as shares of its length and width."""


def draw_raster(seen: Mapping[str, NDArray[np.generic]]) -> NDArray[np.uint8]:
    """[3, 96, 96] lanes (128) and crosswalks (255); route; road users (128 at rest, 255 moving)."""
    picture = np.zeros(RASTER_SHAPE, dtype=np.uint8)
    kinds = np.asarray(seen["map_kinds"], dtype=np.float64)
    lines = _fill(np.asarray(seen["map"], dtype=np.float64))
    for kind, value in ((0, 128), (1, 255)):
        _mark(picture[0], lines[kinds == kind].reshape(-1, 2), value)
    route = np.asarray(seen["route"], dtype=np.float64)
    there = route[route[:, 4] > 0, :2]
    _mark(picture[1], _fill(there[None])[0] if len(there) > 1 else there, 255)
    ego = np.asarray(seen["ego"], dtype=np.float64)
    _mark(picture[2], _BODY * ego[3:5], 255)
    for row in np.asarray(seen["agents"], dtype=np.float64):
        if row[10] > 0:
            _mark(picture[2], _place(row), 255 if np.hypot(row[4], row[5]) > 0.3 else 128)
    return picture


def _fill(lines: FloatArray) -> FloatArray:
    """Lines [M, P, 2] with 15 points between every two."""
    part = np.linspace(0.0, 1.0, 16)[:, None]
    dense = lines[:, :-1, None] + part * (lines[:, 1:, None] - lines[:, :-1, None])
    return np.asarray(dense.reshape(len(lines), -1, 2))


def _place(row: FloatArray) -> FloatArray:
    c, s = row[2:4]
    return np.asarray(row[:2] + (_BODY * row[6:8]) @ np.array([[c, s], [-s, c]]))


def _mark(channel: NDArray[np.uint8], xy: FloatArray, value: int) -> None:
    row = np.floor(PIXELS / 2 - xy[:, 0] / METRES_PER_PIXEL).astype(int)
    column = np.floor(PIXELS / 2 - xy[:, 1] / METRES_PER_PIXEL).astype(int)
    inside = (row >= 0) & (row < PIXELS) & (column >= 0) & (column < PIXELS)
    channel[row[inside], column[inside]] = value
