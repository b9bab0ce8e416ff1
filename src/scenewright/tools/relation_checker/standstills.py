"""Standstills of an agent, measured on its track."""

from __future__ import annotations

import numpy as np

from scenewright.tools.relation_checker.trajectory import Trajectory
from scenewright.tools.relation_checker.yielding import STANDING

LEAST_STAND = 0.5
"""A shorter standstill is none [s]."""


def find_standstills(track: Trajectory) -> list[tuple[float, float]]:
    """From when to when an agent stands [s], in order."""
    slow = np.concatenate(([False], track.speed <= STANDING, [False]))
    edges = np.flatnonzero(slow[1:] != slow[:-1])
    spans = [
        (float(track.times[begin]), float(track.times[end - 1]))
        for begin, end in edges.reshape(-1, 2)
    ]
    return [each for each in spans if each[1] - each[0] >= LEAST_STAND - 1e-6]
