"""TrajNet++ by leaving one recording out: `python benchmarks/trajnet.py FOLDER --out RUNS`.

FOLDER holds the benchmark's real training files. For every fold a network is trained on all other
recordings and predicts the one left out; all folds share one recipe. Work that RUNS already holds
is not done again, and a training that was killed goes on, so the command can simply be repeated.
`--report` prints the tables behind docs/evaluation.md from what RUNS holds.

Models: `polished`, the whole recipe of `lab.trajnet.training`; `refiner`, its first part alone, and
ablations of that: `no_pooling`, `no_goals` and `raw` (without keeping apart; needs no training of
its own); `lstm`, a plain one without pooling, goals and keeping apart; `trees`, gradient-boosted, a
rival of another family; `cv`, constant velocity.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from lab.trajnet.training import build_own_recipe, build_polishing_recipe, train_on
from lab.trajnet.windows import BENDING, cut_training_windows
from scenewright.evals.bootstrap import build_figure, compute_mean, resample_ratio
from scenewright.evals.trajnet.predictors import (
    Predictor,
    Refining,
    predict_constant_velocity,
)
from scenewright.evals.trajnet.recording import (
    OBSERVED,
    PREDICTED,
    BenchmarkRecording,
    read_recording,
)
from scenewright.evals.trajnet.score import (
    Goals,
    SceneScore,
    predict_scenes,
    score_scenes,
)
from scenewright.scene.base import FloatArray
from scenewright.tools.trajnet_refiner.config import RefinerConfig
from scenewright.tools.trajnet_refiner.model import Refiner
from scenewright.tools.trajnet_refiner.store import read_refiner, save_refiner
from scenewright.tools.trajnet_refiner.train import Epoch, Recipe, train
from scenewright.tools.trajnet_refiner.windows import Window

FOLDS = (
    "biwi_hotel", "crowds_zara01", "crowds_zara03", "crowds_students003", "lcas", "wildtrack",
    "crowds_students001",
)  # fmt: skip
TRAINED: dict[str, dict[str, Any]] = {
    "refiner": {},
    "lstm": {"pooling": False, "goals": False, "mirrored": False, "apart": None},
    "no_goals": {"goals": False},
    "no_pooling": {"pooling": False},
}
MODELS = ("cv", "refiner", "polished", "raw", "lstm", "trees", "no_goals", "no_pooling")
PUBLISHED = (
    ("LSTM", "0.60", "1.30", "13.6"),
    ("S-LSTM", "0.53", "1.14", "6.7"),
    ("S-Attn", "0.56", "1.21", "9.0"),
    ("S-GAN", "0.64", "1.40", "6.9"),
    ("D-LSTM", "0.56", "1.22", "5.4"),
    ("DAG-Net", "0.66", "1.44", "9.22"),
    ("constant velocity", "0.679", "1.432", "14.5"),
)


class BoostedTrees:
    """One gradient-boosted ensemble per predicted coordinate: neither recurrent nor neural.

    Each agent is predicted for itself, from its own past and the motion of the nearest five, in
    the frame of its own motion; what is learned is the deviation from constant velocity.
    """

    NEIGHBOURS = 5

    def __init__(self, *, seed: int = 0, rounds: int = 100) -> None:
        from sklearn.ensemble import HistGradientBoostingRegressor

        self._trees: list[Any] = [
            HistGradientBoostingRegressor(
                max_iter=rounds, learning_rate=0.08, max_leaf_nodes=24, random_state=seed,
                min_samples_leaf=40, l2_regularization=1.0, early_stopping=False,
            )
            for _ in range(2 * PREDICTED)
        ]  # fmt: skip

    def fit(self, windows: Sequence[Window]) -> BoostedTrees:
        """Learns from all agents of all windows whose next twelve steps are known."""
        features, targets, weights = [], [], []
        for window in windows:
            past, future = window.xy[:, :OBSERVED], window.xy[:, OBSERVED:]
            own, along = self._compute_features(past)
            off = _rotate(future - predict_constant_velocity([past])[0], along, back=True)
            known = np.isfinite(off).all(axis=(1, 2))
            features.append(own[known])
            targets.append(off[known].reshape(-1, 2 * PREDICTED))
            weights.append(window.weight[known])
        x, y, w = (np.concatenate(part) for part in (features, targets, weights))
        for k, tree in enumerate(self._trees):
            tree.fit(x, y[:, k], sample_weight=w)
        return self

    def __call__(
        self,
        pasts: Sequence[FloatArray],
        goals: Sequence[FloatArray] | None = None,
        *,
        due: float | None = None,
        step: float = 0.4,
    ) -> list[FloatArray]:
        """See `Predictor`; goals are not looked at."""
        del goals, due, step
        computed = [self._compute_features(past) for past in pasts]
        x = np.concatenate([features for features, _ in computed])
        off = np.stack([tree.predict(x) for tree in self._trees], axis=1)
        parts = np.split(off.reshape(-1, PREDICTED, 2), np.cumsum([len(p) for p in pasts])[:-1])
        straight = predict_constant_velocity(pasts)
        return [
            base + _rotate(part, along, back=False)
            for base, part, (_, along) in zip(straight, parts, computed, strict=True)
        ]

    def _compute_features(self, past: FloatArray) -> tuple[FloatArray, FloatArray]:
        """[N, D] what is known of each agent, NaN where unknown, and [N, 2] its direction."""
        n, k = len(past), self.NEIGHBOURS
        moves = np.diff(past, axis=1)
        way = np.nan_to_num(np.nansum(moves[:, -4:], axis=1))
        length = np.linalg.norm(way, axis=1, keepdims=True)
        along = np.where(length > 1e-9, way / np.maximum(length, 1e-9), (1.0, 0.0))
        offset = past[None, :, -1] - past[:, None, -1]
        relative = moves[None, :, -1] - moves[:, None, -1]
        distance = np.linalg.norm(offset, axis=-1) + np.where(np.eye(n, dtype=bool), np.inf, 0.0)
        nearest = np.argsort(distance, axis=1, kind="stable")[:, :k]
        row = np.arange(n)[:, None]
        near = np.full((n, k, 5), np.nan)
        near[:, : nearest.shape[1], :2] = _rotate(offset[row, nearest], along, back=True)
        near[:, : nearest.shape[1], 2:4] = _rotate(relative[row, nearest], along, back=True)
        near[:, : nearest.shape[1], 4] = distance[row, nearest]
        near[~np.isfinite(near[..., 4])] = np.nan
        own = _rotate(moves, along, back=True).reshape(n, -1)
        return np.concatenate((own, length, near.reshape(n, -1)), axis=1), along


def _rotate(vectors: FloatArray, along: FloatArray, *, back: bool) -> FloatArray:
    """[N, K, 2] vectors into (back) or out of the frame in which `along` [N, 2] is +x."""
    c, s = along[:, None, 0], (-1 if back else 1) * along[:, None, 1]
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack((c * x - s * y, s * x + c * y), axis=-1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--folds", nargs="+", choices=FOLDS, default=FOLDS)
    parser.add_argument("--models", nargs="+", choices=MODELS, default=MODELS)
    parser.add_argument("--epochs", type=int, default=build_own_recipe().epochs)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--report", action="store_true")
    asked = parser.parse_args()
    if asked.report:
        print(report(asked.out))
        return
    import torch

    torch.set_num_threads(1)
    asked.out.mkdir(parents=True, exist_ok=True)
    recordings = {name: read_recording(asked.folder / f"{name}.ndjson") for name in FOLDS}
    recipe = build_own_recipe(epochs=asked.epochs, seed=asked.seed)
    for model in asked.models:
        for fold in asked.folds:
            run(model, fold, recordings, asked.out, recipe)


def run(
    model: str, fold: str, recordings: dict[str, BenchmarkRecording], out: Path, recipe: Recipe
) -> None:
    predictor: Predictor | None = None
    for goals in list_goals(model):
        target = out / f"{fold}.{model}.{goals}.json"
        if target.exists():
            continue
        if predictor is None:
            predictor = make_predictions(model, fold, recordings, out, recipe)
            if predictor is None:
                return
        began = time.process_time()
        held = recordings[fold]
        scores = score_scenes(held, predict_scenes(held, predictor, goals=goals))
        target.write_text(json.dumps([asdict(score) for score in scores]))
        inter = [s for s in scores if s.type == 3]
        print(
            f"{fold} {model} {goals}: type III n={len(inter)} "
            f"ADE {np.mean([s.ade for s in inter]):.3f} FDE {np.mean([s.fde for s in inter]):.3f} "
            f"Col-I {100 * np.mean([bool(s.col1) for s in inter]):.2f} % "
            f"({time.process_time() - began:.0f} s)",
            flush=True,
        )


def list_goals(model: str) -> tuple[Goals, ...]:
    uses_goals = model in ("refiner", "polished", "raw", "no_pooling")
    return ("none", "destination", "horizon") if uses_goals else ("none",)


def make_predictions(
    model: str, fold: str, recordings: dict[str, BenchmarkRecording], out: Path, recipe: Recipe
) -> Predictor | None:
    others = [each for name, each in recordings.items() if name != fold]
    if model == "cv":
        return predict_constant_velocity
    if model == "trees":
        return BoostedTrees().fit(cut_training_windows(others))
    weights = out / f"{fold}.{'refiner' if model == 'raw' else model}.safetensors"
    first = out / f"{fold}.refiner.safetensors"
    if not weights.exists():
        if model == "raw" or (model == "polished" and not first.exists()):
            print(f"{fold} {model}: train the refiner first", flush=True)
            return None
        log = out / f"{fold}.{model}.epochs.jsonl"
        begin = time.process_time()

        def note(epoch: Epoch) -> None:
            row = {**epoch._asdict(), "cpu_seconds": round(time.process_time() - begin)}
            with log.open("a") as file:
                file.write(json.dumps(row) + "\n")

        if model == "polished":
            polish(first, others, weights, recipe, note)
        else:
            train_on(
                others, out=weights, config=RefinerConfig(**TRAINED[model]), recipe=recipe,
                polish=False, after_epoch=note,
            )  # fmt: skip
    net = Refiner.from_weights(*read_refiner(weights))
    if model == "raw":
        net.config = net.config.model_copy(update={"apart": None})
    return Refining(net)


def polish(
    first: Path,
    others: list[BenchmarkRecording],
    out: Path,
    recipe: Recipe,
    note: Callable[[Epoch], None],
) -> None:
    """The second part of the recipe, from the weights of the first."""
    start, state = (
        Refiner.from_weights(*read_refiner(first)),
        out.with_name(out.name + ".polishing"),
    )
    net = train(
        cut_training_windows(others, weights=BENDING, both_ways=True), config=start.config,
        recipe=build_polishing_recipe(recipe), checkpoint=state, after_epoch=note, start=start,
    )  # fmt: skip
    about = {"trained_on": [each.name for each in others]}
    save_refiner(net.config, net.list_weights(), out, about=about)
    state.unlink(missing_ok=True)


# ---- report -------------------------------------------------------------------------------------


def report(out: Path) -> str:
    scores = {
        tuple(file.name.split(".")[:3]): [
            SceneScore(**{**row, "person": tuple(row["person"]), "subtypes": ()})
            for row in json.loads(file.read_text())
        ]
        for file in sorted(out.glob("*.*.*.json"))
    }
    columns = [(m, g) for m in MODELS for g in list_goals(m)]
    have = {c: [f for f in FOLDS if (f, *c) in scores] for c in columns}
    lines = ["Type III, each fold left out in turn; intervals from drawing people anew.", "",
             "| model | folds | scenes | ADE [m] | FDE [m] | Col-I [%] | Col-II [%] "
             "| ADE / constant velocity |", "|---|---|---|---|---|---|---|---|"]  # fmt: skip
    for column, folds in have.items():
        if folds:
            lines.append(format_pooled(column, folds, scores))
    for name, ade, fde, col in PUBLISHED:
        lines.append(f"| *{name}, published: official test, another split* | | | {ade} | {fde} "
                     f"| {col} | | |")  # fmt: skip
    lines += ["", "| fold | scenes | " + " | ".join("/".join(c) for c in columns if have[c]) + " |",
              "|---|---|" + "---|" * sum(1 for c in columns if have[c])]  # fmt: skip
    for fold in FOLDS:
        if (fold, "cv", "none") in scores:
            lines.append(format_fold(fold, [c for c in columns if have[c]], scores))
    return "\n".join(lines)


def select_interacting(scores: list[SceneScore]) -> list[SceneScore]:
    return [s for s in scores if s.type == 3]


Scores = dict[tuple[str, ...], list[SceneScore]]


def format_pooled(column: tuple[str, str], folds: list[str], scores: Scores) -> str:
    mine = [s for f in folds for s in select_interacting(scores[f, *column])]
    straight = [s for f in folds for s in select_interacting(scores[f, "cv", "none"])]
    people = np.array([str(s.person) for s in mine])
    cells = []
    for measure in ("ade", "fde", "col1", "col2"):
        scale, digits = (100, 1) if measure.startswith("col") else (1, 3)
        x = np.array([scale * float(getattr(s, measure)) for s in mine])
        pattern = f"{{0:.{digits}f}} ({{1:.{digits}f}} to {{2:.{digits}f}})"
        cells.append(compute_mean(x, people, draws=2000).format(pattern))
    ade, base = (np.array([s.ade for s in part]) for part in (mine, straight))
    ratio = build_figure(resample_ratio(ade, base, people, draws=2000), len(mine))
    cells.append(ratio.format("{0:.3f} ({1:.3f} to {2:.3f})"))
    name = column[0] if column[1] == "none" else f"{column[0]}, {column[1]} given"
    return f"| {name} | {len(folds)} | {len(mine)} | " + " | ".join(cells) + " |"


def format_fold(fold: str, columns: list[tuple[str, str]], scores: Scores) -> str:
    cells = []
    for column in columns:
        mine = select_interacting(scores.get((fold, *column), []))
        ade, fde = (np.mean([getattr(s, m) for s in mine]) if mine else 0 for m in ("ade", "fde"))
        hit = 100 * np.mean([bool(s.col1) for s in mine]) if mine else 0
        cells.append(f"{ade:.3f} / {fde:.3f} / {hit:.1f}" if mine else "")
    count = len(select_interacting(scores[fold, "cv", "none"]))
    return f"| {fold} | {count} | " + " | ".join(cells) + " |"


if __name__ == "__main__":
    main()
