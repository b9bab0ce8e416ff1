"""Mentions and pronouns take their place: subject, object, coordination, background."""

from __future__ import annotations

from scenewright.backends.builtin.attach import (
    VEHICLE_ONLY,
    attach,
    cross,
    put,
)
from scenewright.backends.builtin.cursor import (
    Group,
    OpenRelation,
    can_hold,
    get_words,
)
from scenewright.backends.builtin.draft import AgentDraft, Refused, RelationDraft
from scenewright.backends.builtin.grammar import Modifier
from scenewright.backends.builtin.lexicon import Chunk
from scenewright.backends.builtin.mentions import Item, Mention
from scenewright.backends.builtin.relating import Relating
from scenewright.scene.base import AgentClass
from scenewright.scene.social import MOST_BACKGROUND


def _is_verb(item: Item | None) -> bool:
    return isinstance(item, Modifier) or (isinstance(item, Chunk) and item.has("BE", "WAIT"))


_SIDES_OF_TURNS = frozenset({"from", "bound", "from_to"})
_GENERAL = frozenset({"vehicle", "motorist", "deceased", "respondent", "appellant"})
_STAND_INS = frozenset({"vehicle", "pedestrian", "one", "ego", "ego vehicle", "ego car"})
_ON_FOOT = ("walk", "step", "stroll", "jog", "strode", "stride", "limp", "shuffl", "hobbl")
_BESIDES = ("besides", "in addition", "apart from", "elsewhere", "in the background")


def _is_trailing(mention: Mention) -> bool:
    """ "the following car" is not the car ahead of it."""
    return any(premod.text in {"following", "trailing"} for premod in mention.premods)


