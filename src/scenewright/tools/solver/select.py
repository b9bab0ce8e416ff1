"""Candidate selection (paper Eq. 4): the surviving combination, drawn or likeliest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from scenewright.geometry.map_areas import MapAreas
from scenewright.scene.candidates import CandidateSet
from scenewright.scene.constraints import ConstraintProgram
from scenewright.scene.frozen_agents import FrozenAgents
from scenewright.scene.selection import Selection
from scenewright.scene.social import ObjectNode
from scenewright.tools.solver.frozen_agents import FrozenAgentsSearch
from scenewright.tools.solver.min_cost_search import MinCostSearch
from scenewright.tools.solver.search import Search

Mode = Literal["draw", "map"]


def select(
    program: ConstraintProgram,
    pool: CandidateSet,
    *,
    map_areas: MapAreas,
    rng: np.random.Generator,
    mode: Mode = "draw",
    lenient: bool = True,
    frozen: FrozenAgents | None = None,
    objects: Sequence[ObjectNode] = (),
) -> Selection:
    """Select the surviving combination.

    Args:
        mode: `draw`, the first survivor in the order drawn; `map`, the one of least cost.
        lenient: accept schedules that drivers would choose differently, if they do what was asked.
        frozen: agents of an earlier version that stay; the first survivor around them is taken.
        objects: the objects in the scene, to be placed.

    Raises:
        Rejected: `no_surviving_combination`, naming the clause that most tuples fail.
    """
    if frozen is not None:
        return FrozenAgentsSearch(
            program, pool, map_areas, rng, lenient, frozen=frozen, objects=objects
        ).run()
    search = MinCostSearch if mode == "map" else Search
    return search(program, pool, map_areas, rng, lenient, objects=objects).run()
