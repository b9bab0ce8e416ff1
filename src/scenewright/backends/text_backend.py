"""Text models as backends: prompts out, texts in, one JSON object parsed from each."""

from __future__ import annotations

import hashlib
import json
import math
import re
import threading
import unicodedata
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any, NoReturn, Protocol, cast

from scenewright.backends import STAGE_OF, Call, Prompt, Question
from scenewright.errors import BackendFault, Rejected
from scenewright.scene.rejection import Rejection

LONGEST = 100_000
"""Characters of a reply; the longest answer that fits a scene has a tenth of that."""

_FENCE = re.compile(r"```[A-Za-z]*\s*\n?(.*?)```", re.DOTALL)
_THOUGHT = "</think>"
_MOST_OBJECTS = 20


class Unreadable(ValueError):
    """The reply is no answer; the message says what to mend."""


def extract_object(text: str) -> dict[str, Any]:
    """The JSON object that a reply is, or the only one that it holds.

    Prose around it and a code fence are passed over. NaN, infinity, a key that stands twice and
    control characters are refused, as are two objects that differ.

    Raises:
        Unreadable: there is none, or it is broken; says what and where.
    """
    if len(text) > LONGEST:
        raise Unreadable(f"the reply has {len(text)} characters; at most {LONGEST} are read")
    plain = text.rpartition(_THOUGHT)[2].strip()
    if not plain:
        raise Unreadable("the reply is empty; answer with one JSON object")
    fenced = [each for each in _FENCE.findall(plain) if each.strip()]
    found = [_decode(each) for each in fenced] or list(_find_objects(plain))
    if any(each != found[0] for each in found[1:]):
        raise Unreadable(f"the reply holds {len(found)} JSON values; answer with one object")
    if not isinstance(found[0], dict):
        raise Unreadable(f"the reply is a JSON {_name_kind(found[0])}; answer with one JSON object")
    _refuse_control_characters(found[0])
    return cast("dict[str, Any]", found[0])


def _find_objects(text: str) -> Iterator[Any]:
    """The first JSON value in a text, and whatever whole objects follow it.

    The first must be whole: what stands inside a broken one is not what was meant.
    """
    at = 0 if text[0] in "[{" else text.find("{")
    if at < 0:
        raise Unreadable("the reply holds no JSON object; answer with one JSON object")
    value, end = _decode_at(text, at)
    yield value
    for _ in range(_MOST_OBJECTS):
        at = text.find("{", end)
        if at < 0:
            return
        try:
            value, end = _decode_at(text, at)
            yield value
        except Unreadable:
            end = at + 1


def _decode(text: str) -> Any:
    value, end = _decode_at(text.strip(), 0)
    if text.strip()[end:].strip():
        raise Unreadable(f"not JSON: something follows the value at character {end}")
    return value


def _decode_at(text: str, at: int) -> tuple[Any, int]:
    try:
        return _DECODER.raw_decode(text, at)
    except Unreadable:
        raise
    except json.JSONDecodeError as error:
        what, where = error.msg.removesuffix(" at"), f"line {error.lineno}, column {error.colno}"
        raise Unreadable(f"not JSON: {what} at {where}") from None
    except RecursionError:
        raise Unreadable("not JSON: nested too deeply") from None
    except ValueError as error:
        raise Unreadable(f"not JSON: {str(error)[:120]}") from None


def _check_unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise Unreadable(f"the key {twice[:60]!r} stands twice in one object")
    return found


def _parse_finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        _refuse_constant(text)
    return value


def _refuse_constant(text: str) -> NoReturn:
    raise Unreadable(f"{text[:40]} is no number here; numbers are finite")


_DECODER = json.JSONDecoder(
    object_pairs_hook=_check_unique_keys, parse_float=_parse_finite, parse_constant=_refuse_constant
)


def _refuse_control_characters(value: Any) -> None:
    match value:
        case str():
            found = next((c for c in value if _is_control_character(c)), None)
            if found is not None:
                raise Unreadable(f"a text holds the control character U+{ord(found):04X}")
        case dict():
            for key, each in value.items():
                _refuse_control_characters(key)
                _refuse_control_characters(each)
        case list():
            for each in value:
                _refuse_control_characters(each)


def _is_control_character(char: str) -> bool:
    """Whether a character has no place in a text, be it a program of several lines."""
    return unicodedata.category(char) in ("Cc", "Cs") and char not in "\n\r\t"


def _name_kind(value: Any) -> str:
    return {list: "list", str: "text", bool: "truth value", type(None): "null"}.get(
        type(value), "number"
    )


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
