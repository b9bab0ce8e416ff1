"""What the checker finds in final tracks, and the proof it writes."""

from __future__ import annotations

import math
from typing import Any, Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from scenewright.scene.account import AccountEntry, WordState
from scenewright.scene.base import Model, Point, is_left_out
from scenewright.scene.social import CollisionKind

EventType = Literal["collision", "near_miss", "yielding", "follow"]
Verdict = Literal["verified", "partly", "not verified"]

EventZone = Literal["crosswalk", "sidewalk", "conflict", "lane", "roadway"]
"""Where an event lies: on a crosswalk; inside the junction; in the lane of two that go one way; on
the road, and off the crosswalks of pedestrians."""

EVENT_OF_RELATION: dict[str, EventType] = {
    "collide_at": "collision",
    "near_miss": "near_miss",
    "yield_to": "yielding",
    "follow": "follow",
}
RELATION_OF_EVENT = {str(event): relation for relation, event in EVENT_OF_RELATION.items()}


class Moment(Model):
    """A measured figure, and when [s] and where [m] it was measured."""

    value: float
    time: float
    location: Point


class Event(Model):
    """One encounter of two agents (SEMANTICS section 4).

    Attributes:
        from_, to: int ids of the agents as in scene.json.
        time: [s] since scene start; place [m] in the map frame.
        kind: of a collision.
        cause: `red_light_run`, `late_brake`, ... where one is seen.
        evidence: the measured figures that decided (pet, clearance, speeds, ...).
        when: figure of the evidence -> its moment, where that need not be the event's: a PET is
            that of the arrival of the later one, at the place that both touch.
        worst: figure -> its worst value between the two over the whole scene; of encounters without
            contact that were asked for.
    """

    type: EventType
    from_: int = Field(alias="from")
    to: int
    time: float
    location: Point
    kind: CollisionKind | None = None
    cause: str | None = None
    evidence: dict[str, Any] = Field(default_factory=dict)
    when: dict[str, Moment] = Field(default_factory=dict, exclude_if=is_left_out)
    worst: dict[str, Moment] = Field(default_factory=dict, exclude_if=is_left_out)

    def list_worse(self) -> dict[str, Moment]:
        """Figures that are worse at another moment of the scene than in the event itself.

        Of those that the event has, and of times to collision, where it came to none.
        """
        own = {"path_ttc": math.inf, "ttc_2d": math.inf} | self.evidence
        return {
            name: each
            for name, each in self.worst.items()
            if name in own and (-1 if name == "drac" else 1) * (each.value - own[name]) < 0.0
        }


class Finding(Model):
    """A rule that the scene breaks, with what was measured."""

    rule: str
    agents: tuple[int, ...]
    time: float | None = None
    measured: float | None = None
    limit: float | None = None
    detail: str


class Proof(Model):
    """The checker's verdict on one scene.

    Attributes:
        verified: every relation asked for is observed, and nothing below is broken.
        events: what was asked for and everything that breaks the certificate.
        incidental: allowed yet unasked: between background agents, and follows.
        missing: relations asked for and not observed, in words with evidence.
        interference: certificate of no other interaction, its violations (empty = holds).
        implausible: violations of SEMANTICS section 5.
        signal_violations: red crossings by agents not named as violators.
        account: the state of each content word of the texts in force (SEMANTICS 9).
        scene_digest: names the scene.json that is proven (`scene.digest`); None where none is.
    """

    schema_version: Literal[1] = 1
    verified: bool
    events: tuple[Event, ...]
    incidental: tuple[Event, ...] = ()
    missing: tuple[Finding, ...] = ()
    interference: tuple[Finding, ...] = ()
    implausible: tuple[Finding, ...] = ()
    signal_violations: tuple[Finding, ...] = ()
    account: tuple[AccountEntry, ...] = ()
    figures: dict[str, Any] = Field(default_factory=dict)
    scene_digest: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _drop_said(cls, fields: Any) -> Any:
        """Files of releases before 0.2 hold the planner's hints as well."""
        return (
            {k: v for k, v in fields.items() if k != "said"} if isinstance(fields, dict) else fields
        )

    @property
    def verdict(self) -> Verdict:
        """Whether events and words are proven; `partly` where some words are not shown."""
        if not self.verified:
            return "not verified"
        return "partly" if self.list_words("not_shown") else "verified"

    @property
    def unasked_red_lights(self) -> int:
        """How many red lights are run that no word of the request asks for."""
        runs = self.figures.get("unasked_red_light_runs", ())
        return len(runs) if isinstance(runs, list | tuple) else 0

    @property
    def caveat(self) -> str:
        """What stands beside the tick; empty where nothing does."""
        words, count = self.list_words("not_shown"), self.unasked_red_lights
        found = [f"{', '.join(repr(word.words) for word in words)} not shown"] if words else []
        found += ["no account of words"] if self.verified and not self.account else []
        found += [f"{count} red light{'s' if count > 1 else ''} run unasked"] if count else []
        return ", ".join(found)

    def describe_verdict(self) -> str:
        """The verdict with what stands beside it: "partly: 'dog' not shown"."""
        joint = ": " if self.verdict == "partly" else ", "
        return f"{self.verdict}{joint}{self.caveat}" if self.caveat else self.verdict

    def build_verdict(self) -> dict[str, Any]:
        """What replies say of a scene: the verdict and the account, as plain JSON values."""
        return {
            "verified": self.verified,
            "verdict": self.verdict,
            "caveat": self.caveat,
            "account": [each.model_dump(mode="json") for each in self.account],
        }

    def list_words(self, state: WordState) -> tuple[AccountEntry, ...]:
        """The words of the texts in one state, in order."""
        return tuple(each for each in self.account if each.state == state)

    @model_serializer(mode="wrap")
    def _leave_out_no_digest(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        plain: dict[str, Any] = write(self)
        if plain.get("scene_digest") is None:
            plain.pop("scene_digest", None)
        return plain
