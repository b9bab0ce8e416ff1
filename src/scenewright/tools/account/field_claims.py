"""The fields of a plan as claims on its scene: each set field has one test, as words have."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from scenewright.scene.account import AccountEntry
from scenewright.scene.events import EVENT_OF_RELATION, Event
from scenewright.scene.kinds import has_trait
from scenewright.scene.plan_fields import PlanField, list_fields
from scenewright.scene.social import AgentNode, ObjectNode, RelationEdge, SocialGraph
from scenewright.tools.account import claim_tests as tests
from scenewright.tools.account.claims import Result
from scenewright.tools.account.facts import SceneFacts, fits_object
from scenewright.tools.relation_checker.clock import is_within
from scenewright.tools.relation_checker.legs import find_relative_side

_OTHER_SIDES = {"lateral": ("left", "right"), "other": ("opposite", "left", "right")}
_FIGURES = {"target_pet": "s", "target_ttc": "s", "impact_speed": "m/s"}


def account_fields(
    plan: SocialGraph, facts: SceneFacts, read: Callable[[str], Iterable[AccountEntry]]
) -> Iterator[AccountEntry]:
    """A state for each field of a plan; words that no field holds are read as words.

    Args:
        read: the account of a text.
    """
    numbers = {agent.name: agent.id for agent in facts.scene.agents}
    whole = numbers.keys() >= {agent.id for agent in plan.agents}
    for field in list_fields(plan):
        if field.section == "said":
            for entry in read(field.words):
                moved = {key: getattr(entry, key) + field.start for key in ("start", "end")}
                yield entry.model_copy(update=moved)
            continue
        gap = Result(False, "not all agents of the plan are there")
        result = _test(field, plan, facts, numbers) if whole else gap
        state = {True: "seen", False: "contradicted", None: "not_shown"}[result.holds]
        yield AccountEntry.model_validate(
            {
                "start": field.start, "end": field.end, "words": field.words, "state": state,
                "claim": f"{field.name or field.section.removesuffix('s')} {field.words}",
                "evidence": result.evidence or "no test of it", "agents": result.agents,
            }
        )  # fmt: skip


def _test(each: PlanField, plan: SocialGraph, facts: SceneFacts, numbers: dict[str, int]) -> Result:
    entry = getattr(plan, each.section, ())
    match each.section:
        case "agents":
            return _test_agent(each, entry[each.number], facts, numbers)
        case "relations":
            return _test_relation(each, entry[each.number], facts, numbers)
        case "objects":
            return _test_object(each, entry[each.number], facts, numbers)
        case "ties":
            tie = entry[each.number]
            sides = _OTHER_SIDES.get(tie.side, (tie.side,))
            seen = find_relative_side(
                facts.agents[numbers[tie.agent]].entry,
                seen_from=facts.agents[numbers[tie.of]].entry,
            )
            return Result(seen in sides, f"it comes from the {seen} side")
        case "measures":
            asked = entry[each.number]
            pair = [numbers[name] for name in (asked.agent, asked.other) if name]
            held = any(
                (m.kind, m.low, m.high) == (asked.kind, asked.low, asked.high)
                and [n for n in (m.agent, m.other) if n is not None] == pair
                for m in facts.scene.measures
            )
            return Result(held, "asked for and measured" if held else "no such figure")
        case "normal":
            return tests.check_nothing_else(facts, {})
        case _:
            return _test_context(each.name, each.value, facts)


def _test_context(name: str, value: Any, facts: SceneFacts) -> Result:
    if name == "density":
        return Result(facts.scene.meta.density == value, f"density {facts.scene.meta.density}")
    if name == "time_of_day":
        clock = facts.scene.meta.time_of_day
        first, _, last = value.partition("-")
        fits = is_within(clock, value) if last else clock == first
        return Result(fits, f"the scene is at {clock}")
    seen = facts.count_background(frozenset({name.removesuffix("s")}))
    return Result(seen == value, f"{seen} in the background")


def _test_agent(
    each: PlanField, node: AgentNode, facts: SceneFacts, numbers: dict[str, int]
) -> Result:
    number, wanted = numbers[node.id], each.value
    agent = facts.agents[number]
    match each.name:
        case "":
            return Result(agent.type == node.type, f"a {agent.type}", (number,))
        case "subtype":
            return Result(facts.fits_class(number, frozenset({wanted})), f"a {agent.subtype}")
        case "runs_red":
            runs = number in facts.red_runners
            return Result(runs, "it passes on red" if runs else "it does not pass on red")
        case "members":
            count = facts.count_members(number)
            return Result(count == wanted, f"{count} of them", (number,))
        case "movement":
            turns = abs(facts.compute_turn(number)) >= tests.LEAST_TURN
            fits = turns or wanted not in ("left", "right", "uturn")
            return Result(agent.movement == wanted and fits, f"movement {agent.movement}")
        case name:
            seen = getattr(agent, name)
            return Result(seen == wanted, f"{name} {seen}", (number,))


def _test_relation(
    each: PlanField, edge: RelationEdge, facts: SceneFacts, numbers: dict[str, int]
) -> Result:
    """Test a field of a relation on the event that the checker found of the two."""
    first, second = numbers[edge.from_], numbers[edge.to]
    kind = EVENT_OF_RELATION[edge.type]
    directed = edge.type in ("yield_to", "follow")
    events = [
        event
        for event in facts.list_between(first, second, (kind,))
        if not directed or facts.has_role(event, first)
    ]
    asked = next(
        (r for r in facts.scene.relations if {r.from_, r.to} == {first, second} and r.type == kind),
        None,
    )
    if not events or asked is None:
        return Result(False, f"no {kind} of these agents")
    event, wanted = events[0], each.value
    match each.name:
        case "":
            pair = (event.from_, event.to)
            return Result(True, f"{kind} of {pair[0]} and {pair[1]} at {event.time:.1f} s", pair)
        case "kind":
            return Result(event.kind == wanted, f"kind {event.kind}")
        case "cause":
            runs = facts.red_runners & {first, second}
            late = event.evidence.get("late_brake") is not None or event.cause == wanted
            return Result(
                bool(runs) if has_trait("cause", wanted, "red_light") else late,
                f"cause {event.cause}",
            )
        case "braker":
            seen = event.evidence.get("late_brake", asked.cause_agent)
            return Result(seen == numbers[wanted], f"agent {seen} brakes")
        case "manoeuvre":
            return Result(asked.manoeuvre == wanted, f"manoeuvre {asked.manoeuvre}")
        case "pattern":
            return Result(True, f"{kind}, as that file has it")
        case "first":
            before = facts.find_order(numbers[wanted], ({first, second} - {numbers[wanted]}).pop())
            return Result(before, "the order in which they pass")
        case "strikes":
            return Result(facts.has_role(event, numbers[wanted]), f"agent {event.from_} strikes")
        case "point_from" | "point_to":
            number = first if each.name == "point_from" else second
            return _test_point(event, number, wanted)
        case name:
            return _test_figure(wanted, _FIGURES[name], frozenset({first, second}), facts)


def _test_point(event: Event, number: int, wanted: str) -> Result:
    end = "from" if event.from_ == number else "to"
    seen = {str(event.evidence.get(f"{what}_{end}")) for what in ("point", "side")}
    fits = any(each == wanted or wanted in each.split("_") for each in seen)
    fits = fits or (wanted == "side" and bool(seen & {"left", "right"}))
    return Result(fits, f"contact at {', '.join(sorted(seen))}", (number,))


def _test_figure(value: float, unit: str, pair: frozenset[int], facts: SceneFacts) -> Result:
    for own, low, high, of in facts.list_figures():
        if own == unit and of == pair and low <= value <= high:
            return Result(True, f"as asked for, within {low:.3g} to {high:.3g} {unit}")
    return Result(False, f"no figure of {value:.3g} {unit}")


def _test_object(
    each: PlanField, node: ObjectNode, facts: SceneFacts, numbers: dict[str, int]
) -> Result:
    stands = next((o for o in facts.scene.objects if o.id == node.id), None)
    if stands is None:
        return Result(False, "no such object")
    met = [m for m in facts.scene.encounters if m.object == node.id]
    sights = [s for s in facts.scene.sights if s.object == node.id]
    if not each.name:
        classes = frozenset({node.subtype}) if node.subtype else frozenset[str]()
        fits = stands.kind == node.kind and fits_object(stands, classes)
        return Result(fits, f"{stands.subtype or ''} {stands.kind}".strip())
    seen: dict[str, list[Any]] = {
        "leg": [facts.find_leg(node.id)],
        "side": [facts.find_side(node.id)],
        "lane": [stands.lane],
        "hides": [s.subject for s in sights],
        "hidden_from": [s.observer for s in sights],
        "lead": [s.lead for s in sights],
        "beyond": [s.object for s in facts.scene.sights if s.between == node.id],
        "met_by": [m.agent for m in met],
        "encounter": [m.how for m in met],
        "figure": [m.figure for m in met],
        "others": [tuple((m.agent, m.how, m.figure) for m in met[1:])],
    }
    wanted = numbers.get(each.value, each.value) if isinstance(each.value, str) else each.value
    if each.name == "others":
        wanted = tuple((numbers[o.agent], o.encounter, o.figure) for o in each.value)
    found = seen[each.name]
    return Result(wanted in found, f"{each.name} {', '.join(map(str, found))}")
