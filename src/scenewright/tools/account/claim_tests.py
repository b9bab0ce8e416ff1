"""The tests of claims on a proven scene."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import shapely

from scenewright.scene.events import Event
from scenewright.scene.kinds import Axis, find_kind, get_kind, has_trait
from scenewright.tools.account.claims import (
    BACKGROUND,
    UNTESTED,
    Binding,
    Claim,
    Result,
    list_agents,
    list_pairs,
)
from scenewright.tools.account.facts import SceneFacts, fits_object
from scenewright.tools.account.vocabulary import Token
from scenewright.tools.relation_checker.clock import is_within
from scenewright.tools.relation_checker.legs import find_relative_side

_GEOS: Any = shapely
_TOUCHING = 5.0
"""Ways that end in a collision of two who come from legs at an angle are no farther apart [m]."""
TOGETHER = 5.0
"""Events that begin within so many seconds of one another happen at the same time [s]."""
LATE_BRAKING = 3.4
"""An agent that strikes another one although it brakes so hard brakes too late [m/s²]."""
CLOSE = 1.3
"""Who follows closely has no longer headway than this at the least [s]."""
CENTRE = 10.0
"""What happens within this distance of the middle happens in the centre [m]."""
CLOCK_SLACK = 20
"""How far the scene's clock may be from a time that is said [min]."""
SPEED_SLACK, STANDSTILL_SLACK = 0.52, 0.3
"""How far a speed [m/s] and the length of a standstill [s] may be from what is said."""
_STANDSTILL = 0.5
"""Who gives way and stops is no faster than this at the slowest [m/s]."""
LEAST_STANDSTILL = 0.4
"""Who stands for a shorter time has not stopped [s]."""
LEAST_TURN = 0.08
"""How far who turns has turned at least before its track ends [rad]; a right hook ends early."""
_PACES = {
    "vehicle": (7.0, 11.2), "pedestrian": (1.25, 1.9), "cyclist": (4.2, 6.2), "scooter": (3.8, 5.3),
}  # fmt: skip
"""Who keeps no more than the first of these is slow, who keeps the second is fast [m/s]."""
_BODY = ("front", "rear", "left", "right")
_CAR_SIDES = (
    {"passenger": "right", "driver": "left", "nearside": "right", "offside": "left"},
    {"passenger": "left", "driver": "right", "nearside": "left", "offside": "right"},
)
"""Words for the sides of a vehicle where traffic keeps right, and where it keeps left."""


def _list_all(binding: Binding, mentions: Iterable[int]) -> tuple[int, ...]:
    return tuple(dict.fromkeys(n for each in mentions for n in list_agents(binding, each)))


@dataclass(frozen=True)
class AllAgents:
    """Whether something holds of all agents of any of the mentions, or an object is on the leg."""

    mentions: tuple[int, ...]
    what: str
    holds: Callable[[SceneFacts, int], bool]
    leg: str | None = None

    def __call__(self, facts: SceneFacts, binding: Binding) -> Result:
        for mention in self.mentions:
            agents = list_agents(binding, mention)
            if agents and all(self.holds(facts, n) for n in agents):
                return Result(True, f"{self.what} of agent {_join(agents)}", agents)
            bound = binding.get(mention, frozenset()) - {BACKGROUND}
            objects = [n for n in bound if isinstance(n, str)]
            if self.leg and objects and all(facts.find_leg(n) == self.leg for n in objects):
                return Result(True, f"{_join(objects)} on the {self.leg} leg")
        looked = any(binding.get(mention) for mention in self.mentions)
        return Result(False, self.what) if looked else UNTESTED


