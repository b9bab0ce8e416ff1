"""Exact selection against its rivals: `python benchmarks/selection.py` (`--quick` for a minute).

Parties of twelve (eight vehicles, four pedestrians) on routes, candidates and time laws drawn from
the shipped bundle's priors, without lights, so that crossing traffic must be kept apart in time:

    free     M = 64, every agent may enter at any moment of the scene
    pinned   M = 32, within 2 s of the arrival drawn for each
    tight    the same, within 1 s: where the solver reaches its bounds
    coarse   M = 16, pinned, entry times on a grid of 0.5 s: against toulbar2 (extra `bench`)
    tables   M = 8 and 16, pinned: against CP-SAT over all pairs of options, up front
    small    four agents, M = 4, three entry times: against brute force

and whole requests with `--selection map`. CPU seconds of one thread; `greedy` takes the agents by
how likely their best is, and gives each its cheapest candidate that has room.
"""

from __future__ import annotations

import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from pipeline import CROWD, REQUESTS

from scenewright.errors import Unsatisfiable
from scenewright.geometry.landmarks import find_landmarks
from scenewright.graph.run import ground_of, synthesize
from scenewright.scene.base import AgentClass
from scenewright.scene.candidates import AgentCandidates
from scenewright.scene.grounding import RoleAssignment
from scenewright.scene.social import Background, SceneContext, SocialGraph
from scenewright.scene.track import STEP
from scenewright.tools.gmm_sampler import load_priors
from scenewright.tools.gmm_sampler.generate import amplify
from scenewright.tools.solver.assignment import assign_min_cost
from scenewright.tools.solver.background_assignment import Assignment, ConflictTable, Option
from scenewright.tools.solver.offers import AgentOffers, CandidateOffer
from scenewright.tools.solver.reservation import ReservationTable, find_blocked_offsets
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

PLACE = "amsterdam_120"
SECONDS, SEEN = 30.0, 4.0
SAME = 1e-3
"""Costs so near one another are equal [nats]."""

NO_LIMIT = 600.0
"""Seconds that a rival may take."""


@dataclass(frozen=True, eq=False)
class Party:
    """The background agents, and how many of each class are needed."""

    agents: tuple[AgentOffers, ...]
    wanted: dict[AgentClass, int]

    def build_all(self) -> Party:
        """The same, every candidate built."""
        for agent in self.agents:
            for option in list_options(agent):
                assert option.actor is not None
        return self


def list_options(agent: AgentOffers) -> list[Option]:
    return [option for offer in agent.offers for option in offer.options]


def draw_party(
    seed: int,
    *,
    size: int,
    pinned: float | None = None,
    grid: int = 1,
    vehicles: int = 8,
    pedestrians: int = 4,
) -> Party:
    """A party drawn from the bundle; `grid` thins the entry times [steps]."""
    rng = np.random.default_rng(seed)
    background = Background(vehicles=vehicles, pedestrians=pedestrians)
    pool = amplify(
        SocialGraph(agents=(), context=SceneContext(background=background)),
        RoleAssignment(routes={}, patterns=()),
        load_priors(PLACE),
        intersection_map=ground_of(PLACE).intersection_map,
        hour=float(rng.integers(7, 20)),
        size=size,
        rng=rng,
    )
    agents = tuple(
        AgentOffers(draws.name, draws.route.type, False, tuple(list_offers(draws, pinned, grid)))
        for draws in pool.agents.values()
        if not draws.reserve
    )
    return Party(agents, dict(pool.background))


def list_offers(
    draws: AgentCandidates, pinned: float | None, grid: int
) -> Iterator[CandidateOffer]:
    cost = draws.nll + draws.time_nll
    for m in np.argsort(cost).tolist():
        yield CandidateOffer(
            float(cost[m]), partial(list_ways, draws, m, float(cost[m]), pinned, grid)
        )


