"""A scene in words, for people in a hurry."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from scenewright.cli.console import count, format_one_line
from scenewright.geometry.map_areas import geos
from scenewright.intersections import load_map
from scenewright.scene.account import SaidRecord, SaidSpan, WordState
from scenewright.scene.base import Point
from scenewright.scene.events import Event, Finding, Proof
from scenewright.scene.kinds import get_kind
from scenewright.scene.map import IntersectionMap
from scenewright.scene.objects import ObjectRecord
from scenewright.scene.phrasing import call_agents
from scenewright.scene.record import SceneRecord

VERBS = {
    "yielding": "yields to",
    "follow": "follows",
    "collision": "collides with",
    "near_miss": "has a near miss with",
}
_FIGURES = {"pet": ("PET", "s"), "path_ttc": ("path TTC", "s"), "ttc_2d": ("straight TTC", "s"),
            "clearance": ("clearance", "m"), "drac": ("DRAC", "m/s²")}  # fmt: skip
SAME_MOMENT = 0.25
"""A figure measured this close [s] to the time of its event is said without a time of its own."""
KERB = 1.0
"""How far [m] outside a crosswalk a place still counts as on it."""


def summarize_scene(scene: SceneRecord, proof: Proof) -> list[str]:
    """The verdict, the events, the other agents, and words not seen: a few lines."""
    intersection_map = load_map(scene.meta.intersection)
    names = {agent.id: format_one_line(agent.name, limit=40) for agent in scene.agents}
    figures = proof.figures.get("avoidability", ())
    lines = [
        line
        for event in proof.events
        for line in (
            describe_event(event, scene, intersection_map),
            *_describe_worst(event, intersection_map),
            *describe_avoidability(event, figures, names),
        )
    ]
    if not lines and not scene.encounters:
        lines = ["nothing happens: no collision, near miss or yielding"]
    lines += _describe_unasked_runs(scene, proof)
    lines += [
        _describe_object(scene_object, scene, proof, intersection_map)
        for scene_object in scene.objects
    ]
    lines += [_describe_background(scene), *list_unseen_words(proof), *list_choices(scene.said)]
    return [format_verdict(proof), *(f"  {line}" for line in lines)]


_TITLES: dict[WordState, str] = {
    "not_shown": "not shown", "contradicted": "contradicted",
    "stands_anyway": "stands anyway", "manner": "without effect on tracks",
}  # fmt: skip


def list_unseen_words(proof: Proof) -> list[str]:
    """The words that the checker did not see on the tracks, a line for each state."""
    lines = []
    for state, title in _TITLES.items():
        words = [
            f"{word.words!r} ({word.evidence})"
            if state in ("not_shown", "contradicted")
            else repr(word.words)
            for word in proof.list_words(state)
        ]
        lines += [format_one_line(f"{title}: {', '.join(words)}")] if words else []
    return lines


def list_choices(said: Sequence[SaidSpan | SaidRecord]) -> list[str]:
    """What the planner chose where the words leave it open; no claim of what the scene shows."""
    return [
        f"chosen: the {each.value} leg ({format_one_line(each.note, limit=80)})"
        for each in said
        if each.note and each.became in ("entry", "exit")
    ]


def format_verdict(proof: Proof) -> str:
    """The verdict with what stands beside it, and how many findings stand against the scene."""
    verdict = format_one_line(proof.describe_verdict())
    against = count(len(list_findings(proof)), "finding")
    return verdict if proof.verified else f"{verdict} ({against})"


def choose_style(*, verified: bool, caveat: str) -> str:
    """The colour of a verdict: yellow where something stands beside it."""
    return "red" if not verified else "yellow" if caveat else "green"


def list_findings(proof: Proof) -> tuple[Finding, ...]:
    """Everything that stands against a scene, weightiest first."""
    return (*proof.missing, *proof.interference, *proof.signal_violations, *proof.implausible)


def describe_event(event: Event, scene: SceneRecord, intersection_map: IntersectionMap) -> str:
    """One event: its agents, its type, its time and place."""
    first, second = (name_agent(scene, each) for each in (event.from_, event.to))
    kind = f" ({event.kind.replace('_', ' ')})" if event.kind else ""
    gap, moment = "", event.when.get("pet")
    if isinstance(pet := event.evidence.get("pet"), float):
        gap = f", {pet:.1f} s apart"
    if moment is not None and abs(moment.time - event.time) > SAME_MOMENT:
        gap += f" {place(moment.location, intersection_map)} at {moment.time:.1f} s"
    return (
        f"{event.time:.1f} s: {first} {VERBS[event.type]} {second}{kind}, "
        f"{place(event.location, intersection_map)}{gap}"
    )


def _describe_worst(event: Event, intersection_map: IntersectionMap) -> list[str]:
    """Figures of the two that are worse at another moment than in their event, in one line."""
    worse = event.list_worse()
    said = [
        f"{words} {worse[name].value:.1f} {unit} at {worse[name].time:.1f} s "
        f"{place(worse[name].location, intersection_map)}"
        for name, (words, unit) in _FIGURES.items()
        if name in worse
    ]
    return [f"worse at another moment: {', '.join(said)}"] if said else []


def describe_avoidability(
    event: Event, rows: Sequence[Mapping[str, Any]], names: Mapping[int, str]
) -> list[str]:
    """What each party of an event would have needed to avoid it, in one line at most."""
    parties = []
    for row in rows:
        key = (row["event"], row["time"], {row["agent"], row["other"]})
        if key != (event.type, event.time, {event.from_, event.to}):
            continue
        name = names.get(row["agent"], f"agent {row['agent']}")
        if not row["avoidable"]:
            parties.append(f"{name} could not ({row['why_not']})")
        elif row["after_reaction"] == 0.0:
            parties.append(f"{name} at the speed it had at {row['visible_from']:.1f} s")
        else:
            parties.append(
                f"{name} braking at {row['needed_braking']:.1f} m/s² from "
                f"{row['visible_from']:.1f} s on ({row['after_reaction']:.1f} after 1 s)"
            )
    return [f"to avoid it: {', '.join(parties)}"] if parties else []


def name_agent(scene: SceneRecord, number: int) -> str:
    """An agent by name, with what the instruction calls it and its way."""
    agent = next((each for each in scene.agents if each.id == number), None)
    if agent is None:
        return f"agent {number}"
    way = f"{agent.entry} to {agent.exit}"
    if agent.crosswalk is not None:
        way = f"{agent.crosswalk} crosswalk"
    elif agent.type == "pedestrian":
        way = "jaywalking"
    called = call_agents(scene)[number]  # "the taxi"; "car 1" says no more than its class
    what = called[4:] if called.startswith("the ") else agent.subtype or agent.type
    known = "" if what == agent.type else f"{format_one_line(what, limit=30)}, "
    return f"{format_one_line(agent.name, limit=40)} ({known}{way})"


def place(spot: Point, intersection_map: IntersectionMap) -> str:
    """Where a place [m] is, as people say it."""
    point = geos.Point(spot)
    for crosswalk in intersection_map.crosswalks:
        if geos.Polygon(crosswalk.polygon).distance(point) <= KERB:
            return f"on the {crosswalk.leg} crosswalk"
    lanelet = min(
        intersection_map.lanelets,
        key=lambda each: float(geos.LineString(each.centreline).distance(point)), default=None,
    )  # fmt: skip
    if lanelet is None or lanelet.leg is None:
        return "in the junction"
    return f"on the {lanelet.leg} leg"


def _describe_unasked_runs(scene: SceneRecord, proof: Proof) -> list[str]:
    """Red lights that are run without being asked for."""
    names = {agent.id: agent.name for agent in scene.agents}
    return [
        f"{run['time']:.1f} s: {names.get(run['agent'], run['agent'])} runs a red light, which was "
        "not asked for: no lawful scene was found"
        for run in proof.figures.get("unasked_red_light_runs", ())
    ]


def _describe_object(
    each: ObjectRecord, scene: SceneRecord, proof: Proof, intersection_map: IntersectionMap
) -> str:
    """Where an object is, who meets it, and when the agents that it hides are first seen."""
    what = f"{each.kind} {each.subtype or ''}".replace("_", "-").strip()
    names = {agent.id: agent.name for agent in scene.agents}
    seen = [f for f in proof.figures.get("first_visible", ()) if f["object"] == each.id]
    hides = "".join(
        f"; hides {names[figure['subject']]} from {names[figure['observer']]} until "
        f"{figure['before_event']:.1f} s before"
        for figure in seen
    )
    met = "".join(
        f"; {get_kind('encounter', figure['how']).say(names[figure['agent']], 'it')} "
        f"at {figure['time']:.1f} s"
        for figure in proof.figures.get("encounters", ())
        if figure["object"] == each.id
    )
    stands = "stands" if each.since is None else f"opens at {each.since:.1f} s"
    return f"{each.id} ({what}) {stands} {place((each.x, each.y), intersection_map)}{hides}{met}"


def _describe_background(scene: SceneRecord) -> str:
    counts = Counter(agent.type for agent in scene.agents if agent.role == "background")
    vehicles, walkers = counts["vehicle"], counts["pedestrian"]
    meta = scene.meta
    return (
        f"background: {count(vehicles, 'vehicle')}, {count(walkers, 'pedestrian')}; "
        f"{format_one_line(meta.time_of_day, limit=20)}, {meta.duration:g} s, seed {meta.seed}"
    )