@dataclass(frozen=True)
class PaceTest:
    """Whether an agent is fast, slow or over the speed limit; untested where it is neither.

    Attributes:
        pace: `fast`, `slow` or `speeding`.
    """

    mentions: tuple[int, ...]
    pace: str

    def __call__(self, facts: SceneFacts, binding: Binding) -> Result:
        for mention in self.mentions:
            agents = list_agents(binding, mention)
            kept = ((number, facts.compute_kept_speed(number)) for number in agents)
            speeds = [(number, speed) for number, speed in kept if speed is not None]
            if len(speeds) < max(len(agents), 1):
                continue
            found = [self._compare(facts, *speed) for speed in speeds]
            seen = ", ".join(f"agent {number} at {speed:.1f} m/s" for number, speed in speeds)
            holds = True if all(found) else False if False in found else None
            return Result(holds, seen, agents)
        return UNTESTED

    def _compare(self, facts: SceneFacts, number: int, speed: float) -> bool | None:
        """Whether a kept speed is as said; None where it is neither fast nor slow."""
        agent = facts.agents[number]
        slow, fast = _PACES[agent.type]
        limit = facts.find_speed_limit(number) if agent.type == "vehicle" else None
        if self.pace == "speeding" and limit is not None:
            return speed > limit
        if slow < speed < fast:
            return None
        return (speed >= fast) == (self.pace != "slow")


@dataclass(frozen=True)
class ProvenProperty:
    """Whether the checker proved a property of an agent that is meant, of any where none is."""

    mentions: tuple[int, ...]
    what: str
    value: str
    find: Callable[[SceneFacts, str], Iterable[int]]

    def __call__(self, facts: SceneFacts, binding: Binding) -> Result:
        found = set(self.find(facts, self.value))
        meant = _list_all(binding, self.mentions)
        shown = sorted(found.intersection(meant) if meant else found)
        if shown:
            return Result(True, f"{self.what} of agent {_join(shown)}")
        return Result(False, "none of these agents") if self.what == "cause" else UNTESTED


@dataclass(frozen=True)
class ClassTest:
    """Whether what a mention stands for is of a class that its noun allows.

    Attributes:
        group: the noun is of several who walk together, "a couple".
    """

    mention: int
    classes: frozenset[str]
    group: bool

    def __call__(self, facts: SceneFacts, binding: Binding) -> Result:
        bound = binding.get(self.mention)
        if not bound:
            return Result(False, "no such agent")
        if BACKGROUND in bound:
            seen = 0 if self.group else facts.count_background(self.classes)
            return Result(seen > 0, f"{seen} in the background")
        agents = list_agents(binding, self.mention)
        objects = [scene_object for scene_object in facts.scene.objects if scene_object.id in bound]
        if not (
            all(facts.fits_class(n, self.classes) for n in agents)
            and all(fits_object(scene_object, self.classes) for scene_object in objects)
        ):
            return Result(False, "another class")
        named = ", ".join(
            f"agent {n} ({facts.agents[n].subtype or facts.agents[n].type})" for n in agents
        )
        return Result(True, named or _join(sorted(map(str, bound))), agents)


@dataclass(frozen=True)
class CountTest:
    """Whether a mention stands for as many as are said; None is two or more."""

    mention: int
    classes: frozenset[str]
    count: int | None

    def __call__(self, facts: SceneFacts, binding: Binding) -> Result:
        bound = binding.get(self.mention)
        if not bound:
            return Result(False, "no such agents")
        if BACKGROUND in bound:
            number = facts.count_background(self.classes)
            evidence = f"{number} in the background"
        else:
            number = sum(facts.count_members(n) if isinstance(n, int) else 1 for n in bound)
            evidence = f"{number} of them"
        return Result(number >= 2 if self.count is None else number == self.count, evidence)


@dataclass(frozen=True)
class OrdinalTest:
    """Whether "the last one" is last, and "the first" first, where agents follow one another."""

    word: str
    mention: int

    def __call__(self, facts: SceneFacts, binding: Binding) -> Result:
        own = set(list_agents(binding, self.mention))
        follows = [e for e in facts.events if e.type == "follow"]
        if self.word in ("last", "final") and own & {e.to for e in follows}:
            return Result(False, "another one follows it")
        if self.word in ("lead", "leading") and own & {e.from_ for e in follows}:
            return Result(False, "it follows another one")
        return Result(bool(own) or None, "a road user of its own")