def list_ways(
    draws: AgentCandidates, m: int, cost: float, pinned: float | None, grid: int
) -> tuple[Option, ...]:
    """One candidate, free to come at any moment at which it is seen for four seconds."""
    map_areas, drawn = ground_of(PLACE), draws.build(m)
    candidate = replace(drawn, path=map_areas.trim(drawn.path))
    actor = ScheduledAgent.build_unplaced(candidate, find_landmarks(candidate, map_areas=map_areas))
    steps = len(actor.motion.s)
    first, last = round(SEEN / STEP) - steps, round((SECONDS - SEEN) / STEP)
    drawn_time = int(np.clip(round((draws.arrival or 0.0) / STEP - steps / 2), first, last))
    starts = np.arange(first, last + 1, dtype=np.int64)
    if pinned is not None:
        starts = starts[np.abs(starts - drawn_time) <= pinned / STEP]
    return (Option(lambda: actor, m, starts[(starts - drawn_time) % grid == 0], cost, drawn_time),)


def compute_cost(chosen: Sequence[tuple[AgentOffers, float]]) -> float:
    """Compute the cost above the cheapest options [nats]."""
    return sum(cost - agent.offers[0].cost for agent, cost in chosen)


def assign_exactly(of: Party) -> tuple[float | None, Assignment | str]:
    assignment = assign_min_cost(of.agents, ConflictTable([]), of.wanted)
    if isinstance(assignment, str):
        return None, assignment
    return compute_cost([(g, assignment.chosen[g.name][0].cost) for g in of.agents]), assignment


def assign_greedily(of: Party) -> float | None:
    """Each in turn its cheapest candidate with room, at the moment nearest to its wish."""
    present, chosen = ReservationTable(), []
    for agent in sorted(of.agents, key=lambda each: each.offers[0].cost):
        for option in list_options(agent):
            free = present.find_free_times(option.actor, option.starts, foreground=False)
            if len(free):
                start = free[np.argmin(np.abs(free - option.drawn_time))]
                present.add(option.actor.shift(STEP * int(start)), foreground=False)
                chosen.append((agent, option.cost))
                break
    return compute_cost(chosen) if len(chosen) == len(of.agents) else None


def list_pairs(of: Party) -> Iterator[tuple[tuple[int, int, int, int], list[tuple[int, int]]]]:
    """List what every two options of two agents forbid of start_i - start_j [steps]."""
    every = [list_options(agent) for agent in of.agents]
    for i in range(len(every)):
        for j in range(i):
            for (k, a), (m, b) in product(enumerate(every[i]), enumerate(every[j])):
                yield (i, k, j, m), find_blocked_offsets(b.actor, a.actor, strict=False)


def assign_with_full_tables(of: Party) -> float | None:
    """CP-SAT over all pairs of options, computed up front."""
    from ortools.sat.python import cp_model

    model, every = cp_model.CpModel(), [list_options(agent) for agent in of.agents]
    takes = [[model.new_bool_var("") for _ in own] for own in every]
    starts = [
        model.new_int_var_from_domain(
            cp_model.Domain.from_values(
                np.unique(np.concatenate([o.starts for o in own])).tolist()
            ),
            "",
        )
        for own in every
    ]
    for own, take, start in zip(every, takes, starts, strict=True):
        model.add_exactly_one(take)
        for option, literal in zip(own, take, strict=True):
            domain = cp_model.Domain.from_values(option.starts.tolist())
            model.add_linear_expression_in_domain(start, domain).only_enforce_if(literal)
    for (i, k, j, m), forbidden in list_pairs(of):
        for low, high in forbidden:
            below, above = model.new_bool_var(""), model.new_bool_var("")
            model.add(starts[i] - starts[j] <= low).only_enforce_if(below)
            model.add(starts[i] - starts[j] >= high).only_enforce_if(above)
            model.add_bool_or([~takes[i][k], ~takes[j][m], below, above])
    model.minimize(
        sum(
            round(1e5 * compute_cost([(agent, option.cost)])) * literal
            for agent, own, take in zip(of.agents, every, takes, strict=True)
            for option, literal in zip(own, take, strict=True)
        )
    )
    solver = cp_model.CpSolver()
    solver.parameters.num_workers, solver.parameters.max_time_in_seconds = 1, NO_LIMIT
    status = solver.solve(model)
    assert status in (cp_model.OPTIMAL, cp_model.INFEASIBLE), solver.status_name(status)
    return 1e-5 * solver.objective_value if status == cp_model.OPTIMAL else None


