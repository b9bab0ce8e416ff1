"""How many background agents a scene has: asked, by a density word, or what p_tod leaves over."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import AgentClass
from scenewright.scene.social import SocialGraph
from scenewright.tools.gmm_sampler.priors import HOURS, Priors
from scenewright.tools.gmm_sampler.sample import compute_total_mass, sample_count

DENSITIES: dict[str, tuple[int, int]] = {"low": (1, 4), "medium": (5, 10), "high": (11, 60)}
"""Background agents by density word (SEMANTICS sections 5 and 8)."""

_VEHICLE_SHARE = (0.55, 0.8)
"""Of the background where the text asks for low or medium traffic."""
_BUSIEST = 2 / 3
"""Above this share of an hour's numbers of agents lie those of high density."""
_REDRAWS = 400
_MAY_LACK = 0.1
"""Share of the numbers drawn for an hour that may find no room."""

Counts = dict[AgentClass, int]


def draw_background_counts(
    graph: SocialGraph,
    priors: Priors,
    *,
    hour: float,
    rng: np.random.Generator,
    max_agents: int | None = None,
) -> Counts:
    """How many background agents of each class a scene of 30 s has at an hour of the day [h].

    Numbers in the text are taken as they are. Low and medium density are ranges; high density is
    the busiest third of p_tod. By default the number of agents in the scene follows p_tod.

    Args:
        max_agents: of the whole scene; what is drawn is thinned to it, vehicles and pedestrians
            alike.

    Raises:
        InputError: agents and numbers named in the text exceed `max_agents`.
    """
    drawn, asked = _draw(graph, priors, int(hour) % HOURS, rng), _get_asked(graph)
    free = {kind: count for kind, count in drawn.items() if kind not in asked}
    if max_agents is not None:
        settled = sum(_count_named(graph).values()) + sum(asked.values())
        if settled > max_agents:
            raise InputError(
                f"the text asks for {settled} agents, more than --max-agents {max_agents}"
            )
        total, most = sum(free.values()), max_agents - settled
        if total > most:  # thinned in about the same proportion
            free = {kind: count * most // total for kind, count in free.items()}
            free[next(iter(free))] += most - sum(free.values())
    return {kind: asked[kind] if kind in asked else free[kind] for kind in drawn}


def find_least_counts(graph: SocialGraph, counts: Counts) -> Counts:
    """How many of those drawn suffice where the rest finds no room: all that words ask for."""
    asked = _get_asked(graph)
    if graph.context.density is not None:
        return counts
    return {
        kind: count if kind in asked else count - round(_MAY_LACK * count)
        for kind, count in counts.items()
    }


def _get_asked(graph: SocialGraph) -> Counts:
    """Numbers of background agents that the text gives, by class."""
    asked = graph.context.background
    if asked is None:
        return {}
    stated: Mapping[AgentClass, int | None]
    stated = {"vehicle": asked.vehicles, "pedestrian": asked.pedestrians}
    return {kind: count for kind, count in stated.items() if count is not None}


def _draw(graph: SocialGraph, priors: Priors, hour: int, rng: np.random.Generator) -> Counts:
    """Numbers as density and hour have them."""
    density = graph.context.density
    vehicles, pedestrians = sample_count(priors, rng, hour=hour)
    if density in ("low", "medium"):
        total = int(rng.integers(DENSITIES[density][0], DENSITIES[density][1] + 1))
        share = (vehicles + 1.0) / (vehicles + pedestrians + 2.0)
        return _split(total, float(np.clip(share, *_VEHICLE_SHARE)))
    named = _count_named(graph)
    if density == "high":
        mass = np.cumsum(compute_total_mass(priors, hour=hour))
        least = int(np.searchsorted(mass, _BUSIEST * mass[-1])) + 1
        for _ in range(_REDRAWS):
            if vehicles + pedestrians >= least:
                break
            vehicles, pedestrians = sample_count(priors, rng, hour=hour)
    found: Counts = {
        "vehicle": max(vehicles - named["vehicle"], 0),
        "pedestrian": max(pedestrians - named["pedestrian"], 0),
    }
    low = DENSITIES["high"][0]
    if density == "high" and sum(found.values()) < low:
        return _split(low, (vehicles + 1.0) / (vehicles + pedestrians + 2.0))
    return found


def _split(total: int, share: float) -> Counts:
    vehicles = min(round(total * share), total)
    return {"vehicle": vehicles, "pedestrian": total - vehicles}


def _count_named(graph: SocialGraph) -> Counts:
    """Agents of the foreground by the classes of p_tod, riders as vehicles, groups whole."""
    walkers = [agent for agent in graph.agents if agent.type == "pedestrian"]
    return {
        "vehicle": len(graph.agents) - len(walkers),
        "pedestrian": sum(walker.members or 1 for walker in walkers),
    }
