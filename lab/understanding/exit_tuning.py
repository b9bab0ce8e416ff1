"""Fit the exit model on scenes of development: `... .exit_tuning DIR... --out exits.npz`.

Only the development half of each folder is read. In the end the share of exits that are right is
printed, of scenes of folds that the trees had not seen, beside that of the posterior alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.understanding.tuning import FOLDS, flatten_trees, save_trees, view_all
from scenewright.evals.understanding.cases import SceneCase, hash_scene, observe
from scenewright.evals.understanding.evaluate import load_cases
from scenewright.evals.understanding.exit_model import NAMES, ExitModel, describe_exits
from scenewright.evals.understanding.intent import infer_routes
from scenewright.evals.understanding.route_components import list_sides
from scenewright.intersections import load_map
from scenewright.scene.base import FloatArray

WINDOWS = (2.0, 4.0)
CHECKED = 4.0
"""Window at which exits of unseen folds are counted [s]."""
_TREES = {
    "max_iter": 160,
    "learning_rate": 0.07,
    "max_leaf_nodes": 20,
    "min_samples_leaf": 60,
    "l2_regularization": 5.0,
    "random_state": 0,
}


@dataclass(frozen=True, eq=False)
class ExitRows:
    """The possible exits of one agent after one window.

    Attributes:
        fold: of the scene; kind: class of the agent; values: [N, F]; right: [N] the true one.
    """

    fold: int
    kind: str
    window: float
    values: FloatArray
    right: NDArray[np.bool_]

    def is_right(self, chances: FloatArray) -> bool:
        """Whether the likeliest exit is the true one."""
        return bool(self.right[int(chances.argmax())])


def view_case(case: SceneCase) -> list[ExitRows]:
    """View all agents of a clip after every window."""
    fold, found = int(hash_scene(case.scene)[:4], 16) % FOLDS, []
    for window in WINDOWS:
        seen = observe(case.record, scene=case.id, window=window)
        sides, posteriors = list_sides(load_map(seen.intersection)), infer_routes(seen)
        for agent in seen.agents:
            possible, values = describe_exits(agent, posteriors[agent.id], sides, window)
            right = np.array(possible) == case.labels.exits[agent.id]
            found.append(ExitRows(fold, agent.type, window, values, right))
    return found


def fit_exit_model(rows: Sequence[ExitRows]) -> ExitModel:
    """Fit the trees to the exits of many agents."""
    from sklearn import ensemble

    make: Any = ensemble.HistGradientBoostingClassifier
    trees = make(**_TREES)
    trees.fit(np.concatenate([each.values for each in rows]),
              np.concatenate([each.right for each in rows]))  # fmt: skip
    return ExitModel(start=np.ravel(trees._baseline_prediction), **flatten_trees(trees))


def count_unseen(rows: Sequence[ExitRows]) -> Iterator[tuple[str, int, float, float]]:
    """Class, number of agents, and shares right of the posterior and of trees of other folds."""
    models = [fit_exit_model([e for e in rows if e.fold != fold]) for fold in range(FOLDS)]
    looked_at = [each for each in rows if each.window == CHECKED]
    known = NAMES.index("log_chance")
    for kind in ("all", *sorted({each.kind for each in looked_at})):
        mine = [each for each in looked_at if kind in ("all", each.kind)]
        before = np.mean([each.is_right(each.values[:, known]) for each in mine])
        after = [each.is_right(models[each.fold].weigh(each.values)) for each in mine]
        yield kind, len(mine), float(before), float(np.mean(after))


def main(argv: Sequence[str] | None = None) -> None:
    """Fit on the folders named and write the model."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args(argv)
    cases = [case for folder in given.folders for case in load_cases(folder, split="dev")]
    rows = list(view_all(view_case, cases, given.workers))
    save_trees(given.out, fit_exit_model(rows), NAMES)
    for kind, count, before, after in count_unseen(rows):
        print(f"{kind}: n {count}, posterior {100 * before:.1f} %, trees {100 * after:.1f} %")


if __name__ == "__main__":
    main()
