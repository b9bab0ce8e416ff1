"""An authoring session: turns of a conversation as a checkpointed LangGraph.

    read ──► solve   the words are edits, or a scene of their own
      └────► answer  a question back, a refusal, undo, redo, branches

A version becomes the current one in the same checkpoint in which it is entered, after it has been
verified and everything of it is saved. A process killed before that leaves the version before.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from contextvars import Context
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, cast

from langchain_core.runnables import RunnableConfig
from langgraph.graph import END, START, StateGraph
from langgraph.runtime import Runtime
from pydantic import TypeAdapter

from scenewright.authoring.answer_question import answer_question, define_terms, list_formats
from scenewright.authoring.apply_edits import list_concerned
from scenewright.authoring.compare import compare_versions
from scenewright.authoring.direct_edits import list_handles, read_direct_edits
from scenewright.authoring.find_version import find_removal, find_version, goes_back
from scenewright.authoring.read_turn import (
    SENTENCE,
    ask_what_is_meant,
    build_situation,
    find_narrator,
    read_words,
)
from scenewright.authoring.second_opinion import (
    check_first_words,
    choose_reading,
    correct,
    correct_within,
    weigh_kind,
)
from scenewright.authoring.talk import Talk, simplify
from scenewright.authoring.thread_state import (
    PendingChoice,
    RefusedTurn,
    ThreadSetting,
    ThreadState,
    Version,
    list_lineage,
)
from scenewright.authoring.turn_kind import TurnKind, spell_fully
from scenewright.authoring.versions import EditResult, begin, change
from scenewright.backends import Account, Backend, Call, get_backend_of_task
from scenewright.backends.offline import WORDS, Patterns, begins_anew, read_choice
from scenewright.errors import BackendFault, InputError, Rejected, Unsatisfiable
from scenewright.files import format_json_line
from scenewright.graph.arguments import check_arguments
from scenewright.graph.provenance import sum_costs_by_task
from scenewright.graph.run import ProgressCallback, synthesize
from scenewright.graph.scene_files import encode_proof, encode_scene
from scenewright.intersections import load_map
from scenewright.memory.products import deserialize_version, serialize_version
from scenewright.memory.threads import Threads
from scenewright.nodes.prompts import ExampleRetriever, recall_nothing
from scenewright.scene.account import LEFT_TO_STAGES
from scenewright.scene.edits import (
    CallAgent,
    Clarification,
    DeclinedTurn,
    Edit,
    Edits,
    NewScene,
    Reading,
    Situation,
)
from scenewright.scene.events import Proof
from scenewright.scene.phrasing import describe_graph
from scenewright.scene.plan_file import PlanFile
from scenewright.scene.record import NEXT_TEXT, SceneRecord
from scenewright.scene.social import SocialGraph
from scenewright.time_limit import DEFAULT_LIMIT, check_time_limit, limit_time
from scenewright.work_limit import MOST_WORK, limit_work

_PATTERNS = Patterns("session")

MAIN = "main"
_READING: TypeAdapter[Reading] = TypeAdapter(Reading)
_EDITS: TypeAdapter[tuple[Edit, ...]] = TypeAdapter(tuple[Edit, ...])
_SHORT_ANSWER = 3
"""Words of what may be meant as an answer to a question, though it is none of its answers."""
_SHORT_QUESTION = 8
"""Words of a question that may be about the same as the one before."""
_TURN_WORK = 3 * MOST_WORK
"""Steps of the search in a turn: a change tries several sets of agents that stay as they are."""
LENIENT = "lenient"
_LONGEST_NAME = 60
"""Of a branch [characters]."""
_LONGEST_TEXT = 1900
"""Of what was said, as much as a scene's prompt keeps."""


@dataclass(frozen=True)
class SessionContext:
    """What a turn happens in.

    Attributes:
        backend: the planner and reasoner; log: called with (stage, line) as the turn goes.
        recall: finds accepted answers to requests like this one, for prompts.
        lawful, time_limit: as in `synthesize`, the latter for a turn.
    """

    threads: Threads
    backend: Backend
    log: ProgressCallback
    recall: ExampleRetriever
    time_limit: float
    lawful: bool