@dataclass(frozen=True)
class ObjectTest:
    """Whether an object of a kind stands there."""

    mention: int
    kind: str
    classes: frozenset[str]
    several: bool

    def __call__(self, facts: SceneFacts, binding: Binding) -> Result:
        standing = facts.find_objects(self.kind)
        there = {o.id for o in standing if fits_object(o, self.classes)}
        if self.several and len(there) == 1:
            return Result(False, f"one {self.kind}")
        named = {n for n in binding.get(self.mention, ()) if isinstance(n, str)}
        if named:
            return Result(named <= there, f"{self.kind} {_join(sorted(named))}")
        evidence = f"{self.kind} {_join(sorted(there))}" if there else f"no {self.kind}"
        return Result(bool(there), evidence)


@dataclass(frozen=True)
class BackgroundTest:
    """Whether so many others are around; None is any number.

    Attributes:
        nobody: no road user of the classes may be there at all, "no pedestrians".
    """

    classes: frozenset[str]
    count: int | None
    nobody: bool

    def __call__(self, facts: SceneFacts, _binding: Binding) -> Result:
        seen = facts.count_background(self.classes)
        if self.nobody:
            classes = self.classes or frozenset({"any"})
            absent = not any(facts.fits_class(n, classes) for n in facts.foreground)
            return Result(seen == 0 and absent, f"{seen} of them")
        return Result(
            seen > 0 if self.count is None else seen == self.count, f"{seen} in the background"
        )


@dataclass(frozen=True)
class OthersTest:
    """Whether words such as "in the background" or "nobody else" fit those who are around."""

    denied: bool

    def __call__(self, facts: SceneFacts, _binding: Binding) -> Result:
        seen = facts.count_background()
        return Result(True, f"{seen} in the background") if self.denied == (seen == 0) else UNTESTED


@dataclass(frozen=True)
class EventTest:
    """Whether two of the parties have an event of a kind, in their roles where these are said.

    Attributes:
        stands: who gives way, or just avoids a collision, stops, as "stops for" says.
    """

    kind: str
    subjects: tuple[int, ...]
    objects: tuple[int, ...]
    directed: bool
    denied: bool
    stands: bool = False

    def __call__(self, facts: SceneFacts, binding: Binding) -> Result:
        pairs = list(list_pairs(binding, self.subjects, self.objects))
        together = [
            (first, second)
            for one in (*self.subjects, *self.objects)
            for first, second in list_pairs(binding, (one,), (one,))
            if first < second
        ]
        if not self.denied and (met := self._find_encounter(facts, binding)):
            return met
        found = self._find_between(facts, binding, pairs, together)
        if self.denied:
            if not (pairs or together):
                found = next((e for e in facts.proof.events if e.type == self.kind), None)
            return Result(found is None, f"no {self.kind}")
        found = found or self._find_of_one(facts, binding)
        if found is None:
            return Result(False, f"no {self.kind} of these agents")
        seen = f"{found.type} of {found.from_} and {found.to} at {found.time:.1f} s"
        return Result(True, seen, (found.from_, found.to), found)

    def _find_encounter(self, facts: SceneFacts, binding: Binding) -> Result | None:
        """What an agent does about an object: hits it, waits behind it."""
        parties = (*self.subjects, *self.objects)
        bound = {n for one in parties for n in binding.get(one, ())}
        for encounter in facts.scene.encounters:
            if makes_true("encounter", encounter.how, self.kind) and (
                encounter.agent in bound or not bound
            ):
                how = encounter.how.replace("_", " ")
                return Result(True, f"agent {encounter.agent} {how} {encounter.object}")
        return None

    def _find_between(
        self,
        facts: SceneFacts,
        binding: Binding,
        pairs: Sequence[tuple[int, int]],
        together: Sequence[tuple[int, int]],
    ) -> Event | None:
        """The event of two parties; of any two agents where a party or both are not named."""
        for pair in (*pairs, *together):
            for event in facts.list_between(*pair, (self.kind,)):
                if self.stands and not self._stops(facts, event):
                    continue
                if not self.directed or pair in together or facts.has_role(event, pair[0]):
                    return event
        if together or (self.subjects and self.objects):
            return None
        return next(self._list_of_anyone(facts, binding), None)

    def _list_of_anyone(self, facts: SceneFacts, binding: Binding) -> Iterator[Event]:
        """List events of any two agents, or those done to the named one: "give way to the bus"."""
        done_to = _list_all(binding, self.objects) or facts.foreground
        for first in facts.foreground:
            for second in done_to:
                for event in facts.list_between(first, second, (self.kind,)):
                    if not (self.directed and self.objects) or facts.has_role(event, first):
                        yield event

    def _stops(self, facts: SceneFacts, event: Event) -> bool:
        """Whether the agent that gives way, or either agent of a near miss, stands."""
        if self.kind == "yielding":
            return float(event.evidence["lowest_speed"]) <= _STANDSTILL
        return any(facts.stands(n) >= LEAST_STANDSTILL for n in (event.from_, event.to))

    def _find_of_one(self, facts: SceneFacts, binding: Binding) -> Event | None:
        """The event that one of the subjects has with whomever, where nothing else is named."""
        if self.objects:
            return None
        if not self.subjects:
            return next((e for e in facts.proof.events if e.type == self.kind), None)
        for agent in (n for one in self.subjects for n in list_agents(binding, one)):
            for event in facts.events:
                roles = (event.from_,) if self.directed else (event.from_, event.to)
                if event.type == self.kind and agent in roles:
                    return event
        return None


