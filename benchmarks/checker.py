"""Processor time of the relation checker: made scenes of a busy hour, and 3,000 agents at once.

    python benchmarks/checker.py [--against COMMIT] [FOLDER ...]

Five scenes of some 40 agents are made, or those in the folders taken; the crowd is built here: cars
that stop and go both ways on a grid of streets, and walkers beside them, for 30 s. With a commit,
its sources and these take turns, and the ratio of the medians is printed.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import platform
import subprocess
import sys
import tarfile
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np

TEXTS = (
    "A car hits a pedestrian on the crosswalk at 8 am",
    "A vehicle yields to a pedestrian at 8 am",
    "A car rear-ends a truck on the south approach at 5 pm",
    "Two cars narrowly miss each other with a PET of 1.2 seconds at 8 am",
    "A car follows a bus straight through from the west at 8 am",
)
AGENTS, HALF, SAMPLES = 3000, 900, 300
"""Of the crowd; half the side of the place [m]."""
TURNS, REPEATS = 3, 5


def make_scenes(root: Path) -> list[Path]:
    from scenewright.graph.run import synthesize

    return [synthesize(text).save(root / str(n)) for n, text in enumerate(TEXTS)]


def prepare_scenes(folders: list[Path]) -> Callable[[], object]:
    """A look at every scene."""
    from scenewright.intersections import load_map
    from scenewright.scene.record import SceneRecord
    from scenewright.tools.relation_checker import check

    files = [(folder / "scene.json").read_bytes() for folder in folders]
    scenes = [SceneRecord.model_validate_json(each) for each in files]
    return lambda: [check(each, load_map(each.meta.intersection)) for each in scenes]


def prepare_crowd(agents: int) -> Callable[[], object]:
    """A look at the crowd."""
    from scenewright.scene.track import Shape, Track
    from scenewright.tools.relation_checker import RoadUser
    from scenewright.tools.relation_checker.external_events import ExternalTracks, examine_recording

    rng, t, users = np.random.default_rng(0), np.arange(SAMPLES) * 0.1, []
    for n in range(agents):
        walks, side = rng.random() < 0.3, rng.choice([-1, 1])
        top = 1.4 if walks else 9.0
        swing = 0.6 + 0.6 * np.sin(t / rng.uniform(3, 6) + rng.uniform(0, 6))
        driven = np.cumsum(np.clip(top * swing, 0, top)) * 0.1
        along = rng.uniform(-HALF, HALF) + side * driven
        street = rng.integers(-HALF // 60, HALF // 60 + 1) * 60.0
        across = np.full(SAMPLES, street + side * (5.5 if walks else 1.75))
        turned = rng.random() < 0.5
        xy = np.stack((across, along) if turned else (along, across), axis=1).round(3)
        heading = side * np.pi / 2 if turned else (0.0 if side > 0 else np.pi)
        shape = Shape("pedestrian", 0.6, 0.6) if walks else Shape("vehicle", 4.6, 1.85)
        users.append(RoadUser(n + 1, Track(xy, np.full(SAMPLES, heading), 0.0, 0.1), shape))
    names = {each.id: str(each.id) for each in users}
    tracks = ExternalTracks(tuple(users), names, names, 0.1)
    return lambda: examine_recording(tracks)


def measure(look: Callable[[], object], repeats: int) -> list[float]:
    """Processor times [s]."""
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        look()
        times.append(time.process_time() - begin)
    return times


def measure_apart(source: Path, folders: list[Path]) -> dict[str, list[float]]:
    """The times of the checker in a folder of sources, in a process of its own."""
    command = [sys.executable, __file__, "--as-json", *map(str, folders)]
    environment = os.environ | {"PYTHONPATH": str(source)}
    done = subprocess.run(command, env=environment, capture_output=True, check=True)
    return dict(json.loads(done.stdout))


def extract(commit: str, root: Path) -> Path:
    """The sources of a commit."""
    data = subprocess.run(["git", "archive", commit, "src"], capture_output=True, check=True).stdout
    with tarfile.open(fileobj=io.BytesIO(data)) as archive:
        archive.extractall(root, filter="data")
    return root / "src"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="*", help="Folders of scenes.")
    parser.add_argument("--against", help="An earlier commit.")
    parser.add_argument("--as-json", action="store_true", help="Print the times alone.")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        root = Path(name)
        folders = [each.resolve() for each in options.folders] or make_scenes(root / "scenes")
        if options.as_json:
            look, crowd = prepare_scenes(folders), prepare_crowd(AGENTS)
            measure(look, 1)  # which compiles
            measure(prepare_crowd(40), 1)
            each = [t / len(folders) for t in measure(look, REPEATS)]
            print(json.dumps({"scene": each, "crowd": measure(crowd, 1)}))
            return
        sources = {"now": Path(__file__).parents[1] / "src"}
        if options.against:
            sources[options.against] = extract(options.against, root / "before")
        turns = [(s, measure_apart(sources[s], folders)) for _ in range(TURNS) for s in sources]
    for case in ("scene", "crowd"):
        times = {s: [t for of, found in turns if of == s for t in found[case]] for s in sources}
        middle = {s: median(each) for s, each in times.items()}
        for s, each in times.items():
            ratio = f", {middle[s] / middle['now']:.2f} times as long as now" if s != "now" else ""
            print(f"{case}, {s}: {1e3 * middle[s]:.1f} ms (n = {len(each)}){ratio}")
    print(f"{platform.machine()}, Python {platform.python_version()}")


if __name__ == "__main__":
    main()
