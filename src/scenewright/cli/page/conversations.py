"""The conversations that a page works on, each of which takes one turn at a time."""

from __future__ import annotations

import json
import re
import threading
from dataclasses import dataclass, replace
from typing import Any

from scenewright.authoring.explain import explain_refusal
from scenewright.authoring.read_turn import SENTENCE
from scenewright.authoring.session import LENIENT, MAIN, Session, SessionVersion, list_branches
from scenewright.authoring.thread_state import ThreadState
from scenewright.backends import Backend
from scenewright.cli.console import ProgressCallback
from scenewright.cli.options import SessionOptions
from scenewright.cli.page.asked import NewThread
from scenewright.cli.sessions import (
    add_facts,
    choose_free_name,
    compare,
    get_version,
    list_threads,
    open_session,
)
from scenewright.cli.turn_report import format_reply
from scenewright.errors import InputError
from scenewright.graph.plan_faults import check_plan
from scenewright.graph.run import plan_instruction
from scenewright.memory.threads import Threads
from scenewright.nodes.remaining import OR_LENIENT
from scenewright.scene.phrasing import call_agents, describe_graph, speak_plainly
from scenewright.scene.plan_file import PlanFile, compute_digest, read_plan
from scenewright.scene.record import NEXT_TEXT
from scenewright.scene.social import SocialGraph
from scenewright.time_limit import limit_time

LONGEST_WORDS = 20_000
LEAVE_OUT = "Leave it out"


@dataclass(eq=False)
class Conversation:
    """One thread with its own connection to the file of threads."""

    session: Session
    threads: Threads
    log: ProgressCallback | None = None
    """Of the turn that is being worked on."""

    @property
    def busy(self) -> bool:
        """Whether a turn is being worked on."""
        return self.log is not None

    def act(self, action: str, argument: str, log: ProgressCallback) -> dict[str, Any]:
        """One turn, of an action in `asked.ACTIONS`; the reply with lines for people.

        Raises:
            BusyError: another turn is being worked on.
            InputError: there is no such action, or it cannot be done.
        """
        with self.session.take_turn(wait=False):
            self.log = log
            try:
                return self._report(self._turn(action, argument), self.session.state)
            finally:
                self.log = None

    def _turn(self, action: str, argument: str) -> dict[str, Any]:
        act, _, without = action.partition("_")
        if act in ("say", "make"):
            if not argument.strip() or len(argument) > LONGEST_WORDS:
                raise InputError(f"say something, in at most {LONGEST_WORDS} characters")
            say = self.session.say if act == "say" else self.session.make
            return say(argument, lenient=without == "without")
        if action == "branch":
            return self.session.branch(argument)
        if action == "edit":
            return self.session.edit(_read_json(argument))
        if action == "plan":
            return self.session.make_plan(read_plan_object(_read_json(argument)))
        acts = {"undo": self.session.undo, "redo": self.session.redo}
        if action not in acts:
            raise InputError(f"there is no action {action[:40]!r}")
        return acts[action]()

    def list_log(self) -> list[dict[str, Any]]:
        """All turns so far: what was said, and the reply as it was reported."""
        turns = []
        for turn in self.session.list_turns():
            said = turn["words"] if turn["act"] in ("say", "make", "plan") else ""
            words = LEAVE_OUT if turn.get("argument") == LENIENT else said
            turns.append({"words": words, **self._report(turn["reply"], turn)})
        return turns

    def _report(self, reply: dict[str, Any], state: ThreadState) -> dict[str, Any]:
        """The reply of a turn that left the thread in this state, in words of people."""
        if reply["kind"] == "wish":
            reply = {"kind": "nothing", "reason": _WISHES[reply["wish"]]}
        reply, shown = add_facts(self.session, reply)
        choices = _list_choices(reply, state)
        if reply["kind"] == "asked":
            asked, offered, _ = reply["question"].partition(" Do you mean 1: ")
            asked = f"{asked} Do you mean:" if offered else f"{asked.partition(':')[0]}?"
            reply = {**reply, "question": asked}
        lines = [
            line.partition(OR_LENIENT)[0].partition(" Did you mean: ")[0]
            for _, line in format_reply(reply, shown)
        ]
        refused = state.get("refused")
        why: list[str] = []
        planned: dict[str, str] = {}
        if reply["kind"] == "refused" and refused:  # its first two lines say the reply again
            why, planned = explain_refusal(refused)[2:], refused.get("called", {})
        if shown is None and state.get("current") is not None:  # None would name today's
            shown = self.session.find_version(state.get("current"))
        record = None if shown is None else shown.record
        lines, why = ([speak_plainly(x, record, planned) for x in each] for each in (lines, why))
        return {"kind": reply["kind"], "lines": lines, "why": why, "choices": choices,
                "caveat": reply.get("caveat", "")}  # fmt: skip

    def find_plan(self, which: str | None) -> PlanFile:
        """The plan of a version, its text that of the scene; InputError if there is none."""
        version = self.find(which).version
        graph = SocialGraph.model_validate(version["graph"])
        return PlanFile(graph, "" if NEXT_TEXT in version["text"] else version["text"])

    def list_handles(self, which: str | None) -> list[dict[str, Any]]:
        """What can be changed by hand in a version, of agents as they are called."""
        shown = self.session.find_version(which)
        called = call_agents(shown.record) if shown is not None else {}
        names = {agent.name: called[agent.id] for agent in shown.record.agents} if shown else {}
        handles = self.session.list_handles(which)
        return [
            {**handle, "called": names.get(handle["agent"], handle["agent"])} for handle in handles
        ]

    def describe(self) -> dict[str, Any]:
        """What the page shows of the thread: its versions as a tree, branches, what is current."""
        state = self.session.state
        return {
            "thread": self.session.thread,
            "setting": dict(self.session.heading),
            "versions": [
                {"number": each["number"], "parent": each["parent"], "words": each["words"]}
                for each in state.get("versions", [])
            ],
            "current": state.get("current"),
            "branch": state.get("branch", MAIN),
            "branches": list_branches(state),
            "busy": self.busy,
            "interrupted": self.session.interrupted,
        }

    def find(self, which: str | None) -> SessionVersion:
        """A version by number or branch, the current one if none is named; InputError without."""
        return get_version(self.session, which)

    def compare(self, first: str, second: str) -> list[str]:
        """What differs between two versions, in lines."""
        one, other = self.find(first), self.find(second)
        lines = format_reply(compare(one, other), None)
        return [speak_plainly(line, one.record) for _, line in lines]


