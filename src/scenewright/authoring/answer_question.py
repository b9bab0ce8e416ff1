"""Questions about a scene, answered from its tracks, its lights and its proof alone."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from scenewright.authoring.scene_motion import (
    Motion,
    describe_side,
    find_closest,
    measure_distance,
)
from scenewright.backends.offline import CLASSES, WORDS
from scenewright.geometry.map_areas import geos
from scenewright.scene.events import Event, Proof
from scenewright.scene.kinds import has_trait
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import AgentRecord, SceneRecord, SignalRecord

KERB = 1.0
"""How far [m] outside a crosswalk a place still counts as on it."""
KMH, MPH = 3.6, 2.2369
TOPICS: str = WORDS["answer_question"]["can_answer"]
_VERBS: dict[str, str] = WORDS["answer_question"]["verbs"]
_FIGURES: dict[str, str] = WORDS["answer_question"]["figures"]
_NOUNS = {noun: subtype or kind for noun, (kind, subtype) in CLASSES.items()}
_NOUNS |= {"police": "police_car", "fire": "fire_engine"}
_NOUNS |= dict.fromkeys(("her", "him", "she", "he"), "pedestrian")
"""Noun or pronoun -> class or subtype."""


@dataclass(frozen=True, eq=False)
class _SceneFacts:
    record: SceneRecord
    proof: Proof
    intersection_map: IntersectionMap
    plain: str = ""

    def move(self, agent: AgentRecord) -> Motion:
        """How the agent moved."""
        return Motion(agent, self.record.meta.step)

    def get_agent(self, number: int | None) -> AgentRecord | None:
        return next((agent for agent in self.record.agents if agent.id == number), None)

    def list_named(self) -> list[AgentRecord]:
        return [agent for agent in self.record.agents if agent.role == "foreground"]


_Answer = Callable[[_SceneFacts, list[AgentRecord]], list[str]]


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
    plain = " ".join(words.lower().rstrip(" ?.!").split())
    if _PET.search(plain) and topic != "q_define":
        topic = "q_close"
    scene = _SceneFacts(record, proof, intersection_map, plain)
    answer = _say("The scene has no answer to that.", TOPICS)
    if set(re.findall(r"[a-z]+", plain)) <= {*_NOUNS, "the", "and", "a"}:
        answer = _join(_describe_routes, _describe_speeds, _describe_lights)
    patterns = WORDS["answer_question"]["topics"] if topic not in _ANSWERS else ()
    asked = (name for name, pattern in patterns if re.search(rf"\b(?:{pattern})", plain))
    answer = _ANSWERS.get(next(asked, topic or ""), answer)
    return [*_find_absent(plain, scene), *answer(scene, _find_agents(plain, scene))]


def _find_agents(plain: str, scene: _SceneFacts) -> list[AgentRecord]:
    """The agents that a question names by id or noun; those of the instruction if it names none."""
    by_id = [agent for agent in scene.record.agents if re.search(rf"\b{agent.name}\b", plain)]
    nouns = {_NOUNS[word] for word in re.findall(r"[a-z]+", plain) if word in _NOUNS}
    by_noun = [each for each in scene.list_named() if {each.type, each.subtype} & nouns]
    if re.search(r"\b(?:bikes?|riders?)\b", plain) and not by_noun:
        by_noun = [each for each in scene.list_named() if each.subtype == "motorcycle"]
    driven = [each for each in scene.list_named() if each.type == "vehicle" and "car" in nouns]
    return by_id or by_noun or driven or scene.list_named() or list(scene.record.agents)[:3]


def _find_absent(plain: str, scene: _SceneFacts) -> list[str]:
    """A line for every kind of road user that the question names and that is not there."""
    there = {kind for each in scene.record.agents for kind in (each.type, each.subtype)}
    there |= {"car", "vehicle"} if "vehicle" in there else set()
    there |= {"truck"} if "van" in there else set()
    nouns = [word for word in re.findall(r"[a-z]+", plain) if word in _NOUNS]
    there |= {"cyclist"} if "motorcycle" in there else set()  # both are called a bike
    missing = [noun for noun in dict.fromkeys(nouns) if _NOUNS[noun] not in there]
    return [f"There is no {noun} in this scene." for noun in missing]


def _name(agent: AgentRecord | None, number: int | None = None) -> str:
    if agent is None:
        return f"agent {number}"
    return f"{agent.name} ({agent.subtype})" if agent.subtype else agent.name


def _find_time(scene: _SceneFacts, agent: AgentRecord) -> float | None:
    """When the first event of this agent happens [s]; that of the scene where it has none."""
    own = [e.time for e in scene.proof.events if agent.id in (e.from_, e.to)]
    return min(own or [e.time for e in scene.proof.events], default=None)


def _describe_events(scene: _SceneFacts, _about: list[AgentRecord]) -> list[str]:
    lines = [_describe_event(scene, event) for event in scene.proof.events]
    if re.search(WORDS["answer_question"]["touch"], scene.plain):
        kinds = {event.type for event in scene.proof.events}
        lines.insert(0, "Yes, they touch." if "collision" in kinds else "No, there is no contact.")
    return lines or [
        "Nothing happens: no collision, near miss or giving way, only ordinary traffic."
    ]


def _describe_event(scene: _SceneFacts, event: Event) -> str:
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


def _describe_closeness(scene: _SceneFacts, about: list[AgentRecord]) -> list[str]:
    lines = []
    for event in scene.proof.events:
        figures = [_FIGURES[key].format(event.evidence[key]) for key in _FIGURES
                   if isinstance(event.evidence.get(key), float)]  # fmt: skip
        lines.append(_describe_event(scene, event))
        lines += [f"  {figure}" for figure in figures]
    if _PET.search(scene.plain) and not any(
        "pet" in event.evidence for event in scene.proof.events
    ):
        lines.append("None of them leaves a place that another comes to: there is no PET.")
    return [*lines, *_describe_distances(scene, about)] or _describe_events(scene, [])


_PET = re.compile(r"\bpet\b|\bpost.?encroachment")


def _describe_distances(scene: _SceneFacts, about: list[AgentRecord]) -> list[str]:
    """How far two agents are apart: at the least, and when either brakes or comes in."""
    pair = _find_pair(scene, about)
    if pair is None:
        return []
    one, other = (scene.move(each) for each in pair)
    closest = find_closest(one, other)
    if closest is None:
        return [f"{_name(pair[0])} and {_name(pair[1])} are never there at the same time."]
    names = f"{_name(pair[0])} and {_name(pair[1])}"
    lines = [f"{names} are nearest at {closest[0]:.1f} s, {closest[1]:.1f} m apart."]
    for each in (one, other):
        visit, brakes = each.find_visit(scene.intersection_map), each.find_braking_start()
        for what, time in (("begins to brake", brakes), ("comes in", visit and visit[0])):
            apart = None if time is None else measure_distance(one, other, time)
            if apart is not None:
                lines.append(f"  when {_name(each.agent)} {what} ({time:.1f} s): {apart:.1f} m")
    return lines


def _find_pair(scene: _SceneFacts, about: list[AgentRecord]) -> list[AgentRecord] | None:
    """The two that are asked about: those named, else one named and the one it meets."""
    if len(about) == 2:
        return about
    for event in scene.proof.events:
        pair = [each for n in (event.from_, event.to) if (each := scene.get_agent(n)) is not None]
        if len(pair) == 2 and (len(about) != 1 or about[0] in pair):
            return pair
    named = scene.list_named()
    others = [each for each in named if each not in about]
    return [about[0], others[0]] if len(about) == 1 and len(others) == 1 else None


def _describe_speeds(scene: _SceneFacts, about: list[AgentRecord]) -> list[str]:
    lines = []
    for agent in about:
        motion, time = scene.move(agent), _find_time(scene, agent)
        speed, brakes = motion.speed, motion.find_braking_start()
        line = f"{_name(agent)} goes at {_format_speed(speed.max(), scene.plain)} at the most"
        for what, when in (("when it begins to brake", brakes), ("when it happens", time)):
            at = None if when is None else motion.index(when)
            if at is not None:
                line += f", at {_format_speed(speed[at], scene.plain)} {what} ({when:.1f} s)"
        lines.append(f"{line}, and at {_format_speed(speed.min(), scene.plain)} at the least.")
    if len(about) > 1 and re.search(r"\bwho(?:se)?\b|\bwhich\b|\bfaster|\bcompare", scene.plain):
        most = {_name(each): scene.move(each).speed.max() for each in about}
        first = max(most, key=lambda name: most[name])
        lines.insert(0, f"{first} is the fastest, with {_format_speed(most[first], scene.plain)}.")
    return lines


def _format_speed(value: float, plain: str = "") -> str:
    if re.search(r"\bmph\b|\bmiles\b", plain):
        return f"{value * MPH:.0f} mph ({value * KMH:.0f} km/h)"
    return f"{value:.1f} m/s ({value * KMH:.0f} km/h)"


def _describe_braking(scene: _SceneFacts, about: list[AgentRecord]) -> list[str]:
    lines = []
    for agent in about:
        motion = scene.move(agent)
        starts, stops = motion.find_braking_start(), motion.list_stops()
        line = f"{_name(agent)} does not slow"
        if starts is not None:
            at, hardest = motion.index(starts), int(motion.slowing.argmax())
            speed = _format_speed(motion.speed[at or 0], scene.plain)
            line = (
                f"{_name(agent)} begins to brake at {starts:.1f} s, from {speed}, and slows "
                f"hardest at {motion.times[hardest]:.1f} s, by {motion.slowing[hardest]:.1f} m/s²"
            )
        spans = ", ".join(f"from {a:.1f} to {b:.1f} s" for a, b in stops)
        total = sum(b - a for a, b in stops)
        stands = f"it stands for {total:.1f} s ({spans})" if stops else "it never stands still"
        lines.append(f"{line}; {stands}.")
    return lines


def _describe_order(scene: _SceneFacts, about: list[AgentRecord]) -> list[str]:
    """Who comes onto the junction first, and who leaves it first."""
    pair = about if len(about) > 1 else (_find_pair(scene, about) or about)
    visits = [
        (visit[0], visit[1], _name(each))
        for each in pair
        if (visit := scene.move(each).find_visit(scene.intersection_map)) is not None
    ]
    lines = [f"{name} comes in at {a:.1f} s and is out at {b:.1f} s." for a, b, name in
             sorted(visits)]  # fmt: skip
    if len(visits) > 1:
        (first, _, who), (second, _, _) = sorted(visits)[:2]
        lines.insert(0, f"{who} is first in, {second - first:.1f} s before the next.")
        leaves = min(visits, key=lambda each: each[1])
        lines.append(f"{leaves[2]} is the first to be out again.")
    return lines or _describe_events(scene, about)


def _describe_sides(scene: _SceneFacts, about: list[AgentRecord]) -> list[str]:
    """On which side either of two sees the other, when they are nearest."""
    pair = _find_pair(scene, about)
    closest = None if pair is None else find_closest(*(scene.move(each) for each in pair))
    if pair is None or closest is None:
        return _describe_places(scene, about)
    lines = []
    for one, other in (pair, pair[::-1]):
        side = describe_side(scene.move(one), scene.move(other), closest[0])
        lines.append(f"At {closest[0]:.1f} s {_name(one)} has {_name(other)} {side}, "
                     f"{closest[1]:.1f} m away.")  # fmt: skip
    return [*lines, *_describe_routes(scene, about)]


def _describe_story(scene: _SceneFacts, about: list[AgentRecord]) -> list[str]:
    """What happens, in the order of time."""
    story: list[tuple[float, str]] = []
    for agent in scene.list_named() or about:
        motion, name = scene.move(agent), _name(agent)
        way = f"{agent.entry} to {agent.exit}, {agent.movement}"
        story.append((float(motion.times[0]), f"{name} comes into the scene ({way})."))
        if (starts := motion.find_braking_start()) is not None:
            story.append((starts, f"{name} begins to brake."))
        for begins, ends in motion.list_stops():
            story += [(begins, f"{name} stands."), (ends, f"{name} moves again.")]
        if (visit := motion.find_visit(scene.intersection_map)) is not None:
            where = f"the {agent.crosswalk} crosswalk" if agent.crosswalk else "the junction"
            story += [(visit[0], f"{name} comes onto {where}."), (visit[1], f"{name} is across.")]
    story += [(e.time, _describe_event(scene, e).partition(" s ")[2]) for e in scene.proof.events]
    return [f"{time:4.1f} s: {what}" for time, what in sorted(story)]


def _explain_what_if(scene: _SceneFacts, about: list[AgentRecord]) -> list[str]:
    """What would have been is another scene: how this one is, and how to make that one."""
    name = about[0].name if about else "vehicle-1"
    return [
        "I cannot tell what would have been, only what is in a scene that was made and checked.",
        f'To see it, say it: "let {name} drive at 30 km/h", "make {name} slower", "{name} stops". '
        "Here it is like this:",
        *_describe_events(scene, about), *_describe_braking(scene, about),
    ]  # fmt: skip


def list_formats() -> list[str]:
    """What a scene can be written as."""
    from scenewright.tools.formats import FORMATS

    names = ", ".join(sorted(FORMATS))
    return [
        "/save writes scene.json and proof.json; /html, /gif and /mp4 write something to look at.",
        f"`scenewright export FOLDER --to FORMAT --out DIR` writes one of: {names}.",
    ]


def _describe_routes(_scene: _SceneFacts, about: list[AgentRecord]) -> list[str]:
    lines = []
    for agent in about:
        way = f"comes from the {agent.entry}, goes to the {agent.exit} ({agent.movement})"
        over = f", over the {agent.crosswalk} crosswalk" if agent.crosswalk else ""
        lines.append(f"{_name(agent)} {way}{over}.")
    return lines


def _describe_lights(scene: _SceneFacts, about: list[AgentRecord]) -> list[str]:
    if not scene.record.signals:
        return ["There are no traffic lights here."]
    lines = []
    for leg in dict.fromkeys(re.findall(r"\b(north|south|east|west)\b", scene.plain)):
        stops = {line.id for line in scene.intersection_map.stop_lines if line.leg == leg}
        rows = [row for row in scene.record.signals if row.stop_line in stops]
        time = min((event.time for event in scene.proof.events), default=None)
        if rows:  # as it is when something happens
            lines.append(f"The light for traffic from the {leg} {_describe_rows(rows, time)}.")
    return lines + [line for agent in about for line in _describe_light(scene, agent)]


def _describe_rows(rows: Sequence[SignalRecord], time: float | None) -> str:
    phases = ", ".join(f"{row.colour} {row.start:.0f}-{row.end:.0f} s" for row in rows)
    now = next((r for r in rows if time is not None and r.start <= time < r.end), None)
    if now is None or time is None:
        return f"shows {phases}"
    return f"is {now.colour} at {time:.1f} s, for {time - now.start:.1f} s by then ({phases})"


def _describe_light(scene: _SceneFacts, agent: AgentRecord) -> list[str]:
    plan = scene.intersection_map
    if agent.type == "vehicle" or agent.crosswalk is None:
        names = {line.id for line in plan.stop_lines if line.leg == agent.entry}
    else:
        names = {walk.id for walk in plan.crosswalks if walk.leg == agent.crosswalk}
    rows = [row for row in scene.record.signals if (row.crosswalk or row.stop_line) in names]
    if not rows:
        return [f"No light concerns {_name(agent)}."]
    lines = [f"The light of {_name(agent)} {_describe_rows(rows, _find_time(scene, agent))}"]
    visit = scene.move(agent).find_visit(scene.intersection_map)
    for what, time in zip(("comes in", "is out again"), visit or (), strict=False):
        row = next((r for r in rows if r.start <= time < r.end), None)
        if row is not None:
            lines.append(f"{row.colour} when it {what} ({time:.1f} s)")
    ran = ["it runs a red light"] if agent.violates_signal else []
    return ["; ".join([*lines, *ran]) + "."]


def _describe_counts(scene: _SceneFacts, about: list[AgentRecord]) -> list[str]:
    named = ", ".join(_name(each) for each in scene.list_named()) or "none"
    kinds = Counter(e.subtype or e.type for e in scene.record.agents if e.role == "background")
    others = ", ".join(f"{kind}: {count}" for kind, count in sorted(kinds.items())) or "none"
    lines = [f"In the event: {named}.", f"Besides: {others}; {len(scene.record.agents)} in all."]
    return [*lines, *(_describe_followers(scene, about) if "behind" in scene.plain else [])]


def _describe_followers(scene: _SceneFacts, about: list[AgentRecord]) -> list[str]:
    """Who drives behind each, when it happens."""
    lines = []
    for agent in about:
        time, motion = _find_time(scene, agent), scene.move(agent)
        behind = [
            (apart, _name(each))
            for each in scene.record.agents
            if time is not None and each is not agent and each.entry == agent.entry
            and (describe_side(motion, scene.move(each), time) or "").find("behind") >= 0
            and (apart := measure_distance(motion, scene.move(each), time)) is not None
        ]  # fmt: skip
        nearest = f"{min(behind)[1]}, {min(behind)[0]:.0f} m" if behind else "none"
        lines.append(f"Behind {_name(agent)}: {nearest}.")
    return lines


def _describe_time(scene: _SceneFacts, about: list[AgentRecord]) -> list[str]:
    meta = scene.record.meta
    clock = f"The scene is at {meta.time_of_day} and lasts {meta.duration:g} s."
    visits = [
        f"{_name(each)} comes in at {visit[0]:.1f} s and is across at {visit[1]:.1f} s, "
        f"{visit[1] - visit[0]:.1f} s later."
        for each in about[:4]
        if (visit := scene.move(each).find_visit(scene.intersection_map)) is not None
    ]
    return [*_describe_events(scene, about), *visits, clock]


def _describe_fault(scene: _SceneFacts, _about: list[AgentRecord]) -> list[str]:
    if not scene.proof.events:
        return _describe_events(scene, [])
    return [line for event in scene.proof.events for line in (_describe_event(scene, event),
            f"  {_find_fault(scene, event)}")]  # fmt: skip


def _find_fault(scene: _SceneFacts, event: Event) -> str:
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
    if any(
        has_trait("manoeuvre", r.manoeuvre, "chain") and r.from_ == event.from_
        for r in scene.record.relations
    ):
        return f"{_name(scene.get_agent(event.from_))} stood there, and was pushed into it."
    if event.kind == "rear_end" or event.type == "follow":
        return f"{_name(scene.get_agent(event.from_))} drove behind and had to keep its distance."
    turning = [
        a for a in pair if a.type != "pedestrian" and a.movement in ("left", "right", "uturn")
    ]
    if len(turning) == 1:
        return f"{_name(turning[0])} turned across the other's way and had to give way."
    return "The tracks show no rule broken."


def _describe_danger(scene: _SceneFacts, about: list[AgentRecord]) -> list[str]:
    kinds = {event.type for event in scene.proof.events}
    first = "No: the checker found neither a collision nor a near miss among those asked for."
    for kind, does in (("near_miss", "it is a near miss"), ("collision", "they collide")):
        first = f"Yes: {does}." if kind in kinds else first
    return [first, *_describe_closeness(scene, about)]


def _describe_speed_limit(scene: _SceneFacts, about: list[AgentRecord]) -> list[str]:
    limits = sorted({lane.speed_limit for lane in scene.intersection_map.lanelets})
    limit = " to ".join(_format_speed(each) for each in (limits[0], limits[-1])[: len(limits)])
    return [f"The speed limit here is {limit}.", *_describe_speeds(scene, about)]


def _describe_kinds(_scene: _SceneFacts, about: list[AgentRecord]) -> list[str]:
    return [f"{each.name} is a {each.subtype or each.type}." for each in about]


def define_terms() -> list[str]:
    """What the figures mean."""
    return [*WORDS["answer_question"]["terms"]]


def _describe_sight(scene: _SceneFacts, about: list[AgentRecord]) -> list[str]:
    seen = [
        f"{_name(scene.get_agent(each['observer']))} first sees "
        f"{_name(scene.get_agent(each['subject']))} at {each['first_visible']:.1f} s."
        for each in scene.proof.figures.get("first_visible", [])
    ]
    hidden = [
        scene_object for scene_object in scene.record.objects if scene_object.height == "high"
    ]
    free = "No object stands between them all the time; blind spots of mirrors are not modelled."
    return [*_describe_events(scene, about), *(seen or ([] if hidden else [free]))]


def _describe_proof(scene: _SceneFacts, _about: list[AgentRecord]) -> list[str]:
    return [
        "A checker that shares no code with the generator found this on the finished tracks:",
        *_describe_closeness(scene, []),
        "Motion keeps to limits of acceleration and braking fitted to recorded traffic.",
        "The traffic itself is simulated: it did not happen.",
    ]


def _say(*lines: str) -> _Answer:
    """The answer that is the same for all scenes."""
    return lambda _scene, _about: [*lines]


def _join(*answers: _Answer) -> _Answer:
    """Several answers, one after the other."""
    return lambda scene, about: [line for each in answers for line in each(scene, about)]


_describe_places = _join(_describe_routes, _describe_events)
_explain_no_weather = _say(
    "There is no weather here: the road is dry and all agents see equally far."
)
_ANSWERS: dict[str, _Answer] = {
    "q_what": _describe_events, "q_speed": _describe_speeds, "q_brake": _describe_braking,
    "q_close": _describe_closeness, "q_define": lambda _scene, _about: define_terms(),
    "q_who": _join(_describe_counts, _describe_kinds),
    "q_where": _describe_places, "q_when": _describe_time, "q_light": _describe_lights,
    "q_danger": _describe_danger, "q_fault": _describe_fault,
    "q_why": _join(_describe_fault, _describe_braking),
    "q_sight": _describe_sight, "q_limit": _describe_speed_limit, "q_weather": _explain_no_weather,
    "q_proof": _describe_proof, "q_order": _describe_order, "q_what_if": _explain_what_if,
    "q_story": _describe_story, "q_formats": lambda _scene, _about: list_formats(),
    "age": _join(_say("Pedestrians have no age or sex here; all are about as wide."),
                 _describe_counts),
    "kind": _join(_describe_kinds, _describe_routes), "side": _describe_sides,
    "usage": _say(TOPICS, 'Or say what shall be different: "make the car a truck", "have it be a '
                          'collision".'),
    "count": _describe_counts, "route": _describe_routes,
    "all": _join(_describe_closeness, _describe_counts),
}  # fmt: skip
"""Topics of questions, as the model of turns (`q_...`) or the vocabulary names them."""
