"""Scenes made once for all tests of understanding."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenewright.evals.understanding.cases import SceneCase, read_case
from scenewright.graph.run import synthesize

TEXTS = {
    "plain": "Ordinary traffic in medium traffic",
    "struck": "A left-turning car hits a pedestrian on the crosswalk",
    "gives-way": "A right-turning car yields to a pedestrian on the crosswalk",
    "crash": "A car turning left collides with an oncoming car",
}


@pytest.fixture(scope="session")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of scenes."""
    folder = tmp_path_factory.mktemp("scenes")
    for seed, (name, text) in enumerate(TEXTS.items()):
        synthesize(text, seed=seed, refiner="none").save(folder / name)
    return folder


@pytest.fixture(scope="session")
def cases(scenes: Path) -> dict[str, SceneCase]:
    """The scenes by name."""
    return {name: read_case(scenes / name) for name in TEXTS}
