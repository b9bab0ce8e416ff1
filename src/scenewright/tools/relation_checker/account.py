"""The account of words held against the tracks: is what it calls realised really there?"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, get_args

from scenewright.scene.account import SaidRecord
from scenewright.scene.base import AgentClass
from scenewright.scene.events import EVENT_OF_RELATION, Event, Finding
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import AgentRecord, SceneRecord
from scenewright.scene.track import VEHICLE_SIZES
from scenewright.tools.relation_checker.asked import AskedFor
from scenewright.tools.relation_checker.events import SceneObservation
from scenewright.tools.relation_checker.groups import list_groups
from scenewright.tools.relation_checker.legs import find_entry_leg, find_exit_leg, is_crossed
from scenewright.tools.relation_checker.manoeuvres import describe_manoeuvre
from scenewright.tools.relation_checker.measured import MeasuredFigures
from scenewright.tools.relation_checker.objects import describe_object
from scenewright.tools.relation_checker.obstacles import describe_encounter
from scenewright.tools.relation_checker.passing_order import find_passing_order
from scenewright.tools.relation_checker.pedestrian_motions import (
    describe_motion,
)
from scenewright.tools.relation_checker.reactions import describe_reaction

_ROUTE_WORDS = ("entry", "exit", "movement", "crosswalk")
_HOLDING = ("behavior", "constraint", "measure", "motion", "manoeuvre")
"""Words that may keep an agent from going all of its way."""
_WORDS_ALONE = ("signals", "road", "retracted", "impact_point", "measure", "tie")
"""Checked elsewhere, as conditions on relations, ties and lights, or saying nothing of tracks."""

_DAY = 24 * 60

GROUP = "group of "
"""Prefix of an entry's value that means several pedestrians walking together."""
_CLOCK = re.compile(r"[0-9]{2}:[0-9]{2}(:[0-9]{2})?")


def check_account(
    scene: SceneRecord,
    events: Sequence[Event],
    observed: SceneObservation,
    intersection_map: IntersectionMap | None,
    *,
    sights: Sequence[Mapping[str, Any]] = (),
    reactions: Sequence[Mapping[str, Any]] = (),
    encounters: Sequence[dict[str, Any]] = (),
) -> tuple[tuple[SaidRecord, ...], tuple[Finding, ...]]:
    """The account with evidence, and a finding for every entry that the scene does not bear out.

    Args:
        events: all that the tracks show, incidental ones included.
        sights: what was measured of blocked lines of sight; reactions: of reactions to threats;
            encounters: of objects in agents' way.
    """
    account: list[SaidRecord] = []
    findings: list[Finding] = []
    finder = _EvidenceFinder(
        scene, events, observed, intersection_map, sights, reactions, encounters
    )
    for entry in scene.said:
        if entry.became in ("manner", "nothing"):
            status = "manner" if entry.became == "manner" else "unrealised"
            account.append(entry.model_copy(update={"status": status}))
            continue
        evidence = finder.find(entry)
        if evidence is None:
            findings.append(_report_contradiction(entry))
            account.append(entry.model_copy(update={"status": "claimed", "evidence": None}))
        else:
            update = {"status": "realised", "evidence": evidence}
            account.append(entry.model_copy(update=update))
    return tuple(account), tuple(findings)


def _report_contradiction(entry: SaidRecord) -> Finding:
    value = f" {entry.value}" if entry.value else ""
    return Finding(
        rule="said_not_realised",
        agents=entry.agents,
        detail=f"'{entry.words}' should be {entry.became}{value}; the scene does not show it",
    )


