"""TrajNet++ files: reading recordings, writing predictions.

A file holds one JSON object per line, scenes `{"scene": {id, p, s, e, fps, tag}}` and rows of
tracks `{"track": {f, p, x, y}}`. A scene is a primary pedestrian p and a stretch of 21 steps from
frame s to frame e, with all agents that have rows in it. Predictions are rows with two keys more,
`prediction_number` and `scene_id`, rounded to centimetres.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.tools.formats.trajnet import iterate_trajnet_rows

OBSERVED, PREDICTED = 9, 12
STEPS = OBSERVED + PREDICTED


@dataclass(frozen=True)
class SceneRow:
    """A scene as the file names it.

    Attributes:
        id, primary, start, end: scene and pedestrian ids, first and last frame.
        fps: steps per second.
        type: 1 static, 2 linear, 3 interacting, 4 other; None where the file keeps it secret.
        subtypes: of type 3: 1 leader-follower, 2 avoidance, 3 group, 4 other.
    """

    id: int
    primary: int
    start: int
    end: int
    fps: float
    type: int | None
    subtypes: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class BenchmarkRecording:
    """A file in memory.

    Attributes:
        name: of the file, without its ending.
        scenes: in the order of the file.
        stride: frame numbers per step; step: [s].
        ids: [P] pedestrians, ascending.
        rows: by frame, the indices in `ids` of the agents seen, and their positions [m].
        first: [P, 2] where each pedestrian is first seen [m].
        last: [P, 2] where each is last seen [m], its goal by the benchmark's definition.
    """

    name: str
    scenes: tuple[SceneRow, ...]
    stride: int
    step: float
    ids: NDArray[np.int64]
    rows: dict[int, tuple[NDArray[np.int64], FloatArray]]
    first: FloatArray
    last: FloatArray

    def stretch(self, start: int, *, steps: int = STEPS) -> FloatArray:
        """Cut positions [P, steps, 2] [m] of all agents from frame `start` on; NaN without row."""
        out = np.full((len(self.ids), steps, 2), np.nan)
        for k in range(steps):
            index, xy = self.rows.get(start + k * self.stride, (None, None))
            if index is not None:
                out[index, k] = xy
        return out


def read_recording(path: Path) -> BenchmarkRecording:
    """A TrajNet++ file.

    Raises:
        InputError: not such a file; the message names the line.
        OSError: it cannot be read.
    """
    scenes: list[SceneRow] = []
    rows: dict[tuple[int, int], tuple[float, float]] = {}

    def refuse(line: int, reason: str) -> NoReturn:
        raise InputError(f"{path}, line {line}: not a TrajNet++ row: {reason}")

    try:
        lines = path.read_text(encoding="utf-8").split("\n")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text file") from error
    for line, kind, values in iterate_trajnet_rows(
        lines, predictions="first as tracks", refuse=refuse
    ):
        try:
            if kind == "scene":
                scenes.append(_parse_scene(values))
                continue
            place = float(values["x"]), float(values["y"])
            if not np.isfinite(place).all():
                raise ValueError("a position must be finite")
            rows[int(values["p"]), int(values["f"])] = place
        except (ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
            why = f"{error.args[0]!r} is missing" if isinstance(error, KeyError) else str(error)
            refuse(line, why)
    if not scenes or not rows:
        raise InputError(f"{path}: a TrajNet++ file holds scenes and tracks; found "
                         f"{len(scenes)} scenes and {len(rows)} rows of tracks")  # fmt: skip
    strides = {((s.end - s.start) // (STEPS - 1), s.fps) for s in scenes}
    if len(strides) > 1:
        raise InputError(f"{path}: scenes of different steps (frames, fps): {sorted(strides)}")
    stride, fps = strides.pop()
    keys = np.array(sorted(rows, key=lambda key: (key[1], key[0])))
    xy = np.array([rows[p, f] for p, f in keys.tolist()])
    ids, index = np.unique(keys[:, 0], return_inverse=True)
    frames, begins = np.unique(keys[:, 1], return_index=True)
    parts = zip(np.split(index, begins[1:]), np.split(xy, begins[1:]), strict=True)
    first, last = np.empty((len(ids), 2)), np.empty((len(ids), 2))
    last[index] = xy  # rows are in the order of time, so each pedestrian's last one stays
    first[index[::-1]] = xy[::-1]
    by_frame = dict(zip(frames.tolist(), parts, strict=True))
    return BenchmarkRecording(
        path.stem, tuple(scenes), stride, 1.0 / fps, ids, by_frame, first, last
    )


def _parse_scene(entry: dict[str, Any]) -> SceneRow:
    tag = entry.get("tag")
    kind = tag[0] if isinstance(tag, list) and tag else tag
    parts = tag[1] if isinstance(tag, list) and len(tag) > 1 else []
    known = kind if kind in (1, 2, 3, 4) else None
    start, end = int(entry["s"]), int(entry["e"])
    fps = float(entry["fps"])
    if not 0.1 <= fps <= 100.0:
        raise ValueError(f"{fps} steps per second")
    if end <= start or (end - start) % (STEPS - 1):
        raise ValueError(f"a scene spans {STEPS} steps, but frames {start} to {end} do not")
    return SceneRow(
        int(entry["id"]), int(entry["p"]), start, end, fps, known,
        tuple(int(part) for part in parts),
    )  # fmt: skip


def interpolate_at_times(xy: FloatArray, given: FloatArray, wanted: FloatArray) -> FloatArray:
    """Positions in between, on straight lines.

    Args:
        xy: [N, T, 2] positions [m], NaN where unseen; given: [T] their times [s], ascending.
        wanted: [W] times [s] within those given.

    Returns:
        [N, W, 2]; NaN between two positions of which one is unseen.
    """
    low = np.clip(np.searchsorted(given, wanted + 1e-9) - 1, 0, len(given) - 2)
    share = ((wanted - given[low]) / (given[low + 1] - given[low]))[:, None]
    first, second = xy[:, low], xy[:, low + 1]
    between = np.where(share < 1e-6, first, (1.0 - share) * first + share * second)
    return np.asarray(np.where(share > 1.0 - 1e-6, second, between))


def compute_times_around_now(count: int, *, before: int, step: float) -> FloatArray:
    """[count] times [s] of samples every `step`, of which sample `before` is now."""
    return np.asarray(step * (np.arange(count) - before), dtype=np.float64)