def list_values(of: Party) -> list[list[tuple[int, int]]]:
    """List, per agent, every option with every entry time."""
    return [
        [(k, int(start)) for k, option in enumerate(list_options(agent)) for start in option.starts]
        for agent in of.agents
    ]


def compute_compatible(of: Party) -> dict[tuple[int, int], Any]:
    """Compute [V, W] per two agents: which of their values may go together."""
    every = [np.array(each) for each in list_values(of)]
    fits = {
        (i, j): np.ones((len(every[i]), len(every[j])), dtype=bool)
        for i in range(len(every))
        for j in range(i)
    }
    for (i, k, j, m), forbidden in list_pairs(of):
        rows, columns = (np.flatnonzero(every[g][:, 0] == o) for g, o in ((i, k), (j, m)))
        apart_by = every[i][rows, 1][:, None] - every[j][columns, 1]
        for low, high in forbidden:
            fits[i, j][np.ix_(rows, columns)] &= (apart_by <= low) | (apart_by >= high)
    return fits


def assign_by_toulbar2(of: Party) -> float | None:
    """A weighted constraint network over (candidate, entry time), full tables up front."""
    import pytoulbar2

    top = 1e6
    network = pytoulbar2.CFN(top, 5, verbose=-1)
    for g, (agent, own) in enumerate(zip(of.agents, list_values(of), strict=True)):
        network.AddVariable(str(g), [f"v{n}" for n in range(len(own))])
        ranked = list_options(agent)
        network.AddFunction([g], [compute_cost([(agent, ranked[k].cost)]) for k, _ in own])
    for (i, j), fits in compute_compatible(of).items():
        if not fits.all():
            network.AddFunction([i, j], np.where(fits, 0.0, top).ravel().tolist())
    solved = network.Solve()
    return None if solved is None else float(solved[1])


def assign_by_brute_force(of: Party) -> float | None:
    own, fits, best = list_values(of), compute_compatible(of), None
    costs = [
        [compute_cost([(agent, list_options(agent)[k].cost)]) for k, _ in each]
        for agent, each in zip(of.agents, own, strict=True)
    ]
    for choice in product(*(range(len(each)) for each in own)):
        cost = sum(costs[g][v] for g, v in enumerate(choice))
        if best is not None and cost >= best:
            continue
        if all(fits[i, j][choice[i], choice[j]] for i, j in fits):
            best = cost
    return best


@dataclass
class Tally:
    """Results of one method of assignment over all parties of a kind."""

    seconds: list[float]
    costs: list[float | None]

    @classmethod
    def run_all(cls, way: Callable[[Party], float | None], parties: Sequence[Party]) -> Tally:
        tally = cls([], [])
        for each in parties:
            start = time.process_time()
            tally.costs.append(way(each))
            tally.seconds.append(time.process_time() - start)
        return tally

    def line(self, name: str, best: Tally) -> str:
        both = list(zip(self.costs, best.costs, strict=True))
        equal = sum(is_same(one, other) for one, other in both)
        above = [one - other for one, other in both if one is not None and other is not None]
        worse = f", mean {statistics.fmean(above):.2f} nats above" if above else ""
        none = sum(cost is None for cost in self.costs)
        return (
            f"  {name:<12} median {statistics.median(self.seconds):8.4f} s   "
            f"p90 {np.quantile(self.seconds, 0.9):8.4f} s   least cost in {equal} of {len(both)}"
            f"{worse if equal < len(both) else ''}, no seating in {none}"
        )


def is_same(one: float | None, other: float | None) -> bool:
    if one is None or other is None:
        return one is other
    return abs(one - other) <= SAME