def check_centre(facts: SceneFacts, _binding: Binding) -> Result:
    """Whether something happens in the middle of the junction; untested where nothing does."""
    away = [math.hypot(*e.location) for e in facts.proof.events if e.type != "follow"]
    if not away:
        return UNTESTED
    return Result(min(away) <= CENTRE, f"{min(away):.0f} m from the middle")


@dataclass(frozen=True)
class SequenceTest:
    """Whether the events of two groups of claims come in a sequence.

    Attributes:
        overlap: they happen at the same time; loosely: words as "as", which also say when.
    """

    earlier: tuple[Claim, ...]
    later: tuple[Claim, ...]
    overlap: bool
    loosely: bool

    def __call__(self, facts: SceneFacts, binding: Binding) -> Result:
        ones, others = (
            {e.time: e for c in claims if (e := c.test(facts, binding).event) is not None}
            for claims in (self.earlier, self.later)
        )
        if not ones or not others or ones.keys() & others.keys():
            return UNTESTED
        early, late = ones[min(ones)], others[min(others)]
        seen = f"at {early.time:.1f} s and {late.time:.1f} s"
        if self.overlap:
            apart = max(early.time, late.time) - min(_get_end(early), _get_end(late))
            return Result(apart <= TOGETHER or self.loosely, seen)
        return Result(early.time <= _get_end(late) + 0.05, seen)


@dataclass(frozen=True)
class RedRunOrderTest:
    """Whether a red light is run after the event of claims, or before it."""

    claims: tuple[Claim, ...]
    subjects: tuple[int, ...]
    later: bool

    def __call__(self, facts: SceneFacts, binding: Binding) -> Result:
        agents = _list_all(binding, self.subjects)
        runs = [
            r["time"] for r in facts.proof.figures.get("red_light_runs", ()) if r["agent"] in agents
        ]
        events = [e.time for c in self.claims if (e := c.test(facts, binding).event) is not None]
        if not runs or not events:
            return UNTESTED
        seen = f"red is run at {runs[0]:.1f} s, the event is at {events[0]:.1f} s"
        return Result((max(runs) >= events[0]) == self.later, seen)


def _get_end(event: Event) -> float:
    return float(event.evidence.get("until", event.time))


