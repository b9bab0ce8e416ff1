"""Where in recordings that happens which a text or a plan asks for (docs/tutorials/find.md).

Each agent of the plan gets a recorded one, so that every relation has an event of the checker's;
the stretch, as a scene of that plan, is then proven as made scenes are.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from scenewright.errors import InputError
from scenewright.files import is_plan_file, write_files
from scenewright.graph.arguments import DEFAULT_INTERSECTION
from scenewright.graph.run import plan_instruction
from scenewright.graph.scene_files import encode_proof, encode_scene, load_scene
from scenewright.graph.verify import load_recordings, verify
from scenewright.intersections import load_map
from scenewright.nodes.scene_verifier import add_events
from scenewright.nodes.scene_verifier.assemble import (
    build_measure_records,
    compute_scene_id,
    find_culprit,
)
from scenewright.scene.base import Point
from scenewright.scene.events import EVENT_OF_RELATION, Event, Proof
from scenewright.scene.kinds import get_kind, has_trait
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Route
from scenewright.scene.measures import UNITS, MeasureKind
from scenewright.scene.plan_fields import PlanField, join_fields, list_fields
from scenewright.scene.plan_file import MOST_CHOICES, LogicalPlan, read_logical_plan
from scenewright.scene.record import (
    AgentRecord,
    MeasureRecord,
    RelationRecord,
    SceneMeta,
    SceneRecord,
    SignalRecord,
    TieRecord,
)
from scenewright.scene.relations import get_pattern
from scenewright.scene.social import RelationEdge, SocialGraph
from scenewright.scene.track import STEP, VEHICLE_SIZES
from scenewright.tools.account import list_unknown_words, prove
from scenewright.tools.account.facts import SceneFacts
from scenewright.tools.fitting.route_matching import Match, Matcher
from scenewright.tools.relation_checker import read_users
from scenewright.tools.relation_checker.events import SceneObservation
from scenewright.tools.relation_checker.external_events import ExternalTracks, observe_recording
from scenewright.tools.relation_checker.legs import find_entry_leg, find_exit_leg
from scenewright.tools.relation_checker.trajectory import Trajectory

SPAN = 14.0
"""The events of one hit lie at most so far apart [s]."""
AROUND, LONGEST = 8.0, 30.0
"""What of a recording is cut out before and after a hit's events, and the longest clip [s]."""
CLEARANCE = 3.0
"""Agents of recordings that stay further apart do not nearly hit one another [m]."""
APPROACH = (3.0, 2.0)
"""In how long before a near miss [s] the two come how much nearer [m], where that is seen."""
_FIGURES: dict[str, MeasureKind] = {
    "target_pet": "pet", "target_ttc": "ttc", "impact_speed": "contact_speed",
}  # fmt: skip
_VARIED = {"near_miss": ("target_pet", "pet", 0.4, "s"),
           "collision": ("impact_speed", "speed_from", 1.0, "m/s")}  # fmt: skip
"""Field and evidence of an event's figure, with the width of the range about it."""
_UNHELD = ("constraint", "behavior", "manner", "nothing", "denied", "signals", "road")
"""What words became that no field holds which tracks could show."""
_JOURNEY = ("entry", "exit", "movement", "crosswalk")
_ASKED = (
    "relation_not_realised", "measure_not_met", "entry_elsewhere", "motion_not_seen",
    "reaction_not_seen", "red_light_not_run",
)  # fmt: skip
"""Rules of the checker that are about what was asked for."""
_NEEDS = {
    **{("agents", name): "place" for name in (*_JOURNEY, "motion")}, ("ties", ""): "place",
    ("measures", "line_distance"): "place", ("measures", "line_speed"): "signals",
    ("agents", "runs_red"): "signals", ("context", "time_of_day"): "clock",
    ("context", "density"): "nothing", ("objects", ""): "nothing", ("agents", "members"): "nothing",
}  # fmt: skip
"""What a source must have for a test of a field, by section and field, or kind of figure."""
_LACKS = {
    "place": "no map was given", "signals": "nothing says what the lights showed",
    "clock": "the tracks have no time of day", "nothing": "it is not looked for in tracks",
}  # fmt: skip


Bounds = tuple[SocialGraph, SocialGraph]
"""A plan with the least and with the largest value of every number that it leaves open."""


