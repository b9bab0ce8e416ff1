"""The account of words: what every content word of an instruction became (SEMANTICS 8)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any, Literal

from pydantic import Field, model_validator

from scenewright.scene.base import Model

Became = Literal[
    "agent", "entry", "exit", "movement", "crosswalk", "runs_red", "relation", "cause", "tie",
    "time_of_day", "density", "background", "normal", "denied", "measure", "impact_point", "order",
    "signals", "road", "retracted", "manoeuvre", "motion", "object", "sight", "constraint",
    "behavior", "manner", "nothing", "reaction", "encounter", "striker",
]  # fmt: skip
"""What words can become.

`constraint` and `behavior` are no field of the plan: the waypoint filter turns the former into
clauses, the event reasoner the latter into standstills. `object` is what stands, `sight` which
agent it hides, `encounter` what an agent does about it; their value begins with its id. `manner`
has no effect on tracks, `nothing` cannot be realised.
"""


NAME = "name"
"""The note of words that an agent is called by, such as Anna, whatever class it has."""

LEFT_TO_STAGES = ("constraint", "behavior")
"""What words became that no field of a plan holds."""


class SaidSpan(Model):
    """Words of the instruction and what they became in the plan.

    Attributes:
        start, end: characters of the instruction, end exclusive; both 0 in a model's reply, where
            the program finds the words.
        words: the words themselves.
        became: the part of the plan.
        agents: those it is said of; two for relations and ties.
        value: what exactly: a leg, a relation, a time, a number, a clause, standstills.
        note: why the words became nothing; NAME of an agent's own name.
    """

    start: int = Field(default=0, ge=0)
    end: int = Field(default=0, ge=0)
    words: str = Field(min_length=1, max_length=400)
    became: Became
    agents: tuple[str, ...] = ()
    value: str | None = None
    note: str | None = None


class SaidRecord(Model):
    """What the planner took words for, as scene.json has it: a hint that claims nothing.

    Attributes:
        agents: numbers of agents as in scene.json; the rest as in `SaidSpan`.
    """

    start: int
    end: int
    words: str
    became: Became
    agents: tuple[int, ...] = ()
    value: str | None = None
    note: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _drop_status(cls, fields: Any) -> Any:
        """Files of releases before 0.2 say whether the checker had found it."""
        if isinstance(fields, dict):
            return {k: v for k, v in fields.items() if k not in ("status", "evidence")}
        return fields


WordState = Literal["seen", "stands_anyway", "manner", "not_shown", "contradicted"]
"""What a scene has of a word (SEMANTICS 9)."""


class AccountEntry(Model):
    """A content word of the texts in force, and what the scene has of it.

    Attributes:
        turn: number of the text, from 0; start, end: its characters, end exclusive.
        claim: what the word was taken to say, where a claim covers it.
        evidence: what the checker saw, or why nothing shows the word.
        agents: numbers of the agents in the evidence.
    """

    turn: int = 0
    start: int
    end: int
    words: str
    state: WordState
    claim: str | None = None
    evidence: str = ""
    agents: tuple[int, ...] = ()


def list_unrealised(said: Iterable[SaidSpan]) -> tuple[str, ...]:
    """The words that became nothing, in order."""
    return tuple(each.words for each in said if each.became == "nothing")


def format_background(counts: Mapping[str, int]) -> str:
    """The value of an entry that says how many others there are: "3 vehicles, 0 pedestrians"."""
    return ", ".join(f"{count} {kind}" for kind, count in counts.items())


def read_background(value: str | None) -> dict[str, int]:
    """Vehicles and pedestrians as `format_background` writes them; empty where none are said.

    >>> read_background("3 vehicles, 0 pedestrians"), read_background(None)
    ({'vehicles': 3, 'pedestrians': 0}, {})
    """
    found = re.findall(r"(\d+) (vehicles|pedestrians)\b", value or "")
    return {kind: int(count) for count, kind in found}


def number_agents(said: Iterable[SaidSpan], numbers: Mapping[str, int]) -> tuple[SaidRecord, ...]:
    """The account with the numbers that agents have in scene.json."""
    return tuple(
        SaidRecord.model_validate(
            {
                **each.model_dump(),
                "agents": tuple(numbers[name] for name in each.agents if name in numbers),
            }
        )
        for each in said
    )
