"""A survey as a file of a bundle: what an import read, so that a fit can derive the map anew."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.survey import (
    DrivingSide,
    Survey,
    SurveyConnection,
    SurveyCrossing,
    SurveyLane,
    SurveyLight,
)

FORMAT = 1


def write_survey(survey: Survey, **options: Any) -> bytes:
    """The survey, and how the map was made of it, as JSON."""
    text = json.dumps(
        {"format": FORMAT, "options": options, "survey": _describe(survey)},
        ensure_ascii=False, separators=(",", ":"),
    )  # fmt: skip
    return text.encode()


def _describe(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return np.round(value, 4).tolist()
    if is_dataclass(value):
        return {each.name: _describe(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, Mapping):
        return {key: _describe(each) for key, each in value.items()}
    return [_describe(each) for each in value] if isinstance(value, (list, tuple)) else value


def read_survey(content: bytes) -> tuple[Survey, dict[str, Any]]:
    """The survey and the options that were written.

    Raises:
        InputError: no survey of this version; the map has to be imported again.
    """
    try:
        held = json.loads(content)
        if held["format"] != FORMAT:
            raise ValueError(held["format"])
        return _build_survey(held["survey"]), dict(held["options"])
    except (KeyError, TypeError, ValueError):
        raise InputError(
            "survey.json is damaged or of another version; import the map again"
        ) from None


def _build_survey(raw: dict[str, Any]) -> Survey:
    return Survey(
        **{
            **raw,
            "approaches": {k: _build_lane(each) for k, each in raw["approaches"].items()},
            "exits": {k: _build_lane(each) for k, each in raw["exits"].items()},
            "connections": tuple(
                SurveyConnection(**{**each, "line": np.array(each["line"]).reshape(-1, 2)})
                for each in raw["connections"]
            ),
            "crossings": tuple(_build_crossing(each) for each in raw["crossings"]),
            "areas": _build_lines(raw["areas"]),
            "walks": _build_lines(raw["walks"]),
            "lights": tuple(
                SurveyLight(np.array(each["place"]), each["group"]) for each in raw["lights"]
            ),
            "phases": tuple((duration, colours) for duration, colours in raw["phases"]),
            "side": DrivingSide(**raw["side"]),
            "origin": None if raw["origin"] is None else tuple(raw["origin"]),
            "offset": tuple(raw["offset"]),
            "file_origin": None if raw["file_origin"] is None else tuple(raw["file_origin"]),
        }
    )


def _build_lane(raw: dict[str, Any]) -> SurveyLane:
    return SurveyLane(**{**raw, "line": np.array(raw["line"])})


def _build_crossing(raw: dict[str, Any]) -> SurveyCrossing:
    limits = None if raw["limits"] is None else np.array(raw["limits"])
    return SurveyCrossing(**{**raw, "line": np.array(raw["line"]), "limits": limits})


def _build_lines(raw: Sequence[Any]) -> tuple[FloatArray, ...]:
    return tuple(np.array(line) for line in raw)
