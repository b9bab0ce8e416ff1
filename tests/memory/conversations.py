"""A version to keep."""

from __future__ import annotations

from functools import cache, partial

from scenewright.authoring.versions import begin
from scenewright.graph.run import synthesize
from scenewright.scene.frozen_agents import PreviousVersion


@cache
def first_version() -> PreviousVersion:
    make = partial(synthesize, seed=1, refiner="none")
    return begin("A car yields to a pedestrian at 5 am", make).earlier
