"""Boosted trees that weigh the exits of an agent, over the posterior of its routes.

The posterior says how well routes fit the track so far. What it does not know of, such as how early
most people slow down before which turn, and how far aside they drive, the trees have learned from
scenes of development (`exit_tuning`). They are shipped as plain arrays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import get_args

import numpy as np
from scipy.special import expit

from scenewright.evals.understanding.boosted_trees import BoostedTrees
from scenewright.evals.understanding.cases import ObservedAgent, ObservedScene
from scenewright.evals.understanding.forecast import BoolArray
from scenewright.evals.understanding.intent import RoutePosterior
from scenewright.evals.understanding.route_components import list_sides
from scenewright.intersections import load_map
from scenewright.scene.base import AgentClass, FloatArray

_SHIPPED = Path(__file__).with_name("exits.npz")
_TURNS = ("straight", "left", "right", "uturn")
_AHEAD = (5, 12, 20)
"""Distances ahead at which the speed that the curves allow is looked up [m]."""
OF_EXIT = ("log_chance", "behind", "share", "best", "aside", "turned", "to_line", "to_end",
           *_TURNS, *(f"bend_{ahead}" for ahead in _AHEAD))  # fmt: skip
"""Log posterior of the exit, and by how much it is below that of the likeliest; log of how often
it is taken among those possible; of its likeliest component the log posterior, how far aside [m]
and how far turned [rad] the agent is of its mean, how far line and end are [m], the movement, and
the speed that its curves allow `_AHEAD` [m/s]."""
OF_AGENT = ("class", "speed", "fastest", "slowest", "gain_5", "gain_8", "gain_20", "stood", "seen",
            "length", "gone", "away", "turned_all", "turned_lately", "surest", "lead", "exits",
            "window")  # fmt: skip
"""Its class; speed now, largest and least [m/s]; acceleration over 0.4, 0.7 and 1.9 s [m/s^2]; for
how long it has been stationary and in view [s]; length [m]; whether it is gone; distance from the
middle [m]; by how much it has turned in all and in half a second [rad]; the posterior of the
likeliest exit, by how much its logarithm leads; how many exits are possible; the window [s]."""
NAMES = (*OF_EXIT, *OF_AGENT)
"""Names of the features; a model is for these."""
_LEAST = 1e-4
"""Posterior below which an exit is impossible."""
_FAR = 99.0
"""Largest distance to a stop line [m], and that where there is none."""


class ExitModel(BoostedTrees):
    """The trees, which have one class."""

    def weigh(self, values: FloatArray) -> FloatArray:
        """[N] probabilities of the exits of one agent, which sum to one."""
        odds = expit(self.score(values)[:, 0])
        return np.asarray(odds / odds.sum())


def describe_exits(
    agent: ObservedAgent, posterior: RoutePosterior, sides: Sequence[str], window: float
) -> tuple[list[str], FloatArray]:
    """Describe the exits that the track so far does not rule out: sides and features [N, F].

    Args:
        sides: of the map; window: length of the observation [s].
    """
    leads_to = posterior.components.match_exits(tuple(sides))[posterior.kept]
    chances = posterior.weights @ leads_to
    possible = np.flatnonzero(chances >= _LEAST)
    log = np.log(chances[possible])
    of_exits = [
        _describe_likeliest_component(posterior, there) for there in leads_to[:, possible].T
    ]
    lead = np.sort(log)[::-1]
    speed, heading = agent.speed, agent.heading
    of_agent = [
        float(get_args(AgentClass).index(agent.type)), float(speed[-1]), float(speed.max()),
        float(speed.min()), *(agent.measure_acceleration(count) for count in (5, 8, 20)),
        agent.standstill, 0.1 * len(speed), agent.length, float(agent.left),
        float(np.hypot(*agent.xy[-1])), float(heading[-1] - heading[0]),
        float(heading[-1] - heading[-min(6, len(heading))]), float(chances.max()),
        float(lead[0] - lead[1]) if len(lead) > 1 else -np.log(_LEAST), float(len(possible)),
        window,
    ]  # fmt: skip
    of_every_exit = np.tile(of_agent, (len(possible), 1))
    values = np.column_stack([log, log - log.max(), np.array(of_exits), of_every_exit])
    return [sides[side] for side in possible.tolist()], values


def _describe_likeliest_component(posterior: RoutePosterior, there: BoolArray) -> list[float]:
    """`share` to the last of `OF_EXIT`, of the exit to which the components `there` [M] lead."""
    likeliest = int(np.where(there, posterior.log_weight, -np.inf).argmax())
    component, components = posterior.kept[likeliest], posterior.components
    s, movement = components.s[component], components.routes[component].movement
    here = s[posterior.nearest[likeliest]]
    taken, all_taken = map(np.logaddexp.reduce, (posterior.log_share[there], posterior.log_share))
    return [
        taken - all_taken, posterior.log_weight[likeliest],
        abs(posterior.residual[likeliest, -3]), abs(posterior.residual[likeliest, -1]),
        min(components.line[component] - here, _FAR), s[-1] - here,
        *(float(movement == turn) for turn in _TURNS),
        *np.interp(here + np.array(_AHEAD), s, components.bend[component, 1]),
    ]  # fmt: skip


def weigh_all_exits(
    observation: ObservedScene, posteriors: Mapping[str, RoutePosterior]
) -> dict[str, FloatArray]:
    """[E] probability of every side of the map, by agent; posteriors are by agent, too."""
    sides, exits = list_sides(load_map(observation.intersection)), {}
    for agent in observation.agents:
        possible, values = describe_exits(agent, posteriors[agent.id], sides, observation.now)
        chances = dict(zip(possible, load_exit_model().weigh(values).tolist(), strict=True))
        exits[agent.id] = np.array([chances.get(side, 0.0) for side in sides])
    return exits


@lru_cache(maxsize=2)
def load_exit_model(file: Path = _SHIPPED) -> ExitModel:
    """Load the model in a file; the shipped one if none is named. Raises as `BoostedTrees.load`."""
    return ExitModel.load(file, names=NAMES, what="exit model")