def _pair_with_others(
    facts: SceneFacts, binding: Binding, subjects: tuple[int, ...]
) -> list[tuple[int, int]]:
    """Each agent that the subjects mean, with every other one of the foreground."""
    return [
        (agent, other)
        for subject in subjects
        for agent in list_agents(binding, subject)
        for other in facts.foreground
        if other != agent
    ]


@dataclass(frozen=True)
class OrderTest:
    """Whether one of the subjects passes before, or after, one of the others: of those named, or
    of all where only the subjects are."""

    subjects: tuple[int, ...]
    others: tuple[int, ...]
    late: bool

    def __call__(self, facts: SceneFacts, binding: Binding) -> Result:
        named = list(list_pairs(binding, self.subjects, self.others))
        pairs = named or _pair_with_others(facts, binding, self.subjects)
        orders = [facts.find_order(*pair) for pair in pairs]
        if (not self.late) in orders:
            return Result(True, "the order in which they pass")
        if self.late in orders:
            return Result(False, "they pass in the other order")
        return UNTESTED


@dataclass(frozen=True)
class TieTest:
    """Whether an agent comes from a side of another one: same, opposite, left or right."""

    subjects: tuple[int, ...]
    sides: tuple[str, ...]

    def __call__(self, facts: SceneFacts, binding: Binding) -> Result:
        pairs = _pair_with_others(facts, binding, self.subjects)
        for agent, other in pairs:
            entry, seen_from = facts.agents[agent].entry, facts.agents[other].entry
            seen = find_relative_side(entry, seen_from=seen_from)
            if seen in self.sides:
                return Result(True, f"agent {agent} comes from the {seen} side of {other}")
        return Result(False, "/".join(self.sides)) if pairs else UNTESTED


@dataclass(frozen=True)
class PathsCrossTest:
    """Whether the tracks of two of the agents meant cross."""

    mentions: tuple[int, ...]

    def __call__(self, facts: SceneFacts, binding: Binding) -> Result:
        pairs = list(list_pairs(binding, self.mentions, self.mentions))
        for pair in pairs:
            first, second = (facts.agents[number] for number in pair)
            one, two = (_GEOS.LineString(each.trajectory) for each in (first, second))
            side = find_relative_side(first.entry, seen_from=second.entry)
            across = side in ("left", "right") and one.distance(two) < _TOUCHING
            if across or (side != "same" and one.crosses(two)):
                return Result(True, f"the ways of {_join(pair)} cross", pair)
        return Result(False, "no ways that cross") if pairs else UNTESTED


@dataclass(frozen=True)
class TimeTest:
    """Whether the scene's clock fits a word of the time of day, or a clock time within 20 min.

    Attributes:
        denied: the scene is at another time, "not at night".
        until: the other end of a span of time; shift: minutes after it, "half past 11 pm".
    """

    token: Token
    denied: bool
    until: Token | None = None
    shift: float = 0.0

    def __call__(self, facts: SceneFacts, _binding: Binding) -> Result:
        own, clock = facts.get_minutes(), facts.scene.meta.time_of_day
        if own is None:
            return UNTESTED
        spans = [value.partition("|")[0].split("+") for value in self.token.list_values("time")]
        if self.denied:
            fits = any(not is_within(clock, span[0]) for span in spans)
        elif self.until is not None:
            ends = [read_clock(each.text) for each in (self.token, self.until)]
            around = [(a, b) for a in ends[0] for b in ends[1] if abs(a - b) <= 12 * 60]
            fits = any(min(a, b) <= own <= max(a, b) for a, b in around)
        elif self.token.kind == "clock":
            times = [said + self.shift for said in read_clock(self.token.text)]
            fits = any(abs(own - said) <= CLOCK_SLACK for said in times)
        else:
            fits = any(is_within(clock, part) for span in spans for part in span)
        return Result(fits, f"the scene is at {clock}")


