"""The agents that a mention means: new ones, or ones that the text has introduced."""

from __future__ import annotations

from collections.abc import Sequence

from scenewright.backends.builtin.draft import AgentDraft, Draft, Refused
from scenewright.backends.builtin.grammar import Modifier
from scenewright.backends.builtin.lexicon import Chunk
from scenewright.backends.builtin.mentions import Mention
from scenewright.scene.base import AgentClass
from scenewright.scene.social import MOST_AGENTS

OPPOSITE = {
    "north": "south", "south": "north", "east": "west", "west": "east",
    "northeast": "southwest", "southwest": "northeast",
    "northwest": "southeast", "southeast": "northwest",
}  # fmt: skip
_ORDINALS = {"first": 0, "second": 1, "third": 2, "middle": 1, "last": -1}
_COLOURS = frozenset(
    [
        "red",
        "blue",
        "green",
        "white",
        "black",
        "yellow",
        "silver",
        "grey",
        "gray",
        "brown",
        "orange",
        "purple",
        "pink",
        "beige",
        "gold",
        "maroon",
        "tan",
        "dark",
    ]
)
_SAME_THING = (
    frozenset({"taxi", "cab", "taxicab", "cabbie", "minicab"}),
    frozenset({"pickup", "truck"}),
    frozenset({"motorcycle", "motorbike", "motorcyclist", "biker", "moped", "rider"}),
    frozenset(
        {"truck", "lorry", "trucker", "semi", "rig", "trailer", "wheeler", "tanker", "engine"}
    ),
    frozenset({"cyclist", "bicyclist", "bicycle", "bike", "rider"}),
    frozenset({"scooter", "escooter", "rider"}),
    frozenset({"bus", "coach", "shuttle", "minibus"}),
    frozenset({"ambulance", "vehicle"}),
)
_ANY_VEHICLE = frozenset({"vehicle", "driver", "motorist", "vehicles", "drivers"})
_UNITS = frozenset({"unit", "agent", "participant", "party", "road user", "actor"})
_LABELS = "1234abcd"


