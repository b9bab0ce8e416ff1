"""Driving profiles, apart from the path (SEMANTICS 6): density; those in a range asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from operator import attrgetter

import numpy as np

from scenewright.compiled import compiled
from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import (
    AgentCandidates,
    DrawnWaypoints,
    DrivingProfile,
    RoleAssignment,
)
from scenewright.scene.measures import MeasureKind, get_aim
from scenewright.scene.social import SocialGraph
from scenewright.tools.gmm_sampler.priors import (
    PROFILE_FIELDS,
    STANDARD_NORMAL,
    DrivingProfilePrior,
    Priors,
)

_get_values = attrgetter(*PROFILE_FIELDS)


def sample_driving_profiles(
    priors: Priors, route: str, rng: np.random.Generator, *, size: int
) -> list[DrivingProfile]:
    """Draw driving profiles of a route's agents, within the bounds of comfortable motion."""
    prior = _get_prior(priors, route)
    low, high = prior.tails
    quantile = low + (high - low) * rng.uniform(size=(size, len(PROFILE_FIELDS)))
    safe = np.minimum(np.maximum(quantile, 1e-12), 1 - 1e-12)
    normal = [STANDARD_NORMAL.inv_cdf(q) for q in safe.ravel().tolist()]
    drawn = prior.median * np.exp(prior.spread * np.array(normal).reshape(safe.shape))
    drawn = np.minimum(np.maximum(drawn, prior.low), prior.high)
    return [DrivingProfile(*row) for row in drawn.tolist()]


def compute_profile_nll(
    priors: Priors, route: str, profiles: Sequence[DrivingProfile]
) -> FloatArray:
    """[m] -log density of driving profiles [nats]; infinite outside the bounds."""
    prior = _get_prior(priors, route)
    values = np.array([_get_values(profile) for profile in profiles]).reshape(
        -1, len(PROFILE_FIELDS)
    )
    return _score(values, prior.median, prior.spread, prior.low, prior.high, *prior.tails)


@compiled
def _score(
    values: FloatArray,
    median: FloatArray,
    spread: FloatArray,
    low: FloatArray,
    high: FloatArray,
    below: FloatArray,
    up_to: FloatArray,
) -> FloatArray:
    nll = np.zeros(len(values))
    for m in range(len(values)):
        for k in range(len(median)):
            value = values[m, k]
            if not low[k] <= value <= high[k]:
                nll[m] = np.inf
                break
            z = np.log(value / median[k]) / spread[k]
            share = spread[k] * np.sqrt(2 * np.pi) * (up_to[k] - below[k])
            nll[m] += 0.5 * z * z + np.log(value * share)
    return nll


def _get_prior(priors: Priors, route: str) -> DrivingProfilePrior:
    if route not in priors.driving_profiles:
        raise InputError(f"no time law was fitted for route {route!r}")
    return priors.driving_profiles[route]


_FIELDS: dict[MeasureKind, str] = {
    "speed": "speed", "line_speed": "speed", "braking": "braking", "acceleration": "acceleration",
}  # fmt: skip
"""Fields of a driving profile by what is asked for."""

_NARROW = 1.0
"""A range up to this wide is drawn from evenly [m/s, m/s^2]."""

_BRISK, _FIRM = 12.0, (3.0, 3.5)
"""Lateral acceleration in curves [m/s^2] of an agent asked to be faster than this [m/s]."""

_FASTEST = 20.0
"""Of vehicles [m/s]."""

_ALIKE = 0.02
"""Share by which speeds of two that keep a distance may differ."""


_TURNING = 8.0
"""Faster than this [m/s] no vehicle turns."""

_FASTER = 1.5
"""How much faster than it is to strike a vehicle may come [m/s]."""


def count_slow_routes(graph: SocialGraph, assignment: RoleAssignment) -> int:
    """How many agents are to be faster at the light, or at a contact, than their turn allows."""
    wanted = _list_strike_speeds(graph)
    wanted += [
        (measure.agent, measure.low) for measure in graph.measures if measure.kind == "line_speed"
    ]
    routes = assignment.routes
    return sum(
        speed > _TURNING and routes[name].movement in ("left", "right", "uturn")
        for name, speed in wanted
    )


def _list_strike_speeds(graph: SocialGraph) -> list[tuple[str, float]]:
    """The striking agent, and its least speed [m/s]."""
    strike_speeds = [
        (e.from_, e.impact_speed) for e in graph.relations if e.impact_speed is not None
    ]
    asked = [measure for measure in graph.measures if measure.kind == "contact_speed"]
    return strike_speeds + [(each.agent, each.low + 0.5) for each in asked if each.low > 0.0]


def apply_measures(
    agents: dict[str, AgentCandidates], graph: SocialGraph, rng: np.random.Generator
) -> None:
    """Put agents with an asked figure in motion as it wants, in place.

    Their -log densities stay those of what was drawn before.
    """
    measures = graph.measures
    stated = {measure.agent for measure in measures if measure.kind in ("speed", "line_speed")}
    for name, speed in _list_strike_speeds(graph):
        if speed > _TURNING and name not in stated:
            least = min(speed + 0.2, _FASTEST)
            _draw_field(agents, name, "speed", (least, min(least + _FASTER, _FASTEST)), rng)
    for measure in measures:
        field = _FIELDS.get(measure.kind)
        if field is not None:
            low, high = get_aim(measure)
            _draw_field(agents, measure.agent, field, (low, high), rng)
            if field == "speed" and low > _BRISK:
                _draw_field(agents, measure.agent, "lateral", _FIRM, rng)
    for measure in measures:
        if measure.kind in ("headway", "gap") and measure.other is not None:
            # One speed for both: as asked of either, else one that was drawn for the leader.
            pair = (measure.agent, measure.other)
            asked = [each for each in measures if each.kind == "speed" and each.agent in pair]
            aim = get_aim(asked[0]) if asked else None
            speed = sum(aim) / 2 if aim else agents[measure.other].drawn.time_laws[0].speed
            for name in pair:
                bounds = (speed * (1.0 - _ALIKE), speed * (1.0 + _ALIKE))
                _draw_field(agents, name, "speed", bounds, rng)


def _draw_field(
    agents: dict[str, AgentCandidates],
    name: str,
    field: str,
    bounds: tuple[float, float],
    rng: np.random.Generator,
) -> None:
    own = agents[name]
    inside = 0.01 * (bounds[1] - bounds[0])
    low, high = bounds[0] + inside, bounds[1] - inside
    values = rng.uniform(low, high, size=len(own.nll)).tolist()

    def change(profile: DrivingProfile, m: int) -> DrivingProfile:
        usual = getattr(profile, field)
        # What is asked for is to hold all the way, up to the bend.
        profile = replace(profile, pace=(), foresight=0.0)
        if high - low <= _NARROW:
            return replace(profile, **{field: values[m]})
        # Of a wide range, what people do, or what is nearest to it.
        return replace(profile, **{field: min(max(usual, low), high)})

    @cache
    def draw() -> DrawnWaypoints:
        drawn = own.drawn
        laws = tuple(change(law, m) for m, law in enumerate(drawn.time_laws))
        return replace(drawn, time_laws=laws)

    agents[name] = replace(
        own,
        draw=draw,
        build=lambda m: replace(built := own.build(m), time_law=change(built.time_law, m)),
    )
