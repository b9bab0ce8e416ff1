"""A version to keep."""

from __future__ import annotations

from functools import cache

from scenewright.authoring.versions import Setting, begin
from scenewright.backends import load_backend
from scenewright.scene.frozen_agents import PreviousVersion


@cache
def first_version() -> PreviousVersion:
    setting = Setting("amsterdam_120", load_backend("builtin"), 1)
    return begin("A car yields to a pedestrian at 5 am", setting).earlier
