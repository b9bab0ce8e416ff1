"""Questions about a scene, answered from its tracks, its lights and its proof alone."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from scenewright.geometry.map_areas import geos
from scenewright.scene.base import FloatArray
from scenewright.scene.events import Event, Proof
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import AgentRecord, SceneRecord

STANDS = 0.3
"""Speed [m/s] up to which an agent stands (SEMANTICS section 4)."""
BRAKES = 2.0
"""Deceleration [m/s^2] from which it is called braking here."""
KERB = 1.0
"""How far [m] outside a crosswalk a place still counts as on it."""
KMH = 3.6
TOPICS = (
    "I can answer: what happens, when, where and how close; how fast each goes, whether it brakes "
    "or stops; where each comes from and goes to; the lights; who was there; who had to give way."
)
_VERBS = {
    "yielding": "yields to", "follow": "follows", "collision": "collides with",
    "near_miss": "has a near miss with",
}  # fmt: skip
_FIGURES = {
    "pet": "{:.1f} s between them at the place (PET)", "clearance": "{:.1f} m apart at the closest",
    "path_ttc": "{:.1f} s to a collision at the worst (TTC along their ways)",
    "relative_speed": "contact at {:.1f} m/s", "drac": "{:.1f} m/s² of braking needed",
    "least_gap": "least gap {:.1f} m", "least_headway": "least headway {:.1f} s",
}  # fmt: skip
_WORDS = {
    "car": "car", "vehicle": "vehicle driver", "truck": "truck lorry", "van": "van", "bus": "bus",
    "taxi": "taxi cab", "ambulance": "ambulance", "police_car": "police", "fire_engine": "fire",
    "motorcycle": "motorcycle motorbike", "cyclist": "cyclist bike bicycle", "scooter": "scooter",
    "pedestrian": "pedestrian walker man woman child person her him she he",
}  # fmt: skip
_NOUNS = {word: kind for kind, words in _WORDS.items() for word in words.split()}
"""Noun or pronoun -> class or subtype."""


@dataclass(frozen=True, eq=False)
class _Scene:
    record: SceneRecord
    proof: Proof
    intersection_map: IntersectionMap

    def get_agent(self, number: int | None) -> AgentRecord | None:
        return next((each for each in self.record.agents if each.id == number), None)

    def list_named(self) -> list[AgentRecord]:
        return [each for each in self.record.agents if each.role == "foreground"]


_Answer = Callable[[_Scene, list[AgentRecord]], list[str]]


def answer_question(
    words: str,
    record: SceneRecord,
    proof: Proof,
    intersection_map: IntersectionMap,
    *,
    topic: str | None = None,
) -> list[str]:
    """Lines that answer the question; where its topic is none of ours, what can be answered.

    Args:
        topic: as the model of turns names it, such as `q_speed`; None: found by the words alone.
    """
    scene = _Scene(record, proof, intersection_map)
    plain = " ".join(words.lower().rstrip(" ?.!").split())
    about = _find_agents(plain, scene)
    if topic in _BY_TOPIC:
        return _BY_TOPIC[topic](scene, about)
    for pattern, answer in _TOPICS:
        if re.search(rf"\b(?:{pattern})", plain):
            return answer(scene, about)
    if set(re.findall(r"[a-z]+", plain)) <= {*_NOUNS, "the", "and", "a"}:
        return [
            *_describe_routes(scene, about),
            *_describe_speeds(scene, about),
            *_describe_lights(scene, about),
        ]
    return ["The scene has no answer to that.", TOPICS]


def _find_agents(plain: str, scene: _Scene) -> list[AgentRecord]:
    """The agents that a question names by id or noun; those of the instruction if it names none."""
    by_id = [each for each in scene.record.agents if re.search(rf"\b{each.name}\b", plain)]
    nouns = {_NOUNS[word] for word in re.findall(r"[a-z]+", plain) if word in _NOUNS}
    by_noun = [each for each in scene.list_named() if {each.type, each.subtype} & nouns]
    driven = [each for each in scene.list_named() if each.type == "vehicle" and "car" in nouns]
    return by_id or by_noun or driven or scene.list_named() or list(scene.record.agents)[:3]


def _name(agent: AgentRecord | None, number: int | None = None) -> str:
    if agent is None:
        return f"agent {number}"
    return f"{agent.name} ({agent.subtype})" if agent.subtype else agent.name


def _compute_speeds(agent: AgentRecord, step: float) -> FloatArray:
    """[T] speed [m/s] of every sample."""
    xy = np.array(agent.trajectory)
    if len(xy) < 2:
        return np.zeros(len(xy))
    return np.asarray(np.linalg.norm(np.gradient(xy, step, axis=0), axis=1))


def _find_time(scene: _Scene, agent: AgentRecord) -> float | None:
    """When the first event of this agent happens [s]; that of the scene where it has none."""
    own = [e.time for e in scene.proof.events if agent.id in (e.from_, e.to)]
    return min(own or [e.time for e in scene.proof.events], default=None)


def _describe_events(scene: _Scene, _about: list[AgentRecord]) -> list[str]:
    lines = [_describe_event(scene, event) for event in scene.proof.events]
    return lines or [
        "Nothing happens: no collision, near miss or giving way, only ordinary traffic."
    ]


def _describe_event(scene: _Scene, event: Event) -> str:
    first, second = (_name(scene.get_agent(n), n) for n in (event.from_, event.to))
    kind = f" ({event.kind.replace('_', ' ')})" if event.kind else ""
    where = _describe_place(event.location, scene.intersection_map)
    return f"At {event.time:.1f} s {first} {_VERBS[event.type]} {second}{kind}, {where}."


def _describe_place(spot: tuple[float, float], intersection_map: IntersectionMap) -> str:
    at = geos.points(spot)
    for walk in intersection_map.crosswalks:
        if geos.distance(geos.polygons(walk.polygon), at) <= KERB:
            return f"on the {walk.leg} crosswalk"
    for lane in intersection_map.lanelets:
        area = geos.make_valid(geos.polygons([*lane.left, *reversed(lane.right)]))
        if lane.leg is not None and geos.contains(area, at):
            return f"on the {lane.leg} leg"
    return "in the junction"


def _describe_closeness(scene: _Scene, _about: list[AgentRecord]) -> list[str]:
    lines = []
    for event in scene.proof.events:
        figures = [_FIGURES[key].format(event.evidence[key]) for key in _FIGURES
                   if isinstance(event.evidence.get(key), float)]  # fmt: skip
        lines.append(_describe_event(scene, event))
        lines += [f"  {each}" for each in figures]
    return lines or _describe_events(scene, [])


def _describe_speeds(scene: _Scene, about: list[AgentRecord]) -> list[str]:
    return [_describe_speed(scene, agent) for agent in about]


def _describe_speed(scene: _Scene, agent: AgentRecord) -> str:
    speed, time = _compute_speeds(agent, scene.record.meta.step), _find_time(scene, agent)
    line = f"{_name(agent)} goes at {_format_speed(speed.max())} at the most"
    if time is not None:
        at = round((time - agent.spawn_time) / scene.record.meta.step)
        if 0 <= at < len(speed):
            line += f", at {_format_speed(speed[at])} when it happens ({time:.1f} s)"
    return f"{line}, and at {_format_speed(speed.min())} at the least."


def _format_speed(value: float) -> str:
    return f"{value:.1f} m/s ({value * KMH:.0f} km/h)"


def _describe_braking(scene: _Scene, about: list[AgentRecord]) -> list[str]:
    return [_describe_agent_braking(scene, agent) for agent in about]


def _describe_agent_braking(scene: _Scene, agent: AgentRecord) -> str:
    step = scene.record.meta.step
    speed = _compute_speeds(agent, step)
    change = (speed[6:] - speed[:-6]) / (6 * step) if len(speed) > 6 else np.zeros(1)
    at = int(change.argmin())
    when = agent.spawn_time + (at + 3) * step
    slows = f"slows hardest at {when:.1f} s, by {-change[at]:.1f} m/s²"
    brakes = slows if -change[at] >= 0.3 else "does not slow"
    still = int((speed <= STANDS).sum()) * step
    return f"{_name(agent)} {brakes}; it stands for {still:.1f} s."


def _describe_routes(_scene: _Scene, about: list[AgentRecord]) -> list[str]:
    lines = []
    for agent in about:
        way = f"comes from the {agent.entry}, goes to the {agent.exit} ({agent.movement})"
        over = f", over the {agent.crosswalk} crosswalk" if agent.crosswalk else ""
        lines.append(f"{_name(agent)} {way}{over}.")
    return lines


def _describe_lights(scene: _Scene, about: list[AgentRecord]) -> list[str]:
    if not scene.record.signals:
        return ["There are no traffic lights here."]
    return [line for agent in about for line in _describe_light(scene, agent)]


def _describe_light(scene: _Scene, agent: AgentRecord) -> list[str]:
    names = _find_light_names(scene.intersection_map, agent)
    rows = [row for row in scene.record.signals if (row.crosswalk or row.stop_line) in names]
    if not rows:
        return [f"No light concerns {_name(agent)}."]
    phases = ", ".join(f"{row.colour} {row.start:.0f}-{row.end:.0f} s" for row in rows)
    ran = "; it runs a red light" if agent.violates_signal else ""
    time = _find_time(scene, agent)
    now = next((r.colour for r in rows if time is not None and r.start <= time < r.end), None)
    then = f"is {now} at {time:.1f} s ({phases})" if now is not None else f"shows {phases}"
    return [f"The light of {_name(agent)} {then}{ran}."]


def _find_light_names(intersection_map: IntersectionMap, agent: AgentRecord) -> set[str]:
    """The stop line of the agent's leg, or the crosswalk that it takes."""
    if agent.type == "vehicle" or agent.crosswalk is None:
        return {line.id for line in intersection_map.stop_lines if line.leg == agent.entry}
    return {walk.id for walk in intersection_map.crosswalks if walk.leg == agent.crosswalk}


