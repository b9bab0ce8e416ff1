"""Candidate selection (paper Eq. 4): the surviving combination, drawn or likeliest."""

from __future__ import annotations

from typing import Literal

import numpy as np

from scenewright.geometry.map_areas import MapAreas
from scenewright.scene.candidates import CandidateSet
from scenewright.scene.constraints import ConstraintProgram
from scenewright.scene.frozen_agents import FrozenAgents
from scenewright.scene.selection import Selection
from scenewright.tools.solver.frozen_agents import PinnedSearch
from scenewright.tools.solver.min_cost_search import Least
from scenewright.tools.solver.search import Search

Mode = Literal["draw", "map"]


def select(
    program: ConstraintProgram,
    pool: CandidateSet,
    *,
    ground: MapAreas,
    rng: np.random.Generator,
    mode: Mode = "draw",
    lenient: bool = True,
    pins: FrozenAgents | None = None,
) -> Selection:
    """The surviving combination.

    Args:
        mode: `draw`, the first survivor in the order drawn; `map`, the one of least cost.
        lenient: take stagings that people would do differently, if they do what was asked.
        pins: agents of an earlier version that stay; the first survivor around them is taken.

    Raises:
        Rejected: `no_surviving_combination`, naming the clause that most tuples fail.
    """
    if pins is not None:
        return PinnedSearch(program, pool, ground, rng, lenient, pins=pins).run()
    search = Least if mode == "map" else Search
    return search(program, pool, ground, rng, lenient).run()