class Query(NamedTuple):
    """What is looked for: any of the plans; and words that no field of them holds."""

    plans: tuple[Bounds, ...]
    unheld: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Source:
    """Tracks to look into; their map; the lights of a scene, and its time of day."""

    path: str
    tracks: ExternalTracks
    place: IntersectionMap | None = None
    signals: tuple[SignalRecord, ...] = ()
    clock: str | None = None

    @cached_property
    def find_route(self) -> Callable[[Trajectory], tuple[Route | None, bool]]:
        """A route of the map that fits a track, and whether the track shows that it is this one."""
        place = self.place
        if place is None:
            return lambda _: (None, False)
        routes = {route.id: route for route in place.routes}
        lines = {
            r.id: [np.array(m.centreline)] for r in place.routes if (m := place.find_movement(r))
        }
        for route, walk in product(place.routes, place.crosswalks):
            if (route.movement, route.crosswalk) == ("crossing", walk.leg):
                onward = 1 if walk.sides[0] == route.entry else -1
                lines[route.id] = [np.array(walk.centreline[::onward])]
        matcher = Matcher(place, lines)

        def find(track: Trajectory) -> tuple[Route | None, bool]:
            kind = "pedestrian" if track.type == "pedestrian" else "vehicle"
            found = matcher.match(track.xy, kind)
            if isinstance(found, Match):
                return routes[found.route], True
            own = [route for route in place.routes if route.type == kind]
            entry, exit_ = find_entry_leg(track, place), find_exit_leg(track, place)
            fit = [r for r in own if entry in (None, r.entry) and exit_ in (None, r.exit)]
            return next(iter(fit or own), None), False

        return cache(find)


@dataclass(frozen=True, eq=False)
class Hit:
    """A stretch of a recording that shows what is asked for.

    Attributes:
        agents: number of the recorded agent, by the plan's id.
        events: what the checker found for each relation, in the times of the recording.
        time: of the first event [s].
        scene, proof: the clip as a scene, and of it.
        untested: what was asked for and could not be tested, one sentence each.
    """

    source: Source
    plan: SocialGraph
    agents: Mapping[str, int]
    events: tuple[Event, ...]
    time: float
    scene: SceneRecord
    proof: Proof
    untested: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """One entry of `--json`."""
        tracks = self.source.tracks
        return {
            "path": self.source.path, "time": round(self.time, 3),
            "agents": {
                name: {"id": n, "name": tracks.names[n], "subtype": tracks.subtypes[n]}
                for name, n in self.agents.items()
            },
            "events": [e.model_dump(mode="json", by_alias=True) for e in self.events],
            "claims": [e.model_dump(mode="json") for e in self.proof.account],
            "untested": list(self.untested),
        }  # fmt: skip


def read_query(asked: str | Mapping[str, Any], *, intersection: str | None = None) -> Query:
    """The plans that a text, or a plan with values left open, a file or its fields, stands for.

    Raises:
        InputError, Unsatisfiable, BackendFault: as `synthesize`; too many choices.
    """
    place, unknown = intersection or DEFAULT_INTERSECTION, list[str]()
    if not isinstance(asked, str) or is_plan_file(asked):
        logical = read_logical_plan(asked)
        unknown = [constraint.text for constraint in logical.constraints]
        if intersection is None:
            unknown += logical.legs.values()
        plans = _list_bounds(logical.place_at(load_map(place)))
    else:
        plan = plan_instruction(asked, intersection=place)
        plans = ((plan, plan),)
        unknown = [word.words for word in list_unknown_words(asked, load_map(place))]
    unheld = [each.words for each in plans[0][0].said if each.became in _UNHELD]
    bare = {"said": ()}
    plans = tuple((a.model_copy(update=bare), b.model_copy(update=bare)) for a, b in plans)
    return Query(plans, tuple(dict.fromkeys([*unheld, *unknown])))


def _list_bounds(logical: LogicalPlan) -> tuple[Bounds, ...]:
    """The plans of every choice of listed values."""
    lists = {at: each.values for at, each in logical.spreads.items() if each.kind == "list"}
    if math.prod(map(len, lists.values())) > MOST_CHOICES:
        raise InputError(f"{logical.name}: its lists have more than {MOST_CHOICES} combinations")
    low, high = (
        {at: each.compute_value(share) for at, each in logical.spreads.items()}
        for share in (0.0, 1.0)
    )
    chosen = (dict(zip(lists, values, strict=True)) for values in product(*lists.values()))
    return tuple((logical.settle(low | c).plan, logical.settle(high | c).plan) for c in chosen)


