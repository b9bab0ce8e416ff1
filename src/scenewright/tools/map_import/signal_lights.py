"""Which legs of a junction have lights, by the places of the lights in the file."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenewright.geometry.polyline import resample_by_spacing
from scenewright.tools.map_import.legs import SurveyLeg
from scenewright.tools.map_import.mapped_crosswalks import CrossingChoice
from scenewright.tools.map_import.survey import Survey

_FARTHEST = 40.0
"""A light farther out along a lane is another junction's [m]."""
_BESIDE = 6.0
"""From a lane to its light [m]."""


def find_lit_legs(
    survey: Survey, legs: Sequence[SurveyLeg], crossings: CrossingChoice
) -> dict[int, str]:
    """By leg with lights at its stop line or crosswalk: the file's group of them, or ``."""
    found: dict[int, str] = {}
    # The last stretch of every approach, a point every metre; and the first half of the ways on:
    # before a stop line a slip lane may have left, with which the junction begins.
    near = [
        (k, resample_by_spacing(lane.line, 1.0)[-round(_FARTHEST) :])
        for k, leg in enumerate(legs)
        for lane in leg.approaches
    ]
    leg_of = {lane.id: k for k, leg in enumerate(legs) for lane in leg.approaches}
    for way in survey.connections:
        line = resample_by_spacing(way.line, 1.0)
        near.append((leg_of[way.approach], line[: len(line) // 2 + 1]))
    for light in survey.lights:
        away = [
            (round(float(np.hypot(*(stretch - light.place).T).min()), 3), k) for k, stretch in near
        ]
        nearest, k = min(away, default=(np.inf, -1))
        if nearest < _BESIDE and not found.get(k):
            found[k] = light.group
    for k, mapped in crossings.by_leg.items():
        if legs[k].approaches and any(x.crossing.is_signalised for x in mapped.stages):
            found.setdefault(k, "")
    return dict(sorted(found.items()))
