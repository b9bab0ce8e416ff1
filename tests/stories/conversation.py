"""A conversation as a test has it: words in, the version that came of them out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from scenewright import verify
from scenewright.authoring.session import Session, SessionVersion
from scenewright.backends import Backend, load_backend
from scenewright.memory.threads import Threads
from scenewright.scene.record import AgentRecord


class Conversation:
    """A thread of its own."""

    def __init__(
        self, file: str | Path = ":memory:", *, seed: int = 1, backend: Backend | None = None
    ) -> None:
        self.threads = Threads(file)
        self.session = Session(
            self.threads,
            "story",
            backend=backend or load_backend("builtin"),
            setting={"intersection": "amsterdam_120", "seed": seed, "refiner": "none"},
        )

    def say(self, words: str) -> dict[str, Any]:
        return self.session.say(words)

    def made(self, words: str) -> SessionVersion:
        """The version that the words made; it must be verified, by the file alone."""
        reply = self.session.say(words)
        assert reply["kind"] == "made", (words, reply)
        shown = self.now
        assert shown.proof.verified
        assert verify(shown.record) == shown.proof
        return shown

    @property
    def now(self) -> SessionVersion:
        shown = self.session.find_version()
        assert shown is not None
        return shown


def agents(shown: SessionVersion) -> dict[str, AgentRecord]:
    return {each.name: each for each in shown.record.agents}


def events(shown: SessionVersion) -> list[str]:
    return [each.type for each in shown.record.events]


def same(before: SessionVersion, after: SessionVersion) -> set[str]:
    """Names of those who are the same to the last bit."""
    old = agents(before)
    return {name for name, each in agents(after).items() if old.get(name) == each}