def load_sources(path: Path, intersection: str | None = None) -> Iterator[Source]:
    """The recordings of a file of tracks, or a scene with its own map and lights.

    Raises:
        InputError: unreadable, or no such intersection.
    """
    if path.is_dir() or path.suffix == ".json":
        scene = load_scene(path)
        names = {agent.id: agent.name for agent in scene.agents}
        subtypes = {agent.id: agent.subtype or agent.type for agent in scene.agents}
        tracks = ExternalTracks(read_users(scene), names, subtypes, scene.meta.step)
        place = load_map(intersection or scene.meta.intersection)
        yield Source(str(path), tracks, place, scene.signals, scene.meta.time_of_day)
        return
    given = None if intersection is None else load_map(intersection)
    for name, tracks in load_recordings(path).items():
        yield Source(f"{path}:{name}" if name else str(path), tracks, given)


def find_hits(query: Query, source: Source) -> Iterator[Hit]:
    """Every encounter in a recording that contradicts nothing of what is asked for, in order.

    Raises:
        InputError: too many agents at once.
    """
    lacks = list_untestable(query, source)
    for window in observe_recording(
        source.tracks, intersection_map=source.place, signals=source.signals
    ):
        searches = (_PlanSearch(low, high, lacks, source, *window) for low, high in query.plans)
        found = (hit for search in searches for hit in search.find_hits())
        yield from sorted(found, key=lambda hit: hit.time)


def list_untestable(query: Query, source: Source) -> tuple[str, ...]:
    """What is asked for that no stretch of such a recording can show, one sentence each."""
    fields = (each for plan, _ in query.plans for each in list_fields(plan))
    lacks = [f"{field.words}: {lack}" for field in fields if (lack := _find_lack(field, source))]
    unheld = [f"'{words}': no field of a plan holds it" for words in query.unheld]
    return tuple(dict.fromkeys([*unheld, *lacks]))


def _find_lack(each: PlanField, source: Source) -> str | None:
    """Why a field cannot be tested on any tracks of a source; None where it can."""
    need = _NEEDS.get((each.section, each.name or getattr(each.value, "kind", "") or ""))
    need = "nothing" if each.section == "objects" else need
    if has_trait("cause", str(each.value), "red_light"):
        need = "signals"
    if each.section == "relations" and not each.name and each.value.type == "near_miss":
        pair = (each.value.from_, each.value.to)
        need = "nothing" if all(name.startswith("pedestrian") for name in pair) else None
    return _LACKS[need] if need and not getattr(source, need, None) else None


