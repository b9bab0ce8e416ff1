"""Modifiers and properties find the agents they belong to."""

from __future__ import annotations

from scenewright.backends.builtin.attach import (
    IGNORED,
    PEDESTRIAN_ONLY,
    VEHICLE_ONLY,
    attach,
    cross,
    put,
)
from scenewright.backends.builtin.coreference import OPPOSITE
from scenewright.backends.builtin.cursor import (
    Group,
    can_hold,
    can_kind_hold,
)
from scenewright.backends.builtin.draft import AgentDraft, Refused
from scenewright.backends.builtin.grammar import Modifier
from scenewright.backends.builtin.lexicon import Chunk
from scenewright.backends.builtin.mentions import Mention
from scenewright.backends.builtin.settling import Settling
from scenewright.scene.base import RIDERS

_ANYBODY = frozenset(
    [
        "guy",
        "dude",
        "man",
        "woman",
        "lady",
        "fellow",
        "bloke",
        "chap",
        "someone",
        "somebody",
        "person",
        "individual",
        "teenager",
        "tourist",
        "commuter",
        "gentleman",
        "female",
        "male",
        "lad",
        "customer",
        "mother",
        "father",
        "parent",
        "student",
        "senior",
        "officer",
        "worker",
        "nurse",
        "doctor",
        "old man",
        "old woman",
        "old lady",
        "young man",
        "young woman",
        "elderly man",
        "elderly woman",
        "elderly lady",
        "husband",
        "wife",
        "brother",
        "sister",
        "uncle",
        "aunt",
        "nephew",
        "niece",
        "girlfriend",
        "boyfriend",
        "pupil",
        "respondent",
        "appellant",
        "neighbour",
        "neighbor",
    ]
)
_ACROSS = {"cross_street": "lateral", "other_approach": "other"}
_TOUCHES = {
    "from": {"entry"},
    "from_to": {"entry", "exit"},
    "cross_from_to": {"entry", "exit"},
    "to": {"exit"},
    "head_to": {"entry", "exit"},
    "bound": {"entry"},
    "cross_bound": {"entry"},
    "turn": {"movement"},
    "uturn": {"movement"},
    "straight": {"movement"},
    "crosswalk": {"crosswalk", "movement"},
    "on_crosswalk": {"movement"},
    "leg": {"entry", "crosswalk"},
}