@dataclass(frozen=True, eq=False)
class SessionVersion:
    """A version with everything that is kept of it."""

    version: Version
    record: SceneRecord
    proof: Proof
    scene_json: bytes
    proof_json: bytes
    provenance_json: bytes

    @property
    def provenance(self) -> dict[str, Any]:
        """How it came about."""
        found: dict[str, Any] = json.loads(self.provenance_json)
        return found


class Session:
    """One thread of conversation.

    Args:
        thread: its name; a thread that is not there begins empty.
        setting: of a new thread; one that is there keeps its own.

    Raises:
        InputError: nothing can be made with the setting.
    """

    def __init__(
        self,
        threads: Threads,
        thread: str,
        *,
        backend: Backend,
        setting: ThreadSetting,
        log: ProgressCallback | None = None,
        recall: ExampleRetriever | None = None,
        time_limit: float = DEFAULT_LIMIT,
        lawful: bool = False,
    ) -> None:
        check_time_limit(time_limit)
        self.thread = thread
        self._threads = threads
        log, recall = log or (lambda _stage, _line: None), recall or recall_nothing
        self._context = SessionContext(threads, backend, log, recall, time_limit, lawful)
        self._graph = build_session().compile(checkpointer=threads.saver)
        self._config: RunnableConfig = {
            "configurable": {"thread_id": thread},
            "recursion_limit": 12,
        }
        snapshot = self._graph.get_state(self._config)
        self.interrupted: str | None = None
        if snapshot.values and snapshot.next:
            self.interrupted = str(snapshot.values.get("words", ""))
        self._heading: ThreadSetting = snapshot.values.get("heading") or setting
        if self._heading is setting:  # of a new thread: refused where it could never make anything
            load_map(setting["intersection"])
            check_arguments(setting["seed"], setting["refiner"])

    @property
    def heading(self) -> ThreadSetting:
        """What all turns of the thread share: intersection, seed, refiner."""
        return self._heading

    @property
    def state(self) -> ThreadState:
        """The thread as it was last checkpointed."""
        return cast(ThreadState, self._graph.get_state(self._config).values)

    def take_turn(self, *, wait: bool = True) -> AbstractContextManager[None]:
        """Keep the thread for one turn and its messages (see `Threads.take_turn`)."""
        return self._threads.take_turn(self.thread, wait=wait)

    def say(self, words: str, *, lenient: bool = False) -> dict[str, Any]:
        """One turn in words, lenient as in `synthesize`; the reply says what became of it."""
        return self._turn({"act": "say", "words": words, "argument": LENIENT * lenient})

    def make(self, instruction: str, *, lenient: bool = False) -> dict[str, Any]:
        """A scene of its own, whatever was there before; lenient as in `synthesize`."""
        return self._turn({"act": "make", "words": instruction, "argument": LENIENT * lenient})

    def make_plan(self, plan: PlanFile, *, seed: int | None = None) -> dict[str, Any]:
        """A scene of its own of a plan, whose fields then must be seen; the seed is the thread's,
        unless another is given."""
        asked = {
            "plan": plan.plan.model_dump(mode="json", by_alias=True),
            "text": plan.text, "as_read": plan.as_read, "seed": seed,
        }  # fmt: skip
        words = plan.text if plan.as_read else describe_graph(plan.plan)
        return self._turn({"act": "plan", "words": words, "argument": json.dumps(asked)})

    def edit(self, asked: Any) -> dict[str, Any]:
        """Changes made by hand, a list of objects (`authoring/direct_edits.py`).

        Raises:
            InputError: they are no such list, or there is no scene yet.
        """
        with self.take_turn():
            version = _find_version(self.state, None)
            if version is None:
                raise InputError("there is no scene yet; say what shall happen")
            graph = SocialGraph.model_validate(version["graph"])
            edits, words = read_direct_edits(asked, graph)
            argument = _EDITS.dump_json(edits, by_alias=True).decode()
            return self._turn({"act": "edit", "words": words, "argument": argument})

    def list_handles(self, which: str | int | None = None) -> list[dict[str, Any]]:
        """What can be changed by hand in a version (`list_handles`); empty before there is one."""
        version = _find_version(self.state, which)
        if version is None:
            return []
        earlier = deserialize_version(self._threads.get_bytes(version["earlier"]))
        graph = SocialGraph.model_validate(version["graph"])
        return list_handles(graph, earlier, load_map(self._heading["intersection"]))

    def list_turns(self) -> list[ThreadState]:
        """The thread as it was after every turn, from the first."""
        history = self._graph.get_state_history(self._config)
        ended = [state.values for state in history if state.values.get("reply") and not state.next]
        return cast(list[ThreadState], ended[::-1])

    def speak_with(self, backend: Backend) -> None:
        """From now on this backend plans and reasons."""
        self._context = replace(self._context, backend=backend)

    def undo(self) -> dict[str, Any]:
        """Back to the version that the current one was made from."""
        return self._turn({"act": "undo", "words": "/undo"})

    def redo(self) -> dict[str, Any]:
        """Forth to what was undone last."""
        return self._turn({"act": "redo", "words": "/redo"})

    def branch(self, name: str) -> dict[str, Any]:
        """A new branch from the current version; or over to the one of that name."""
        return self._turn({"act": "branch", "words": f"/branch {name}", "argument": name})

    def _turn(self, said: Mapping[str, Any]) -> dict[str, Any]:
        with self.take_turn():
            self.interrupted = None
            self._heading = self.state.get("heading") or self._heading  # another's may be first
            blank = ThreadState(
                argument="", heading=self._heading, reading=None, models={}, reply={}
            )
            out = self._graph.invoke(
                cast(ThreadState, {**blank, **said}),
                config=self._config,
                context=self._context,
                durability="sync",
            )
            reply: dict[str, Any] = out["reply"]
            return reply

    def find_version(self, which: str | int | None = None) -> SessionVersion | None:
        """A version by number or by branch; the current one if none is named.

        Raises:
            InputError: there is no such version.
        """
        state = self.state
        version = _find_version(state, which)
        if version is None:
            return None
        scene = self._threads.get_bytes(version["scene"])
        proof = self._threads.get_bytes(version["proof"])
        return SessionVersion(
            version,
            SceneRecord.model_validate_json(scene),
            Proof.model_validate_json(proof),
            scene,
            proof,
            self._threads.get_bytes(version["provenance"]),
        )


