"""Agents that leave their path because of a threat: aside and back, or a step back."""

import numpy as np
import pytest

from scenewright.geometry.spline import sample_poses
from scenewright.graph.run import synthesize
from scenewright.scene.frozen_agents import without_edits
from scenewright.scene.selection import SelectedAgent
from scenewright.tools.solver.reactions import step_back, swerve
from solver_agents import EAST, SOUTH, actor, candidate, law, straight, walker

DRIVER = actor(candidate(straight((-80.0, 0.0), EAST, 160.0), time_law=law(10.0)))
ON_FOOT = actor(walker(straight((5.0, 12.0), SOUTH, 24.0)))


def test_who_swerves_is_aside_where_the_other_is_and_comes_back() -> None:
    moved = swerve(DRIVER, onset=4.0, there=60.0, aside=0.4)

    assert moved is not None
    x, y = moved.candidate.path.xy.T
    assert np.interp([-45.0, -20.0, -18.0, 20.0], x, y) == pytest.approx([0, 0.4, 0.4, 0], abs=0.02)
    assert np.abs(moved.candidate.path.curvature).max() * 10.0**2 < 2.5
    assert swerve(DRIVER, onset=5.5, there=60.0, aside=0.4) is None


def test_who_steps_back_turns_round_rests_and_goes_on_facing_ahead() -> None:
    moved = step_back(ON_FOOT, at=10.0, back=0.6, braking=2.0, speed=0.9, rests=1.0)

    assert moved is not None
    poses = sample_poses(moved.candidate.path, moved.motion.s)
    y = poses[:, 1]
    turn = int(np.argmin(np.where(np.arange(len(y)) < np.argmax(np.diff(y) > 0.02) + 8, y, 99.0)))
    assert y[turn] == pytest.approx(2.0, abs=0.05)
    assert y[turn : turn + 20].max() == pytest.approx(2.6, abs=0.1)
    assert y[-1] == pytest.approx(ON_FOOT.candidate.path.xy[-1, 1], abs=0.2)
    assert np.diff(moved.motion.s).min() >= 0.0
    assert np.ptp(poses[:, 2]) < 0.01
    assert np.abs(np.gradient(moved.motion.speed, 0.1)).max() < 3.0


def test_an_agent_without_its_edits_is_on_the_path_that_it_had() -> None:
    moved = step_back(ON_FOOT, at=10.0, back=0.6, braking=2.0, speed=0.9, rests=1.0)
    assert moved is not None
    chosen = SelectedAgent(
        "pedestrian-1", "foreground", moved.candidate, 0, 0.0, slowings=moved.slowings
    )

    alone = without_edits(chosen)

    assert alone.candidate.path is ON_FOOT.candidate.path
    assert not alone.slowings


@pytest.mark.parametrize(("text", "way"), [
    ("A car narrowly misses a pedestrian, who jumps back", "jumps_back"),
    ("A van hits a pedestrian who steps back too late", "steps_back"),
    ("A car swerves within its lane to avoid a pedestrian", "swerves"),
    ("A cyclist swerves and is hit by a car", "swerves"),
    ("A car nearly hits a pedestrian, who runs out of the way", "runs"),
])  # fmt: skip
def test_a_reaction_that_the_words_ask_for_is_proven(text: str, way: str) -> None:
    made = synthesize(f"{text}. Nobody else is around.", seed=1, refiner="none")

    said = next(each for each in made.record.said if each.became == "reaction")
    assert said.value == way
    assert way in [row.get("how") for row in made.proof.figures["reactions"]]
