"""How often, how close and how fast: the figures of a dataset's card, and their picture."""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from scenewright.dataset.batch.overview import create_figure
from scenewright.dataset.tables.parquet import SceneFiles
from scenewright.geometry.kinematics import differentiate
from scenewright.scene.base import FloatArray

_MOVING = 0.5
"""Slower than this an agent stands [m/s]."""
_MEASURES: Mapping[str, tuple[str, str]] = {
    "pet": ("post-encroachment time", "s"),
    "ttc_2d": ("least time to collision straight on", "s"),
    "path_ttc": ("least time to collision along paths", "s"),
    "drac": ("deceleration needed to avoid the crash", "m/s²"),
    "relative_speed": ("closing speed at contact", "m/s"),
}
"""Key of the checker's evidence -> what it is, and its unit."""
_PLOTTED = (
    ("post-encroachment time of ", "s", (0.0, 6.0)),
    ("least time to collision along paths of ", "s", (0.0, 6.0)),
    ("mean speed of moving ", "m/s", (0.0, 15.0)),
    ("seen in a scene: ", "agents", (0.0, 40.0)),
)
"""Beginning of a figure's name, its unit, and what its histogram spans."""


@dataclass
class Statistics:
    """Values of each figure over all scenes; figure -> values, in the order of the scenes."""

    values: dict[str, array[float]] = field(default_factory=dict)

    def note(self, files: SceneFiles) -> None:
        """Adds what one scene shows."""
        if files.scene is None or files.proof is None:
            return
        for event in files.proof["events"]:
            for key, (name, unit) in _MEASURES.items():
                value = event["evidence"].get(key)
                if value is not None:
                    kind = event["type"].replace("_", " ")
                    self._add(f"{name} of {kind} [{unit}]", value)
        kinds = [agent["type"] for agent in files.scene["agents"]]
        for kind in ("vehicle", "pedestrian"):
            self._add(f"seen in a scene: {kind}s [agents]", kinds.count(kind))
        for kind in sorted({*kinds} & {"cyclist", "scooter"}):
            self._add(f"seen in a scene that has any: {kind}s [agents]", kinds.count(kind))
        for agent in files.scene["agents"]:
            speed = _compute_mean_speed(agent, files.scene["meta"]["step"])
            if speed is not None:
                self._add(f"mean speed of moving {agent['type']}s [m/s]", speed)

    def _add(self, figure: str, value: float) -> None:
        self.values.setdefault(figure, array("d")).append(value)

    def list_rows(self) -> list[tuple[str, str, str]]:
        """(figure, number of values, "5 % / median / 95 %") of each figure, by name."""
        found = []
        for name, values in sorted(self.values.items()):
            low, middle, high = np.percentile(np.array(values), (5, 50, 95))
            found.append((name, str(len(values)), f"{low:.2f} / {middle:.2f} / {high:.2f}"))
        return found


def _compute_mean_speed(agent: Mapping[str, Any], step: float) -> float | None:
    """Mean over the samples at which it moves [m/s]; None where it stands throughout."""
    velocity: FloatArray = differentiate(np.array(agent["trajectory"], dtype=np.float64), step)
    speed = np.hypot(*velocity.T)
    moving = speed[speed > _MOVING]
    return float(moving.mean()) if len(moving) else None


def draw_statistics(path: Path, statistics: Statistics) -> None:
    """Writes histograms as a PNG; the same values give the same bytes."""
    figure = create_figure(11.5, 2.9)
    all_axes = figure.subplots(1, len(_PLOTTED))
    for axes, (begin, unit, span) in zip(all_axes, _PLOTTED, strict=True):
        for name, values in sorted(statistics.values.items()):
            if name.startswith(begin):
                label = name.removeprefix(begin).rpartition(" [")[0]
                axes.hist(np.array(values), bins=24, range=span, histtype="stepfilled", alpha=0.5,
                          label=label)  # fmt: skip
        axes.set(xlabel=f"{begin.removesuffix(' of ').strip(': ')} [{unit}]", xlim=span)
        if axes.patches:
            axes.legend(fontsize=7)
    all_axes[0].set_ylabel("how many")
    figure.savefig(path, metadata={"Software": None})