def _find_version(state: ThreadState, which: str | int | None) -> Version | None:
    if which is None or which == "":
        number = state.get("current")
    elif str(which).isdigit():
        number = int(which)
    else:
        branches = list_branches(state)
        if which not in branches:
            raise InputError(
                f"there is no version or branch {which!r}; there is {_list_versions(state)}"
            )
        number = branches[str(which)]
    if number is None:
        return None
    for version in state.get("versions", []):
        if version["number"] == number:
            return version
    raise InputError(f"there is no version {number}; there is {_list_versions(state)}")


def _list_versions(state: ThreadState) -> str:
    numbers = ", ".join(str(each["number"]) for each in state.get("versions", []))
    return f"{numbers or 'none yet'}; branches: {', '.join(list_branches(state)) or 'none yet'}"


def list_branches(state: ThreadState) -> dict[str, int]:
    """The branches, the one worked on included."""
    found = dict(state.get("branches", {}))
    current = state.get("current")
    if current is not None:
        found[state.get("branch", MAIN)] = current
    return found


def build_session() -> StateGraph[ThreadState, SessionContext, Any, Any]:
    """The graph of one turn, not yet compiled."""
    graph: StateGraph[ThreadState, SessionContext, Any, Any] = StateGraph(
        ThreadState, context_schema=SessionContext
    )
    graph.add_node("read", read)
    graph.add_node("solve", solve)
    graph.add_node("answer", answer)
    graph.add_edge(START, "read")
    graph.add_conditional_edges("read", choose_after_read)
    graph.add_edge("solve", END)
    graph.add_edge("answer", END)
    return graph


