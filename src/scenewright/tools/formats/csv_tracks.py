"""CSV of tracks, which `scenewright verify` reads: one row per agent and sample."""

from __future__ import annotations

import csv
import io

from scenewright.tools.formats.exported_scene import ExportedScene

COLUMNS = ("t", "id", "class", "x", "y", "heading", "length", "width")


def write_csv(scene: ExportedScene) -> dict[str, bytes]:
    """The rows in order of agents and times; metres, seconds, radians."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for agent in scene.agents:
        size = (agent.length, agent.width)
        for t, (x, y), heading in zip(
            agent.times.tolist(), agent.xy.tolist(), agent.heading.tolist(), strict=True
        ):
            writer.writerow((t, agent.id, agent.names.tracks, x, y, round(heading, 6), *size))
    return {f"{scene.name}.csv": text.getvalue().encode()}
