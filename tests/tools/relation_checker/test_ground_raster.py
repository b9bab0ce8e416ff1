"""Which points lie in an area that is held as cells."""

from __future__ import annotations

import numpy as np
import shapely

from scenewright.tools.relation_checker.ground_raster import rasterize_area


def test_all_edges_of_an_area_are_included() -> None:
    for corner in (10.0, 10.4):
        area = rasterize_area(shapely.box(0.0, 0.0, corner, corner))
        edges = np.array([(0.0, 5.0), (corner, 5.0), (5.0, 0.0), (5.0, corner), (corner, corner)])
        assert area.contains(edges).all()
        assert not area.contains(edges + np.sign(edges - 5.0) * 0.01).any()


def test_an_area_with_a_hole_contains_as_the_exact_one_does() -> None:
    hole = shapely.box(3.2, 3.2, 6.7, 6.7)
    exact = shapely.difference(shapely.box(-5.5, -4.0, 12.0, 11.3), hole)
    points = np.random.default_rng(0).uniform(-8.0, 14.0, (2000, 2))
    expected = shapely.intersects_xy(exact, points[:, 0], points[:, 1])
    assert (rasterize_area(exact).contains(points) == expected).all()
