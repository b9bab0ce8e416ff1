"""Degrees and metres near an origin, on the sphere of web maps."""

from __future__ import annotations

import math

import numpy as np

from scenewright.scene.base import FloatArray

EARTH_RADIUS = 6_378_137.0
"""Of the sphere [m]."""
_ECCENTRICITY = 0.00669437999014
"""Squared, of the WGS 84 ellipsoid."""
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


def project_ellipsoid(origin: LatLon, place: LatLon) -> FloatArray:
    """[2] metres east and north of an origin, as the transverse Mercator projection there has them.

    The series of Snyder, Map Projections (1987), 8-9 and 8-10, on the WGS 84 ellipsoid; within
    30 km of the origin it is exact to a millimetre.
    """
    latitude, a = math.radians(place[0]), math.radians(place[1] - origin[1])
    a *= math.cos(latitude)
    t, c = math.tan(latitude) ** 2, _ECCENTRICITY / (1 - _ECCENTRICITY) * math.cos(latitude) ** 2
    radius = EARTH_RADIUS / math.sqrt(1 - _ECCENTRICITY * math.sin(latitude) ** 2)
    x = radius * (a + (1 - t + c) * a**3 / 6)
    rise = a**2 / 2 + (5 - t + 9 * c + 4 * c**2) * a**4 / 24
    arc = _measure_meridian(latitude) - _measure_meridian(math.radians(origin[0]))
    return np.array([x, arc + radius * math.tan(latitude) * rise])


def _measure_meridian(latitude: float) -> float:
    """From the equator along the WGS 84 ellipsoid's meridian [m] (Snyder 3-21)."""
    e = _ECCENTRICITY
    terms = (
        (1 - e / 4 - 3 * e**2 / 64 - 5 * e**3 / 256) * latitude,
        -(3 * e / 8 + 3 * e**2 / 32 + 45 * e**3 / 1024) * math.sin(2 * latitude),
        (15 * e**2 / 256 + 45 * e**3 / 1024) * math.sin(4 * latitude),
        -35 * e**3 / 3072 * math.sin(6 * latitude),
    )
    return EARTH_RADIUS * sum(terms)


def unproject_ellipsoid(origin: LatLon, xy: FloatArray) -> LatLon:
    """Latitude and longitude of a place [2] that `project_ellipsoid` has there [m]."""
    place = project_to_degrees(origin, xy)
    for _ in range(3):
        place = project_to_degrees(place, np.asarray(xy) - project_ellipsoid(origin, place))
    return place


def is_in_degrees(place: LatLon) -> bool:
    """Whether two numbers can be a latitude and a longitude of a road."""
    return abs(place[0]) <= 85.0 and abs(place[1]) <= 180.0