def _describe_counts(scene: _Scene, _about: list[AgentRecord]) -> list[str]:
    named = ", ".join(_name(each) for each in scene.list_named()) or "none"
    kinds = Counter(e.subtype or e.type for e in scene.record.agents if e.role == "background")
    others = ", ".join(f"{kind}: {count}" for kind, count in sorted(kinds.items())) or "none"
    return [f"In the event: {named}.", f"Besides: {others}; {len(scene.record.agents)} in all."]


def _describe_time(scene: _Scene, about: list[AgentRecord]) -> list[str]:
    meta = scene.record.meta
    clock = f"The scene is at {meta.time_of_day} and lasts {meta.duration:g} s."
    return [*_describe_events(scene, about), clock]


def _describe_fault(scene: _Scene, _about: list[AgentRecord]) -> list[str]:
    if not scene.proof.events:
        return _describe_events(scene, [])
    return [line for event in scene.proof.events for line in (_describe_event(scene, event),
            f"  {_find_fault(scene, event)}")]  # fmt: skip


def _find_fault(scene: _Scene, event: Event) -> str:
    """Agents that broke a rule of the road as the tracks show; lawyers may see it otherwise."""
    pair = [each for n in (event.from_, event.to) if (each := scene.get_agent(n)) is not None]
    for agent in pair:
        if agent.violates_signal:
            return f"{_name(agent)} passed a red light."
    for agent in pair:
        if agent.movement == "jaywalking":
            return f"{_name(agent)} crossed away from the crosswalks."
    if event.type == "yielding":
        return "Neither: one gave way to the other."
    if event.kind == "rear_end" or event.type == "follow":
        return f"{_name(scene.get_agent(event.from_))} drove behind and had to keep its distance."
    turning = [
        a for a in pair if a.type != "pedestrian" and a.movement in ("left", "right", "uturn")
    ]
    if len(turning) == 1:
        return f"{_name(turning[0])} turned across the other's way and had to give way."
    return "The tracks show no rule broken."


