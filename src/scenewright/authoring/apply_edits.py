"""Applies edits to an earlier version: the new graph, and the agents that they concern."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from scenewright.errors import Rejected
from scenewright.geometry.driving_profile import StopCommand, compute_arrival
from scenewright.scene.base import AgentClass
from scenewright.scene.candidates import Grounding
from scenewright.scene.edits import (
    AddAgent,
    AddObject,
    ChangeAgent,
    ChangeContext,
    ComeLater,
    Edit,
    MoveStop,
    Redraw,
    Relate,
    RemoveAgent,
    RemoveObject,
    SetBackground,
    SetMeasure,
    SetPace,
    Unrelate,
    WaitLonger,
    apply_edits,
)
from scenewright.scene.frozen_agents import PreviousVersion
from scenewright.scene.map import IntersectionMap
from scenewright.scene.rejection import Rejection
from scenewright.scene.selection import SelectedAgent, Stop
from scenewright.scene.social import SocialGraph
from scenewright.tools.gmm_sampler.frozen_agents import scale_speed
from scenewright.tools.map_grounding.grounding import ground_graph

_LEAST_STAND = 1.6
"""A standstill lasts at least so long [s], its smoothed ends included."""


def move_stop(agent: SelectedAgent, metres: float) -> SelectedAgent:
    """The agent standing that much further along its path; Rejected if it stands nowhere."""
    stop = _find_stop(agent)
    s = stop.s + metres
    if not 2.0 < s < agent.candidate.path.length - 1.0:
        raise build_rejection(agent.name, f"has no room to stop {metres:+g} m from where it does")
    stands = _compute_standing_time(agent, stop, StopCommand(s, 0.0, stop.braking))
    ahead = None if stop.ahead is None else stop.ahead - metres
    moved = replace(
        stop,
        anchor="yield_point",
        s=s,
        start=stands,
        until=max(stop.until, stands + _LEAST_STAND),
        ahead=ahead,
    )
    return _replace_stop(agent, stop, moved)


def extend_stop(agent: SelectedAgent, seconds: float) -> SelectedAgent:
    """The agent standing that much longer; Rejected if it stands nowhere or would not stand.

    An agent that slows down without standing stands that long where it was slowest.
    """
    rolling = _find_slowest(agent)
    if rolling is not None and seconds > 0.0:
        stands = _compute_standing_time(agent, rolling, StopCommand(rolling.s, 0.0))
        until = stands + max(seconds, _LEAST_STAND)
        return _replace_stop(agent, rolling, replace(rolling, start=stands, until=until, speed=0.0))
    stop = _find_stop(agent)
    until = stop.until + seconds
    if until < stop.start + _LEAST_STAND:
        raise build_rejection(
            agent.name, f"stands for {stop.until - stop.start:.1f} s, which leaves nothing"
        )
    return _replace_stop(agent, stop, replace(stop, until=until))


def move_time(agent: SelectedAgent, seconds: float) -> SelectedAgent:
    """The agent doing the same that much later, to the step.

    The light's times stay: an agent that came from a red light then comes on green.
    """
    seconds = round(seconds, 1)
    if agent.role == "foreground" and any(stop.at_red for stop in agent.stops):
        # Without its wait at red, as late as before where it gives way, or at its line.
        free = tuple(stop for stop in agent.stops if not stop.at_red)
        last = free[0] if free else agent.stops[-1]
        reaches = compute_arrival(agent.candidate, StopCommand(last.s, 0.0, last.braking))
        at = last.start if free else last.until
        return move_time(replace(agent, enters=round(at - reaches, 1), stops=free), seconds)
    stops = tuple(
        replace(stop, start=stop.start + seconds, until=stop.until + seconds)
        for stop in agent.stops
    )
    contact = None if agent.contact is None else agent.contact + seconds
    push = None if agent.push is None else agent.push.shift(seconds)
    enters = round(agent.enters + seconds, 1)
    return replace(agent, enters=enters, stops=stops, contact=contact, push=push)


def _find_stop(agent: SelectedAgent) -> Stop:
    """Where it gives way; else, of the others, where they stand at all."""
    stops = [stand for stand in agent.stands if stand.reason == "gives_way"] or agent.stands
    rolling = _find_slowest(agent)
    if rolling is not None:
        where = "" if rolling.ahead is None else f", {rolling.ahead:.1f} m before the other's way"
        raise build_rejection(
            agent.name,
            f"gives way without standing: it slows to {rolling.speed:.1f} m/s{where}; say 'make it "
            "stop' first, and then where or how long",
        )
    if not stops:
        but = " but at its light" if agent.stops else ""
        raise build_rejection(
            agent.name, f"gives way to no agent and stands nowhere in this scene{but}"
        )
    return stops[0]


def _find_slowest(agent: SelectedAgent) -> Stop | None:
    """The slowest place of an agent that gives way without standing; None for all other agents."""
    yields = [stop for stop in agent.stops if stop.reason == "gives_way"]
    return yields[0] if yields and all(each.rolls for each in yields) else None


def _compute_standing_time(agent: SelectedAgent, earlier: Stop, command: StopCommand) -> float:
    """When the agent comes to stand by a command in place of an earlier stop [s]."""
    others = tuple(
        StopCommand(stop.s, stop.until - agent.enters, stop.braking)
        for stop in agent.stops
        if stop is not earlier
    )
    return compute_arrival(agent.candidate, command, others) + agent.enters


def _replace_stop(agent: SelectedAgent, earlier: Stop, later: Stop) -> SelectedAgent:
    """The agent with a stop in place of an earlier one."""
    stops = (*(stop for stop in agent.stops if stop is not earlier), later)
    return replace(agent, stops=tuple(sorted(stops, key=lambda stop: stop.s)))


def build_rejection(name: str, what: str) -> Rejected:
    """The rejection of a change by hand that cannot be."""
    return Rejected(
        Rejection(
            stage="scene_planner", code="contradictory", agents=(name,), detail=f"{name} {what}"
        )
    )


@dataclass(frozen=True, eq=False)
class Revision:
    """What edits make of an earlier version.

    Attributes:
        graph: the social graph now; before: as it was.
        named: the agents that the edits speak of; touched: those that must be solved anew.
        amended: those changed by hand, as they shall be.
        other: the second agents of relations that changed: if the first cannot serve, these may.
        pace: share of the free speed, by name.
        by_hand: those of the amended whose stop or time was given, and stays as given.
        redrawn: agents that are to take another path; anew: all agents are.
        background: how many of each class; None: drawn anew, as another hour or density has them.
    """

    earlier: PreviousVersion
    before: SocialGraph
    graph: SocialGraph
    grounding: Grounding
    background: Mapping[AgentClass, int] | None
    hour: float
    named: frozenset[str]
    touched: frozenset[str]
    amended: Mapping[str, SelectedAgent] = field(default_factory=dict)
    other: frozenset[str] = frozenset()
    pace: Mapping[str, float] = field(default_factory=dict)
    by_hand: frozenset[str] = frozenset()
    redrawn: frozenset[str] = frozenset()
    anew: bool = False

    @property
    def present(self) -> dict[str, SelectedAgent]:
        """Earlier agents that are still there, as they were or as amended."""
        foreground = {agent.id for agent in self.graph.agents}
        once = {agent.id for agent in self.before.agents}
        room = {"vehicle": 0, "pedestrian": 0} if self.background is None else {**self.background}
        found: dict[str, SelectedAgent] = {}
        for name, each in self.earlier.agents.items():
            if name in foreground:
                found[name] = self.amended.get(name, each.agent)
            elif name not in once and name not in self.named - self.amended.keys():
                kind = each.agent.candidate.route.type
                room[kind] -= 1
                if room[kind] >= 0:
                    found[name] = self.amended.get(name, each.agent)
        return found


def build_revision(
    earlier: PreviousVersion,
    before: SocialGraph,
    edits: tuple[Edit, ...],
    *,
    intersection_map: IntersectionMap,
    pace: Mapping[str, float],
) -> Revision:
    """What the edits make of a version.

    Raises:
        Rejected: an edit cannot be, or the map cannot serve the graph.
    """
    graph = apply_edits(before, edits)
    grounding = ground_graph(graph, intersection_map=intersection_map)
    amended, paces = _amend_agents(earlier, edits, pace)
    hour = _choose_hour(earlier, edits)
    redraws = hour != earlier.hour or graph.context.density != before.context.density
    touched, other = _find_touched(before, graph, edits)
    return Revision(
        earlier=earlier,
        before=before,
        graph=graph,
        grounding=grounding,
        background=None if redraws else _count_background(earlier, before, edits),
        hour=hour,
        named=frozenset(list_concerned(edits)),
        touched=touched,
        amended=amended,
        other=other,
        pace=paces,
        by_hand=frozenset(
            edit.agent for edit in edits if isinstance(edit, MoveStop | WaitLonger | ComeLater)
        ),
        redrawn=frozenset(e.agent for e in edits if isinstance(e, Redraw) and e.agent is not None),
        anew=any(isinstance(edit, Redraw) and edit.agent is None for edit in edits),
    )


def _find_touched(
    before: SocialGraph, graph: SocialGraph, edits: tuple[Edit, ...]
) -> tuple[frozenset[str], frozenset[str]]:
    """Agents that must be solved anew, and the other ends of relations that changed."""
    touched, other = set(), set()
    for edit in edits:
        match edit:
            case ChangeAgent(node=node) | AddAgent(node=node):
                touched.add(node.id)
            case Relate(edge=edge):
                touched.add(edge.from_)
                other.add(edge.to)
            case SetPace(agent=name) | Redraw(agent=str(name)):
                touched.add(name)
            case SetMeasure(measure=measure):
                touched.add(measure.agent)
                other |= set() if measure.other is None else {measure.other}
            case ComeLater(agent=name):
                touched |= {e.get_other(name) for e in graph.relations if name in e.pair}
            case AddObject(node=node) if node.hides is not None:
                touched.add(node.hides)
                other.add(str(node.hidden_from))
            case RemoveObject(object=name):
                touched |= {str(o.met_by) for o in before.objects if o.id == name and o.met_by}
            case Unrelate() | RemoveAgent():
                pass
    new = {agent.id for agent in graph.agents} - {agent.id for agent in before.agents}
    # A new agent is the one that comes to the other.
    if touched & new:
        stay = {name for name in touched - new if before.agent(name) == graph.agent(name)}
        touched, other = touched - stay, (other | stay) - new
    foreground = {agent.id for agent in graph.agents}
    return frozenset(touched & foreground), frozenset((other - touched) & foreground)


def list_concerned(edits: tuple[Edit, ...]) -> set[str]:
    """Agents that the edits name."""
    names: set[str | None] = set()
    for edit in edits:
        for part in (edit, getattr(edit, "edge", None), getattr(edit, "measure", None)):
            keys = ("agent", "first", "second", "from_", "to", "other")
            names |= {getattr(part, key, None) for key in keys}
        if isinstance(edit, ChangeAgent | AddAgent):
            names.add(edit.node.id)
    return {name for name in names if name is not None}


def _amend_agents(
    earlier: PreviousVersion, edits: tuple[Edit, ...], pace: Mapping[str, float]
) -> tuple[dict[str, SelectedAgent], dict[str, float]]:
    """Agents changed by hand, and the pace of each agent."""
    amended: dict[str, SelectedAgent] = {}
    paces = dict(pace)
    for edit in edits:
        if not isinstance(edit, MoveStop | WaitLonger | ComeLater | SetPace):
            continue
        if edit.agent not in earlier.agents:
            raise build_rejection(edit.agent, "is not in the scene")
        agent = amended.get(edit.agent, earlier.agents[edit.agent].agent)
        match edit:
            case MoveStop(metres=metres):
                amended[edit.agent] = move_stop(agent, metres)
            case WaitLonger(seconds=seconds):
                amended[edit.agent] = extend_stop(agent, seconds)
            case ComeLater(seconds=seconds):
                amended[edit.agent] = move_time(agent, seconds)
            case SetPace(factor=factor):
                paces[edit.agent] = paces.get(edit.agent, 1.0) * factor
                law = scale_speed(agent.candidate.time_law, factor)
                amended[edit.agent] = replace(
                    agent, candidate=replace(agent.candidate, time_law=law)
                )
    return amended, paces


def _count_background(
    earlier: PreviousVersion, before: SocialGraph, edits: tuple[Edit, ...]
) -> dict[AgentClass, int]:
    """How many of each class, without members of asked groups: as before, or as an edit says."""
    once = {agent.id for agent in before.agents}
    here = [
        known.agent
        for name, known in earlier.agents.items()
        if name not in once and known.agent.group not in once
    ]
    counts: dict[AgentClass, int] = {
        kind: sum(agent.candidate.route.type == kind for agent in here)
        for kind in ("vehicle", "pedestrian")
    }
    for edit in edits:
        if isinstance(edit, RemoveAgent) and edit.agent not in once:
            counts["vehicle" if edit.agent.startswith("vehicle") else "pedestrian"] -= 1
        if isinstance(edit, SetBackground):
            counts["vehicle"] = counts["vehicle"] if edit.vehicles is None else edit.vehicles
            asked = edit.pedestrians
            counts["pedestrian"] = counts["pedestrian"] if asked is None else asked
    return {kind: max(count, 0) for kind, count in counts.items()}


def _choose_hour(earlier: PreviousVersion, edits: tuple[Edit, ...]) -> float:
    """The time of day as given; as it was, if that is within what is given."""
    given = [edit.time_of_day for edit in edits if isinstance(edit, ChangeContext)]
    if not given or given[-1] is None:
        return earlier.hour
    start, _, end = given[-1].partition("-")
    first, last = _parse_clock(start), _parse_clock(end or start)
    within = (earlier.hour - first) % 24.0 <= (last - first) % 24.0
    return earlier.hour if within else first


def _parse_clock(text: str) -> float:
    hours, minutes = text.split(":")
    return int(hours) + int(minutes) / 60.0
