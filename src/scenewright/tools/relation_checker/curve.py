"""The curve of a track: evenly sampled in arc length, projected on, extended straight on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenewright.scene.base import FloatArray

SPACING = 0.5
"""Distance of path points [m]."""


@dataclass(frozen=True, eq=False)
class Path:
    """The curve of an agent's whole track, evenly sampled in arc length.

    Attributes:
        s: [P] arc length [m] from the first position; negative on a straight extension.
        xy: [P, 2] points [m]; direction: [P] of travel, unwrapped [rad].
    """

    s: FloatArray
    xy: FloatArray
    direction: FloatArray

    def coarser(self) -> Path:
        """Every second point."""
        return Path(self.s[::2], self.xy[::2], self.direction[::2])

    def extended(self, *, before: float, after: float) -> Path:
        """The path with straight pieces at both ends [m]."""
        back, on = (SPACING * np.arange(1, int(d / SPACING) + 1) for d in (before, after))
        first, last = self.direction[0], self.direction[-1]
        tail = self.xy[0] - back[::-1, None] * np.array((np.cos(first), np.sin(first)))
        front = self.xy[-1] + on[:, None] * np.array((np.cos(last), np.sin(last)))
        return Path(
            np.concatenate((self.s[0] - back[::-1], self.s, self.s[-1] + on)),
            np.concatenate((tail, self.xy, front)),
            np.concatenate((np.full(len(back), first), self.direction, np.full(len(on), last))),
        )


def curve(xy: FloatArray, s: FloatArray, heading: FloatArray) -> Path:
    """The path through positions [T, 2] at arc lengths [T]; one point if shorter than 0.05 m."""
    total = float(s[-1])
    if total < 0.05:
        return Path(np.zeros(1), xy[:1], heading[:1])
    keep = np.concatenate(([True], np.diff(s) > 1e-4))
    even = np.linspace(0.0, total, max(int(total / SPACING), 1) + 1)
    points = np.stack([np.interp(even, s[keep], xy[keep, k]) for k in (0, 1)], axis=1)
    delta = np.empty_like(points)
    delta[1:-1] = points[2:] - points[:-2]
    delta[0], delta[-1] = points[1] - points[0], points[-1] - points[-2]
    return Path(even, points, np.unwrap(np.arctan2(delta[:, 1], delta[:, 0])))


def curvature(path: Path) -> FloatArray:
    """[P] change of direction per metre [1/m], over 2 m of path."""
    if len(path.s) < 3:
        return np.zeros(len(path.s))
    k = np.arange(len(path.s))
    low, high = np.maximum(k - 2, 0), np.minimum(k + 2, len(k) - 1)
    return np.asarray((path.direction[high] - path.direction[low]) / (path.s[high] - path.s[low]))


@dataclass(frozen=True, eq=False)
class Projection:
    """Where points lie along a path.

    Attributes:
        s: arc length of the foot [m]; lateral: distance from the path [m]; direction: of the path
            there [rad]. All have the shape of the points.
    """

    s: FloatArray
    lateral: FloatArray
    direction: FloatArray


def project(points: FloatArray, path: Path) -> Projection:
    """Projects points [..., 2] on the nearest place of a path."""
    dx = points[..., None, 0] - path.xy[:, 0]
    dy = points[..., None, 1] - path.xy[:, 1]
    square = dx * dx
    square += dy * dy
    k = np.argmin(square, axis=-1)
    least = np.take_along_axis(square, k[..., None], axis=-1)[..., 0]
    direction = path.direction[k]
    px, py = points[..., 0] - path.xy[k, 0], points[..., 1] - path.xy[k, 1]
    along = np.clip(np.cos(direction) * px + np.sin(direction) * py, -2 * SPACING, 2 * SPACING)
    return Projection(path.s[k] + along, np.sqrt(np.maximum(least - along**2, 0.0)), direction)


def at_distance(path: Path, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points [..., 2] and directions [...] at arc lengths, straight beyond the end of the path."""
    beyond = np.maximum(s - path.s[-1], 0.0)
    xy = np.stack([np.interp(s, path.s, path.xy[:, k]) for k in (0, 1)], axis=-1)
    last = path.direction[-1]
    xy += beyond[..., None] * np.array((np.cos(last), np.sin(last)))
    return xy, np.asarray(np.interp(s, path.s, path.direction))
