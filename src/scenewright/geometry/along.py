"""Where a path leads: position and heading at arc lengths."""

from __future__ import annotations

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import Path, sample_evenly


def sample_poses(path: Path, s: FloatArray) -> FloatArray:
    """[N, 3] x, y [m] and heading [rad] at arc lengths [m], in any order; held at both ends."""
    return _interpolate_poses(s, path.s, path.xy, path.heading)


def sample_nodes(path: Path, spacing: float) -> FloatArray:
    """[N] arc lengths [m] from 0 to the very end, about `spacing` apart."""
    return sample_evenly(path.length, max(2, round(path.length / spacing) + 1))


@compiled
def to_cosines(poses: FloatArray) -> FloatArray:
    """[4, N] x, y, cosine and sine of the heading of poses [N, 3]."""
    rows = np.empty((4, len(poses)))
    for n in range(len(poses)):
        rows[0, n], rows[1, n] = poses[n, 0], poses[n, 1]
        rows[2, n], rows[3, n] = np.cos(poses[n, 2]), np.sin(poses[n, 2])
    return rows


@compiled
def _interpolate_poses(
    s: FloatArray, nodes: FloatArray, xy: FloatArray, heading: FloatArray
) -> FloatArray:
    poses, last, k = np.empty((len(s), 3)), len(nodes) - 1, 0
    step = nodes[last] / last
    for n in range(len(s)):
        at = min(max(s[n], nodes[0]), nodes[last])
        # Nodes lie evenly but for rounding.
        k = min(int(at / step), last - 1)
        while k < last - 1 and nodes[k + 1] <= at:
            k += 1
        while k > 0 and nodes[k] > at:
            k -= 1
        into, apart = at - nodes[k], nodes[k + 1] - nodes[k]
        poses[n, 0] = (xy[k + 1, 0] - xy[k, 0]) / apart * into + xy[k, 0]
        poses[n, 1] = (xy[k + 1, 1] - xy[k, 1]) / apart * into + xy[k, 1]
        poses[n, 2] = (heading[k + 1] - heading[k]) / apart * into + heading[k]
        if at == nodes[last]:
            poses[n, 0], poses[n, 1], poses[n, 2] = xy[last, 0], xy[last, 1], heading[last]
    return poses


@compiled
def find_nearest_point(xy: FloatArray, x: float, y: float) -> tuple[int, float]:
    """Find the point [N, 2] nearest to (x, y), and its distance [m]."""
    away = np.hypot(xy[:, 0] - x, xy[:, 1] - y)
    node = int(np.argmin(away))
    return node, float(away[node])
