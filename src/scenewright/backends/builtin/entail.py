"""What entry, exit and movement entail of one another, and what cannot be (SEMANTICS 2).

Where the legs' names are no compass of the turns (five legs; three at odd angles), the map alone
says where a turn leads: what is said is kept as it is, and grounding finds the rest.
"""

from __future__ import annotations

from collections.abc import Mapping

from scenewright.backends.builtin.draft import (
    LEFT_OF_HEADING,
    AgentDraft,
    Draft,
    Refused,
    RelationDraft,
    Site,
)
from scenewright.scene.base import OPPOSITE, AgentClass
from scenewright.scene.kinds import has_trait
from scenewright.scene.relations import load_patterns

LEFT = {"north": "east", "east": "south", "south": "west", "west": "north"}
RIGHT = {exit_: entry for entry, exit_ in LEFT.items()}
TURNS: Mapping[str, Mapping[str, str]] = {
    "left": LEFT,
    "right": RIGHT,
    "straight": OPPOSITE,
    "uturn": {side: side for side in OPPOSITE},
}


def fill_entailed(draft: Draft) -> None:
    """Fill what follows from what is said; Refused where it cannot be."""
    for relation in draft.relations:
        _turn_across(relation, draft.site)
        _meet_on_crosswalk(relation)
    for _ in range(2):
        for agent in draft.agents:
            fill_agent(agent, draft.site)
            _fill_relatives(agent, draft)
        for relation in draft.relations:
            _check_shared_lane(relation, draft.site)
            _check_head_on(relation, draft.site)
    for agent in draft.agents:
        fill_agent(agent, draft.site)
    for relation in draft.relations:
        _check_possible(relation, draft.site)


def fill_agent(agent: AgentDraft, site: Site) -> None:
    """Entry, exit, movement and crosswalk of one agent from one another."""
    if agent.drives and agent.movement not in (None, *TURNS):
        raise Refused(
            "impossible", "Only pedestrians cross or jaywalk; give the crossing to a pedestrian."
        )
    jaywalks = agent.type == "pedestrian" and agent.movement == "jaywalking"
    if jaywalks and agent.crosswalk is not None and agent.marked:
        raise Refused(
            "contradictory",
            "A jaywalker is outside the crosswalks; drop the jaywalking or the crosswalk.",
        )
    if site.compass and agent.drives:
        _fill_vehicle(agent)
    elif site.compass and agent.movement == "crossing":
        _fill_pedestrian(agent)


def _fill_vehicle(agent: AgentDraft) -> None:
    entry, exit_, movement = agent.entry, agent.exit, agent.movement
    if movement is not None and entry in TURNS[movement]:
        follows = TURNS[movement][str(entry)]
        if exit_ is not None and exit_ != follows:
            raise Refused(
                "impossible",
                f"A vehicle from the {entry} with movement {movement} leaves to the "
                f"{follows}, not to the {exit_}; "
                "change its entry, turn or exit.",
            )
        agent.exit = follows
    elif movement is not None and entry is None and exit_ is not None:
        agent.entry = next((e for e, x in TURNS[movement].items() if x == exit_), None)
    elif movement is None and entry is not None and exit_ is not None:
        agent.movement = next((m for m, table in TURNS.items() if table.get(entry) == exit_), None)


def _fill_pedestrian(agent: AgentDraft) -> None:
    for field, other in (("entry", "exit"), ("exit", "entry")):
        side = getattr(agent, field)
        if side is None:
            continue
        if agent.crosswalk in {side, OPPOSITE[side]}:
            axis = "east-west" if agent.crosswalk in {"north", "south"} else "north-south"
            raise Refused(
                "contradictory",
                f"One walks {axis} on the {agent.crosswalk} crosswalk, so not {field} "
                f"{side}; change one of them.",
            )
        if getattr(agent, other) is None:
            setattr(agent, other, OPPOSITE[side])
        elif getattr(agent, other) != OPPOSITE[side]:
            raise Refused(
                "impossible",
                "A pedestrian on a crosswalk leaves on the opposite side; change entry or exit.",
            )


def _fill_relatives(agent: AgentDraft, draft: Draft) -> None:
    for word, named in agent.relatives:
        other = named or find_partner(agent, draft)
        if other is None or other is agent or not other.drives:
            continue
        if word.endswith("_crosswalk"):
            leg = other.exit if word == "exit_crosswalk" else other.entry
            agent.crosswalk = agent.crosswalk or leg
            continue
        if not draft.site.compass and word != "same":
            continue  # the tie between the two is kept; the map says which leg that is
        if other.entry is None and word in {"opposite", "mutual"} and agent.entry is not None:
            other.entry = OPPOSITE[agent.entry]
        if agent.entry is None and other.entry is not None:
            heading = OPPOSITE[other.entry]
            left = LEFT_OF_HEADING.get(heading)
            sides = {"of_left": left, "of_right": OPPOSITE.get(left or ""), "same": other.entry}
            agent.entry = {**sides, "opposite": heading, "mutual": heading}.get(word)
        elif agent.entry is not None and other.entry is None and word == "same":
            other.entry = agent.entry
        elif agent.entry == other.entry is not None and word == "opposite" and agent.drives:
            raise Refused(
                "contradictory",
                f"Oncoming vehicles cannot both come from the {agent.entry}; change one of them.",
            )