def read(state: ThreadState, *, runtime: Runtime[SessionContext]) -> ThreadState:
    """What the words amount to, where the scene is as it is."""
    if state["act"] in ("make", "plan"):
        return {"reading": NewScene().model_dump(mode="json"), "pending": None}
    if state["act"] == "edit":
        edits = _EDITS.validate_json(state.get("argument", ""))
        return {
            "reading": Edits(edits=edits).model_dump(mode="json", by_alias=True),
            "pending": None,
        }
    if state["act"] != "say":
        return {"reading": None}
    words, chosen = _resolve_answer(state)
    words = words if chosen else spell_fully(words)
    narrator = find_narrator(words) or state.get("narrator")
    words = words if chosen else correct_within(words)
    words, other = (words, False) if chosen else correct(words, state.get("before", ""))
    if other:
        state = _take_back(state)
    talk = _build_talk(state, runtime.context)
    given = None if talk is None or chosen else _read_given(words, talk, state)
    if talk is not None and not chosen and given is None:
        words = talk.name_plainly(words)
    turn = given if isinstance(given, TurnKind) else _classify(words, state)
    if not chosen and not isinstance(given, Edits) and turn.kind != "words":
        steered = {"reading": "turn", **turn.model_dump(mode="json")}
        return {"reading": steered, "pending": None, "before": words,
                "narrator": narrator, "topic": turn.topic}  # fmt: skip
    calls: list[Call] = []
    reading: Reading = (
        given
        if isinstance(given, Edits)
        else _read(turn.words, chosen, state, runtime.context, talk, words, calls.append)
    )
    pending = state.get("pending") if len(words.split()) <= _SHORT_ANSWER else None
    if (
        isinstance(reading, NewScene)
        and get_backend_of_task(runtime.context.backend, "plan").deterministic
    ):
        intersection_map = load_map(state["heading"]["intersection"])
        reading = ask_what_is_meant(turn.words, intersection_map) or reading
    lost = isinstance(reading, DeclinedTurn) and reading.code in ("no_change", "out_of_scope")
    if pending is not None and lost and not pending["ask"]["choices"][0]["answer"].isdigit():
        first = pending["ask"]["choices"][0]["answer"]
        reason = f"I still cannot tell which is meant; say it anew with an id, such as {first}."
        reading = DeclinedTurn(code="no_change", reason=reason)
    plain = reading.model_dump(mode="json", by_alias=True)
    question = reading if isinstance(reading, Clarification) else None
    open_: PendingChoice | None = None
    if question is not None:
        asked = question.model_dump(mode="json", by_alias=True)
        open_ = {"words": turn.words, "ask": asked, "chosen": chosen}
    out: ThreadState = {
        "words": turn.words, "reading": plain, "pending": open_, "before": words,
        "narrator": narrator,
        "models": sum_costs_by_task(calls),
    }  # fmt: skip
    return {**out, "current": state.get("current")} if other else out


def _read_given(words: str, talk: Talk, state: ThreadState) -> Edits | TurnKind | None:
    """Words that give a name, or want back what went; None for all others."""
    if (name := talk.read_name(words)) is not None:
        return Edits(edits=(name,))
    if (removal := find_removal(words, state)) is None:
        return None
    number, edits = removal
    last = number == state.get("current")
    return TurnKind(kind="undo", words=words) if last else Edits(edits=edits)


def _classify(words: str, state: ThreadState) -> TurnKind:
    """The kind of the words, of a question its topic, of a version its number."""
    turn = weigh_kind(words, scene=state.get("current") is not None)
    if turn.kind == "why" and not state.get("refused"):
        return TurnKind(kind="question", words=words, topic="q_why")
    if turn.kind == "question" and turn.topic is None and len(words.split()) <= _SHORT_QUESTION:
        return turn.model_copy(update={"topic": state.get("topic")})  # "and how much is it now?"
    back = turn.kind == "words" and goes_back(words)
    if (turn.kind == "version" or back) and turn.number is None:
        number = find_version(words, state)
        if number is not None or not back:
            return TurnKind(kind="version", words=words, number=number)
    return turn


def _take_back(state: ThreadState) -> ThreadState:
    """The thread before the last words, if these made the current version: they meant another."""
    version = _find_version(state, None)
    if version is None or version["parent"] is None or version["words"] != state.get("before"):
        return state
    return cast(ThreadState, {**state, "current": version["parent"]})