def compare(
    name: str, draw: Callable[[int], Party], n: int, rivals: Mapping[str, Callable[[Party], Any]]
) -> None:
    """Assign n parties exactly and by every rival, and print the results."""
    seatings: list[Assignment | str] = []

    def assign_by_ours(of: Party) -> float | None:
        cost, assignment = assign_exactly(of)
        seatings.append(assignment)
        return cost

    parties = [draw(seed).build_all() for seed in range(n)]
    best = Tally.run_all(assign_by_ours, parties)
    found = [each for each in seatings if isinstance(each, Assignment)]
    why = [each for each in seatings if isinstance(each, str)]
    on_demand = Tally.run_all(lambda of: assign_exactly(of)[0], [draw(seed) for seed in range(n)])
    print(f"{name}, n = {n}")
    print(best.line("exact", best))
    print(on_demand.line("  + building", best))
    if found:
        print(
            f"    proved optimal {sum(each.optimal for each in found)} of {n}, at once "
            f"{sum(not each.rounds for each in found)}; median rounds "
            f"{statistics.median(each.rounds for each in found):g}, pairs compared "
            f"{statistics.median(each.pairs for each in found):g} (most "
            f"{max(each.pairs for each in found)})"
        )
    if why:
        given_up = sum(each.endswith("within the bounds of the search") for each in why)
        print(f"    proved impossible {len(why) - given_up}, given up {given_up}")
    for rival, way in rivals.items():
        print(Tally.run_all(way, parties).line(rival, best), flush=True)


def time_requests(seeds: int) -> None:
    """Whole requests with ten agents, least cost, warm; seconds from text to proof."""
    seconds, tried, proved, gaps = [], 0, 0, []
    synthesize(f"{REQUESTS[0]} {CROWD}", seed=99, selection="map", refiner="none")
    for request, seed in product(REQUESTS, range(seeds)):
        tried, start = tried + 1, time.process_time()
        try:
            scene = synthesize(f"{request} {CROWD}", seed=seed, selection="map", refiner="none")
        except Unsatisfiable:
            continue
        seconds.append(time.process_time() - start)
        selection = scene.state["selection"]
        proved += selection.optimal
        gaps += [] if selection.optimal else [selection.figures["gap"]]
    print(f"requests with --selection map, n = {tried}, not satisfied: {tried - len(seconds)}")
    print(
        f"  median {statistics.median(seconds):.3f} s   p90 {np.quantile(seconds, 0.9):.3f} s   "
        f"proved optimal {proved}; else at most "
        f"{statistics.median(gaps) if gaps else 0.0:.2f} nats above (median)"
    )


def find_toulbar2() -> dict[str, Callable[[Party], Any]]:
    try:
        import pytoulbar2  # noqa: F401
    except ImportError:
        print("toulbar2 is not here, its comparison is left out: pip install 'scenewright[bench]'")
        return {}
    return {"toulbar2": assign_by_toulbar2}


def main(*, quick: bool) -> None:
    done = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
    )
    print(
        f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, "
        f"commit {done.stdout.strip() or 'unknown'}, CPU seconds"
    )
    assign_exactly(draw_party(99, size=8, pinned=2.0))  # loads the solver
    many, some, few = (6, 2, 2) if quick else (40, 12, 4)
    compare("free: 12 x 64", partial(draw_party, size=64), many, {"greedy": assign_greedily})
    pinned = partial(draw_party, pinned=2.0)
    compare("pinned: 12 x 32", partial(pinned, size=32), many, {"greedy": assign_greedily})
    tight = partial(draw_party, size=32, pinned=1.0)
    compare("tight: 12 x 32, within 1 s", tight, some, {"greedy": assign_greedily})
    coarse = partial(pinned, size=16, grid=5)
    compare("coarse: 12 x 16, every 0.5 s", coarse, few, find_toulbar2())
    tables = {"full tables": assign_with_full_tables}
    compare("tables: 12 x 8", partial(pinned, size=8), some, tables)
    if not quick:
        compare("tables: 12 x 16", partial(pinned, size=16), few, tables)
    small = partial(draw_party, size=4, pinned=1.0, grid=10, vehicles=3, pedestrians=1)
    compare("small: 4 x 4", small, some, {"brute force": assign_by_brute_force})
    time_requests(1 if quick else 6)


if __name__ == "__main__":
    main(quick="--quick" in sys.argv[1:])