@dataclass(frozen=True, eq=False)
class _PlanSearch:
    """Looks for a plan in what the checker saw in a window."""

    plan: SocialGraph
    most: SocialGraph
    lacks: tuple[str, ...]
    source: Source
    observed: SceneObservation
    begin: float
    end: float

    @cached_property
    def _tracks(self) -> dict[int, Trajectory]:
        return {track.id: track for track in self.observed.tracks}

    @cached_property
    def _list_events(self) -> Callable[[RelationEdge, Mapping[str, int]], list[Event]]:
        """Events that may be a relation's; near misses and collisions count either way round."""
        found: dict[tuple[str, int, int], list[Event]] = defaultdict(list)
        for event in self.observed.events:
            found[event.type, event.from_, event.to].append(event)
            if event.type in ("near_miss", "collision"):
                found[event.type, event.to, event.from_].append(event)
        return lambda edge, agents: found.get(
            (EVENT_OF_RELATION[edge.type], agents[edge.from_], agents[edge.to]), []
        )

    def find_hits(self) -> Iterator[Hit]:
        """Hits in order of time, one of the same agents within `SPAN` s."""
        plan, last, found = self.plan, dict[tuple[int, ...], float](), []
        bound = {name for edge in plan.relations for name in (edge.from_, edge.to)}
        names = sorted((node.id for node in plan.agents), key=lambda name: name not in bound)
        for agents in self._assign(names, {}):
            for events in product(*(self._list_events(e, agents) for e in plan.relations)):
                track = self._tracks[agents[names[0]]]
                starts = [e.time for e in events] or [track.start]
                # Of all events only a follow lasts.
                ends = [e.evidence.get("until", e.time) for e in events] or [track.end]
                if max(starts) - min(ends) <= SPAN:
                    found.append((min(starts), max(ends), agents, events))
        for time, until, agents, events in sorted(found, key=lambda each: each[:2]):
            key = tuple(sorted(agents[name] for name in bound or names[:1]))
            ours = self.begin <= time < self.end
            if ours and time - last.get(key, -math.inf) > SPAN:
                hit = self._prove(agents, events, time, until)
                if hit is not None:
                    last[key] = time
                    yield hit

    def _assign(self, names: Sequence[str], agents: dict[str, int]) -> Iterator[dict[str, int]]:
        """Recorded agents for all names, so that those of every relation have such an event."""
        if not names:
            yield agents
            return
        name, *rest = names
        edges = [e for e in self.plan.relations if name in (e.from_, e.to)]
        own = [self._tracks[n] for n in agents.values()]
        for n, track in self._tracks.items():
            named = agents | {name: n}
            known = [e for e in edges if {e.from_, e.to} <= named.keys()]
            there = all(track.start <= t.end and t.start <= track.end for t in own)
            if (
                n not in agents.values()
                and (there or edges)
                and all(self._list_events(e, named) for e in known)
                and self._find_doubts(name, n) is not None
            ):
                yield from self._assign(rest, named)

    @cached_property
    def _find_doubts(self) -> Callable[[str, int], tuple[str, ...] | None]:
        """What of a node cannot be tested of a recorded agent; None if something contradicts it."""

        def find(name: str, number: int) -> tuple[str, ...] | None:
            node, track, found = self.plan.agent(name), self._tracks[number], list[str]()
            seen, exact = self.source.tracks.subtypes[number], self.source.clock is not None
            if track.type != node.type:
                if exact or (node.type, track.type) != ("scooter", "cyclist"):
                    return None
                found.append(f"{name}: files tell no scooters from bicycles")
            if node.subtype not in (None, seen):
                if exact or get_kind("subtype", str(node.subtype)).wider != seen:
                    return None
                found.append(f"{name}: the file says {seen}, which may be a {node.subtype}")
            asked = {key: value for key in _JOURNEY if (value := getattr(node, key)) is not None}
            route, shown = self.source.find_route(track) if asked else (None, False)
            if shown and any(getattr(route, key) != value for key, value in asked.items()):
                return None
            lost = asked and self.source.place and not shown
            return (*found, *[f"{name}: its track does not show its way"] * bool(lost))

        return cache(find)

    def _prove(
        self, agents: dict[str, int], events: tuple[Event, ...], time: float, until: float
    ) -> Hit | None:
        """The hit, unless the checker finds something asked for missing or contradicted."""
        plan, source = self.plan, self.source
        begin = max(min(self._tracks[n].start for n in agents.values()), time - AROUND)
        span = (begin, min(until + AROUND, begin + LONGEST))
        shown = {name for name, n in agents.items() if source.find_route(self._tracks[n])[1]}
        ties = tuple(tie for tie in plan.ties if {tie.agent, tie.of} <= shown)
        lost = [tie for tie in plan.ties if tie not in ties and source.place]
        plan = plan.model_copy(update={"ties": ties})
        clip = self._build_clip(plan, agents, span)
        proof, doubts = prove(clip, source.place), list(self.lacks)
        if any(each.rule in _ASKED for each in proof.missing):
            return None
        for each, entry in zip(list_fields(plan), proof.account, strict=True):
            own = each.name in (*_JOURNEY, "subtype", "") or _find_lack(each, source)
            if entry.state == "contradicted" and not own:
                return None
            doubts += [f"{each.words}: {entry.evidence}"] * (entry.state == "not_shown")
        for name, n in agents.items():
            doubts += self._find_doubts(name, n) or ()
        doubts += [f"{t.agent} {t.side} of {t.of}: a track does not show its way" for t in lost]
        if source.clock is None:  # tracks of a scene are exact
            doubts += filter(None, map(self._doubt_near_miss, events))
        untested = tuple(dict.fromkeys(doubts))
        return Hit(source, self.plan, agents, events, time, clip, proof, untested)

    def _doubt_near_miss(self, event: Event) -> str | None:
        """Why a near miss of recorded tracks may be none: companions have a short PET, too, and so
        has a track that begins or jumps beside another."""
        if event.type != "near_miss":
            return None
        if (clearance := float(event.evidence.get("clearance", 0.0))) > CLEARANCE:
            return f"near miss: the two stay {clearance:.1f} m apart"
        pair = [self._tracks[n] for n in (event.from_, event.to)]
        since = max(event.time - APPROACH[0], *(track.start for track in pair))
        (x, y), (u, v) = (
            [[np.interp(t, track.times, own) for t in (since, event.time)] for own in track.xy.T]
            for track in pair
        )
        before, at = np.hypot(np.subtract(x, u), np.subtract(y, v))
        return None if before - at >= APPROACH[1] else "near miss: no approach of the two is seen"

    def _build_clip(
        self, plan: SocialGraph, numbers: dict[str, int], span: tuple[float, float]
    ) -> SceneRecord:
        """What of the recording lies in a span [s], as a scene with what the plan asks for.

        Whose track does not show its way has some route that fits; without a map there are none,
        and the scene is for the checker alone.
        """
        source, place = self.source, self.source.place
        nodes = {numbers[node.id]: node for node in plan.agents}
        counts = Counter[str]()
        for name in sorted(numbers):  # others are numbered after those of the plan
            counts[nodes[numbers[name]].type] += int(name.partition("-")[2])
        regions = place.goal_regions if place else ()
        agents = list[AgentRecord]()
        goals: dict[Any, Point] = {
            (region.type, region.leg): region.polygon[0] for region in regions
        }
        for n, track in self._tracks.items():
            inside = (track.times >= span[0] - 1e-6) & (track.times <= span[1] + 1e-6)
            if inside.sum() < 2:
                continue
            node = nodes.get(n)
            counts[track.type] += node is None
            kind = "pedestrian" if track.type == "pedestrian" else "vehicle"
            route, _ = source.find_route(track)
            labels = {name: getattr(route, name, None) for name in _JOURNEY}
            if node is not None:
                labels |= {name: getattr(node, name) for name in ("motion", "reaction")}
            subtype = source.tracks.subtypes[n]
            agents.append(AgentRecord.model_construct(
                **labels,
                id=n, type=track.type, role="foreground" if node else "background",
                name=node.id if node else f"{track.type}-{counts[track.type]}",
                subtype=subtype if subtype in VEHICLE_SIZES else None,
                spawn_time=round(float(track.times[inside][0] - span[0]), 3),
                goal=goals.get((kind, labels["exit"]), tuple(track.xy[-1].round(3).tolist())),
                violates_signal=node is not None and node.runs_red,
                trajectory=tuple(map(tuple, track.xy[inside].round(3).tolist())),
                heading=tuple(np.unwrap(track.heading[inside]).round(4).tolist()),
                length=track.length, width=track.width, route=route.id if route else "",
            ))  # fmt: skip
        clock, words = source.clock or "12:00", join_fields(list_fields(plan))
        name, map_id = (place.name, place.map_id) if place else ("", 0)
        meta = SceneMeta(
            scene_id=compute_scene_id(f"{source.path} {span[0]:.1f} {numbers} {words}", name, 0),
            map_id=map_id,
            timestamp=60.0 * (60 * int(clock[:2]) + int(clock[3:5])), time_of_day=clock, seed=0,
            intersection=name, user_prompt=words, plan=plan, rules=3, step=STEP,
            duration=round(span[1] - span[0], 3),
        )  # fmt: skip
        lights = (
            row.model_copy(update={"start": round(max(row.start - span[0], 0.0), 3),
                                   "end": round(min(row.end, span[1]) - span[0], 3)})
            for row in source.signals if row.end > span[0] and row.start < span[1]
        )  # fmt: skip
        return SceneRecord.model_construct(
            meta=meta, agents=tuple(agents), events=(), signals=tuple(lights),
            relations=tuple(_build_relation(edge, plan, numbers) for edge in plan.relations),
            measures=tuple(self._list_measures(numbers)),
            ties=tuple(
                TieRecord(agent=numbers[t.agent], of=numbers[t.of], side=t.side) for t in plan.ties
            ),
        )  # fmt: skip

    def _list_measures(self, agents: dict[str, int]) -> Iterator[MeasureRecord]:
        """Figures that are asked for, those of relations too, with the range of each."""
        low, high = self.plan, self.most
        ends = build_measure_records(low, agents), build_measure_records(high, agents)
        for least, most in zip(*ends, strict=True):
            yield least.model_copy(update={"high": max(least.high, most.high)})
        for edge, other in zip(low.relations, high.relations, strict=True):
            for name, kind in _FIGURES.items():
                if getattr(edge, name) is not None:
                    slack = UNITS[kind].tolerance
                    yield MeasureRecord(
                        kind=kind, agent=agents[edge.from_], other=agents[edge.to],
                        low=getattr(edge, name) - slack, high=getattr(other, name) + slack,
                    )  # fmt: skip