def _meet_on_crosswalk(relation: RelationDraft) -> None:
    """Two that meet on foot, one of them on a crosswalk, cross it in opposite directions."""
    pair = relation.ends
    met = relation.type in ("collide_at", "near_miss") and relation.pattern is None
    if not (met and all(each.walks for each in pair)):
        return
    for agent, other in (pair, pair[::-1]):
        if other.movement != "crossing" or agent.movement == "jaywalking":
            continue
        agent.movement = "crossing"
        if agent.crosswalk is None:
            agent.crosswalk = other.crosswalk


def find_partner(agent: AgentDraft, draft: Draft) -> AgentDraft | None:
    """The vehicle that the agent has to do with, else the only other one."""
    bound = [
        other
        for relation in draft.relations
        for other in relation.ends
        if agent in relation.ends and other is not agent and other.drives
    ]
    if bound:
        return bound[0]
    others = [other for other in draft.agents if other is not agent and other.drives]
    return others[0] if len(others) == 1 else None


def _check_shared_lane(relation: RelationDraft, site: Site) -> None:
    first, second = relation.ends
    lane = relation.type == "follow" or relation.kind == "rear_end"
    if not lane or not (first.drives and second.drives):
        return
    if first.entry and second.entry and first.entry != second.entry:
        # From two legs one can still end up behind the other on a common exit.
        exits = {agent.exit or OPPOSITE.get(str(agent.entry)) for agent in (first, second)}
        turned = {first.movement, second.movement} & {"left", "right"}
        if not site.compass or (turned and len(exits) == 1):
            return
        raise Refused(
            "contradictory",
            f"Vehicles in one lane cannot come from the {first.entry} and the "
            f"{second.entry}; give them one entry.",
        )
    first.entry = second.entry = first.entry or second.entry


_TURN_CRASHES = {"left_turn": "left", "right_turn": "right"}


def _turn_across(relation: RelationDraft, site: Site) -> None:
    """A left-turn crash has an agent turning left, a right-turn crash right.

    It is of the kind `left_turn` if that turn crosses the way of oncoming traffic.
    """
    turn = _TURN_CRASHES.get(relation.kind or "")
    if turn is None:
        return
    vehicles = [agent for agent in relation.ends if agent.drives]
    free = [agent for agent in vehicles if agent.movement is None]
    if free and all(a.movement != turn for a in vehicles):
        free[0].movement = turn
    relation.kind = "left_turn" if turn == site.across else None


def _check_head_on(relation: RelationDraft, site: Site) -> None:
    first, second = relation.ends
    if relation.kind != "head_on" or not (first.drives and second.drives and site.compass):
        return
    for agent, other in ((first, second), (second, first)):
        if agent.entry is not None and other.entry is None:
            other.entry = OPPOSITE[agent.entry]
    if (
        first.entry is not None
        and first.entry == second.entry
        and "uturn" not in {first.movement, second.movement}
    ):
        raise Refused(
            "impossible",
            f"Two vehicles from the {first.entry} cannot meet head-on; change one entry.",
        )


def _check_possible(relation: RelationDraft, site: Site) -> None:
    first, second = relation.ends
    if first.type == second.type == "pedestrian" and relation.type == "yield_to":
        raise Refused(
            "impossible",
            "Between two pedestrians nobody has the right of way; make one of them a vehicle, or "
            "ask for a near miss.",
        )
    if relation.type == "follow" and first.walks != second.walks:
        raise Refused(
            "impossible",
            "A pedestrian and a vehicle share no lane, so neither follows the other; "
            "use two of a kind.",
        )
    if relation.type != "follow" and first.walks != second.walks and site.compass:
        _check_crosswalk(*((first, second) if first.drives else (second, first)))
    if relation.type == "collide_at" and "pedestrian" in (first.type, second.type):
        # A car may hit a pedestrian head-on; a pedestrian never rear-ends.
        kind = relation.kind or ""
        if has_trait("collision", kind, "of_vehicles") and first.type == "pedestrian":
            raise Refused(
                "impossible",
                f"Only two vehicles collide as {kind.replace('_', ' ')}; name two "
                "vehicles or just a collision.",
            )
        relation.kind = None
    if relation.type == "collide_at" and relation.kind is not None:
        kinds = _list_collision_kinds(first.type, second.type)
        if relation.kind not in kinds:
            raise Refused(
                "impossible",
                f"A {first.type} and a {second.type} cannot collide {_name_kind(relation.kind)} "
                f"here, only {' or '.join(map(_name_kind, kinds))}; choose one of these, or leave "
                "it open.",
            )


def _name_kind(kind: str) -> str:
    return f"as {kind.replace('_', ' ')}"


def _list_collision_kinds(*pair: AgentClass) -> list[str]:
    """The kinds of collisions that relation files have of two classes."""
    found = (
        pattern.kind
        for pattern in load_patterns()
        if pattern.relation == "collide_at" and pattern.kind is not None
        for one, two in (pair, pair[::-1])
        if pattern.from_.admits(one) and pattern.to.admits(two)
    )
    return list(dict.fromkeys(found))


def _check_crosswalk(vehicle: AgentDraft, pedestrian: AgentDraft) -> None:
    """A vehicle drives over the crosswalks of its entry and its exit, and no other."""
    legs, crosswalk = (vehicle.entry, vehicle.exit), pedestrian.crosswalk
    if (
        crosswalk in OPPOSITE
        and all(leg in TURNS["left"] for leg in legs)
        and crosswalk not in legs
    ):
        raise Refused(
            "impossible",
            f"A vehicle from the {legs[0]} to the {legs[1]} never gets to the {crosswalk} "
            "crosswalk; change its way or the crosswalk.",
        )