class Modifying(Settling):
    """Attaches directions, turns, crosswalks and properties."""

    def _apply_modifier(self, at: int, modifier: Modifier) -> None:
        if modifier.means in IGNORED:
            return
        if modifier.means.startswith("cross"):
            self.crossing = True
        if modifier.means == "side":
            self._set_sides(modifier)
            return
        finite = self._is_finite(modifier) or self._is_said_of_all(at)
        finite = finite and not self._is_of_last(at, modifier)
        if modifier.means in {"crosswalk", "on_crosswalk"} and self._is_kept_off(at):
            return
        if finite:
            self._return_to_main_clause(modifier)
        if modifier.means in VEHICLE_ONLY or modifier.first.startswith(("driv", "drov")):
            self._mark_as_driver(finite=finite)
        targets = self._find_targets(at, modifier, finite=finite)
        if isinstance(self._get_item(at - 1), Modifier) and modifier.means in {
            "from",
            "to",
            "from_to",
            "leg",
        }:
            targets = [agent for agent in self.modified if can_hold(agent, modifier)] or targets
        self.modified = targets
        if not targets:
            self._drop_turning_pedestrians(at, modifier)
            self.fronted.append(modifier)
            return
        if finite:
            self.verb_seen = True
        for agent in targets:
            self._reopen(agent, modifier)
        if modifier.means in {"from_two", "bound_two"}:
            self._give_one_each(at, modifier, targets)
            return
        if modifier.means == "from_to" and self._is_along_with():
            targets = targets + [a for a in self.subject if a not in targets and a.entry is None]
        attach(modifier, targets, crossing=self.crossing)
        self._reconcile_crosswalks(targets)

    def _is_of_last(self, at: int, modifier: Modifier) -> bool:
        """ "hits a bus bound north": the bus is."""
        noun = isinstance(self._get_item(at - 1), Mention)
        return modifier.first == "bound" and noun and self.verb_seen

    def _return_to_main_clause(self, modifier: Modifier) -> None:
        """ "the car that should have waited for a bus turns left": the car turns."""
        relation = self.awaiting
        closed = relation is not None and relation.object is not None
        inside = self.relative and self.verb_seen and not self.boundary and self.gap is None
        if closed and inside and modifier.first.endswith("s"):
            self._leave_relative()
            self.last = self.subject or self.last

    def _is_said_of_all(self, at: int) -> bool:
        """ "a truck and a sedan are going straight": the verb belongs to both."""
        before = self._get_item(at - 1)
        earlier = self._get_item(at)
        first = earlier.first if isinstance(earlier, Modifier) else ""
        plural = isinstance(before, Chunk) and before.text in {"are", "were"}
        plural |= first in {"are", "were"}
        return plural and len(self.subject) > 1 and not self.relative

    def _mark_as_driver(self, *, finite: bool) -> None:
        """ "some guy turned left", "a man ran the light": that agent is driving."""
        group = (self.subject if finite else self.last) or self.last
        for agent in group if len(group) == 1 else []:
            on_foot = agent.movement or agent.crosswalk or agent.head not in _ANYBODY
            if agent.type == "pedestrian" and not on_foot:
                agent.type = "vehicle"

    def _drop_turning_pedestrians(self, at: int, modifier: Modifier) -> None:
        turns = modifier.means in {"turn", "uturn"} and not modifier.first.startswith(
            ("left", "right", "a")
        )
        if (
            turns
            and isinstance(self._get_item(at - 1), Mention)
            and self.last
            and self.last[0].type == "pedestrian"
        ):
            raise Refused(
                "impossible",
                "Pedestrians cross or jaywalk here, only vehicles turn; give the turn "
                "to a vehicle.",
            )

    def _give_one_each(self, at: int, modifier: Modifier, targets: Group) -> None:
        """ "two cars from the north and the west": a side each; one agent cannot have both."""
        single = "from" if modifier.means == "from_two" else "bound"
        if len(targets) == 1 and targets[0].generic:
            targets = [*targets, self.discourse.create(targets[0].type, head=targets[0].head)]
            targets[0].generic, targets[1].subtype = False, targets[0].subtype
            self.discourse.groups.append(targets)
            self.last = targets
            self.subject = targets if self.subject == targets[:1] else self.subject
            self.sentence.append((at, targets))
        if len(targets) == 1 and len(self.subject) == 2 and targets[0] in self.subject:
            targets = self.subject
        sides = [Modifier(single, (value,), modifier.chunks) for value in modifier.values]
        for agent, side in zip(
            targets if len(targets) == 2 else targets[:1] * 2, sides, strict=False
        ):
            self._reopen(agent, side)
            attach(side, [agent])

    def _is_along_with(self) -> bool:
        """ "A follows B from south to north": both go that way."""
        relation = self.awaiting
        return relation is not None and relation.type == "follow" and relation.object is self.last

    def _set_sides(self, modifier: Modifier) -> None:
        for agent in self.last or self.subject:
            self._set_side(agent, "map_" + modifier.values[0])

    def _is_kept_off(self, at: int) -> bool:
        before = self._get_item(at - 1)
        return isinstance(before, Chunk) and before.has("NEARBY")

    def _find_targets(self, at: int, modifier: Modifier, *, finite: bool) -> Group:
        if not finite and not self.sentence and self._is_introduction(at, modifier):
            return []
        if not finite and self._is_before_agent(at, modifier):
            return []
        prefer = (
            self.subject
            if (finite and not self._is_of_passing_agent()) or self._is_after_while(at)
            else self.last
        )
        if modifier.means in {"turn", "straight", "uturn"} and self._is_nominal_turn(at):
            prefer = self.subject or self.last
        if modifier.means in PEDESTRIAN_ONLY and (riders := self._find_riders_there(at)):
            return riders
        drives = self._is_of_turning_agent(at, modifier)
        for group in (prefer, *(group for _, group in reversed(self.sentence))):
            fits = [a for a in group if can_hold(a, modifier) and not (drives and a.type[0] == "p")]
            if fits:
                return fits
        if not self._has_mentions_ahead(at, modifier):
            kinds = [a for a in self.draft.agents if can_hold(a, modifier)]
            if len(kinds) == 1 and (
                modifier.means in VEHICLE_ONLY | PEDESTRIAN_ONLY or len(self.draft.agents) == 1
            ):
                return kinds
        return []

    def _find_riders_there(self, at: int) -> Group:
        """ "A cyclist on the crosswalk hits ...", "rides on the crosswalk": the rider is there."""
        before = self._get_item(at - 1)
        walkers = any(agent.type == "pedestrian" for agent in self.draft.agents)
        named = isinstance(before, Mention) and not (self.verb_seen and walkers)
        rides = isinstance(before, Chunk) and before.text.startswith("rid")
        group = self.last if named else self.subject
        there = (named or rides) and all(agent.subtype in RIDERS for agent in group)
        return group if there else []

    def _is_of_turning_agent(self, at: int, modifier: Modifier) -> bool:
        """ "..., northbound, left turn": a side that stands with a turn is a vehicle's."""
        before, comma, turn = self._get_item(at - 1), self._get_item(at + 1), self._get_item(at + 2)
        return (
            modifier.means in {"bound", "from"}
            and isinstance(before, Chunk)
            and before.mark == ","
            and isinstance(comma, Chunk)
            and comma.mark == ","
            and isinstance(turn, Modifier)
            and turn.means in VEHICLE_ONLY
        )

    def _is_before_agent(self, at: int, modifier: Modifier) -> bool:
        """ "from the east a bus, from the north a car": each side comes before its agent."""
        before, after = self._get_item(at - 1), self._get_item(at + 1)
        first = self._get_item(at - 2)
        opens = isinstance(before, Chunk) and (before.mark == "," or before.has("AND"))
        named = isinstance(after, Mention) and after.type is not None
        earlier = isinstance(first, Mention) and isinstance(self._get_item(at - 3), Modifier)
        new = named and isinstance(after, Mention) and after.det in {"indefinite", "bare"}
        return modifier.means in {"from", "from_to"} and opens and new and earlier

    def _is_introduction(self, at: int, modifier: Modifier) -> bool:
        """ "From the south comes a bus": a new sentence brings in a new agent."""
        if self.editing or modifier.means not in {"from", "bound", "from_to", "crosswalk"}:
            return False
        for item in self.items[at + 1 :]:
            if isinstance(item, Chunk) and item.mark in {".", ";", "!", "?"}:
                return False
            if isinstance(item, Mention):
                kind = item.type is not None and can_kind_hold(item.type, modifier)
                return kind and item.det in {"indefinite", "bare"}
        return False

    def _is_of_passing_agent(self) -> bool:
        """ "lets B turn left": the verb belongs to B."""
        relation = self.awaiting
        return (
            relation is not None
            and relation.tag in {"LET", "WAIT"}
            and relation.object is self.last
            and not self.boundary
        )

    def _has_mentions_ahead(self, at: int, modifier: Modifier) -> bool:
        for item in self.items[at + 1 :]:
            if isinstance(item, Chunk) and item.mark in {".", ";", "!", "?"}:
                return False
            if isinstance(item, Mention) and (
                item.type is None or can_kind_hold(item.type, modifier)
            ):
                return True
        return False

    def _is_nominal_turn(self, at: int) -> bool:
        before = self._get_item(at - 1)
        return isinstance(before, Chunk) and before.has("WHILE", "BY")

    def _reopen(self, agent: AgentDraft, modifier: Modifier) -> None:
        if not self.editing:
            return
        agent.edited |= _TOUCHES.get(modifier.means, set())

    def _reconcile_crosswalks(self, agents: Group) -> None:
        """A crosswalk named anew outlives the sides that do not go with it."""
        for agent in agents:
            along = (
                {"north", "south"} if agent.crosswalk in {"north", "south"} else {"east", "west"}
            )
            if self.editing and agent.crosswalk and agent.entry in along:
                agent.entry = agent.exit = None

    def _read_bare_turn(self, at: int, chunk: Chunk) -> None:
        before, after = self._get_item(at - 1), self._get_item(at + 1)
        self._refuse_both_ways(at, chunk)
        closed = after is None or (isinstance(after, Chunk) and (after.mark or after.has("AND")))
        follows = (isinstance(before, Chunk) and bool(before.mark)) or (
            isinstance(before, Modifier) and before.means in {"from", "bound", "leg"}
        )
        vehicles = [agent for agent in self.last if agent.type == "vehicle"]
        if chunk.has("THROUGH") and self._let_through():
            return
        if chunk.has("THROUGH"):
            noun = isinstance(after, Chunk) and after.has("COLLIDE", "NEAR", "YIELD", "AND")
            bound = isinstance(before, Modifier) and before.means == "bound"
            vs = isinstance(before, Mention)
            if (closed or noun) and (bound or follows or vs):
                for agent in vehicles:
                    put(agent, "movement", "straight")
        elif closed and follows:
            for agent in vehicles:
                put(agent, "movement", "left" if chunk.has("LEFT") else "right")

    def _let_through(self) -> bool:
        """ "lets a bus through": nothing is said of its way."""
        relation = self.awaiting
        return relation is not None and relation.tag == "LET" and relation.object is self.last

    def _refuse_both_ways(self, at: int, chunk: Chunk) -> None:
        """ "turns left and right": one vehicle cannot do both."""
        link, turn = self._get_item(at - 1), self._get_item(at - 2)
        joined = isinstance(link, Chunk) and link.text == "and"
        if (
            joined
            and isinstance(turn, Modifier)
            and turn.means == "turn"
            and len(self.subject) == 1
        ):
            for agent in self.modified:
                put(agent, "movement", "left" if chunk.has("LEFT") else "right")

    def _read_property(self, at: int, chunk: Chunk) -> None:
        if chunk.has("SIGNAL") and not chunk.has("REDRUN"):
            self.signal = True
            return
        self.crossing |= chunk.has("CROSS")
        if chunk.text == "from behind" and self._is_hit_from_behind():
            return
        finite = (
            chunk.has("CROSS", "REDRUN", "JAYWALK")
            and not chunk.words[0].endswith("ing")
            and chunk.words[0] not in {"across", "mid", "midblock", "outside"}
        )
        prefer = (
            self.subject
            if (finite and not self._is_of_passing_agent()) or self._is_after_while(at)
            else self.last
        )
        if chunk.has("REDRUN") and self._is_walking_on_red(at, chunk, finite=finite):
            return
        fits = [agent for agent in prefer if can_hold(agent, chunk)]
        if not fits and finite and chunk.has("CROSS"):
            fits = [agent for agent in self.last if can_hold(agent, chunk)]
        if not fits and not (finite and prefer and chunk.has("CROSS")):
            fits = next(
                (
                    [a for a in g if can_hold(a, chunk)]
                    for _, g in reversed(self.sentence)
                    if any(can_hold(a, chunk) for a in g)
                ),
                [],
            )
        if (
            not fits
            and chunk.has("JAYWALK", "CROSS")
            and (chunk.has("JAYWALK") or not finite)
            and not self._has_pedestrians_ahead(at)
        ):
            ped = self.discourse.find_recent("pedestrian")
            fits = [ped] if ped is not None and chunk.has("JAYWALK") else []
        if fits:
            self._mark(fits, chunk)
            if self._is_after_while(at):
                self.last = fits
            if chunk.has("CROSS") and self._get_next_text(at) == "there":
                self._cross_there(fits)
        elif (
            chunk.has("JAYWALK") and finite and self.subject and not self._has_pedestrians_ahead(at)
        ):
            raise Refused(
                "impossible", "Only pedestrians jaywalk; give the crossing to a pedestrian."
            )
        elif chunk.has("JAYWALK", "REDRUN", "OPPOSITE", "OF_OTHER", "ACROSS") or (
            chunk.has("CROSS") and not self.sentence
        ):
            self.fronted.append(chunk)
        if finite:
            self.verb_seen = True

    def _is_hit_from_behind(self) -> bool:
        """ "the second hits the first from behind"."""
        relation = self.open[-1] if self.open else None
        if relation is not None and relation.type == "near_miss":
            bound = [*(relation.subject or []), *(relation.object or [])]
            if bound and all(agent.type == "vehicle" for agent in bound):
                relation.kind = "rear_end"
            return relation.kind == "rear_end"
        if relation is None or relation.type != "collide_at" or relation.kind is not None:
            return False
        bound = [*(relation.subject or []), *(relation.object or [])]
        if len(bound) != 2 or any(agent.type != "vehicle" for agent in bound):
            return False
        relation.kind = "rear_end"
        return True

    def _is_walking_on_red(self, at: int, chunk: Chunk, *, finite: bool) -> bool:
        """ "a pedestrian ignores the light", "crossing against the signal": said of a
        pedestrian."""
        placed = chunk.words[0] in {"against", "on", "in", "through"}
        if finite and not placed:
            self._mark_as_driver(finite=True)
        walkers = self.last
        if not walkers or any(agent.type != "pedestrian" for agent in walkers):
            return False
        before = self._get_item(at - 1)
        if placed:
            crossing = isinstance(before, Modifier) and before.means.startswith("cross")
            walking = isinstance(before, Chunk) and (
                before.has("CROSS") or before.text.startswith(("walk", "step"))
            )
            said = crossing or walking
        elif chunk.words[0].endswith("ing"):
            said = isinstance(before, Mention)
        else:
            said = finite and [*map(id, walkers)] == [*map(id, self.subject)]
        for agent in walkers if said else []:
            agent.runs_red = True
        self.verb_seen |= said and finite
        return said

    def _read_place(self, at: int, chunk: Chunk) -> None:
        """ "on the crosswalk of its exit", "a second one there"."""
        walkers = [agent for agent in self.last if agent.type == "pedestrian"]
        if chunk.has("EXITWALK"):
            named = [a for _, g in self.sentence for a in g if a.type == "pedestrian"]
            self._mark(walkers or named, chunk)
            if not walkers and not named:
                self.fronted.append(chunk)
            return
        known = next((a.crosswalk for a in reversed(self.draft.agents) if a.crosswalk), None)
        after = self._get_item(at + 1)
        exists = isinstance(after, Chunk) and after.has("BE")
        if known is None or (exists and not isinstance(self._get_item(at - 1), Mention)):
            return
        for agent in walkers:
            if agent.crosswalk is None:
                agent.crosswalk = known
                cross(agent)

    def _repeat_movement(self) -> None:
        """ "... and the SUV does the same": the movement of the agent mentioned before."""
        open_ = [agent for agent in self.subject if not agent.movement]
        earlier = open_ or [agent for agent in self.last if not agent.movement]
        others = [a for a in self.draft.agents if a not in earlier and a.type == "vehicle"]
        model = next((a for a in reversed(others) if a.movement or a.exit or a.entry), None)
        self.verb_seen = True
        yields = self._is_giving_way_too(earlier)
        for agent in earlier:
            if model is None or agent.type != "vehicle":
                continue
            agent.movement = model.movement
            if model.movement is None and not yields:
                agent.exit = agent.exit or model.exit
                agent.entry = agent.entry or model.entry

    def _is_giving_way_too(self, earlier: Group) -> bool:
        """ "yields to a pedestrian, and so does the bus"."""
        for relation in reversed(self.open):
            bound = [*(relation.subject or []), *(relation.object or [])]
            same = relation.type == "yield_to" and relation.object and relation.subject
            if same and not (relation.negated or relation.passive) and earlier:
                if not any(agent in bound for agent in earlier):
                    relation.subject = [*(relation.subject or []), *earlier]
                return True
        return False

    def _cross_there(self, agents: Group) -> None:
        leg = next(
            (a.exit for a in reversed(self.draft.agents) if a.type == "vehicle" and a.exit), None
        )
        for agent in agents:
            agent.crosswalk = agent.crosswalk or leg

    def _has_pedestrians_ahead(self, at: int) -> bool:
        return any(isinstance(i, Mention) and i.type == "pedestrian" for i in self.items[at + 1 :])

    def _mark(self, agents: Group, chunk: Chunk) -> None:
        for agent in agents:
            if chunk.has("JAYWALK") and agent.type == "pedestrian":
                if self.editing:
                    agent.crosswalk, agent.marked = None, False
                agent.movement = "jaywalking"
            elif chunk.has("CROSS"):
                cross(agent)
            elif chunk.has("EXITWALK"):
                cross(agent)
                self._relate(agent, f"{chunk.tags['EXITWALK']}_crosswalk")
            elif chunk.has("OPPOSITE"):
                if agent.type == "pedestrian" and chunk.tags["OPPOSITE"] == "mutual":
                    continue
                if self.editing and chunk.tags["OPPOSITE"] == "opposite" and agent.entry:
                    self._turn_round(agent)
                    continue
                self._relate(
                    agent, "opposite" if chunk.tags["OPPOSITE"] == "opposite" else "mutual"
                )
            elif chunk.has("OF_OTHER"):
                self._set_side(agent, chunk.tags["OF_OTHER"])
            elif chunk.has("SAME") and chunk.tags["SAME"] == "same":
                self._relate(agent, "same")
            elif chunk.has("ACROSS"):
                self._relate(agent, _ACROSS[chunk.tags["ACROSS"]])
            elif chunk.has("REDRUN") and agent.type == "vehicle":
                agent.runs_red = True

    def _turn_round(self, agent: AgentDraft) -> None:
        agent.entry = OPPOSITE[agent.entry] if agent.entry else None
        agent.exit = OPPOSITE[agent.exit] if agent.exit else None

    def _set_side(self, agent: AgentDraft, side: str) -> None:
        others = [a for a in self.draft.agents if a is not agent and a.entry is not None]
        if side.startswith("map_") and not others:
            put(agent, "entry", {"map_left": "west", "map_right": "east"}[side])
            return
        self._relate(agent, "of_" + side.removeprefix("map_"))

    def _relate(self, agent: AgentDraft, word: str) -> None:
        other = next((a for a in self.subject if a is not agent and a.type == "vehicle"), None)
        if other is None:
            for _, group in reversed(self.sentence):
                other = next((a for a in group if a is not agent and a.type == "vehicle"), None)
                if other is not None:
                    break
        agent.relatives.append((word, other))

    def _spread_hints(self) -> None:
        """Directions said of no agent in particular hold for all agents that can have them."""
        for hint in self.hints:
            fits = [a for a in self.draft.agents if can_hold(a, hint)]
            if isinstance(hint, Modifier):
                open_ = [
                    a for a in fits if hint.means not in {"bound", "from", "leg"} or a.entry is None
                ]
                vehicles = [a for a in open_ if a.type == "vehicle"]
                single = hint.means in VEHICLE_ONLY
                attach(
                    hint,
                    (vehicles[:1] if single else vehicles) or open_[:1],
                    crossing=self.crossing,
                )
            else:
                self._mark(fits[:1], hint)