def _build_relation(
    edge: RelationEdge, plan: SocialGraph, numbers: dict[str, int]
) -> RelationRecord:
    """What an edge asks of an event, its figures aside, and its file where it names one."""
    pattern = None if edge.pattern is None else get_pattern(edge.pattern)
    kind = edge.kind or (pattern and pattern.proof.kind)
    sides = [(edge.from_, edge.point_from), (edge.to, edge.point_to)]
    if kind == "pedestrian_strike" and edge.from_.startswith("pedestrian"):
        sides.reverse()
    (first, point_from), (second, point_to) = sides
    return RelationRecord.model_validate(
        {
            "type": EVENT_OF_RELATION[edge.type], "kind": kind,
            "from": numbers[first], "to": numbers[second],
            "point_from": point_from, "point_to": point_to,
            "cause": edge.cause or (pattern and pattern.proof.cause),
            "cause_agent": find_culprit(edge, plan, numbers),
            "manoeuvre": edge.manoeuvre or (pattern and pattern.manoeuvre),
            "zone": pattern and pattern.zone,
            "first": edge.first and numbers[edge.first],
            "strikes": edge.strikes and numbers[edge.strikes],
            "within": pattern.compute_bounds() if pattern else {},
        }
    )  # fmt: skip


def save_clip(hit: Hit, folder: Path) -> Path:
    """Write a hit as a scene folder, which `show`, `verify` and `export` read.

    Raises:
        InputError: there is no map, or the folder cannot be written.
    """
    if hit.source.place is None:
        raise InputError("a clip is a scene, which needs a map: name that of the tracks with --map")
    scene = add_events(hit.scene, hit.proof)
    files = {"scene.json": encode_scene(scene), "proof.json": encode_proof(verify(scene))}
    return write_files(folder, files)


