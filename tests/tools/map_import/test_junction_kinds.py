"""What is one junction and what is none: kinds of faults that files of users showed."""

import numpy as np
import pytest

from scenewright.cli.map_junctions import list_rows
from scenewright.errors import InputError
from scenewright.tools.map_import import import_map, list_junctions
from scenewright.tools.map_import.read_lanelet2 import _Path
from tests.tools.map_import.test_rings import bend, commonroad

STEPS = [np.array(step) for step in ((1, 0), (0, 1), (-1, 0), (0, -1))]
PITCH, THROAT = 60.0, 8.0


def draw_grid(file, count):
    """Lanes of `count` by `count` two-way streets, 60 m apart, one lane each way."""

    def place(corner, step, distance):
        return PITCH * corner + distance * step + 1.75 * np.array([step[1], -step[0]])

    def has(corner):
        return 0 <= corner.min() and corner.max() < count

    lanes = []
    for corner in np.argwhere(np.ones((count, count))):
        lanes += [
            np.array([place(corner, step, THROAT), place(corner, step, PITCH - THROAT)])
            for step in STEPS
            if has(corner + step)
        ]
        for step in (each for each in STEPS if has(corner - each)):
            for onto in (each for each in STEPS if has(corner + each) and each @ step >= 0):
                begin, end = place(corner, step, -THROAT), place(corner, onto, THROAT)
                lanes.append(bend(begin, begin + step * ((end - begin) @ step), end))
    return commonroad(file, lanes)


def test_no_block_of_a_grid_is_a_roundabout_and_corners_are_no_junctions(tmp_path):
    found = list_junctions(draw_grid(tmp_path / "grid.xml", 3)).junctions
    assert sorted(each.legs for each in found) == [3, 3, 3, 3, 4]
    assert not any(each.is_roundabout for each in found)


def test_the_ways_that_are_looked_at_grow_as_the_junctions_do(tmp_path, monkeypatch):
    join, names = _Path.join.__func__, []
    monkeypatch.setattr(
        _Path, "join", classmethod(lambda *given: names.append(given[2]) or join(*given))
    )
    found = list_junctions(draw_grid(tmp_path / "grid.xml", 5)).junctions
    assert len(found) == 21
    assert len(names) < 16 * len(found)


def test_a_file_without_a_junction_is_refused_in_one_line_by_list_and_import(tmp_path):
    lanes = [np.array([(0.0, y), (60.0, y), (120.0, y)]) for y in (0.0, -3.5)]
    file = commonroad(tmp_path / "road.xml", lanes)
    for read in (list_rows, lambda path: import_map(path, name="x")):
        with pytest.raises(InputError, match="no junction of three or more legs"):
            read(str(file))