def _resolve_answer(state: ThreadState) -> tuple[str, dict[str, str]]:
    """The words that are to be read, and the agent chosen for them if these are an answer."""
    pending, words = state.get("pending"), state["words"]
    if pending is None:
        return words, {}
    question = Clarification.model_validate(pending["ask"])
    choice = read_choice(words, question)
    if choice is None and _PATTERNS.agrees.match(words.lower()):
        choice = question.choices[0]
    if choice is None:
        return words, {}
    noun, _, meant = choice.means.partition("=")
    if noun == SENTENCE:
        return meant or "none of these", {}
    return pending["words"], {**pending["chosen"], noun: choice.answer}


def _read(
    words: str,
    chosen: dict[str, str],
    state: ThreadState,
    context: SessionContext,
    talk: Talk | None,
    said: str,
    account: Account,
) -> Reading:
    if talk is None:
        missing = check_first_words(said)
        return missing or _read_with(words, None, chosen, state, context, account=account)
    situation = talk.situation
    if (
        chosen
        or begins_anew(words)
        or not get_backend_of_task(context.backend, "plan").deterministic
    ):
        return _read_with(words, situation, chosen, state, context, account=account)

    def read_plain(plain: str) -> Reading:
        return _read_with(plain, situation, {}, state, context, account=account)

    return choose_reading(said, read_plain(talk.name_spoken(words)), talk, read_plain)


def _build_talk(state: ThreadState, context: SessionContext) -> Talk | None:
    """The current version as it is spoken of; None before there is one."""
    version = _find_version(state, None)
    if version is None:
        return None
    record, proof = _load_scene(version, context)
    situation = build_situation(
        SocialGraph.model_validate(version["graph"]),
        record,
        deserialize_version(context.threads.get_bytes(version["earlier"])),
    )
    talk = Talk(situation, _list_touched(state), proof.events, state.get("narrator"))
    asked = [agent.id for agent in talk.find_agents(simplify(state.get("before", "")))]
    if len(asked) == 1:  # "how fast is the car?", and then "make it slower"
        talk = replace(talk, touched=[*asked, *talk.touched])
    return talk


def _list_touched(state: ThreadState) -> list[str]:
    """Agents that earlier words were about, the last first, back to the first version."""
    turns = (_EDITS.validate_python(version["edits"]) for version in list_lineage(state))
    names = (name for edits in turns for name in sorted(list_concerned(edits), reverse=True))
    return list(dict.fromkeys(names))


def _read_with(
    words: str,
    situation: Situation | None,
    chosen: dict[str, str],
    state: ThreadState,
    context: SessionContext,
    *,
    account: Account,
) -> Reading:
    version, heading = _find_version(state, None), state["heading"]
    return read_words(
        words,
        situation,
        backend=context.backend,
        before=None if version is None else version["text"],
        chosen=chosen,
        intersection_map=load_map(heading["intersection"]),
        seed=heading["seed"],
        account=account,
    )


def choose_after_read(state: ThreadState) -> Literal["solve", "answer"]:
    """To the solver with edits and with scenes of their own."""
    reading = state.get("reading")
    return "solve" if reading and reading["reading"] in ("edits", "fresh") else "answer"


