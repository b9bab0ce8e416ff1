"""How long the relation checker takes for a busy 30 s scene.

`python benchmarks/checker.py` checks scenes of 14 agents that are built here; with folders of
scenes behind it, each of those.
"""

from __future__ import annotations

import argparse
import platform
import time
from importlib import resources
from pathlib import Path

import numpy as np

from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import AgentRecord, SceneMeta, SceneRecord
from scenewright.tools.relation_checker import check

AGENTS, SAMPLES, REPEATS = 14, 300, 40
"""Of scenes built here; and how often each is checked."""


def load_default_map() -> IntersectionMap | None:
    file = resources.files("scenewright.intersections") / "amsterdam_120" / "map.json"
    return IntersectionMap.model_validate_json(file.read_text()) if file.is_file() else None


def build_agent(n: int, rng: np.random.Generator) -> AgentRecord:
    """Build one agent in its lane. North-south cars wait 13 s, east-west cars pass before, walkers
    cross beside the traffic that has green; four of each kind of car per lane, 13 m apart."""
    walker, queue = n >= 10, n % 10
    t = np.arange(SAMPLES) * 0.1
    if walker:
        side, offset = 2 * (n % 2), 13.5 * (-1) ** (n // 12)
        moved = -20.0 + 1.3 * np.minimum(np.maximum(t - rng.uniform(0, 2), 0), 7.0)
    elif queue < 6:
        side, offset = 1 + 2 * (queue % 2), -1.6 - 3.3 * (queue % 4 > 1)
        go = 14.0 + queue // 4 * 2 + rng.uniform(0, 0.5)
        v = np.clip(2.0 * (t - go), 0, 10)
        moved = -15.0 - 9.0 * (queue // 4) + np.concatenate(([0.0], np.cumsum(v[1:] + v[:-1]) / 20))
    else:
        side, offset = 2 * (queue % 2), -1.6
        v = np.clip(7.0 - 2.0 * (t - 11.5), 0.0, 7.0)
        moved = (
            -45.0
            + 18.0 * (queue // 8)
            + rng.uniform(0, 3)
            + np.concatenate(([0.0], np.cumsum(v[1:] + v[:-1]) / 20))
        )
    angle = side * np.pi / 2
    c, s = np.cos(angle), np.sin(angle)
    xy = np.stack((c * moved - s * offset, s * moved + c * offset), axis=1).round(3)
    sides = ("west", "south", "east", "north")
    return AgentRecord.model_validate({
        "id": n + 1, "type": "pedestrian" if walker else "vehicle", "spawn_time": 0.0,
        "goal": (0.0, 0.0), "trajectory": xy.tolist(), "role": "background" if n > 2 else
        "foreground", "name": f"agent {n}", "entry": sides[side], "exit": sides[(side + 2) % 4],
        "movement": "straight", "route": "r", "heading": [float(angle)] * SAMPLES,
        "length": 0.6 if walker else 4.6, "width": 0.6 if walker else 1.85,
    })  # fmt: skip


def build_scene(seed: int) -> SceneRecord:
    rng = np.random.default_rng(seed)
    meta = SceneMeta(
        scene_id=str(seed), map_id=0, timestamp=0.0, user_prompt="", intersection="amsterdam_120",
        step=0.1, duration=30.0, time_of_day="12:00", seed=seed,
    )  # fmt: skip
    return SceneRecord(
        meta=meta, agents=tuple(build_agent(n, rng) for n in range(AGENTS)), events=()
    )


def measure(scenes: list[SceneRecord], ground: IntersectionMap | None) -> None:
    """Print the processor time of one check each, in milliseconds."""
    check(scenes[0], ground)
    times = []
    for record in scenes:
        begin = time.process_time()
        check(record, ground)
        times.append(1e3 * (time.process_time() - begin))
    low, median, high = np.percentile(times, (10, 50, 90))
    agents, objects = len(scenes[0].agents), len(scenes[0].objects)
    print(
        f"check: {median:.1f} ms median ({low:.1f} to {high:.1f}, 10th to 90th percentile; least "
        f"{min(times):.1f}) for {agents} agents and {objects} objects over "
        f"{scenes[0].meta.duration:g} s, n = {len(times)}, {platform.machine()}, "
        f"Python {platform.python_version()}, map {'yes' if ground else 'no'}"
    )


def main() -> None:
    """Measure scenes built here, or those in the folders named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="*", help="Folders of scenes.")
    ground, folders = load_default_map(), parser.parse_args().folders
    for folder in folders:
        record = SceneRecord.model_validate_json((folder / "scene.json").read_bytes())
        measure([record] * REPEATS, ground)
    if not folders:
        measure([build_scene(seed) for seed in range(REPEATS)], ground)


if __name__ == "__main__":
    main()
