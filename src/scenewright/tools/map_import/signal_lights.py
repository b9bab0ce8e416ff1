"""Which legs of a junction have lights, by the places of the lights in the file."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenewright.geometry.polyline import resample_by_spacing
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.legs import SurveyLeg
from scenewright.tools.map_import.mapped_crosswalks import CrossingChoice
from scenewright.tools.map_import.survey import Survey, SurveyLight

_FARTHEST = 40.0
"""A light farther out along a lane is another junction's [m]."""
_BESIDE = 6.0
"""From a lane to its light [m]."""


def find_lit_legs(
    survey: Survey, legs: Sequence[SurveyLeg], crossings: CrossingChoice
) -> dict[int, str]:
    """By leg with lights at its stop line or crosswalk: the file's group of them, or ``."""
    found: dict[int, str] = {}
    for light in survey.lights:
        k = _find_leg(light, legs)
        if k is not None and not found.get(k):
            found[k] = light.group
    for k, mapped in crossings.by_leg.items():
        if legs[k].approaches and any(x.crossing.is_signalised for x in mapped.stages):
            found.setdefault(k, "")
    return dict(sorted(found.items()))


def _find_leg(light: SurveyLight, legs: Sequence[SurveyLeg]) -> int | None:
    """The leg on one of whose lanes into the junction, within 40 m of it, the light stands."""
    away = [
        (_measure_distance(light.place, lane.line), k)
        for k, leg in enumerate(legs)
        for lane in leg.approaches
    ]
    nearest, k = min(away, default=(np.inf, -1))
    return k if nearest < _BESIDE else None


def _measure_distance(place: FloatArray, line: FloatArray) -> float:
    """To the last stretch of an approach [m]."""
    last = resample_by_spacing(line, 1.0)[-round(_FARTHEST) :]
    return round(float(np.hypot(*(last - place).T).min()), 3)