class _EvidenceFinder:
    """What a scene shows for the entries of its account."""

    def __init__(
        self,
        scene: SceneRecord,
        events: Sequence[Event],
        observed: SceneObservation,
        intersection_map: IntersectionMap | None,
        sights: Sequence[Mapping[str, Any]],
        reactions: Sequence[Mapping[str, Any]],
        encounters: Sequence[dict[str, Any]],
    ) -> None:
        self._sights, self._reactions, self._encounters = sights, reactions, encounters
        self._scene, self._events, self._seen = scene, events, observed
        self._map = intersection_map
        self._agents = {agent.id: agent for agent in scene.agents}
        self._tracks = {track.id: track for track in observed.tracks}
        numbers = {agent.name: agent.id for agent in scene.agents if agent.name is not None}
        self._measured = MeasuredFigures(numbers, events, observed, intersection_map)
        self._asked = AskedFor(numbers, events, observed, intersection_map)
        self._by_entry: dict[str, Callable[[SaidRecord], str | None]] = {
            **dict.fromkeys(_ROUTE_WORDS, self._find_route),
            **dict.fromkeys(("normal", "denied"), self._find_absence),
            "agent": self._find_presence,
            "runs_red": self._find_red_run,
            "relation": self._find_event,
            "cause": self._find_cause,
            "order": self._find_order,
            "striker": self._find_striker,
            "manoeuvre": self._find_manoeuvre,
            "motion": self._find_motion,
            "reaction": self._find_reaction,
            "object": self._find_object,
            "sight": self._find_sight,
            "encounter": self._find_encounter,
        }

    def find(self, entry: SaidRecord) -> str | None:
        """Evidence for an entry; None where there is none."""
        if any(number not in self._agents for number in entry.agents):
            return None
        if finder := self._by_entry.get(entry.became):
            return finder(entry)
        match entry.became:
            case "time_of_day":
                return self._find_time(entry.value)
            case "density":
                return self._find_density(entry.value)
            case "background":
                return self._count_background(entry.value or "")
            case "constraint" | "behavior" | "measure":
                return self._find_asked(entry)
            case _:
                return "no claim on the tracks by itself"

    def _find_asked(self, entry: SaidRecord) -> str | None:
        """Clauses, standstills and figures; the severity of an event is looked at with that."""
        if entry.became != "measure":
            return self._asked.find(entry.value, entry.words)
        if " in [" not in (entry.value or ""):
            return "no claim on the tracks by itself"
        return self._measured.find(entry.value or "")

    def _find_presence(self, entry: SaidRecord) -> str | None:
        agents = [self._agents[number] for number in entry.agents]
        if (entry.value or "").startswith(GROUP):
            return self._find_group(entry)
        if entry.value in get_args(AgentClass) and any(a.type != entry.value for a in agents):
            return None
        named = entry.value in VEHICLE_SIZES
        if named and any(a.subtype != entry.value for a in agents):
            return None
        if not agents:
            return "words alone" if entry.value is None else None
        return ", ".join(f"agent {a.id} ({a.subtype or a.type})" for a in agents)

    def _find_object(self, entry: SaidRecord) -> str | None:
        """The object that the value names, if it is what the value calls it."""
        named, *what = (entry.value or "").split(" ")
        found = (each for each in self._scene.objects if each.id == named)
        fitting = (each for each in found if {each.kind, each.subtype}.issuperset(what))
        return next((describe_object(each) for each in fitting), None)

    def _find_sight(self, entry: SaidRecord) -> str | None:
        """When the hidden one is first seen, as far as before its event."""
        named = (entry.value or "").split(" ")[0]
        for sight in self._sights:
            both = (sight["observer"], sight["subject"])
            if sight["object"] == named and (
                entry.agents == both or (len(entry.agents) < 2 and set(entry.agents) <= set(both))
            ):
                seen, lead = sight["first_visible"], sight["before_event"]
                return (
                    f"agent {sight['observer']} first sees agent {sight['subject']} at "
                    f"{seen:.1f} s, {lead:.2f} s before the event"
                )
        return None

    def _find_encounter(self, entry: SaidRecord) -> str | None:
        return describe_encounter(entry.value or "", self._encounters, entry.agents)

    def _find_group(self, entry: SaidRecord) -> str | None:
        """That so many walk in the group of the agent; how, `check_groups` sees."""
        members = list_groups(self._scene.agents).get(entry.agents[0], ()) if entry.agents else ()
        wanted = (entry.value or "").removeprefix(GROUP)
        return f"agents {', '.join(map(str, members))}" if str(len(members)) == wanted else None

    def _find_route(self, entry: SaidRecord) -> str | None:
        agents = [self._agents[number] for number in entry.agents]
        if not agents or any(getattr(agent, entry.became) != entry.value for agent in agents):
            return None
        observed = [self._find_observed_leg(agent, entry.became) for agent in agents]
        if any(side not in (None, entry.value) for side in observed):
            return None
        if entry.became != "entry" and not all(map(self._goes_its_way, agents)):
            return None
        return f"{entry.became} {entry.value} on the track of " + ", ".join(
            f"agent {agent.id}" for agent in agents
        )

    @cached_property
    def _occupied(self) -> frozenset[int]:
        """Parties of relations and collisions, and agents with words of a way of moving."""
        bound = {n for each in self._scene.relations for n in (each.from_, each.to)}
        hits = (each for each in self._events if each.type == "collision")
        struck = {n for each in hits for n in (each.from_, each.to)}
        held = {n for each in self._scene.said if each.became in _HOLDING for n in each.agents}
        met = {each.agent for each in self._scene.encounters if each.how != "goes_round"}
        return frozenset(bound | struck | held | met)

    def _goes_its_way(self, agent: AgentRecord) -> bool:
        """Whether one to whom nothing else happens is seen to go where it is said to go.

        Events decide how far their parties come, and words of a standstill may hold an agent.
        """
        if self._map is None or self._scene.meta.rules is None or agent.id in self._occupied:
            return True
        track = self._tracks[agent.id]
        if agent.type == "pedestrian":
            return agent.crosswalk is None or is_crossed(track.xy, agent.crosswalk, self._map)
        return agent.crosswalk is not None or find_exit_leg(track, self._map) is not None

    def _find_observed_leg(self, agent: AgentRecord, field: str) -> str | None:
        """The leg that the track itself shows, where it can be determined."""
        if self._map is None or agent.type == "pedestrian" or agent.crosswalk is not None:
            return None
        track = self._tracks[agent.id]
        if field == "entry":
            return find_entry_leg(track, self._map)
        return find_exit_leg(track, self._map) if field == "exit" else None

    def _find_red_run(self, entry: SaidRecord) -> str | None:
        if self._map is None or not self._scene.signals:
            return "lights were not checked"
        for number in entry.agents:
            runs = list(self._seen.lights.find_red_crossings(self._tracks[number]))
            if not runs:
                return None
        return f"passes red at {runs[0].time:.1f} s" if entry.agents else None

    def _find_event(self, entry: SaidRecord) -> str | None:
        kind = EVENT_OF_RELATION.get(entry.value or "")
        for event in self._events:
            if event.type == kind and {event.from_, event.to} == set(entry.agents):
                return f"{event.type} of {event.from_} and {event.to} at {event.time:.1f} s"
        return None

    def _find_order(self, entry: SaidRecord) -> str | None:
        """That the first agent of the entry passes before the second in an event of the two."""
        for event in self._events:
            if len(entry.agents) != 2 or {event.from_, event.to} != set(entry.agents):
                continue
            first, second = entry.agents
            order = find_passing_order(self._seen, event)
            if order is not None and order.first == first:
                does = "enters the conflict zone" if event.type == "collision" else "passes"
                return (
                    f"agent {first} {does} at {order.first_time:.2f} s, "
                    f"agent {second} at {order.second_time:.2f} s"
                )
            if order is None and event.to == first and event.type in ("yielding", "follow"):
                return f"agent {first} goes ahead in the {event.type} at {event.time:.1f} s"
        return None

    def _find_striker(self, entry: SaidRecord) -> str | None:
        """That the first agent of the entry strikes the second."""
        for event in self._events:
            if event.type == "collision" and (event.from_, event.to) == entry.agents:
                side = event.evidence.get("side_from") or "body"
                return f"agent {event.from_} strikes with its {side} at {event.time:.1f} s"
        return None

    def _find_cause(self, entry: SaidRecord) -> str | None:
        if entry.value == "red_light_run":
            ran = next((each for each in self._events if each.cause == entry.value), None)
            return None if ran is None else f"red is run in the {ran.type} at {ran.time:.1f} s"
        return self._find_braking(entry)

    def _find_braking(self, entry: SaidRecord) -> str | None:
        for event in self._events:
            brakes = event.evidence.get("late_brake")
            if event.cause == "late_brake":
                brakes = event.evidence.get("cause_agent", brakes)
            if brakes is not None and (not entry.agents or brakes in entry.agents):
                return f"agent {brakes} brakes hard in the {event.type} at {event.time:.1f} s"
        return None

    def _find_manoeuvre(self, entry: SaidRecord) -> str | None:
        """Of a relation of these agents that is to come about so."""
        for relation in self._scene.relations:
            pair = {relation.from_, relation.to}
            if relation.manoeuvre != entry.value or not pair.issuperset(entry.agents):
                continue
            for event in self._events:
                if event.type == relation.type and {event.from_, event.to} == pair:
                    seen = describe_manoeuvre(relation, event, self._seen)
                    if seen is not None:
                        return seen
        return None

    def _find_motion(self, entry: SaidRecord) -> str | None:
        """Of every agent that it is said of."""
        if self._map is None:
            return "the ground was not checked"
        found = [
            describe_motion(entry.value, self._tracks[number], self._seen, self._map)
            for number in entry.agents
        ]
        evidence = [each for each in found if each is not None]
        return "; ".join(evidence) if len(evidence) == len(found) > 0 else None

    def _find_reaction(self, entry: SaidRecord) -> str | None:
        """Of every agent that it is said of, and of which it is asked."""
        if any(self._agents[number].reaction != entry.value for number in entry.agents):
            return None
        found = [
            describe_reaction(
                entry.value or "", [row for row in self._reactions if row["agent"] == number]
            )
            for number in entry.agents
        ]
        evidence = [each for each in found if each is not None]
        return "; ".join(evidence) if len(evidence) == len(found) > 0 else None

    def _find_time(self, value: str | None) -> str | None:
        own = self._scene.meta.time_of_day
        if value is None or not _is_within(own, value):
            return None
        return f"the scene is at {own}"

    def _find_density(self, value: str | None) -> str | None:
        if value not in ("low", "medium", "high"):
            return "ordinary traffic"
        return f"density {value}" if self._scene.meta.density == value else None

    def _count_background(self, value: str) -> str | None:
        """How many others there are; None where they are not as many as the words say."""
        kinds = [agent.type for agent in self._scene.agents if agent.role == "background"]
        for number, kind in re.findall(r"(\d+) (vehicle|pedestrian)s", value):
            if kinds.count(kind) != int(number):
                return None
        return (
            f"{kinds.count('vehicle')} vehicles and {kinds.count('pedestrian')} pedestrians "
            "in the background"
        )

    def _find_absence(self, entry: SaidRecord) -> str | None:
        kind = EVENT_OF_RELATION.get(entry.value or "")
        between = set(entry.agents)
        asked = {frozenset((r.from_, r.to)) for r in self._scene.relations}
        for event in self._events:
            pair = {event.from_, event.to}
            same = kind is None or event.type == kind
            if entry.became == "denied" and same and between and between <= pair:
                return None
            if entry.became == "normal" and frozenset(pair) not in asked and event.type != "follow":
                if all(self._agents[n].role == "background" for n in pair):
                    continue
                return None
        return "nothing of the kind observed"


def _is_within(time: str, span: str) -> bool:
    """Whether HH:MM lies in HH:MM or HH:MM-HH:MM, which may pass midnight.

    >>> _within("23:40", "23:30-00:30"), _within("08:00", "08:00"), _within("09:00", "08:00")
    (True, True, False)
    """
    first, _, last = span.partition("-")
    if not all(_CLOCK.fullmatch(each) for each in (first, last or first, time)):
        return False
    start, own = _parse_minutes(first), _parse_minutes(time)
    return (own - start) % _DAY <= (_parse_minutes(last or first) - start) % _DAY


def _parse_minutes(text: str) -> int:
    return int(text[:2]) * 60 + int(text[3:5])