def read_clock(text: str) -> list[int]:
    """The times that a clock time may mean [min since midnight].

    >>> read_clock("5:30 pm"), read_clock("1730"), read_clock("5:30")
    ([1050], [1050], [330, 1050])
    """
    if len(text) == 4 and text.isdecimal():
        return [60 * int(text[:2]) + int(text[2:])]
    digits = [int(part) for part in "".join(c if c.isdigit() else " " for c in text).split()]
    hours, minutes = digits[0], digits[1] if len(digits) > 1 else 0
    if "p" in text:
        return [60 * (hours % 12 + 12) + minutes]
    if "a" in text:
        return [60 * (hours % 12) + minutes]
    either = 0 < hours < 12 and not text.startswith("0")
    return [60 * hours + minutes, *([60 * (hours + 12) + minutes] if either else [])]


@dataclass(frozen=True)
class NumberTest:
    """Whether a figure with a unit was asked for and is proven, or is measured on an agent.

    Attributes:
        stands: it says how long who stands does.
        bound: it is the `least` or the `most` that the figure may be; None where it is neither.
    """

    subjects: tuple[int, ...]
    unit: str
    value: float
    stands: bool
    bound: str | None = None

    def __call__(self, facts: SceneFacts, binding: Binding) -> Result:
        agents = _list_all(binding, self.subjects) or facts.foreground
        for number in agents if self.unit == "m/s" and self.bound is None else ():
            speed = facts.compute_kept_speed(number)
            if speed is not None and abs(speed - self.value) <= SPEED_SLACK:
                return Result(True, f"agent {number} goes at {speed:.1f} m/s", (number,))
        for number in agents if self.unit == "s" else ():
            for lasts in facts.list_standstills(number):
                if abs(lasts - self.value) <= STANDSTILL_SLACK:
                    return Result(True, f"agent {number} stands for {lasts:.1f} s", (number,))
        known = [
            (low, high)
            for unit, low, high, of in facts.list_figures(standstills=self.stands)
            if unit == self.unit and of.intersection(agents)
        ]
        for low, high in known:
            above = (low + high) / 2 - self.value  # of what is asked for, most lies on one side
            turned = above > 1e-6 if self.bound == "most" else above < -1e-6
            if low - 1e-6 <= self.value <= high + 1e-6 and not (self.bound and turned):
                return Result(True, f"as asked for, within {low:.3g} to {high:.3g} {self.unit}")
        missing = Result(False, f"no figure of {self.value:.3g} {self.unit}")
        return missing if known else UNTESTED


@dataclass(frozen=True)
class StandstillCountTest:
    """Whether an agent stands so many times."""

    subjects: tuple[int, ...]
    number: int

    def __call__(self, facts: SceneFacts, binding: Binding) -> Result:
        agents = _list_all(binding, self.subjects)
        for number in agents:
            times = sum(
                standstill >= LEAST_STANDSTILL for standstill in facts.list_standstills(number)
            )
            if times != self.number:
                return Result(False, f"agent {number} stands {times} times", (number,))
        return Result(True, f"{self.number} standstills", tuple(agents)) if agents else UNTESTED


@dataclass(frozen=True)
class EventCountTest:
    """Whether so many events of a kind happen."""

    kinds: tuple[str, ...]
    number: float

    def __call__(self, facts: SceneFacts, _binding: Binding) -> Result:
        found = sum(e.type in self.kinds for e in facts.proof.events)
        return Result(found == self.number, f"{found} of them")


@dataclass(frozen=True)
class KindTest:
    """Whether a collision is of a kind, where there is one."""

    kind: str

    def __call__(self, facts: SceneFacts, _binding: Binding) -> Result:
        kinds = [e.kind or "none" for e in facts.proof.events if e.type == "collision"]
        return Result(self.kind in kinds, f"kind {_join(kinds)}") if kinds else UNTESTED


