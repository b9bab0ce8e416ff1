"""The state of a thread, as it is checkpointed: plain values, products by their fingerprint."""

from __future__ import annotations

from typing import Any, Literal, TypedDict

Act = Literal["say", "make", "plan", "edit", "undo", "redo", "branch"]


class Version(TypedDict):
    """One verified version.

    Attributes:
        number: from 1, never used again in this thread; parent: what it was made from.
        words: what was said; text: everything said up to it, for the scene's prompt.
        edits: what the words amounted to; graph: its social graph.
        scene, proof, provenance, earlier: fingerprints of what is kept.
        moved, gone, come: other agents that changed; longer: by so much [s].
        by_hand: agents whose stop or time is as given; let_go: those whose is no longer.
    """

    number: int
    parent: int | None
    words: str
    text: str
    edits: list[dict[str, Any]]
    graph: dict[str, Any]
    pace: dict[str, float]
    scene: str
    proof: str
    provenance: str
    earlier: str
    moved: list[str]
    gone: list[str]
    come: list[str]
    longer: float
    by_hand: list[str]
    let_go: list[str]


def list_lineage(state: ThreadState) -> list[Version]:
    """The current version, the one that it was made from, and so on, back to the first."""
    versions = {version["number"]: version for version in state.get("versions", [])}
    lineage, number = list[Version](), state.get("current")
    while number is not None:
        lineage.append(versions[number])
        number = versions[number]["parent"]
    return lineage


class PendingChoice(TypedDict):
    """A question that was asked back, and the words that it is about."""

    words: str
    ask: dict[str, Any]
    chosen: dict[str, str]


class RefusedTurn(TypedDict):
    """Why a turn came to nothing; `called` is how people call the agents of its plan."""

    words: str
    code: str
    reason: str
    rejections: list[dict[str, Any]]
    called: dict[str, str]


class ThreadSetting(TypedDict):
    """What all turns of a thread share."""

    intersection: str
    seed: int
    refiner: str


class ThreadState(TypedDict, total=False):
    """Every channel of a thread.

    Attributes:
        act, words: of this turn; argument: of an act that has one; of an `edit`, the edits as JSON;
            of a `plan`, the plan and the seed as JSON; of words, whether they are taken leniently.
        reading: what the words amount to; models: what reading them has cost, where one was asked.
        current: number of the version that is shown; ahead: those that were undone, last first.
        branches: name -> number of its version; branch: the one that is worked on.
        pending: a question that waits for its answer; refused: the last refusal.
        before: the words of the turn before, which a correction is about.
        narrator: the noun of what the one who writes drives or is.
        topic: what the last question was about.
        reply: what became of this turn: `made`, `asked`, `refused`, `moved_to`, `nothing`.
    """

    act: Act
    words: str
    argument: str
    heading: ThreadSetting
    reading: dict[str, Any] | None
    models: dict[str, Any]
    versions: list[Version]
    current: int | None
    ahead: list[int]
    branches: dict[str, int]
    branch: str
    pending: PendingChoice | None
    before: str
    narrator: str | None
    topic: str | None
    refused: RefusedTurn | None
    reply: dict[str, Any]
