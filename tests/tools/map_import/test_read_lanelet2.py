"""Our reader of Lanelet2 files sees the lanelets that the Lanelet2 library sees in them."""

import os
from pathlib import Path

import numpy as np
import pytest

import map_files
from scenewright.geometry.geographic import project_mercator
from scenewright.tools.map_import.read_lanelet2 import chain_pieces, load_lanelet2

TAF = os.environ.get("SCENEWRIGHT_TAF_BW")


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (1, 2, 0)])
@pytest.mark.parametrize("turned", [(), (0,), (1, 2)])
def test_a_bound_of_several_ways_is_one_line_however_they_are_listed(order, turned):
    line = np.stack([np.arange(10.0), np.sin(np.arange(10.0))], axis=1)
    pieces = [line[:4], line[3:7], line[6:]]
    pieces = [piece[::-1] if n in turned else piece for n, piece in enumerate(pieces)]
    found = chain_pieces([pieces[n] for n in order])
    kept = found[np.concatenate([[True], np.hypot(*np.diff(found, axis=0).T) > 1e-9])]
    assert np.allclose(kept, line) or np.allclose(kept, line[::-1])


def maps(folder):
    found = [
        map_files.lanelet2(folder / "four.osm"),
        map_files.lanelet2(folder / "b.osm", reverse=True),
    ]
    if TAF is not None:
        found += sorted((Path(TAF) / "datasets" / "maps").glob("*.osm"))
    return found


def test_the_library_sees_the_same_lanelets(tmp_path):
    library = pytest.importorskip("lanelet2")
    for file in maps(tmp_path):
        graph = load_lanelet2(file)
        middle = graph.origin
        ours = {**graph.lanes, **{lane.id: lane for lane in graph.foot}}
        frame = library.projection.UtmProjector(library.io.Origin(*middle))
        read, _ = library.io.loadRobust(str(file), frame)
        theirs = {str(each.id): each for each in read.laneletLayer}
        assert set(ours) <= set(theirs)
        for name, lane in ours.items():
            middles = [library.core.BasicPoint3d(p.x, p.y, p.z) for p in theirs[name].centerline]
            points = [frame.reverse(each) for each in middles]
            line = np.array([project_mercator(middle, (point.lat, point.lon)) for point in points])
            away = np.hypot(*(line[:, None] - lane.line[None]).transpose(2, 0, 1)).min(axis=1)
            assert float(np.quantile(away, 0.9)) < 0.6, name