class Naming(Relating):
    """Places mentions and pronouns in the clause."""

    def _read_mention(self, at: int, mention: Mention) -> None:
        if mention.det == "neither" or self._is_list_heading(at, mention):
            return
        if mention.det == "no":
            self._count_background(mention, 0)
            return
        if self._is_background(at, mention):
            self._count_background(mention, mention.count)
            return
        if self._is_some_others(at, mention):
            return
        group = self._resolve(at, mention)
        if not group:
            return
        self._apply_premodifiers(group, mention)
        self.last = group
        self.sentence.append((at, group))
        self.named[at] = group
        self._set_front(group)
        self._place(at, group[:1] if mention.of_group else group)
        self._set_crossed_before(at, mention, group)
        if mention.counted and self._is_before(at, "WITH"):
            self.counted.append(group)
        self.boundary = self.linked = False

    def _set_crossed_before(self, at: int, mention: Mention, group: Group) -> None:
        """ "two people cross in front of a waiting bus": it waits for them."""
        waits = mention.type == "vehicle" and any(p.text == "waiting" for p in mention.premods)
        of, front = self._get_item(at - 1), self._get_item(at - 2)
        before = get_words(of) == "of" and get_words(front) == "in front"
        walkers = [agent for agent in self.subject if agent.type == "pedestrian"]
        if not (waits and before) or len(walkers) != len(self.subject):
            return
        for walker in walkers:
            self._add_edge(RelationDraft("yield_to", group[0], walker, soft=True))

    def _is_list_heading(self, at: int, mention: Mention) -> bool:
        """ "Vehicles: a bus and a taxi": a heading, no agent of its own."""
        after, then = self._get_item(at + 1), self._get_item(at + 2)
        plain = mention.plural and not mention.counted and mention.det == "bare"
        heading = isinstance(after, Chunk) and after.mark == ":" and not mention.premods
        return plain and heading and isinstance(then, Mention) and then.type is not None

    def _resolve(self, at: int, mention: Mention) -> Group:
        if not self.editing:
            mention.post = self._list_described_after(at)
        if self._is_apposition(at, mention):
            return self.last
        placed = self._find_by_place(at, mention)
        if placed:
            return placed
        self._distinguish_agent(at, mention)
        if mention.head in {"one", "car", "vehicle"} and self._is_of_group(at, mention):
            return []
        same_clause = bool(self.sentence) and not self._is_named_again(at, mention)
        mine = self._find_mine(mention)
        if mine:
            return mine
        group = self.discourse.resolve(mention, avoid=self._find_actors(), same_clause=same_clause)
        self._set_lane(at, mention, group)
        return group

    def _find_by_place(self, at: int, mention: Mention) -> Group:
        """ "the one behind", "the one in front of it"."""
        behind = self._is_one_behind(at, mention)
        pair = next((g for g in reversed(self.discourse.groups) if len(g) > 1), None)
        if behind and pair is not None:
            return pair[:1]
        if behind or self._is_one_ahead(at, mention):
            twin = self.discourse.create("vehicle", head="vehicle")
            self.discourse.groups.append([twin])
            self._relate(twin, "same")
            return [twin]
        if self._is_ahead_of(at) and mention.type is None:
            follows = (r.to for r in reversed(self.draft.relations) if r.type == "follow")
            return list(follows)[:1]
        return []

    def _distinguish_agent(self, at: int, mention: Mention) -> None:
        """ "the car behind it" is a car that was not named before."""
        placed = mention.type is not None and mention.det == "definite"
        if placed and (self._is_ahead_of(at) or self._is_behind(at)):
            mention.det = "another"
        if mention.det in {"definite", "bare"} and _is_trailing(mention):
            mention.det = "another"

    def _is_named_again(self, at: int, mention: Mention) -> bool:
        """A bare noun can name an agent of the same clause again."""
        if mention.det != "bare" or mention.counted:
            return False
        renewed = self._is_after_comma(at) and (
            self._has_verb_ahead(at) or self._get_next_text(at) in {"has", "had"}
        )
        return renewed or self._takes_object() or self._is_echo(at, mention)

    def _set_lane(self, at: int, mention: Mention, group: Group) -> None:
        if self._is_behind(at) and mention.type == "vehicle":
            self.trailing += group[:1]
        near = self._is_behind(at) or self._is_ahead_of(at)
        if near and mention.type == "vehicle" and self._is_same_lane(at):
            for agent in group:
                self._relate(agent, "same")

    def _find_mine(self, mention: Mention) -> Group:
        """ "my car" is the speaker's, before or after the speaker turns up; "ego" is one car."""
        if mention.head.startswith("ego"):
            return [agent for agent in self.draft.agents if "ego" in agent.words]
        if mention.owner != "my" or mention.type != "vehicle":
            return []
        known = [agent for agent in self.draft.agents if agent.label == "me"]
        if known:
            return known if known[0].type == "vehicle" else []
        agent = self.discourse.create("vehicle", head=mention.head)
        agent.label, agent.subtype = "me", mention.subtype
        self.discourse.groups.append([agent])
        return [agent]

    def _is_same_lane(self, at: int) -> bool:
        """ "the bus behind it", not "a bus in front of a pedestrian"."""
        after = self._get_item(at + 2)
        return not (isinstance(after, Chunk) and after.text == "of")

    def _is_echo(self, at: int, mention: Mention) -> bool:
        """ "..., truck at fault": a bare noun that names a known agent once more."""
        after = self._get_item(at + 1)
        known = any(r.object for r in self.open) and self._is_after_comma(at)
        if known and not mention.premods and self._is_only_namesake(mention):
            return True
        plain = (
            isinstance(after, Chunk)
            and not after.mark
            and not after.has("AND", "TO", "BETWEEN", "WITH", "COLLIDE", "NEAR")
        )
        return (
            plain
            and not mention.premods
            and any(agent.head == mention.head for agent in self.draft.agents)
        )

    def _is_only_namesake(self, mention: Mention) -> bool:
        return sum(agent.head == mention.head for agent in self.draft.agents) == 1

    def _is_apposition(self, at: int, mention: Mention) -> bool:
        """ "Unit 1, a sedan heading east" and "the other is a bus" are one agent each."""
        if not self.last or mention.type is None or (mention.counted and mention.count > 1):
            return False
        if self._is_predicate(at, mention):
            self._rename(self.last[0], mention)
            return True
        comma, named = self._get_item(at - 1), self._get_item(at - 2)
        if not (
            isinstance(comma, Chunk) and comma.mark in {",", "("} and isinstance(named, Mention)
        ):
            return False
        after, verb = self._get_item(at + 1), self._get_item(at + 2)
        inserted = isinstance(after, Chunk) and after.mark == "," and _is_verb(verb)
        generic = inserted and named.head in _GENERAL
        bracketed = comma.mark == "(" and isinstance(after, Chunk) and after.mark in {")", ","}
        plain = mention.det == "indefinite" or (mention.det == "bare" and bracketed)
        if not (named.label or generic) or not plain or mention.label:
            return False
        self._rename(self.last[0], mention)
        return True

    def _rename(self, agent: AgentDraft, mention: Mention) -> None:
        if mention.type is not None:
            agent.type = mention.type
        stands_in = {"ego"} if agent.head.startswith("ego") else set()
        agent.subtype, agent.head = mention.subtype, mention.head
        agent.words = agent.words | frozenset(mention.words) | stands_in
        agent.generic = agent.announced = False
        self._apply_premodifiers([agent], mention)

    def _is_predicate(self, at: int, mention: Mention) -> bool:
        """ "Vehicle 1 is a bus", "the other a taxi", "leader: a bus"."""
        link = self._get_item(at - 1)
        plain = mention.det == "indefinite"
        if isinstance(link, Mention):
            return plain and (link.type is None or bool(link.role)) and not self._takes_object()
        named = self._get_item(at - 2)
        if not (isinstance(link, Chunk) and isinstance(named, Mention)):
            return False
        if named.counted and named.count > 1:
            return False
        if link.mark == ":":
            known = named.label or named.role or named.head in _STAND_INS
            return bool(known) and mention.det in {"indefinite", "bare"} and not mention.label
        before = self._get_item(at - 3)
        place = isinstance(before, Chunk) and (
            before.has("SAME", "FOLLOW", "NEARBY", "TO", "OF_OTHER") or before.text == "of"
        )
        same = named.type in {None, mention.type} or bool(named.label)
        return plain and link.text in {"is", "was", "being"} and same and not place

    def _is_one_behind(self, at: int, mention: Mention) -> bool:
        """ "the one behind", "the driver behind it"."""
        person = mention.type is None and mention.head == "one"
        return person and self._is_behind(at) and bool(self.draft.agents)

    def _is_one_ahead(self, at: int, mention: Mention) -> bool:
        """ "the one in front of it", where the text knows one vehicle only."""
        vehicles = [agent for agent in self.draft.agents if agent.type == "vehicle"]
        return mention.type is None and self._is_ahead_of(at) and len(vehicles) == 1

    def _list_described_after(self, at: int) -> list[Modifier]:
        """Entries and -ing turns right after the noun, which distinguish agents."""
        found: list[Modifier] = []
        for item in self.items[at + 1 : at + 6]:
            if isinstance(item, Modifier):
                turns = item.means in {"turn", "straight"} and item.first.endswith("ing")
                if turns or (item.means in {"from", "from_to", "bound"}):
                    found.append(item)
                    continue
                return found
            if not isinstance(item, Chunk) or not (
                item.has("WHO", "BE") or item.text in {"coming", "entering"}
            ):
                return found
        return found

    def _is_of_group(self, at: int, mention: Mention) -> bool:
        """ "one of two cars": the group comes next; the first of it is meant."""
        after, then = self._get_item(at + 1), self._get_item(at + 2)
        if mention.head != "one" or mention.det != "one":
            return False
        if not (isinstance(after, Chunk) and after.text == "of" and isinstance(then, Mention)):
            return False
        then.of_group = 1
        return then.type is not None

    def _apply_premodifiers(self, group: Group, mention: Mention) -> None:
        for premod in mention.premods:
            if isinstance(premod, Modifier):
                for agent in group:
                    self._reopen(agent, premod)
                attach(premod, group, crossing=premod.means == "crosswalk")
            else:
                self._apply_adjective(group, premod)

    def _apply_adjective(self, group: Group, chunk: Chunk) -> None:
        for agent in group:
            if chunk.has("JAYWALK"):
                agent.movement = "jaywalking"
            elif chunk.has("CROSS", "XWALK"):
                cross(agent)
            elif chunk.has("OPPOSITE"):
                self._relate(agent, "opposite")
            elif chunk.has("ACROSS"):
                self._relate(agent, "lateral")
            elif chunk.has("THROUGH", "STRAIGHT") and agent.type == "vehicle":
                put(agent, "movement", "straight")
            elif chunk.has("UTURN") and agent.type == "vehicle":
                put(agent, "movement", "uturn")
            elif chunk.has("REDRUN"):
                agent.runs_red = True
        if chunk.has("YIELD"):
            self.deferred.append(OpenRelation("yield_to", None, 0, group, weak=True))

    def _set_front(self, group: Group) -> None:
        kept: list[Modifier | Chunk] = []
        turns = any(isinstance(w, Modifier) and w.means in VEHICLE_ONLY for w in self.fronted)
        for waiting in self.fronted:
            fits = [agent for agent in group if can_hold(agent, waiting)]
            if turns and isinstance(waiting, Modifier) and waiting.means in _SIDES_OF_TURNS:
                fits = [agent for agent in fits if agent.type == "vehicle"]
            if not fits:
                kept.append(waiting)
            elif isinstance(waiting, Modifier):
                attach(waiting, fits, crossing=self.crossing)
                kept += [waiting] if self.shared else []
            else:
                self._mark(fits, waiting)
        self.fronted = kept

    def _place(self, at: int, group: Group) -> None:
        """Decide whether the mention is object, coordinated, or the subject of a new clause."""
        relation = self.awaiting
        if self.caused:
            self.subject, self.caused = group, False
            return
        if relation is not None and self._is_accepting(relation, at):
            self._give_object(relation, group)
            return
        if self.gap is not None and self.relative and self.boundary:
            self.subject, self.verb_seen = group, False
            return
        last = self.open[-1] if self.open else None
        coordinates = self.linked and self._is_joining(at)
        if coordinates and last is not None and self._is_joining_object(last, at):
            last.object = (last.object or []) + group
            return
        comma = isinstance(before := self._get_item(at - 1), Chunk) and before.mark == ","
        if (
            coordinates
            and self.subject
            and not self.verb_seen
            and not (comma and self._has_verb_ahead(at))
            and not (set(map(id, group)) < set(map(id, self.subject)) and self._has_verb_ahead(at))
        ):
            self.subject = self.subject + [a for a in group if a not in self.subject]
            self.discourse.groups.append(self.subject)
            return
        if not self.subject or (self.boundary and self._has_verb_ahead(at)):
            self.subject, self.verb_seen = group, False

    def _is_accepting(self, relation: OpenRelation, at: int) -> bool:
        if relation.closed:
            return False
        if relation.between:
            return len(relation.object or []) < 2
        if relation.object is not None:
            return False
        if relation.passive and not relation.by:
            return False
        if self.boundary and relation.tag != "WAIT" and self._is_complete(relation):
            return False
        if (
            self.boundary
            and relation.nominal
            and not relation.explicit
            and self._has_verb_ahead(at)
        ):
            before = {id(a) for place, group in self.sentence if place < relation.at for a in group}
            if len(before) > 1:
                return False  # "a bus and a truck have an accident because the truck ..."
        return not (
            self.boundary
            and relation.tag not in {"WAIT", "LET"}
            and not relation.nominal
            and self._has_verb_ahead(at)
        )

    def _give_object(self, relation: OpenRelation, group: Group) -> None:
        known = relation.object or []
        fresh = [agent for agent in group if agent not in known]
        if relation.between:
            relation.object = known + fresh
            return
        if relation.nominal and relation.subject is None:
            relation.object = known + fresh
            relation.between = True
            return
        relation.object = group

    def _is_joining(self, at: int) -> bool:
        before = self._get_item(at - 1)
        if not isinstance(before, Chunk):
            return False
        if self._has_and_to(at):
            return True
        joint = before.text in {"and", "plus", "n", "as well as", "or"} or (
            before.text == "and then" and not self._has_verb_ahead(at)
        )
        return before.mark == "," or (before.has("AND") and joint)

    def _is_joining_object(self, relation: OpenRelation, at: int) -> bool:
        if relation.object is None or self._has_verb_ahead(at) or relation.weak:
            return False
        before = self._get_item(at - 1)
        joined = (isinstance(before, Chunk) and before.has("AND")) or self._has_and_to(at)
        return joined and self.last is not None

    def _has_and_to(self, at: int) -> bool:
        """ "yields to a bus and to a pedestrian"."""
        before, link = self._get_item(at - 1), self._get_item(at - 2)
        preposition = isinstance(before, Chunk) and (before.text in {"to", "for", "by"})
        joint = {"and", "as well as", "and then", "then"}
        return preposition and isinstance(link, Chunk) and link.text in joint

    def _read_pronoun(self, at: int, chunk: Chunk) -> None:
        value = chunk.tags["PRONOUN"]
        if value == "self":
            self._read_reflexive()
            return
        if value == "each":
            self._read_mutual()
            return
        group = self._find_antecedent(at, value, chunk.text)
        if not group:
            return
        before = self._get_item(at - 1)
        if (
            isinstance(before, Mention)
            and self.last
            and not self._takes_object()
            and not self.boundary
        ):
            self.gap = self.last
            self.relative.append((self.subject, self.verb_seen))
            self.subject, self.verb_seen = group, False
            return
        self.discourse.groups.append(group)
        self.last = group
        self.sentence.append((at, group))
        self.named[at] = group
        self._place_pronoun(at, group)
        self.boundary = self.linked = False

    def _place_pronoun(self, at: int, group: Group) -> None:
        relation = self.awaiting
        if relation is not None and self._is_accepting(relation, at):
            relation.object = group
        elif not self.subject or (
            self.boundary and get_words(self._get_item(at)) not in {"him", "her", "them"}
        ):
            self.subject, self.verb_seen = group, False

    def _find_antecedent(self, at: int, value: str, text: str) -> Group:
        avoid = self._find_actors()
        if text == "we" and len(self.draft.agents) > 1:
            value = "they"
        if value == "me":
            return self._find_speaker(at)
        if value == "it":
            return self._find_it(avoid)
        if value == "he":
            ped = self.discourse.find_recent("pedestrian", avoid=avoid)
            vehicle = self.discourse.find_recent("vehicle", avoid=avoid)
            found = self._find_driver(at) or ped or vehicle or self._find_unnamed(at)
            return [found] if found else []
        plural = next(
            (g for g in reversed(self.discourse.groups) if len(g) > 1 and g[0] not in avoid), None
        )
        if self._takes_object() or text == "them":
            ped = self.discourse.find_recent("pedestrian", avoid=avoid)
            if plural is not None and (ped is None or ped in plural):
                return plural
            return [ped] if ped else [a for a in self.draft.agents if a not in avoid][-1:]
        return plural or self.draft.agents[-2:]

    def _find_unnamed(self, at: int) -> AgentDraft | None:
        """ "She was crossing when ...": no agent was named before."""
        kind = None if self._takes_object() else self._own_way(at)
        after = self._get_item(at + 1)
        if kind == "vehicle" and not (isinstance(after, Chunk) and after.has("BE", "DRIVING")):
            return None
        return None if kind is None else self.discourse.create(kind)

    def _find_driver(self, at: int) -> AgentDraft | None:
        """ "A cab driver brakes for a kid; he misses him": the driver goes on acting."""
        group = self.subject or self.previous_subject
        after = self._get_item(at + 1)
        walks = isinstance(after, Modifier) and after.means.startswith("cross")
        if isinstance(after, Chunk) and after.has("BE"):
            after = self._get_item(at + 2)
        walks |= isinstance(after, Chunk) and (
            after.has("CROSS", "JAYWALK") or after.text.startswith("walk")
        )
        if self._takes_object() or walks:
            return None
        drivers = [agent for agent in self.draft.agents if agent.type == "vehicle"]
        ahead = f"{get_words(self._get_item(at + 1))} {get_words(self._get_item(at + 2))}"
        at_wheel = " driv" in f" {ahead}" or " drov" in f" {ahead}"
        if (self._is_striking_pedestrian(at) or at_wheel) and len(drivers) == 1:
            return drivers[0]
        driven = {"driver", "motorist", "cabbie", "operator", "rider", "trucker", "motorcyclist"}
        single = len(group) == 1 and group[0].type == "vehicle"
        return group[0] if single and driven & set(group[0].head.split()) else None

    def _is_striking_pedestrian(self, at: int) -> bool:
        """ "he ... and struck the pedestrian": the subject is no pedestrian."""
        hit = False
        for item in self.items[at + 1 : at + 9]:
            if isinstance(item, Mention):
                return hit and item.type == "pedestrian"
            if isinstance(item, Chunk):
                if item.mark in {".", ";"} or item.has("BY", "WHO"):
                    return False
                hit |= item.has("COLLIDE", "NEAR", "YIELD", "WAIT", "LET")
        return False

    def _find_it(self, avoid: Group) -> Group:
        if not self._takes_object():
            for group in (self.subject, self.previous_subject):
                if len(group) == 1 and group[0].type == "vehicle" and group[0] not in avoid:
                    return group
        found = self.discourse.find_recent("vehicle", avoid=avoid)
        if found is None and self._takes_object():
            found = self.discourse.find_recent(
                "pedestrian", avoid=avoid
            )  # "a child ...; a car hits it"
        return [found] if found else []

    def _find_speaker(self, at: int) -> Group:
        """ "I was driving ..." names a vehicle, "I was crossing ..." a pedestrian."""
        known = [agent for agent in self.draft.agents if agent.label == "me"]
        if known:
            return known
        if self._get_item(at) is None or not {"i", "me", "we", "us"} & set(
            get_words(self.items[at]).split()
        ):
            return []
        objective = bool({"me", "us"} & set(get_words(self.items[at]).split()))
        kind = self._own_way(at) if not objective else self._own_class(at)
        if kind is None:
            return []
        agent = self.discourse.create(kind, head="car" if kind == "vehicle" else "pedestrian")
        agent.label = "me"
        return [agent]

    def _own_class(self, at: int) -> AgentClass | None:
        """ "hits me" names a vehicle, "lets me cross" a pedestrian."""
        after = self._get_item(at + 1)
        if isinstance(after, Chunk) and after.has("CROSS"):
            return "pedestrian"
        for then, item in enumerate(self.items[at + 1 :], start=at + 1):
            known = self._own_way(then) if get_words(item) == "i" else None
            if known is not None:
                return known
        return "vehicle" if self._takes_object() else None

    def _own_way(self, at: int) -> AgentClass | None:
        """The class of the speaker, from what he says he did."""
        for item in self.items[at + 1 : at + 4]:
            if isinstance(item, Mention):
                return None
            if isinstance(item, Modifier):
                on_foot = item.means.startswith("cross") or item.means == "on_crosswalk"
                return "pedestrian" if on_foot or item.first.startswith(_ON_FOOT) else "vehicle"
            if item.has("CROSS", "JAYWALK") or item.text.startswith(_ON_FOOT):
                return "pedestrian"
            if item.has("COLLIDE", "YIELD", "WAIT", "FOLLOW", "LET", "HEAD", "TURN", "DRIVING"):
                return "vehicle" if item.words[0] not in {"make", "let", "give"} else None
            if item.mark or not (
                item.has("BE", "ALMOST", "NEGATION")
                or item.text in {"just", "had", "the right of way", "right of way", "priority"}
            ):
                return None
        return None

    def _read_reflexive(self) -> None:
        if self.awaiting is not None and self.awaiting.object is None and self.awaiting.subject:
            raise Refused("impossible", "An agent cannot do this to itself; name a second agent.")

    def _read_mutual(self) -> None:
        if self.awaiting is not None and self.awaiting.type == "follow":
            self.open.remove(self.awaiting)
            self.awaiting = None
            self._chain()
            return
        if self.awaiting is not None and self.awaiting.object is None:
            subject = self.awaiting.subject or []
            if len(subject) < 2:
                others = [a for _, g in self.sentence for a in g if a not in subject]
                self.awaiting.object = others[:1] or None
            self.awaiting.closed = True
            self.awaiting = None

    def _set_plural_subject(self, *, everyone: bool = False) -> None:
        group = next(
            (g for g in reversed(self.discourse.groups) if len(g) > 1), self.draft.agents[-2:]
        )
        self.shared = not self.draft.agents  # "both go straight, a car from ... and a bus"
        if everyone and not self._takes_object():
            group = [agent for agent in self.draft.agents if agent.type == "vehicle"]
        if len(group) > 1:
            relation = self.awaiting
            if (
                relation is not None
                and relation.object is None
                and relation.tag in {"WAIT", "YIELD", "LET"}
            ):
                relation.object = [a for a in group if a not in (relation.subject or [])]
            else:
                self.subject, self.verb_seen = list(group), False
            self.last = list(group)

    def _is_background(self, at: int, mention: Mention) -> bool:
        if mention.type is None or mention.of_group or mention.mass:
            return False
        marked = any(isinstance(p, Chunk) and p.has("BACKGROUND") for p in mention.premods)
        if marked and (mention.counted or mention.plural):
            return mention.counted
        if not mention.counted:
            return False
        if mention.count > 6 or self._has_background_ahead(at) or self._has_background_before(at):
            return True
        others = mention.det in {"other"} or (mention.first_word and self._has_other(mention))
        return bool(others) and not self._takes_object()

    def _is_some_others(self, at: int, mention: Mention) -> bool:
        """ "with other cars around": no agent in particular."""
        some = mention.plural and not mention.counted and mention.det == "other"
        return some and self._has_background_ahead(at) and not self._takes_object()

    def _has_other(self, mention: Mention) -> bool:
        return mention.det == "other"

    def _has_background_before(self, at: int) -> bool:
        """ "besides them there are two buses and five pedestrians"."""
        for back in range(1, 9):
            item = self._get_item(at - back)
            if (
                isinstance(item, Chunk)
                and item.has("BACKGROUND")
                and item.text.startswith(_BESIDES)
            ):
                return True
            if item is None or (isinstance(item, Chunk) and item.mark in {".", ";"}):
                return False
        return False

    def _has_background_ahead(self, at: int) -> bool:
        for step in range(1, 6):
            item = self._get_item(at + step)
            if isinstance(item, Chunk) and item.has("BACKGROUND"):
                return True
            if isinstance(item, Mention):
                if not item.counted:
                    return False
                continue
            if (
                item is None
                or isinstance(item, Modifier)
                or (
                    item.tags
                    and not item.has("AND", "WITH", "LEG")
                    and item.text != "in"
                    and not self._is_continuing_list(at + step)
                )
            ):
                return False
        return False

    def _is_continuing_list(self, at: int) -> bool:
        """ "4 cars, 2 pedestrians in the background"."""
        comma, then = self._get_item(at), self._get_item(at + 1)
        listed = isinstance(then, Mention) and then.counted
        return isinstance(comma, Chunk) and comma.mark == "," and listed

    def _count_background(self, mention: Mention, count: int) -> None:
        if mention.type is None:
            return
        context = self.draft.context
        if count > MOST_BACKGROUND:
            raise Refused(
                "impossible",
                f"{count} background agents are too many; ask for at most {MOST_BACKGROUND}.",
            )
        if mention.type == "vehicle":
            context.vehicles = count
        else:
            context.pedestrians = count
        self.last = self.last or []

    def _bound(self, group: Group) -> bool:
        """Some relation has taken one of the agents already."""
        bound = [
            agent
            for r in self.open + self.deferred
            for agent in (r.subject or []) + (r.object or [])
        ]
        bound += [agent for edge in self.draft.relations for agent in (edge.from_, edge.to)]
        bound += [agent for edge in self.failed for agent in (edge.from_, edge.to)]
        return any(agent in bound for agent in group) or self.counted.count(group) == 0

    def move_to_background(self, group: Group) -> None:
        """Take the agents of a counted mention out of the scene; they are background."""
        if self._bound(group):
            return
        for agent in group:
            if agent in self.draft.agents:
                self.draft.agents.remove(agent)
        self.discourse.groups = [g for g in self.discourse.groups if g is not group]
        self.sentence = [(at, g) for at, g in self.sentence if g is not group]
        kind = group[0].type
        if kind == "vehicle":
            self.draft.context.vehicles = len(group)
        else:
            self.draft.context.pedestrians = len(group)
        self.counted.remove(group)
        self.last = self.sentence[-1][1] if self.sentence else []
        if self.subject is group:
            self.subject = []
