"""Tracks in scenario files of Argoverse 2 motion forecasting (Parquet)."""

from __future__ import annotations

import io
from importlib import import_module
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.extras import require_extra
from scenewright.tools.track_io.sampled_recording import (
    AgentSamples,
    SampledRecording,
    find_road_user,
    sort_out,
)

NANOSECONDS = 1e-9
_NEEDED = (
    "track_id", "object_type", "timestep", "position_x", "position_y", "heading",
    "start_timestamp", "end_timestamp", "num_timestamps",
)  # fmt: skip
_OWN = ("length", "width", "kind")
"""Columns that our exporter adds: Argoverse 2 states no sizes."""


def read_argoverse2(data: bytes, *, name: str) -> list[SampledRecording]:
    """The tracks of one scenario; sizes are the usual ones unless our exporter wrote the file.

    Raises:
        InputError: no Parquet file, or not the columns of a scenario.
    """
    require_extra("exports", "reading Argoverse 2", "pyarrow")
    arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
    try:
        file = parquet.ParquetFile(io.BytesIO(data))
        names = file.schema_arrow.names
        if missing := [column for column in _NEEDED if column not in names]:
            raise InputError(
                f"{name} is no Argoverse 2 scenario: no column {', '.join(missing)[:120]}"
            )
        own = [column for column in _OWN if column in names]
        columns: dict[str, list[Any]] = file.read([*_NEEDED, *own]).to_pydict()
    except (arrow.ArrowException, OSError, ValueError) as error:
        raise InputError(f"{name} is no Parquet file that can be read") from error
    if not columns["track_id"]:
        raise InputError(f"{name} holds no tracks")
    steps, ids = np.array(columns["timestep"]), np.array(columns["track_id"], dtype=str)
    start, end, count = (columns[key][0] for key in _NEEDED[-3:])
    step = (end - start) * NANOSECONDS / max(count - 1, 1)
    keys = ("position_x", "position_y", "heading")
    places = np.stack([np.array(columns[key], dtype=np.float64) for key in keys], axis=1)
    found = []
    for who in dict.fromkeys(ids.tolist()):
        rows = np.flatnonzero(ids == who)
        rows = rows[np.argsort(steps[rows], kind="stable")]
        first = int(rows[0])
        word = str(columns["kind" if "kind" in columns else "object_type"][first])
        subtype = find_road_user(word)
        agent = None
        if subtype is not None:
            length, width = (columns[key][first] if key in columns else None for key in _OWN[:2])
            t = (steps[rows] * step).round(4)
            agent = AgentSamples(who, subtype, t, places[rows, :2], places[rows, 2], length, width)
        found.append((word, agent))
    return [sort_out("", found)]
