"""The user's own conversations and memory: where they are kept, and how one is opened."""

from __future__ import annotations

import re
from collections.abc import Collection
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenewright.errors import InputError
from scenewright.intersections import find_data_folder

if TYPE_CHECKING:
    from scenewright.authoring.session import Session, SessionVersion
    from scenewright.backends import Backend
    from scenewright.cli.options import SessionOptions
    from scenewright.memory.threads import Threads


def find_memory_file() -> Path:
    """The file of episodes."""
    return find_data_folder() / "memory.jsonl"


def open_threads(path: str | None) -> Threads:
    """The file of conversations: the one named, else that of the data folder."""
    from scenewright.memory.threads import Threads

    return Threads(path or find_data_folder() / "threads.sqlite")


def list_threads(path: str | None) -> list[str]:
    """The names of all conversations, last used first."""
    threads = open_threads(path)
    try:
        return list(threads.list_names())
    finally:
        threads.close()


def choose_free_name(begin: str, taken: Collection[str]) -> str:
    """The first of BEGIN-1, BEGIN-2, ... that is no name yet."""
    return next(name for n in count(1) if (name := f"{begin}-{n}") not in taken)


def open_session(
    options: SessionOptions, thread: str, backend: Backend, *, refiner: str | None = None,
    **more: Any,
) -> tuple[Threads, Session]:  # fmt: skip
    """The file of a conversation, to be closed, and the conversation, of this process alone.

    Args:
        refiner: of a new one; that of `make` if none is named. more: as `Session` has them.

    Raises:
        InputError: its name cannot be one, or another process has it.
    """
    from scenewright.authoring.session import Session
    from scenewright.graph.arguments import choose_refiner

    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}", thread):
        raise InputError(
            f"{thread[:80]!r} is no name for a thread; use up to 64 letters, digits, ., - and _"
        )
    threads = open_threads(options.threads)
    try:
        threads.hold(thread)
        session = Session(
            threads, thread, backend=backend, time_limit=options.time_limit, lawful=options.lawful,
            setting={"intersection": options.intersection, "seed": options.seed,
                     "refiner": choose_refiner(refiner)}, **more,
        )  # fmt: skip
    except BaseException:
        threads.close()
        raise
    return threads, session


def get_version(session: Session, which: str | None = None) -> SessionVersion:
    """A version by number or branch, the current one if none is named; InputError without any."""
    if (shown := session.find_version(which)) is None:
        raise InputError("there is no scene yet; say what shall happen")
    return shown


def compare(first: SessionVersion, second: SessionVersion) -> dict[str, Any]:
    """The reply of a comparison of two versions."""
    from scenewright.authoring.compare import compare_versions

    found = compare_versions(first.record, first.proof, second.record, second.proof)
    numbers = {"first": first.version["number"], "second": second.version["number"]}
    return {"kind": "compared", **numbers, **found}


def list_versions(session: Session) -> dict[str, Any]:
    """All versions of a conversation with their words, and which is the current one."""
    state = session.state
    rows = [
        {"version": each["number"], "from": each["parent"], "words": each["words"]}
        for each in state.get("versions", [])
    ]
    return {"versions": rows, "current": state.get("current")}


_AGENT = ("id", "name", "type", "subtype", "entry", "exit", "role")


def build_facts(shown: SessionVersion) -> dict[str, Any]:
    """What a script wants to know of a version."""
    version = shown.version
    return {
        **shown.proof.build_verdict(),
        "events": shown.record.to_json()["events"],
        "agents": [{key: getattr(agent, key) for key in _AGENT} for agent in shown.record.agents],
        "duration": shown.record.meta.duration,
        "time_of_day": shown.record.meta.time_of_day,
        **{key: version[key] for key in ("edits", "moved", "gone", "come", "longer", "let_go")},
    }


def add_facts(
    session: Session, reply: dict[str, Any]
) -> tuple[dict[str, Any], SessionVersion | None]:
    """A reply with the facts of the version that it shows, and that version, if it shows one."""
    shows = reply["kind"] in ("made", "moved_to", "shown")
    shown = session.find_version(reply.get("version")) if shows else None
    return (reply if shown is None else {**reply, **build_facts(shown)}), shown