def _describe_scene(scene: _Scene, about: list[AgentRecord]) -> list[str]:
    return [*_describe_closeness(scene, about), *_describe_counts(scene, about)]


def _describe_danger(scene: _Scene, about: list[AgentRecord]) -> list[str]:
    kinds = {event.type for event in scene.proof.events}
    first = (
        "Yes: they collide." if "collision" in kinds
        else "Yes: it is a near miss." if "near_miss" in kinds
        else "No: the checker found neither a collision nor a near miss among those asked for."
    )  # fmt: skip
    return [first, *_describe_closeness(scene, about)]


def _describe_speed_limit(scene: _Scene, about: list[AgentRecord]) -> list[str]:
    limits = sorted({lane.speed_limit for lane in scene.intersection_map.lanelets})
    limit = " to ".join(_format_speed(each) for each in (limits[0], limits[-1])[: len(limits)])
    return [f"The speed limit here is {limit}.", *_describe_speeds(scene, about)]


def _explain_no_weather(_scene: _Scene, _about: list[AgentRecord]) -> list[str]:
    return ["There is no weather here: the road is dry and all agents see equally far."]


def _explain_no_age(scene: _Scene, about: list[AgentRecord]) -> list[str]:
    return [
        "Pedestrians have no age or sex here; all are about as wide.",
        *_describe_counts(scene, about),
    ]


def _describe_kinds(scene: _Scene, about: list[AgentRecord]) -> list[str]:
    kinds = [f"{each.name} is a {each.subtype or each.type}." for each in about]
    return [*kinds, *_describe_routes(scene, about)]


def define_terms() -> list[str]:
    """What the figures mean."""
    return [
        "PET is the time from one leaving a place to the other coming to it [s]: less is closer.",
        "TTC is the time until they would touch if both went on as they do [s].",
        "DRAC is the braking that just avoids the collision [m/s²].",
        "Headway is the time by which one follows another [s].",
    ]


def _define_figures(_scene: _Scene, _about: list[AgentRecord]) -> list[str]:
    return define_terms()


