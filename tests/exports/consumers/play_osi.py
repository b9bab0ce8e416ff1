"""First overlaps of the footprints that omega-prime makes of OSI ground truth, and its map."""

from __future__ import annotations

import json
import sys
from importlib.metadata import version
from typing import Any

import numpy as np
import omega_prime
import shapely


def play(question: dict[str, Any]) -> dict[str, Any]:
    """Pairs and times of first contact, and how far the positions are from the scene's [m]."""
    recording = omega_prime.Recording.from_file(question["file"], validate=True)
    names = {agent["id"]: name for name, agent in question["agents"].items()}
    names |= {number: name for name, number in question["objects"].items()}
    table = recording.df.select("total_nanos", "idx", "x", "y", "yaw", "length", "width")
    rows = table.to_numpy()
    known = {
        (round(t * 1e9), agent["id"]): xy
        for agent in question["agents"].values()
        for t, xy in zip(agent["t"], agent["xy"], strict=True)
    }
    users = [row for row in rows if names[round(row[1])] in question["agents"]]
    worst = max(float(np.abs(r[2:4] - known[round(r[0]), round(r[1])]).max()) for r in users)
    found: dict[tuple[str, str], float] = {}
    for nanos in np.unique(rows[:, 0]):
        here = rows[rows[:, 0] == nanos]
        shapes = [_box(*row[2:]) for row in here]
        tree = shapely.STRtree(shapes)
        for a, b in tree.query(shapes, predicate="intersects").T:
            if a < b:
                pair = sorted(names[round(here[k, 1])] for k in (a, b))
                found.setdefault((pair[0], pair[1]), round(nanos * 1e-9, 3))
    return {
        "agents": len(np.unique(rows[:, 1])),
        "rows": len(rows),
        "collisions": [[*pair, t] for pair, t in sorted(found.items())],
        "position_error": worst,
        "map": len(recording.map.odr_xml),
    }


def _box(x: float, y: float, yaw: float, length: float, width: float) -> shapely.Polygon:
    c, s = np.cos(yaw), np.sin(yaw)
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [length / 2, width / 2]
    return shapely.Polygon(corners @ np.array([[c, s], [-s, c]]) + [x, y])


def main() -> None:
    request = json.load(sys.stdin)
    answers = [play(each) for each in request["scenes"]]
    json.dump({"version": version("omega-prime"), "scenes": answers}, sys.stdout)


if __name__ == "__main__":
    main()