class Discourse:
    """The agents of a text in order of mention, and the groups that mentions made."""

    def __init__(self, draft: Draft) -> None:
        self.draft = draft
        self.groups: list[list[AgentDraft]] = [[agent] for agent in draft.agents]
        self.seeded = bool(draft.agents)
        self.claimed: list[AgentDraft] = []

    def resolve(
        self, mention: Mention, *, avoid: Sequence[AgentDraft] = (), same_clause: bool = False
    ) -> list[AgentDraft]:
        """The agents that the mention means; new ones are entered."""
        found = self._find_existing(mention, avoid, same_clause)
        group = found if found is not None else self._introduce_agents(mention)
        self.groups.append(group)
        return group

    def find_recent(
        self, kind: AgentClass, *, avoid: Sequence[AgentDraft] = ()
    ) -> AgentDraft | None:
        """The agent of this class that was mentioned last."""
        for group in reversed(self.groups):
            for agent in reversed(group):
                if agent.type == kind and agent not in avoid:
                    return agent
        return None

    def create(self, kind: AgentClass, *, head: str = "") -> AgentDraft:
        """A new agent that no noun phrase named."""
        if len(self.draft.agents) >= MOST_AGENTS:
            raise Refused(
                "out_of_scope", f"At most {MOST_AGENTS} agents can take part; name fewer."
            )
        agent = AgentDraft(kind, head=head)
        self.draft.agents.append(agent)
        return agent

    def _find_existing(
        self, mention: Mention, avoid: Sequence[AgentDraft], same_clause: bool
    ) -> list[AgentDraft] | None:
        if mention.type is None:
            return self._find_pronominal(mention, avoid)
        if mention.label is not None:
            return self._find_labelled(mention)
        same_class = [agent for agent in self.draft.agents if agent.type == mention.type]
        announced = [agent for agent in same_class if agent.announced and agent not in avoid]
        if (
            mention.det in {"indefinite", "bare", "another", "definite", "both"}
            and len(announced) >= mention.count
        ):
            return self._name_at_last(announced[: mention.count], mention)
        if mention.det == "both" or (
            mention.counted and mention.count > 1 and mention.det == "definite"
        ):
            fitting = [agent for agent in same_class if _is_compatible(agent, mention)]
            return fitting[-mention.count :] if len(fitting) >= mention.count else None
        if mention.counted and mention.count > 1:
            return None
        if mention.plural and mention.det in {"definite", "bare"} and len(same_class) > 1:
            return same_class
        return self._find_singular(mention, same_class, avoid, same_clause)

    def _is_met(self, agent: AgentDraft) -> bool:
        """The agent comes towards another one."""
        entries = {other.entry for other in self.draft.agents if other is not agent}
        known = any(word in {"opposite", "mutual"} for word, _ in agent.relatives)
        return known or (agent.entry is not None and OPPOSITE[agent.entry] in entries)

    def _is_unnamed(self, agent: AgentDraft) -> bool:
        """ "the two vehicles ...: the van ... the oncoming car": one of the two, so far unnamed."""
        known = agent.entry or agent.exit or agent.movement or agent.relatives
        pairs = [group for group in self.groups if len(group) == 2 and agent in group]
        return agent.head == "vehicles" and bool(pairs) and not known

    def _name_at_last(self, group: list[AgentDraft], mention: Mention) -> list[AgentDraft]:
        for agent in group:
            agent.announced = False
            agent.subtype, agent.head = mention.subtype or agent.subtype, mention.head
            if mention.jaywalking:
                agent.movement = "jaywalking"
        return group

    def _find_singular(
        self,
        mention: Mention,
        same_class: list[AgentDraft],
        avoid: Sequence[AgentDraft],
        same_clause: bool,
    ) -> list[AgentDraft] | None:
        fitting = [agent for agent in same_class if _is_compatible(agent, mention)]
        if any(isinstance(premod, Chunk) and premod.has("OPPOSITE") for premod in mention.premods):
            fitting = [agent for agent in fitting if self._is_met(agent) or self._is_unnamed(agent)]
        if mention.det in _ORDINALS:
            index = _ORDINALS[mention.det]
            alike = [agent for agent in same_class if _is_of_kind(agent, mention)]
            pool = alike if len(alike) > max(index, 0) else []
            return (
                [pool[index]]
                if pool and not (mention.premods and pool[index] not in fitting)
                else None
            )
        if mention.det == "other":
            others = [
                agent for agent in fitting if agent not in avoid and agent not in self._get_last()
            ]
            return [others[-1]] if others else None
        if mention.det in {"indefinite", "another", "no"} or mention.mass:
            return None
        if mention.det == "bare" and (same_clause or len(fitting) != 1):
            return None
        free = [agent for agent in fitting if agent not in avoid]
        if not free:
            return None
        return [
            max(free, key=lambda agent: (_score_affinity(agent, mention), self._get_recency(agent)))
        ]

    def _find_pronominal(
        self, mention: Mention, avoid: Sequence[AgentDraft]
    ) -> list[AgentDraft] | None:
        pair = next((g for g in reversed(self.groups) if len(g) > 1), None)
        group = pair or list(self.draft.agents)
        if not group:
            return []
        if mention.det == "another" and pair is None:
            return self._find_twin(self._get_last()[-1] if self._get_last() else group[-1])
        described = [agent for agent in self.draft.agents if _score_affinity(agent, mention) >= 4]
        known = mention.premods or mention.words or mention.post
        if known and described and mention.det != "one":
            return described[-1:]
        if mention.det in _ORDINALS:
            index = _ORDINALS[mention.det]
            alike = [] if pair else self._find_like(avoid)
            if max(index, 0) < len(alike) and alike[index] not in avoid:
                return [alike[index]]
            return [group[index]] if index < len(group) else self._find_twin(group[-1])
        if len(group) == 1 and group[0].generic and mention.det == "one":
            group[0].generic = False
            return group
        if len(group) == 1:
            return (
                self._find_twin(group[-1])
                if mention.det in {"one", "another", "indefinite", "other"}
                else self._choose_only(group, avoid)
            )
        if mention.det in {"one", "definite", "indefinite"}:
            free = [agent for agent in group if agent not in self.claimed] or group
            self.claimed.append(free[0])
            return [free[0]]
        acting = [agent for agent in avoid if agent in group]
        if len(acting) == len(group):
            acting = []
        last = acting or self.claimed[-1:] or self._get_last()
        others = [agent for agent in group if agent not in last and agent not in avoid]
        if not others:
            others = [agent for agent in group if agent not in last]
        if others:
            self.claimed.append(others[0])
            return [others[0]]
        if mention.det == "another" and group:
            return self._find_twin(group[-1])
        return []

    def _find_like(self, acting: Sequence[AgentDraft]) -> list[AgentDraft]:
        """ "a third car collides with the second": all agents of the actor's class."""
        kinds = {agent.type for agent in acting}
        return [agent for agent in self.draft.agents if {agent.type} == kinds]

    def _find_twin(self, agent: AgentDraft) -> list[AgentDraft]:
        twin = self.create(agent.type, head=agent.head)
        twin.subtype = agent.subtype
        return [twin]

    def _choose_only(
        self, group: list[AgentDraft], avoid: Sequence[AgentDraft]
    ) -> list[AgentDraft]:
        return [agent for agent in group if agent not in avoid]

    def _find_labelled(self, mention: Mention) -> list[AgentDraft] | None:
        unit = mention.head in _UNITS
        for agent in self.draft.agents:
            if agent.label == mention.label and (agent.type == mention.type or unit):
                return [agent]
        announced = [agent for agent in self.draft.agents if agent.announced]
        if announced and announced[0].type == mention.type:
            announced[0].announced, announced[0].label = False, mention.label
            return announced[:1]
        return self._find_nth(mention)

    def _find_nth(self, mention: Mention) -> list[AgentDraft] | None:
        """ "two cars: car 1 ..., car 2 ...": the labels distinguish the members of a counted
        group."""
        place = _LABELS.find(mention.label or " ") % 4
        for group in reversed(self.groups):
            if not (len(group) > 1 and place < len(group)):
                continue
            agent = group[place]
            same = agent.type == mention.type and _is_compatible(agent, mention)
            if same and agent.label is None and agent.head.rstrip("s") == mention.head.rstrip("s"):
                agent.label = mention.label
                return [agent]
        return None

    def _introduce_agents(self, mention: Mention) -> list[AgentDraft]:
        if mention.type is None:
            return []
        count = mention.count if mention.counted else 1
        group = []
        for _ in range(count):
            agent = self.create(mention.type, head=mention.head)
            agent.subtype = mention.subtype  # checked against the social graph's list on output
            agent.label = mention.label
            agent.words, agent.role = frozenset(mention.words), mention.role
            agent.generic = (
                mention.plural
                and not mention.counted
                and mention.det in {"bare", "indefinite", "definite"}
            )
            if mention.jaywalking:
                agent.movement = "jaywalking"
            group.append(agent)
        if count > 1:
            self.claimed = []
        return group

    def _get_last(self) -> list[AgentDraft]:
        return self.groups[-1] if self.groups else []

    def _get_recency(self, agent: AgentDraft) -> int:
        return max((i for i, group in enumerate(self.groups) if agent in group), default=-1)