def solve(state: ThreadState, *, runtime: Runtime[SessionContext]) -> ThreadState:
    """The next version, verified and kept; or why there is none."""
    context, heading = runtime.context, state["heading"]
    shared: dict[str, Any] = {
        "intersection": heading["intersection"], "seed": heading["seed"],
        "refiner": heading["refiner"], "backend": context.backend, "recall": context.recall,
        "lawful": context.lawful, "lenient": state.get("argument") == LENIENT,
        "time_limit": context.time_limit, "log": context.log,
    }  # fmt: skip
    reading = _READING.validate_python(state["reading"])
    version, lost = _find_version(state, None), list[str]()
    try:
        if isinstance(reading, Edits) and version is not None:
            # What was left out of the version is left out of what is made of it.
            record, proof = _load_scene(version, context)
            shared["lenient"] = shared["lenient"] or bool(proof.list_words("not_shown"))
            names = all(isinstance(edit, CallAgent) for edit in reading.edits)
            text = version["text"] if names else _join_words(version["text"], state["words"])
            step = partial(
                change, text, reading.edits, partial(synthesize, **shared),
                intersection=heading["intersection"], record=record,
                before=SocialGraph.model_validate(version["graph"]),
                earlier=deserialize_version(context.threads.get_bytes(version["earlier"])),
                pace=version["pace"], by_hand=version["by_hand"], log=context.log,
            )  # fmt: skip
            made = _run_apart(step, context.time_limit)
        else:
            text = _keep_hour(_PATTERNS.opening.sub("", state["words"]), version)
            asked: str | PlanFile = text
            if state["act"] == "plan":
                given = json.loads(state["argument"])
                plan = SocialGraph.model_validate(given["plan"])
                asked = PlanFile(plan, given["text"], given["as_read"])
                shared["seed"] = shared["seed"] if given["seed"] is None else given["seed"]
            make = partial(begin, asked, partial(synthesize, **shared))
            made = _run_apart(make, context.time_limit)
            if isinstance(asked, PlanFile) and not asked.as_read:  # its words are of its fields
                made = replace(made, graph=made.graph.model_copy(update={"said": ()}))
                lost = [each.words for each in asked.plan.said if each.became in LEFT_TO_STAGES]
    except (InputError, Unsatisfiable, Rejected, BackendFault) as error:
        return _build_refusal(state, error)
    edits = reading.edits if isinstance(reading, Edits) else ()
    entered = _enter_version(state, text, edits, made, context)
    if lost:
        words = ", ".join(map(repr, lost))
        entered["reply"] |= {"note": f"no field holds {words}: a change must say it again"}
    return entered


def _keep_hour(words: str, version: Version | None) -> str:
    """Words that add something to a scene in which nothing happened: at its hour, if none is said.

    Such words are a scene of their own, as there is no agent that an edit could be about.
    """
    hour = None if version is None else (version["graph"].get("context") or {}).get("time_of_day")
    if hour is None or not _PATTERNS.added.match(words) or _PATTERNS.hour.search(words.lower()):
        return words
    return f"{_PATTERNS.added.sub('', words).rstrip('.! ')}, at {str(hour)[:5]}"


def _run_apart(make: Callable[[], EditResult], time_limit: float) -> EditResult:
    """Run in the time of a turn, and where LangGraph knows nothing of this graph: a pipeline inside
    it is not checkpointed."""

    def run_limited() -> EditResult:
        with limit_time(time_limit), limit_work(_TURN_WORK):
            return make()

    return Context().run(run_limited)


def _join_words(before: str, words: str) -> str:
    """Everything said, the first words and the last kept where it is too much."""
    text = f"{before}{NEXT_TEXT}{words}"
    if len(text) <= _LONGEST_TEXT:
        return text
    first, _, rest = text.partition(NEXT_TEXT)
    return f"{first[:900]}{NEXT_TEXT}… {rest[-900:]}"


def _enter_version(
    state: ThreadState,
    text: str,
    edits: tuple[Edit, ...],
    made: EditResult,
    context: SessionContext,
) -> ThreadState:
    """The version kept, entered and current, all in one checkpoint."""
    keep, scene = context.threads.keep, made.scene
    versions = state.get("versions", [])
    parent = state.get("current")
    dumped = [edit.model_dump(mode="json", by_alias=True) for edit in edits]
    paid = {**state.get("models", {}), **scene.provenance.get("models", {})}
    provenance = {**scene.provenance, "edits": dumped, **_build_costs(paid)}
    version: Version = {
        "number": max((each["number"] for each in versions), default=0) + 1,
        "parent": parent,
        "words": state["words"],
        "text": text,
        "edits": dumped,
        "graph": made.graph.model_dump(mode="json", by_alias=True),
        "pace": dict(made.pace),
        "scene": keep(encode_scene(scene.record)),
        "proof": keep(encode_proof(scene.proof)),
        "provenance": keep(format_json_line(provenance)),
        "earlier": keep(serialize_version(made.earlier)),
        "moved": list(made.moved),
        "gone": list(made.gone),
        "come": list(made.come),
        "longer": made.longer,
        "by_hand": list(made.by_hand),
        "let_go": list(made.let_go),
    }
    return {
        "versions": [*versions, version],
        "current": version["number"],
        "ahead": [],
        "refused": None,
        "reply": {"kind": "made", "version": version["number"], "from": parent},
    }


