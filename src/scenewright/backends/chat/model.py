"""A chat model as a text_model: one question, one reply, with retries and within limits."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from scenewright.backends import Prompt, Question
from scenewright.backends.chat.naming import Endpoint
from scenewright.backends.chat.retry import (
    RetryPolicy,
    convert_fault,
    find_refused_option,
    hide_key,
    is_cut_off,
    is_filtered,
    quote,
    retry_transient,
)
from scenewright.backends.text_backend import Completion

_CUT_OFF = ("length", "max_tokens", "model_length")
_REFUSED = ("refusal", "content_filter")
_OPTIONAL = ("response_format", "temperature", "seed")
_FORMS = ("json_schema", "json_object")
"""How a reply's schema is asked for; the second is older, and all that llama-cpp-python takes."""

_RETRY_TEMPERATURE = 0.7
"""Temperature of an attempt after a refused one."""


@dataclass(frozen=True)
class Limits:
    """Limits of requests to a model.

    Attributes:
        timeout: longest wait for a reply [s]; tokens: most tokens of a reply; at_once: most
            requests at a time; retries: when a failed request is sent again.
    """

    timeout: float = 60.0
    tokens: int = 3000
    at_once: int = 8
    retries: RetryPolicy = field(default_factory=RetryPolicy)


class ChatModel:
    """Puts questions to a LangChain chat model (see `TextModel`).

    The reply's schema is asked for as `response_format`: of the type `json_schema`, else, of an
    OpenAI-compatible server, of the older `json_object` with the schema in it. An endpoint that
    knows neither, or not another option, is asked without it; the prompt has the schema too.
    """

    def __init__(self, endpoint: Endpoint, *, limits: Limits | None = None) -> None:
        self.name = endpoint.name
        self._model, self._key = endpoint.model, endpoint.key
        self._limits = limits or Limits()
        self._slots = threading.BoundedSemaphore(self._limits.at_once)
        self._forms: tuple[str, ...] = _FORMS if self.name.startswith("openai:") else _FORMS[:1]
        self._unknown: set[str] = set()

    def complete(self, question: Question, prompt: Prompt) -> Completion:
        """The reply (see `TextModel`)."""
        said, asked = retry_transient(
            lambda: self._ask_once(question, prompt), policy=self._limits.retries
        )
        return Completion(
            text=hide_key(said.text, self._key),
            fault=None if said.fault is None else hide_key(said.fault, self._key),
            asked=asked,
            input_tokens=said.input_tokens,
            output_tokens=said.output_tokens,
        )

    def _ask_once(self, question: Question, prompt: Prompt) -> Completion:
        try:
            with self._slots:
                return self._invoke(question, prompt)
        except Exception as error:
            if is_cut_off(error):
                usage = getattr(getattr(error, "completion", None), "usage", None)
                return Completion(
                    "",
                    fault=_describe_too_long(),
                    input_tokens=_count(getattr(usage, "prompt_tokens", None)),
                    output_tokens=_count(getattr(usage, "completion_tokens", None)),
                )
            if is_filtered(error):
                return Completion("", fault=_describe_declined("content filter"))
            fault = convert_fault(error, model=self.name, key=self._key)
            if fault is None:
                raise
            raise fault from None

    def _invoke(self, question: Question, prompt: Prompt) -> Completion:
        messages = [("system", prompt.system), ("human", prompt.user)]
        for _ in range(len(_OPTIONAL) + len(self._forms) - 1):
            options = self._build_options(question, prompt)
            try:
                return _read_message(self._model.invoke(messages, **options))
            except Exception as error:
                refused = find_refused_option(error)
                if refused not in options:
                    raise
                # What the endpoint refuses is not sent again; of a response format, that form.
                if refused == "response_format":
                    sent = options[refused]["type"]
                    self._forms = tuple(form for form in self._forms if form != sent)
                else:
                    self._unknown.add(str(refused))
        return _read_message(self._model.invoke(messages))

    def _build_options(self, question: Question, prompt: Prompt) -> dict[str, Any]:
        """The reply's schema and, where models take them, a temperature and a seed."""
        options: dict[str, Any] = {}
        if self._forms:
            form, schema = self._forms[0], prompt.schema
            fields = {form: {"name": question.task, "schema": schema}}
            own = fields if form == "json_schema" else {"schema": schema}
            options["response_format"] = {"type": form, **own}
        if self.name.startswith("openai:"):
            # At temperature 0 a model that is shown an error often repeats it.
            options["temperature"] = _RETRY_TEMPERATURE if question.rejections else 0.0
            options["seed"] = question.seed % 2**31
        return {key: each for key, each in options.items() if key not in self._unknown}


def _read_message(message: Any) -> Completion:
    usage, content = message.usage_metadata or {}, message.content
    if not isinstance(content, str):
        # Parts of other kinds than text, such as reasoning blocks, are left out.
        parts = [each if isinstance(each, str) else each.get("text", "") for each in content]
        content = "".join(part for part in parts if isinstance(part, str))
    return Completion(
        text=content,
        fault=_find_fault(message),
        input_tokens=_count(usage.get("input_tokens")),
        output_tokens=_count(usage.get("output_tokens")),
    )


def _find_fault(message: Any) -> str | None:
    """Why a reply is unusable, whatever its text; None if it is not."""
    fields: Mapping[str, Any] = message.response_metadata or {}
    ended = fields.get("finish_reason") or fields.get("stop_reason")
    refused = (message.additional_kwargs or {}).get("refusal")
    if ended in _CUT_OFF:
        return _describe_too_long()
    if refused or ended in _REFUSED:
        return _describe_declined(refused if isinstance(refused, str) else str(ended))
    if message.tool_calls or message.invalid_tool_calls:
        return "the reply calls a tool; there are none, answer with one JSON object"
    return None


def _describe_too_long() -> str:
    return "the reply was cut off before its end; answer with less, as one JSON object"


def _describe_declined(why: str) -> str:
    return f"the model declined to answer ({quote(why, None)}); this is a simulated traffic scene"


def _count(value: Any) -> int | None:
    return value if isinstance(value, int) and value >= 0 else None
