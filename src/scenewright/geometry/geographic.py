"""Degrees and metres near an origin, on the sphere of web maps."""

from __future__ import annotations

import math

import numpy as np

from scenewright.scene.base import FloatArray

EARTH_RADIUS = 6_378_137.0
"""Of the sphere [m]."""
LatLon = tuple[float, float]
"""Latitude and longitude [deg]."""


def project_to_metres(origin: LatLon, place: LatLon) -> FloatArray:
    """[2] metres east and north of an origin."""
    east = EARTH_RADIUS * math.cos(math.radians(origin[0])) * math.radians(place[1] - origin[1])
    return np.array([east, EARTH_RADIUS * math.radians(place[0] - origin[0])])


def project_mercator(origin: LatLon, place: LatLon) -> FloatArray:
    """[2] metres east and north of an origin under Mercator's projection, scaled back there."""
    scale = EARTH_RADIUS * math.cos(math.radians(origin[0]))
    east = scale * math.radians(place[1] - origin[1])
    return np.array([east, scale * (_compute_northing(place[0]) - _compute_northing(origin[0]))])


def _compute_northing(latitude: float) -> float:
    return math.log(math.tan(math.pi / 4 + math.radians(latitude) / 2))


def project_to_degrees(origin: LatLon, xy: FloatArray) -> LatLon:
    """Latitude and longitude of a place [2] in metres from an origin, to seven decimals."""
    x, y = float(xy[0]), float(xy[1])
    longitude = x / (EARTH_RADIUS * math.cos(math.radians(origin[0])))
    latitude = origin[0] + math.degrees(y / EARTH_RADIUS)
    return round(latitude, 7), round(origin[1] + math.degrees(longitude), 7)


def is_in_degrees(place: LatLon) -> bool:
    """Whether two numbers can be a latitude and a longitude of a road."""
    return abs(place[0]) <= 85.0 and abs(place[1]) <= 180.0
