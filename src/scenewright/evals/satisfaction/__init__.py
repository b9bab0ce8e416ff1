"""Instruction satisfaction, judged from tracks: the events asked for, their agents, and nothing
else.

The instructions are those of `evals.planning`, written by people who had seen no planner. A
submission may come from any program: scenes of scenewright, or tracks in any format that `verify`
reads. `seen` recognises the agents in tracks, `judge` compares with the label, `report` counts.
"""

from scenewright.evals.satisfaction.judge import (
    Submission,
    Verdict,
    count_verdicts,
    judge,
    to_json,
    to_markdown,
)
from scenewright.evals.satisfaction.seen import read_submission

__all__ = [
    "Submission",
    "Verdict",
    "count_verdicts",
    "judge",
    "read_submission",
    "to_json",
    "to_markdown",
]