def _list_choices(reply: dict[str, Any], state: ThreadState) -> list[dict[str, str]]:
    """What can be answered, each a sentence with the action that it stands for."""
    pending, reason = state.get("pending"), reply.get("reason", "")
    if reply["kind"] == "refused":
        left_out = OR_LENIENT in reason and state["act"] != "plan"
        offered = reason.partition(OR_LENIENT if left_out else " Did you mean: ")[2]
        edits = (state.get("reading") or {}).get("reading") == "edits"  # then it says the old scene
        sentences = [] if edits else [each for each in offered.strip("'?").split("' or '") if each]
        without = {"label": LEAVE_OUT, "action": f"{state['act']}_without"}
        return [
            *([{**without, "argument": state["words"]}] if left_out else []),
            *(
                {"label": sentence, "action": "make", "argument": sentence}
                for sentence in sentences
            ),
        ]
    if reply["kind"] != "asked" or pending is None:
        return []
    return [
        {"label": _spell_choice(each["means"]), "action": "say", "argument": each["answer"]}
        for each in pending["ask"]["choices"]
    ]


def _spell_choice(means: str) -> str:
    """The sentence that an answer stands for, without the id that it is answered by."""
    noun, _, meant = means.partition("=")
    sentence = meant if noun == SENTENCE else meant.partition(": ")[2] or meant
    sentence = re.sub(r" \([a-z]+-\d+\)$", "", sentence) or "none of these"
    return sentence[0].upper() + sentence[1:]


_WISHES = {
    "show": "The scene is beside the conversation; its proof is under the picture.",
    "play": "Press play under the picture, or the space bar.",
    "why": "The reason is under the refusal, at Why.",
    "help": "Say what shall happen, then what shall be different; or ask about the scene.",
    "quit": "Close the window when you like; the conversation is kept.",
    "html": "Save as, above the picture, gives one file to send to others.",
    **dict.fromkeys(("save", "gif", "mp4"), "Save as, above the picture, writes every format."),
}
"""What the page answers to what it has buttons for."""


def _read_json(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError("what is changed by hand or in a form is sent as JSON") from error


class Conversations:
    """All conversations of one file of threads; opened when they are first used."""

    def __init__(self, options: SessionOptions, backend: Backend) -> None:
        self._options, self._backend = options, backend
        self._open: dict[str, Conversation] = {}
        self._lock = threading.Lock()

    def list_names(self) -> list[str]:
        """Names of all threads, last used first."""
        return list_threads(self._options.threads)

    def create(self, asked: NewThread) -> Conversation:
        """A new conversation; InputError if there is no such intersection."""
        given = {key: each for key, each in vars(asked).items() if each not in (None, "")}
        with self._lock:
            name = choose_free_name("page", {*self.list_names(), *self._open})
            return self._start(name, replace(self._options, **given))

    def get(self, name: str) -> Conversation:
        """The conversation of this name; InputError if there is none."""
        with self._lock:
            if name in self._open:
                return self._open[name]
            if name not in self.list_names():
                raise InputError(f"there is no conversation {name[:64]!r}")
            return self._start(name, self._options)

    def plan(self, words: str, intersection: str) -> SocialGraph:
        """The plan of an instruction; raises as `synthesize`."""
        with limit_time(self._options.time_limit):
            return plan_instruction(words, intersection=intersection, backend=self._backend)

    def speak_with(self, backend: Backend) -> None:
        """From now on this backend plans and reasons, in the open conversations as well."""
        with self._lock:
            self._backend = backend
            for each in self._open.values():
                each.session.speak_with(backend)

    def close(self) -> None:
        """Let go of the file."""
        for each in self._open.values():
            each.threads.close()

    def _log(self, name: str, stage: str, line: str) -> None:
        if (log := self._open[name].log) is not None:
            log(stage, line)

    def _start(self, name: str, options: SessionOptions) -> Conversation:
        threads, session = open_session(
            options, name, self._backend, log=lambda stage, line: self._log(name, stage, line)
        )
        self._open[name] = Conversation(session, threads)
        return self._open[name]


def read_plan_object(given: Any) -> PlanFile:
    """The plan in an object of the page; InputError, which names the field, if it is none."""
    if not isinstance(given, dict):
        raise InputError("a plan is an object with its fields")
    return read_plan(given)


def check_plan_object(given: Any, intersection: str) -> PlanFile:
    """The plan in an object of the page, if that intersection has ways for its agents."""
    found = read_plan_object(given)
    check_plan(found, intersection=intersection)
    return found


def describe_plan_file(found: PlanFile) -> dict[str, Any]:
    """The fields that are set, as a plan file has them, and the plan in words."""
    fields = found.plan.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    words = found.text if found.as_read else describe_graph(found.plan)
    if found.text:
        fields["text"] = found.text
    if found.as_read:
        fields["read_as"] = compute_digest(found.plan, found.text)
    return {"plan": fields, "words": words}
