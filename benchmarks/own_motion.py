"""Generated against real motion at an intersection of one's own: speed, acceleration, jerk, PET.

    python benchmarks/own_motion.py NAME DATASET TRACKS...

NAME is an imported intersection, DATASET a folder of scenes that `scenewright batch --intersection
NAME` has made, TRACKS folders of TAF-BW tracks recorded there. Distances are Wasserstein's, with
intervals drawn again over scenes and recordings; `halves` is that of two halves of the real tracks,
what no set of scenes can be expected to go below. All positions are smoothed over 0.4 s first. Only
agents that no relation binds are compared: people do not collide on request.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from scenewright.evals.realism.scenes import SceneTracks, read_scenes
from scenewright.evals.tables.nearness import (
    compare_with_reference,
    isolate_agents,
    measure_motion,
    measure_scenes,
    observe_scenes,
)
from scenewright.intersections import load_map
from scenewright.tools.relation_checker import RoadUser
from scenewright.tools.track_io import Recording
from scenewright.tools.track_io.taf_bw import read_taf_bw

SMOOTHING = 0.4


def keep_background(scene: SceneTracks) -> SceneTracks:
    """Keep the background agents of a scene."""
    users = tuple(user for user in scene.users if user.id not in scene.foreground)
    return SceneTracks(users, signals=scene.signals)


def read_whole(recording: Recording) -> SceneTracks:
    """Read all agents of a recording, bicycles left out; windows of it would cut encounters."""
    seen = [a for a in recording.agents if a.subtype != "bicycle" and len(a.track.xy) > 1]
    return SceneTracks(tuple(RoadUser(n, a.track, a.shape) for n, a in enumerate(seen)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name")
    parser.add_argument("dataset", type=Path)
    parser.add_argument("tracks", nargs="+", type=Path)
    options = parser.parse_args()
    place = load_map(options.name)
    made = [keep_background(scene) for scene in read_scenes(options.dataset)]
    real = [each for folder in options.tracks for each in read_taf_bw(folder).recordings]
    ours = measure_scenes(list(observe_scenes(made, intersection_map=place)), smoothing=SMOOTHING)
    seen = list(observe_scenes(map(read_whole, real), intersection_map=None))
    theirs = {**measure_scenes(seen), **measure_motion(isolate_agents(real), smoothing=SMOOTHING)}
    print(f"{options.name}: {len(made)} scenes, {sum(len(r.agents) for r in real)} real tracks")
    print("| measure | of | distance, 95 % | halves | scenes 5/50/95 % | real 5/50/95 % |")
    print("|---|---|---|---|---|---|")
    for each in compare_with_reference(ours, theirs, named="real", draws=200, seed=0):
        if each.distance is not None and each.quantiles and each.reference_quantiles:
            far = each.distance
            spans = [
                " / ".join(f"{q:.2f}" for q in span)
                for span in (each.quantiles, each.reference_quantiles)
            ]
            halves = "" if each.halves is None else f"{each.halves:.2f}"
            interval = f"{far.value:.2f} ({far.low:.2f}-{far.high:.2f})"
            cells = [each.measure, each.group, interval, halves, *spans]
            print(f"| {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
