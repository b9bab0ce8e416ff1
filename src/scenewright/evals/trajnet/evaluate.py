"""The benchmark over several recordings: predictors, their inputs and their errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenewright.evals.trajnet.predictors import Predictor, Refining, predict_constant_velocity
from scenewright.evals.trajnet.recording import BenchmarkRecording
from scenewright.evals.trajnet.score import (
    Goals,
    PredictedScene,
    ScoreRow,
    build_table,
    predict_scenes,
    score_scenes,
)

KINDS_OF_GOALS: tuple[Goals, ...] = ("none", "destination", "horizon")


@dataclass(frozen=True, eq=False)
class Evaluated:
    """One predictor over all recordings.

    Attributes:
        predictor: its name; goals: those it was given.
        predicted: of each recording its scenes, in order.
        rows: the scores; empty where no file holds what really happened.
    """

    predictor: str
    goals: Goals
    predicted: list[list[PredictedScene]]
    rows: list[ScoreRow]

    def to_json(self) -> dict[str, Any]:
        """For a report, without the predictions."""
        rows = [row.to_json() for row in self.rows]
        return {"predictor": self.predictor, "goals": self.goals, "rows": rows}


def evaluate(
    recordings: Sequence[BenchmarkRecording],
    *,
    weights: Path | None,
    log: Callable[[str], None] = lambda _: None,
) -> list[Evaluated]:
    """Constant velocity, then the refiner without and with goals, over all scenes together.

    Goals come from the future, so a file that does not hold it is predicted without.

    Args:
        weights: of the refiner; None leaves it out.

    Raises:
        InputError: the weights cannot be used, or a scene has no primary.
    """

    def run(predictor: Predictor, name: str, goals: Goals) -> Evaluated:
        predicted, scores = [], []
        for recording in recordings:
            with_goals = "" if goals == "none" else f", given the {goals}"
            log(f"{recording.name}: {name}{with_goals}")
            predicted.append(predict_scenes(recording, predictor, goals=goals))
            scores += score_scenes(recording, predicted[-1])
        return Evaluated(name, goals, predicted, build_table(scores))

    straight = run(predict_constant_velocity, "constant velocity", "none")
    if weights is None:
        return [straight]
    from scenewright.tools.trajnet_refiner.model import Refiner
    from scenewright.tools.trajnet_refiner.store import read_refiner

    net = Refiner.from_weights(*read_refiner(weights, task="benchmark"))
    kinds = KINDS_OF_GOALS if net.config.goals and straight.rows else KINDS_OF_GOALS[:1]
    return [straight, *(run(Refining(net), "refiner", goals) for goals in kinds)]
