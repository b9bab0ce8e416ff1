"""What the kinematic layer is worth: `python benchmarks/kinematic_layer.py [N] [--corpus F.npz]`.

N requests (60) are edited, and refined once with the network as shipped, with the layer and
without it: then what the network proposes goes along each agent's path as it is. Printed are the
agents that break a limit of SEMANTICS section 5 and, where `scenewright intersections corpus` has
made a recording, how far jerk and acceleration are from its validation hours (Wasserstein).
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from scenewright import synthesize
from scenewright.backends import load_backend
from scenewright.errors import Unsatisfiable
from scenewright.evals.planning import PlanningShare
from scenewright.evals.realism.distances import compute_wasserstein
from scenewright.evals.realism.samples import (
    Agents,
    MotionFilter,
    list_scene_agents,
    measure_motion,
)
from scenewright.evals.realism.scenes import convert_scene, cut_scenes, list_requests
from scenewright.graph.run import ground_of
from scenewright.nodes.context import RunContext
from scenewright.nodes.scene_verifier.assemble import assemble
from scenewright.nodes.trajectory_refiner import refine_trajectories
from scenewright.scene.record import SceneRecord
from scenewright.tools.gmm_sampler import load_priors
from scenewright.tools.relation_checker import check
from scenewright.tools.track_io import load_recordings
from scenewright.tools.trajnet_refiner import kinematic_layer
from scenewright.tools.trajnet_refiner.bundled import load_bundled_refiner

PLACE = "amsterdam_120"
FIRST_SEED = 9_000
"""No other figure is of these requests."""
MEASURES = (("vehicle", "jerk"), ("vehicle", "acceleration"), ("pedestrian", "jerk"))


def run_requests(count: int) -> Iterator[Mapping[str, Any]]:
    """Run requests without a refiner; those that cannot be met are left out."""
    for text, number in list_requests(count):
        try:
            yield synthesize(text, seed=FIRST_SEED + number, refiner="none").state
        except Unsatisfiable:
            continue


def refine_once(state: Mapping[str, Any], seed: int) -> SceneRecord:
    """Refine the scene's tracks once, whatever the checker says of them."""
    context = RunContext(
        load_backend("builtin"), ground_of(PLACE), load_priors(PLACE), seed,
        refiner="trajnet", learned=load_bundled_refiner(PLACE),
    )  # fmt: skip
    made = refine_trajectories(state, runtime=SimpleNamespace(context=context))  # type: ignore[arg-type]
    return record(state, made["refined"])


def record(state: Mapping[str, Any], tracks: Mapping[str, Any]) -> SceneRecord:
    return assemble(
        state["instruction"], state["social_graph"], state["candidates"], state["selection"],
        state["behavior"], tracks, intersection_map=ground_of(PLACE).intersection_map, seed=0,
    )  # fmt: skip


@contextmanager
def disable_layer() -> Iterator[None]:
    """Within, proposals go as they are, but where the prior is kept or one would go back."""
    known = kinematic_layer.limit_deviation

    def skip_layer(
        prior: Any, deviation: Any, *, kept: Any, path: Any, **_: Any
    ) -> tuple[Any, Any]:
        s = np.where(kept, prior, np.maximum.accumulate(prior + deviation))
        return np.clip(s, 0.0, path.length), np.where(kept, 0.0, 1.0)

    kinematic_layer.limit_deviation = skip_layer
    try:
        yield
    finally:
        kinematic_layer.limit_deviation = known


def count_broken(scenes: Sequence[SceneRecord]) -> PlanningShare:
    """How many agents break a limit, of all."""
    intersection_map = ground_of(PLACE).intersection_map
    faults = [check(scene, intersection_map).implausible for scene in scenes]
    found = sum(len({agent for fault in each for agent in fault.agents}) for each in faults)
    return PlanningShare(found, sum(len(scene.agents) for scene in scenes))


def format_share(share: PlanningShare) -> str:
    low, high = share.interval or (0.0, 1.0)
    return f"{share.right} of {share.n} ({share.rate or 0.0:.1%}, {low:.1%} to {high:.1%})"


def list_distances(scenes: Sequence[SceneRecord], known: Sequence[Agents]) -> Iterator[str]:
    clusters = list_scene_agents([convert_scene(scene) for scene in scenes])
    for kind, measure in MEASURES:
        ours, theirs = (
            measure_motion(each, MotionFilter(kind), side=()).samples[measure].values  # type: ignore[arg-type]
            for each in (clusters, known)
        )
        yield f"{compute_wasserstein(ours, theirs):.3f}"


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("count", type=int, nargs="?", default=60)
    words.add_argument("--corpus", type=Path)
    told = words.parse_args()
    known: list[Agents] = []
    if told.corpus:
        hours = load_recordings(told.corpus, split="validation")
        known = list_scene_agents(
            [
                scene
                for _, scene in cut_scenes(
                    hours, intersection_map=ground_of(PLACE).intersection_map
                )
            ]
        )
    found = list(run_requests(told.count))
    sets = {
        "edited": [record(state, state["edited"]) for state in found],
        "refined": [refine_once(state, k) for k, state in enumerate(found)],
    }
    with disable_layer():
        sets["refined without the layer"] = [refine_once(state, k) for k, state in enumerate(found)]
    print("tracks | agents that break a limit |", " | ".join(" ".join(each) for each in MEASURES))
    for name, scenes in sets.items():
        cells = [
            name,
            format_share(count_broken(scenes)),
            *(list_distances(scenes, known) if known else ()),
        ]
        print(" | ".join(cells))


if __name__ == "__main__":
    main()