def format_variation(hit: Hit) -> str:
    """A hit as a plan file: its agents and relations, with ranges around what was measured."""
    names = ", ".join(f"{k} is {hit.source.tracks.names[n]}" for k, n in hit.agents.items())
    data = hit.plan.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    facts, measures = SceneFacts(hit.scene, hit.proof, hit.source.place), data.pop("measures", [])
    for edge, event in zip(data.get("relations", ()), hit.events, strict=True):
        key, figure, slack, unit = _VARIED.get(event.type, ("", "", 0.0, ""))
        value = event.evidence.get(figure)
        if value is not None:
            edge[key] = f"{max(value - slack, 0.1):.1f} .. {value + slack:.1f} {unit}"
    for name, n in hit.agents.items():
        speed = facts.compute_kept_speed(n) or 0.0
        known = [m for m in measures if (m["kind"], m["agent"]) == ("speed", name)]
        if 0.5 < speed < 17.0 and not known:
            value = f"{0.85 * speed:.1f} .. {1.15 * speed:.1f} m/s"
            measures.append({"kind": "speed", "agent": name, "value": value})
    lines = [
        f"# Like {hit.source.path} at {hit.time:.1f} s: {names}.",
        "# Ranges lie around what was measured there; a speed is the highest kept for a second.",
    ]
    for section, entries in {**data, "measures": measures}.items():
        lines.append(f"{section}:")
        single = isinstance(entries, dict)
        for entry in [entries] if single else entries:
            own = (f"{k}: {str(v).lower() if v is True else v}" for k, v in entry.items())
            lines.append(f"  {'' if single else '- '}{{{', '.join(own)}}}")
    return "\n".join([*lines, ""])