def _build_refusal(
    state: ThreadState,
    error: InputError | Unsatisfiable | Rejected | BackendFault | DeclinedTurn,
) -> ThreadState:
    """The refusal, in reply and for `why`; the current version stays."""
    rejections = list(error.rejections) if isinstance(error, Unsatisfiable) else []
    if isinstance(error, Rejected):
        rejections = [error.rejection]
    code: str = rejections[-1].code if rejections else "unusable_input"
    if isinstance(error, BackendFault):
        code = "backend_failed"
    reason = error.rejection.detail if isinstance(error, Rejected) else str(error)
    if isinstance(error, DeclinedTurn):
        code, reason = error.code, error.reason
    refused: RefusedTurn = {
        "words": state["words"],
        "code": code,
        "reason": reason,
        "rejections": [rejection.model_dump(mode="json") for rejection in rejections],
        "called": {} if isinstance(error, DeclinedTurn | Rejected) else dict(error.called),
    }
    spent = {} if isinstance(error, DeclinedTurn) else error.models
    paid = {**state.get("models", {}), **spent}
    reply = {"kind": "refused", "code": code, "reason": reason, **_build_costs(paid)}
    return {"refused": refused, "reply": reply}


def _build_costs(models: Mapping[str, Any]) -> dict[str, Any]:
    """What models were asked for a turn; nothing where none was."""
    return {"models": dict(models)} if models else {}


def answer(state: ThreadState, *, runtime: Runtime[SessionContext]) -> ThreadState:
    """Everything that makes no new version."""
    match state["act"]:
        case "undo":
            return _undo(state)
        case "redo":
            return _redo(state)
        case "branch":
            return _branch(state, state.get("argument", ""))
    plain = state["reading"] or {}
    if plain.get("reading") == "turn":
        turn = TurnKind.model_validate({k: v for k, v in plain.items() if k != "reading"})
        return _handle_command(state, turn, runtime.context)
    reading = _READING.validate_python(plain)
    match reading:
        case Clarification():
            choices = [choice.answer for choice in reading.choices]
            return {"reply": {"kind": "asked", "question": reading.question, "choices": choices}}
        case DeclinedTurn():
            return _build_refusal(state, reading)
    return {"reply": {"kind": "nothing", "reason": "there is nothing to change yet"}}


def _handle_command(state: ThreadState, turn: TurnKind, context: SessionContext) -> ThreadState:
    """Steps between versions, answers, and what the front end does itself."""
    match turn.kind:
        case "undo":
            return _undo(state, turn.count)
        case "redo":
            return _redo(state, turn.count)
        case "version":
            if not turn.number:
                lines = ["Which version? Say its number.", *_format_versions(state)]
                return {"reply": {"kind": "answer", "lines": lines}}
            try:
                _find_version(state, turn.number)
            except InputError as error:
                return {"reply": {"kind": "nothing", "reason": str(error)}}
            return _go_to(turn.number, [])
        case "restart":
            # No version is current any more: the next words are a scene of their own.
            current = state.get("current")
            ahead = [] if current is None else [current]
            reason = "Say what shall happen; the versions so far are kept (/history)."
            reply = {"kind": "nothing", "reason": reason}
            return {"current": None, "ahead": ahead, "pending": None, "reply": reply}
        case "question":
            return {"reply": _answer_question(state, turn, context)}
        case "talk":
            begun = state.get("current") is not None
            reason = WORDS["session"]["say_more"] if begun else WORDS["session"]["begin"]
            return {"reply": {"kind": "nothing", "reason": reason}}
    named = {"name": turn.name} if turn.name else {}
    return {"reply": {"kind": "wish", "wish": turn.kind, **named}}


def _format_versions(state: ThreadState) -> list[str]:
    """A line for every version; the current one is marked."""
    return [
        f"{'*' if each['number'] == state.get('current') else ' '} version {each['number']}: "
        f"{each['words']}"
        for each in state.get("versions", [])
    ]