@dataclass(frozen=True)
class BareNumberTest:
    """Whether a number without a unit is of the clock, a background, agents or a figure."""

    number: float

    def __call__(self, facts: SceneFacts, binding: Binding) -> Result:
        number, own = self.number, facts.get_minutes()
        past = None if own is None else own % 720 - 60 * (number % 12)
        if past is not None and number <= 24 and min(abs(past), abs(past - 30)) <= CLOCK_SLACK:
            return Result(True, f"the scene is at {facts.scene.meta.time_of_day}")
        if number in {
            facts.count_background(frozenset({k})) for k in ("any", "vehicle", "pedestrian")
        }:
            return Result(True, f"{number:g} in the background")
        factors = (1.0, 1 / 3.6, 0.447)  # as it stands, in km/h or mph
        figures = [(low, high) for _, low, high, _ in facts.list_figures()]
        if any(low <= number * factor <= high for low, high in figures for factor in factors):
            return Result(True, "a figure that was asked for")
        if any(len(bound) == number for bound in binding.values()):
            return Result(True, f"{number:g} agents")
        return Result(False, f"nothing is {number:g}")


@dataclass(frozen=True)
class PointTest:
    """Whether a collision touches a vehicle where a word says, the struck one if none is named."""

    word: str
    whose: tuple[int, ...]

    def __call__(self, facts: SceneFacts, binding: Binding) -> Result:
        hits = [e for e in facts.proof.events if e.type == "collision"]
        meant = _list_all(binding, self.whose)
        both = self.word in ("front", "bumper", "corner")
        ends = [
            (each.evidence, end)
            for each in hits
            for end, number in (("from", each.from_), ("to", each.to))
            if (number in meant if meant else both or end == "to")
        ]
        points = {str(evidence.get(f"point_{end}") or "") for evidence, end in ends}
        shown = {part for each in points for part in each.split("_")}
        shown |= {str(evidence.get(f"side_{end}")) for evidence, end in ends}
        shown |= {"side", "flank"} if shown & {"left", "right"} else set()
        on_left = facts.intersection_map is not None and facts.intersection_map.left_hand_traffic
        word = _CAR_SIDES[on_left].get(self.word, self.word)
        kinds = {
            word
            for e in facts.proof.events
            if e.kind
            for word in get_kind("collision", e.kind).points
        }
        measured = any(m.kind.endswith("point") or "point_" in m.kind for m in facts.scene.measures)
        if (
            word in shown
            or (word in kinds and not (meant and word in _BODY))
            or (measured and word not in _BODY)
        ):
            return Result(True, f"the point of impact ({_join(sorted(points))})")
        return Result(False, f"contact at {_join(sorted(points))}") if word in _BODY else UNTESTED


def check_crosswalk(facts: SceneFacts, _binding: Binding) -> Result:
    """Whether anyone walks on a crosswalk; untested where nobody walks."""
    for n in facts.foreground:
        if facts.agents[n].crosswalk is not None:
            return Result(True, f"agent {n} on the {facts.agents[n].crosswalk} crosswalk")
    walks = any(facts.agents[n].type == "pedestrian" for n in facts.foreground)
    return Result(False, "no agent is on a crosswalk") if walks else UNTESTED


@dataclass(frozen=True)
class LegCrosswalkTest:
    """Whether someone walks on the crosswalk of the leg that a vehicle enters or leaves by.

    Attributes:
        field: `entry` or `exit`.
    """

    field: str

    def __call__(self, facts: SceneFacts, _binding: Binding) -> Result:
        agents = [facts.agents[n] for n in facts.foreground]
        legs = {getattr(agent, self.field) for agent in agents if agent.crosswalk is None}
        walked = {agent.crosswalk for agent in agents if agent.crosswalk}
        return Result(bool(legs & walked), f"crosswalk on the {self.field} leg")


def check_lights(facts: SceneFacts, _binding: Binding) -> Result:
    """Whether the place has traffic lights."""
    return Result(bool(facts.scene.signals), "the place has lights")


