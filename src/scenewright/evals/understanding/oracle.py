"""How much can be known at all: predictions of somebody who has seen the plan.

`oracle` knows what the generator drew, the route of everybody seen, but not what it decided: it
reads motion like the reasoner. What it cannot tell, nobody can tell from motion, ways and lights
alone, or only by better measuring. `oracle_seen` knows every event among those seen; what it lacks
is due to agents who are still to come.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from scenewright.evals.understanding.calibration import Calibration, load_calibration
from scenewright.evals.understanding.dataset import Case
from scenewright.evals.understanding.futures import Outlook, outlook
from scenewright.evals.understanding.intent import Fit, fits_of
from scenewright.evals.understanding.observing import (
    Observation,
    ObservationRow,
    agent_codes,
    as_arrays,
)
from scenewright.evals.understanding.predictions import Prediction
from scenewright.evals.understanding.reasoner import relations_of, suspicions

_SHIPPED = Path(__file__).with_name("calibration_oracle.npz")
_ELSEWHERE = -60.0


@lru_cache(maxsize=1)
def oracle_calibration() -> Calibration:
    """The shipped calibration of the oracle, fitted as the reasoner's is."""
    return load_calibration(_SHIPPED)


def routes_of(case: Case) -> dict[str, str]:
    """The route of every agent, by code."""
    codes = agent_codes(case.id, tuple(agent.id for agent in case.record.agents))
    return {codes[agent.id]: agent.route for agent in case.record.agents}


def informed(fit: Fit, route: str) -> Fit:
    """The fit of somebody who knows the route."""
    mine = np.array([each.id == route for each in fit.routes])
    log = np.where(mine, fit.log, fit.log + _ELSEWHERE)
    return replace(fit, log=log - np.logaddexp.reduce(log))


def oracle(row: ObservationRow, case: Case, calibration: Calibration | None = None) -> Prediction:
    """Exits and relations with all routes known."""
    observation, trees = as_arrays(row), calibration or oracle_calibration()
    seen = futures_with_routes(observation, case)
    found = suspicions(seen, window=observation.now, calibration=trees)
    exits = {agent.id: case.labels.exits[agent.id] for agent in observation.agents}
    relations = relations_of(found, window=observation.now, calibration=trees)
    return Prediction(exits, relations)


def futures_with_routes(observation: Observation, case: Case) -> Outlook:
    """Sampled futures along the true routes."""
    routes = routes_of(case)
    fits = {agent: informed(fit, routes[agent]) for agent, fit in fits_of(observation).items()}
    return outlook(observation, known=fits)


def oracle_seen(row: ObservationRow, case: Case) -> Prediction:
    """Everything that happens among those seen."""
    ids = {agent.id for agent in row.agents}
    relations = tuple({
        r.key: r for r in case.labels.relations if {r.from_, r.to} <= ids
    }.values())  # fmt: skip
    return Prediction({agent: case.labels.exits[agent] for agent in ids}, relations)
