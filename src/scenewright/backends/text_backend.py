"""Text models as backends: prompts out, texts in, replies parsed from them."""

from __future__ import annotations

import hashlib
import json
import threading
from collections import OrderedDict
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any, Protocol

from scenewright.backends import STAGE_OF, Call, Prompt, Question
from scenewright.backends.reading import LONGEST, Unreadable, extract_object
from scenewright.errors import BackendFault, Rejected
from scenewright.scene.rejection import Rejection

AT_ONCE = 8
"""Questions that a model takes at a time unless it says otherwise."""

_REMEMBERED = 256


@dataclass(frozen=True)
class Completion:
    """What was said.

    Attributes:
        text: the reply, as it came.
        fault: why it is no answer whatever it says, such as that it was cut off; else None.
        asked: how often the request was sent.
    """

    text: str
    fault: str | None = None
    asked: int = 1
    input_tokens: int | None = None
    output_tokens: int | None = None


class TextModel(Protocol):
    """Says something to a question in words.

    Attributes:
        name: for provenance, and part of the key under which answers are kept.
    """

    name: str

    def complete(self, question: Question, prompt: Prompt) -> Completion:
        """The reply to a question.

        Raises:
            BackendFault: nothing can be said.
        """


class TextBackend:
    """A backend that reads the answer out of what a text_model says.

    Attributes:
        at_once: how many questions it is worth to put at a time.

    The same question in the same words is not put twice: a question that comes again, after a
    fresh sample that changed nothing of it, gets the answer that it had.
    """

    deterministic = False

    def __init__(self, text_model: TextModel) -> None:
        self.text_model = text_model
        self.name = text_model.name
        self.at_once: int = getattr(text_model, "at_once", AT_ONCE)
        self._known: OrderedDict[str, Completion] = OrderedDict()
        self._lock = threading.Lock()

    def answer(self, question: Question) -> dict[str, Any]:
        """The reply to a question (see `Backend`)."""
        prompt = question.prompt()
        key = compute_key(self.name, question, prompt, by_facts=self.deterministic)
        before = perf_counter()
        with self._lock:
            said = self._known.get(key)
        asked = 0 if said is not None else 1
        if said is None:
            said = self._ask_model(question, prompt, key)
        question.account(
            _build_call(self.name, question, said, asked, perf_counter() - before, key)
        )
        return _read(said, question)

    def _ask_model(self, question: Question, prompt: Prompt, key: str) -> Completion:
        """Ask for a fresh reply; the cost of a question without a reply is reported as well."""
        before = perf_counter()
        try:
            said = self.text_model.complete(question, prompt)
        except BackendFault as fault:
            if fault.asked:
                nothing = Completion("", asked=fault.asked)
                call = _build_call(self.name, question, nothing, 1, perf_counter() - before, key)
                question.account(replace(call, answered=False))
            raise
        if len(said.text) <= LONGEST:
            with self._lock:
                self._known[key] = said
                while len(self._known) > _REMEMBERED:
                    self._known.popitem(last=False)
        return said


def compute_key(model: str, question: Question, prompt: Prompt, *, by_facts: bool = False) -> str:
    """Compute the fingerprint of a question: model, prompt, schema of the reply and seed.

    Args:
        by_facts: whether the model answers from the facts, of which the prompt holds only a part.
    """
    asked = [model, prompt.system, prompt.user, prompt.schema, question.seed]
    asked += [question.facts] if by_facts else []
    text = json.dumps(asked, ensure_ascii=False, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode("utf-8", "backslashreplace")).hexdigest()[:32]


def _read(said: Completion, question: Question) -> dict[str, Any]:
    try:
        if said.fault is not None:
            raise Unreadable(said.fault)
        return extract_object(said.text)
    except Unreadable as error:
        raise Rejected(
            Rejection(stage=STAGE_OF[question.task], code="malformed_reply", detail=str(error))
        ) from None


def _build_call(
    model: str, question: Question, said: Completion, asked: int, seconds: float, key: str
) -> Call:
    return Call(
        task=question.task,
        model=model,
        asked=said.asked * asked,
        seconds=seconds,
        input_tokens=None if said.input_tokens is None else said.input_tokens * asked,
        output_tokens=None if said.output_tokens is None else said.output_tokens * asked,
        prompt=key,
    )