def _answer_question(state: ThreadState, turn: TurnKind, context: SessionContext) -> dict[str, Any]:
    version, words = _find_version(state, None), turn.words
    if turn.topic in ("q_define", "q_limit") and version is None:
        return {"kind": "answer", "lines": define_terms()}
    if turn.topic == "q_formats":
        return {"kind": "answer", "lines": list_formats()}
    if version is None:
        return {"kind": "nothing", "reason": WORDS["session"]["nothing_yet"]}
    if turn.topic in ("q_changed", "q_version") or _PATTERNS.about_version.search(words.lower()):
        return {"kind": "answer", "lines": _describe_version(state, version, words, context)}
    record, proof = _load_scene(version, context)
    place = load_map(record.meta.intersection)
    lines = answer_question(words, record, proof, place, topic=turn.topic)
    return {"kind": "answer", "lines": lines}


def _describe_version(
    state: ThreadState, version: Version, words: str, context: SessionContext
) -> list[str]:
    """Which version this is, and how it differs from the one that it is compared with."""
    versions = {each["number"]: each for each in state.get("versions", [])}
    named = [int(each) for each in re.findall(r"\bv?(\d{1,3})\b", words) if int(each) in versions]
    first = [1] if re.search(r"\b(?:first|original)\b", words.lower()) else []
    other = versions.get((named or first or [version["parent"] or 0])[0])
    came = "" if version["parent"] is None else f", made from version {version['parent']}"
    lines = [f"Version {version['number']} of {len(versions)}{came}: {version['words']}"]
    if re.search(r"\b(?:versions|numbers?|list|order|history|many)\b", words.lower()):
        return [*lines, *_format_versions(state)]
    if other is None or other["number"] == version["number"]:
        return lines
    found = compare_versions(*_load_scene(other, context), *_load_scene(version, context))
    lines += [
        f"{what}: {before} in version {other['number']}, now {now}"
        for what, before, now in found["differences"]
    ]
    names = found["changed"] + found["only_first"] + found["only_second"]
    unlike = ", ".join(names[:12]) or "no agent"
    return [*lines, f"Other than in version {other['number']}: {unlike}"]


def _load_scene(version: Version, context: SessionContext) -> tuple[SceneRecord, Proof]:
    scene = context.threads.get_bytes(version["scene"])
    proof = context.threads.get_bytes(version["proof"])
    return SceneRecord.model_validate_json(scene), Proof.model_validate_json(proof)


def _go_to(number: int, ahead: list[int], **named: str) -> ThreadState:
    """The thread at another version, with those that `redo` goes to."""
    moved = {"kind": "moved_to", "version": number, **named}
    return {"current": number, "ahead": ahead, "pending": None, "reply": moved}


def _undo(state: ThreadState, count: int = 1) -> ThreadState:
    """As many steps back as asked for, or as there are."""
    out: ThreadState = {}
    for _ in range(count):
        version = _find_version(cast(ThreadState, {**state, **out}), None)
        if version is None or version["parent"] is None:
            return out or {"reply": {"kind": "nothing", "reason": "there is nothing to undo"}}
        out = _go_to(version["parent"], [*(out or state).get("ahead", []), version["number"]])
    return out


def _redo(state: ThreadState, count: int = 1) -> ThreadState:
    """As many steps forth as asked for, or as there are."""
    ahead = list(state.get("ahead", []))
    if not ahead:
        return {"reply": {"kind": "nothing", "reason": "there is nothing to redo"}}
    for _ in range(min(count, len(ahead))):
        number = ahead.pop()
    return _go_to(number, ahead)


def _branch(state: ThreadState, name: str) -> ThreadState:
    branches = list_branches(state)
    current = state.get("current")
    name = " ".join(name.split())
    if not name or name.isdigit() or len(name) > _LONGEST_NAME or not name.isprintable():
        reason = (
            f"a branch has a name of at most {_LONGEST_NAME} characters that is no number, as "
            "versions have"
        )
        return {"reply": {"kind": "nothing", "reason": reason}}
    number = branches.get(name, current)
    if number is None:
        return {"reply": {"kind": "nothing", "reason": "there is no scene to branch from yet"}}
    moved = _go_to(number, [], branch=name)
    return {**moved, "branches": {**branches, name: number}, "branch": name}