def _is_of_kind(agent: AgentDraft, mention: Mention) -> bool:
    """ "the first car" of a bus and two cars is the first of the cars."""
    general = mention.head in _ANY_VEHICLE or mention.type == "pedestrian"
    return general or agent.subtype in {None, mention.subtype}


def _is_compatible(agent: AgentDraft, mention: Mention) -> bool:
    colours, known = _COLOURS.intersection(mention.words), _COLOURS & agent.words
    if (colours and known and not colours & known) or (agent.role and mention.role != agent.role):
        return False
    if not all(_is_agreeing(agent, modifier) for modifier in mention.post):
        return False
    if (
        mention.subtype
        and mention.head != "car"
        and agent.subtype
        and agent.subtype != mention.subtype
        and not _is_same_word(agent.head, mention.head)
    ):
        return False
    if mention.head == "car" and agent.subtype not in {None, "car"}:
        return False
    specific = mention.head not in _ANY_VEHICLE | {"car", "cars"} and mention.type == "vehicle"
    if specific and agent.head not in _ANY_VEHICLE | {"car", "cars", mention.head}:
        return _is_same_word(agent.head, mention.head)
    return all(
        _is_agreeing(agent, premod) for premod in mention.premods if isinstance(premod, Modifier)
    )


def _is_same_word(first: str, second: str) -> bool:
    """ "the pickup" can be the pickup truck, "the cab" the taxi."""
    if not first:
        return True
    ours, theirs = _list_singulars(first), _list_singulars(second)
    return bool(ours & theirs) or any(ours & same and theirs & same for same in _SAME_THING)


def _list_singulars(head: str) -> set[str]:
    return {
        word if word.endswith("ss") or word == "bus" else word.rstrip("s") for word in head.split()
    }


def _is_agreeing(agent: AgentDraft, premod: Modifier) -> bool:
    if premod.means == "bound":
        return agent.entry in {None, OPPOSITE[premod.values[0]]}
    if premod.means == "from":
        return agent.entry in {None, premod.values[0]}
    if premod.means == "turn":
        return agent.movement in {None, premod.values[0]}
    if premod.means == "straight":
        return agent.movement in {None, "straight"}
    if premod.means == "from_to":
        return agent.entry in {None, premod.values[0]}
    return True


def _score_affinity(agent: AgentDraft, mention: Mention) -> int:
    score = 2 * (agent.head == mention.head) + (agent.subtype == mention.subtype)
    score += 4 * bool(_COLOURS.intersection(mention.words) & agent.words)
    for premod in [*mention.premods, *mention.post]:
        if isinstance(premod, Modifier) and premod.means in {"from", "from_to"}:
            score += 4 * (agent.entry == premod.values[0])
        if (
            isinstance(premod, Modifier)
            and premod.means == "straight"
            and agent.movement == "straight"
        ):
            score += 4
        if (
            isinstance(premod, Modifier)
            and premod.means == "bound"
            and agent.entry == OPPOSITE[premod.values[0]]
        ):
            score += 4
        if (
            isinstance(premod, Modifier)
            and premod.means == "turn"
            and agent.movement == premod.values[0]
        ):
            score += 4
    return score
