"""What the spans of a reading have become: a draft of the plan, and the account of the words."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field

from scenewright.backends.builtin.draft import AgentDraft, Draft, MeasureDraft
from scenewright.backends.builtin.reader.reading import ReadSpan
from scenewright.scene.account import Became, SaidSpan
from scenewright.scene.measures import format_measure


@dataclass(frozen=True)
class AccountEntry:
    """What a span became, with road users still by number."""

    span: ReadSpan
    became: Became
    users: tuple[int, ...] = ()
    value: str | None = None
    note: str | None = None
    measures: tuple[MeasureDraft, ...] = ()


@dataclass
class Interpretation:
    """A draft, the road users by number, and what every span became.

    Attributes:
        braking: agents that brake hard; dodging: whether one swerves or jumps aside, which is all
            that is said of an event; times: spans that say the time of day; first: those that
            say which agent passes first; behind: those that say this or which one follows; places:
            those that name another place; absent: those that say that a class is not in the scene
            at all.
        eventful: whether the text names any event.
        changing: whether the spans that come next change an earlier instruction; retimed: whether
            such a span has said a time; settling: whether all spans have been read.
    """

    draft: Draft
    text: str = ""
    users: dict[int, AgentDraft] = field(default_factory=dict)
    entries: list[AccountEntry] = field(default_factory=list)
    denied: list[ReadSpan] = field(default_factory=list)
    braking: set[int] = field(default_factory=set)
    dodging: bool = False
    times: list[ReadSpan] = field(default_factory=list)
    first: list[ReadSpan] = field(default_factory=list)
    behind: list[ReadSpan] = field(default_factory=list)
    absent: list[ReadSpan] = field(default_factory=list)
    numbers: list[ReadSpan] = field(default_factory=list)
    lanes: list[ReadSpan] = field(default_factory=list)
    places: list[ReadSpan] = field(default_factory=list)
    spans: tuple[ReadSpan, ...] = ()
    eventful: bool = False
    changing: bool = False
    retimed: bool = False
    settling: bool = False

    def enter(
        self,
        span: ReadSpan,
        became: Became,
        users: Iterable[int] = (),
        value: str | None = None,
        note: str | None = None,
    ) -> None:
        """Add what a span became to the account."""
        self.entries.append(AccountEntry(span, became, tuple(users), value, note))

    def find_users(self, numbers: Iterable[int]) -> list[tuple[int, AgentDraft]]:
        """The road users of these numbers that are in the scene, each with its number."""
        return [(number, self.users[number]) for number in numbers if number in self.users]

    def list_agents(self, numbers: Iterable[int]) -> list[AgentDraft]:
        """The road users of these numbers that are in the scene."""
        return [agent for _, agent in self.find_users(numbers)]

    def list_numbers(self, agents: Collection[AgentDraft]) -> list[int]:
        """The numbers of these road users."""
        return [number for number, agent in self.users.items() if agent in agents]

    def build_account(
        self, names: Mapping[AgentDraft, str], offset: int = 0
    ) -> tuple[SaidSpan, ...]:
        """The account with agents by name.

        Args:
            names: of the agents in the social graph.
            offset: where the instruction begins in the text that was read; what comes before it
                belongs to an earlier instruction.
        """
        return tuple(
            SaidSpan(
                start=each.span.start - offset,
                end=each.span.end - offset,
                words=each.span.words,
                became=each.became,
                agents=tuple(
                    names[agent] for agent in self.list_agents(each.users) if agent in names
                ),
                value="; ".join(
                    format_measure(measure)
                    for draft in each.measures
                    if (measure := draft.name_agents(names)) is not None
                )
                or each.value,
                note=each.note,
            )
            for each in sorted(self.entries, key=lambda entry: entry.span.start)
            if each.span.start >= offset
        )
