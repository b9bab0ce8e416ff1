"""What words say of a scene: a claim, its test, and what the test found."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

from scenewright.scene.events import Event
from scenewright.tools.account.facts import SceneFacts

Bound = frozenset[int | str]
"""Numbers of agents or ids of objects that a mention stands for."""

Binding = Mapping[int, Bound]
"""What each mention stands for, by its index."""

BACKGROUND = "background"
"""What a plural stands for that is said of the traffic around."""


class Result(NamedTuple):
    """Outcome of a test: None where it could not be made; with the agents or event it saw."""

    holds: bool | None
    evidence: str = ""
    agents: tuple[int, ...] = ()
    event: Event | None = None


UNTESTED = Result(None)

ClaimType = Literal[
    "absence", "background", "braking", "cause", "class", "count", "crossing", "crosswalk",
    "density", "encounter", "event", "group", "heading", "kind", "light", "manoeuvre", "motion",
    "moves", "movement", "number", "object", "order", "pace", "phrase", "point", "reaction",
    "red_light", "sequence", "side", "sight", "stop", "tie", "time",
]  # fmt: skip

Test = Callable[[SceneFacts, Binding], Result]


@dataclass(frozen=True)
class Claim:
    """What words say of a scene.

    Attributes:
        type: one of docs/checker.md; value: what exactly, for the account.
        tokens: indices of the words; mentions: those that the test may look at.
        test: says whether it holds of a scene under a binding.
    """

    type: ClaimType
    value: str
    tokens: tuple[int, ...]
    mentions: tuple[int, ...]
    test: Test


def list_agents(binding: Binding, mention: int) -> tuple[int, ...]:
    """The agents, not the objects, that a mention stands for."""
    return tuple(n for n in binding.get(mention, ()) if isinstance(n, int))


def list_pairs(
    binding: Binding, ones: Iterable[int], others: Iterable[int]
) -> Iterator[tuple[int, int]]:
    """Pairs of two agents: the first of a mention of `ones`, the second of one of `others`."""
    others = tuple(others)
    for one in ones:
        for other in others:
            for first in list_agents(binding, one):
                yield from ((first, n) for n in list_agents(binding, other) if n != first)
