"""Compass names of legs: their order, their bearings and the turns between them."""

from __future__ import annotations

import math
from typing import get_args

from scenewright.scene.base import Compass

COMPASS_RING: tuple[Compass, ...] = get_args(Compass)
"""Clockwise."""


def rotate_compass(leg: Compass, eighths: int) -> Compass:
    """The direction that lies so many eighths of a turn clockwise of another."""
    return COMPASS_RING[(COMPASS_RING.index(leg) + eighths) % len(COMPASS_RING)]


def find_sides(leg: Compass) -> tuple[Compass, Compass]:
    """The directions on the left and on the right of a leg, looking outwards."""
    return rotate_compass(leg, -2), rotate_compass(leg, 2)


def compute_bearing(leg: Compass) -> float:
    """The outward direction of a compass name [rad, counter-clockwise from east]."""
    return math.pi / 2 - COMPASS_RING.index(leg) * math.pi / 4


def name_bearing(bearing: float) -> Compass:
    """The compass name nearest to an outward direction [rad, counter-clockwise from east].

    >>> name_bearing(0.1), name_bearing(2.3)
    ('east', 'northwest')
    """
    return COMPASS_RING[round((math.pi / 2 - bearing) / (math.pi / 4)) % len(COMPASS_RING)]


def name_turn(entry: Compass, exit_: Compass) -> str:
    """The turn of a movement by the names of its legs: straight, left, right or uturn.

    >>> name_turn("north", "east"), name_turn("west", "east")
    ('left', 'straight')
    """
    step = (COMPASS_RING.index(exit_) - COMPASS_RING.index(entry)) % len(COMPASS_RING)
    if step == 0:
        return "uturn"
    return "straight" if step == 4 else "left" if step < 4 else "right"