def find_late_braking(facts: SceneFacts, _value: str) -> list[int]:
    """Agents that brake too late, or do not react to what they could see."""
    events = facts.proof.events
    late = [e.evidence.get("late_brake") for e in events if e.kind != "rear_end"]
    late += [
        e.from_ for e in events if e.kind == "rear_end" and has_trait("cause", e.cause, "late")
    ]
    late += [r["agent"] for r in facts.reactions if "behind" not in (r.get("why_not") or "behind")]
    hits = [e.from_ for e in events if e.type == "collision"]
    late += [n for n in hits if facts.compute_braking(n) >= LATE_BRAKING]
    return [each for each in late if each is not None]


def check_nothing_else(facts: SceneFacts, _binding: Binding) -> Result:
    """Whether nothing happens that is not asked for: the certificate, and no red light is run."""
    runs = facts.proof.figures.get("unasked_red_light_runs")
    return Result(facts.proof.verified and not runs, "nothing else happens")


@dataclass(frozen=True)
class DensityTest:
    """Whether the traffic is as dense as a word says, where the scene was made with a density."""

    density: str

    def __call__(self, facts: SceneFacts, _binding: Binding) -> Result:
        own = facts.scene.meta.density
        return UNTESTED if own is None else Result(own == self.density, f"density {own}")


def check_priority(facts: SceneFacts, _binding: Binding) -> Result:
    """Whether anyone gives way."""
    priority = any(e.type == "yielding" for e in facts.proof.events)
    return Result(True, "one gives way") if priority else UNTESTED


def find_motion(facts: SceneFacts, value: str) -> list[int]:
    """Agents that move in a way such as `runs`."""
    return [n for n in facts.foreground if makes_true("motion", facts.agents[n].motion, value)]


def find_reaction(facts: SceneFacts, value: str) -> list[int]:
    """Agents that were to react in a way, or are seen to."""
    asked = [n for n in facts.foreground if facts.agents[n].reaction == value]
    seen = (r["agent"] for r in facts.reactions if makes_true("reaction", r.get("how"), value))
    return [*asked, *seen]


def makes_true(axis: Axis, name: str | None, sense: str) -> bool:
    """Whether a kind makes a sense of words true."""
    kind = find_kind(axis, name)
    return kind is not None and sense in (kind.id, *kind.claims)


def find_manoeuvre(facts: SceneFacts, value: str) -> list[int]:
    """Agents that do a manoeuvre of a relation: the leader brakes, who pushes was struck or not."""
    relations = [relation for relation in facts.scene.relations if relation.manoeuvre == value]
    if has_trait("manoeuvre", value, "by_to"):
        return [relation.to for relation in relations]
    if has_trait("manoeuvre", value, "by_all"):
        return list(facts.foreground) if relations else []
    return [relation.from_ for relation in relations]


def find_close_following(facts: SceneFacts, _value: str) -> list[int]:
    """Agents that follow another one closely or nearly hit it, and those others; or an object."""
    follows = (e for e in facts.events if e.type == "follow")
    close = [e for e in follows if e.evidence.get("least_headway", 2 * CLOSE) <= CLOSE]
    close += [e for e in facts.events if e.type == "near_miss"]
    met = [m.agent for m in facts.scene.encounters if makes_true("encounter", m.how, "near_miss")]
    return [*met, *(number for e in close for number in (e.from_, e.to))]


def find_meeting(facts: SceneFacts, value: str) -> list[int]:
    """Agents that do something of a kind about an object."""
    return [
        encounter.agent
        for encounter in facts.scene.encounters
        if makes_true("encounter", encounter.how, value)
    ]


def find_overtaking(facts: SceneFacts, _value: str) -> list[int]:
    """Agents that get from behind another one on the road to ahead of it."""
    drivers = [n for n in facts.foreground if facts.agents[n].type != "pedestrian"]
    return [one for one, other in permutations(drivers, 2) if facts.overtakes(one, other)]


def _join(names: Iterable[int | str]) -> str:
    return ", ".join(map(str, names))