def _describe_causes(scene: _Scene, about: list[AgentRecord]) -> list[str]:
    """Causes: the event, the agents that broke a rule, the motion of each."""
    lines = _describe_fault(scene, about)
    return [*lines, *_describe_braking(scene, about)]


def _describe_sight(scene: _Scene, about: list[AgentRecord]) -> list[str]:
    seen = [
        f"{_name(scene.get_agent(each['observer']))} first sees "
        f"{_name(scene.get_agent(each['subject']))} at {each['first_visible']:.1f} s."
        for each in scene.proof.figures.get("first_visible", [])
    ]
    hidden = [each for each in scene.record.objects if each.height == "high"]
    free = "Nothing stands between them: they can see one another all the time."
    return [*_describe_events(scene, about), *(seen or ([] if hidden else [free]))]


def _describe_proof(scene: _Scene, _about: list[AgentRecord]) -> list[str]:
    return [
        "A checker that shares no code with the generator found this on the finished tracks:",
        *_describe_closeness(scene, []),
        "Motion keeps to limits of acceleration and braking fitted to recorded traffic.",
    ]


def _describe_counts_and_kinds(scene: _Scene, about: list[AgentRecord]) -> list[str]:
    return [
        *_describe_counts(scene, about),
        *(f"{each.name} is a {each.subtype or each.type}." for each in about),
    ]


def _describe_places(scene: _Scene, about: list[AgentRecord]) -> list[str]:
    return [*_describe_routes(scene, about), *_describe_events(scene, about)]


def _list_topics(_scene: _Scene, _about: list[AgentRecord]) -> list[str]:
    return [
        TOPICS,
        'Or say what shall be different: "make the car a truck", "have it be a collision".',
    ]


_TOPICS: tuple[tuple[str, _Answer], ...] = (
    (r"(?:what(?:'s| is| does| are)|explain) (?:an? |the )?(?:pet|ttc|drac)\b", _define_figures),
    (r"speed limit|allowed to (?:go|drive)", _describe_speed_limit),
    (r"rain|snow|weather|wet\b|fog|icy?\b|slippery", _explain_no_weather),
    (r"(?:are|is) (?:there|any).*\b(?:kids?|child(?:ren)?|wom[ae]n|m[ae]n|old|elderly)\b|how "
     r"old", _explain_no_age),
    (r"(?:who|what)(?:'s| is| are) (?:she|he|her|him|it|they|them)$|(?:is|are) (?:that|it|this|"
     r"he|she|the \w+) "
     r"(?:really )?an? \w+", _describe_kinds),
    (r"what (?:else )?can (?:i|you|we)\b|what (?:could|should) i (?:say|ask)\b|how do i\b",
     _list_topics),
    (r"fault|blame|right of way|priority|had to (?:yield|give way)|guilty", _describe_fault),
    (r"lights?\b|signals?\b|green\b|red\b|yellow\b", _describe_lights),
    (r"danger|safe\b|risk|serious|severe|critical|how bad", _describe_danger),
    (r"(?:how|too) (?:fast|slow)\b|speed|km/?h\b|m/s\b|mph\b", _describe_speeds),
    (r"brak|stops?\b|stopped\b|slow|decelerat|stand|wait", _describe_braking),
    (r"how close|distance|apart\b|gap\b|pet\b|ttc\b|headway|near\b|close\b|far\b",
     _describe_closeness),
    (r"how many|(?:is|are) there|who else\b|how much traffic|busy\b|who(?:'s| is| are) in\b",
     _describe_counts),
    (r"where(?: (?:does|do|did|is|are)|'s) .*\b(?:comes?|coming|from|go|goes|going|head|heading)\b|"
     r"which way|turn(?:s|ing)?\b|direction", _describe_routes),
    (r"when\b|what time|how long|take so long|take that long|what hour|day or night\b|time of "
     r"day", _describe_time),
    (r"hit|touch|collid|crash|happen|where\b|miss|yield|give way|follow|whom?\b", _describe_events),
    (r"what is (?:this|that|there|it)\b|what do we have|what do i see|what's", _describe_scene),
)  # fmt: skip
"""Words of a question -> what answers it, the more special topic first."""
_BY_TOPIC: dict[str, _Answer] = {
    "q_what": _describe_events, "q_speed": _describe_speeds, "q_brake": _describe_braking,
    "q_close": _describe_closeness, "q_define": _define_figures,
    "q_who": _describe_counts_and_kinds,
    "q_where": _describe_places, "q_when": _describe_time, "q_light": _describe_lights,
    "q_danger": _describe_danger, "q_fault": _describe_fault, "q_why": _describe_causes,
    "q_sight": _describe_sight, "q_limit": _describe_speed_limit, "q_weather": _explain_no_weather,
    "q_proof": _describe_proof,
}  # fmt: skip
"""Intents of the model of turns -> what answers them."""
