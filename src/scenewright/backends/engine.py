"""A vLLM engine in this process, for many prompts: questions that wait at once are one batch.

The engine belongs to one thread, which takes whatever has come while it worked, and a moment
longer, and answers all of it together under each question's own schema.
"""

from __future__ import annotations

import queue
import threading
import time
from concurrent.futures import Future
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from scenewright.backends import Prompt, Question
from scenewright.backends.text_backend import Completion
from scenewright.errors import BackendFault, InputError
from scenewright.extras import require_extra

PREFIX = "vllm:"
_GATHERED_FOR = 0.02
_AGAIN = 0.7
"""Temperature of an attempt after a refused one: at none the same fault is often made again."""

_CUT_OFF = "the reply was cut off before its end; answer with less, as one JSON object"


@dataclass(frozen=True)
class _Waiting:
    prompt: Prompt
    seed: int
    again: bool
    reply: Future[Completion]


class Engine:
    """Answers with a model that vLLM runs here (see `TextModel`).

    Attributes:
        at_once: how many questions make a full batch.
    """

    def __init__(
        self, model: str, *, tokens: int = 3000, at_once: int = 256, **settings: Any
    ) -> None:
        """Loads the model: minutes, and most of the GPU's memory.

        Args:
            settings: of `vllm.LLM`, such as max_model_len.

        Raises:
            InputError: vLLM is not installed, or cannot load the model.
        """
        require_extra("vllm", PREFIX + model, "vllm")
        self.name, self.at_once = PREFIX + model, at_once
        self._tokens = tokens
        self._waiting: queue.SimpleQueue[_Waiting] = queue.SimpleQueue()
        loaded: Future[None] = Future()
        arguments = (model, {"max_model_len": 8192, **settings}, loaded)
        threading.Thread(target=self._work, args=arguments, daemon=True).start()
        loaded.result()

    def complete(self, question: Question, prompt: Prompt) -> Completion:
        """The reply (see `TextModel`)."""
        asked = _Waiting(prompt, question.seed, bool(question.rejections), Future())
        self._waiting.put(asked)
        return asked.reply.result()

    def _work(self, model: str, settings: dict[str, Any], loaded: Future[None]) -> None:
        try:
            engine = import_module("vllm").LLM(model=model, **settings)
        except Exception as error:  # whatever a large library and its hardware come up with
            loaded.set_exception(InputError(f"vLLM cannot load {model}: {_get_first_line(error)}"))
            return
        loaded.set_result(None)
        while True:
            self._answer(engine, self._collect_batch())

    def _collect_batch(self) -> list[_Waiting]:
        """Collect the waiting questions, and those that arrive within a moment."""
        batch = [self._waiting.get()]
        until = time.monotonic() + _GATHERED_FOR
        while len(batch) < self.at_once:
            try:
                batch.append(self._waiting.get(timeout=max(until - time.monotonic(), 0.0)))
            except queue.Empty:
                break
        return batch

    def _answer(self, engine: Any, batch: list[_Waiting]) -> None:
        try:
            found = self._generate_batch(engine, batch)
        except Exception as error:  # one prompt that the engine cannot take must not cost the rest
            if len(batch) == 1:
                words = f"{self.name} failed: {_get_first_line(error)}"
                batch[0].reply.set_exception(BackendFault(words, final=True))
                return
            for each in batch:
                self._answer(engine, [each])
            return
        for each, said in zip(batch, found, strict=True):
            each.reply.set_result(said)

    def _generate_batch(self, engine: Any, batch: list[_Waiting]) -> list[Completion]:
        talks = [
            [
                {"role": "system", "content": each.prompt.system},
                {"role": "user", "content": each.prompt.user},
            ]
            for each in batch
        ]
        limits = [self._build_limits(each) for each in batch]
        return [_read_completion(each) for each in engine.chat(talks, limits, use_tqdm=False)]

    def _build_limits(self, asked: _Waiting) -> Any:
        sampling = import_module("vllm.sampling_params")
        return sampling.SamplingParams(
            temperature=_AGAIN if asked.again else 0.0,
            seed=asked.seed % 2**31,
            max_tokens=self._tokens,
            structured_outputs=sampling.StructuredOutputsParams(
                json=asked.prompt.schema, disable_any_whitespace=True
            ),
        )


def _read_completion(output: Any) -> Completion:
    reply = output.outputs[0]
    return Completion(
        reply.text,
        fault=_CUT_OFF if reply.finish_reason == "length" else None,
        input_tokens=len(output.prompt_token_ids),
        output_tokens=len(reply.token_ids),
    )


def _get_first_line(error: Exception) -> str:
    lines = str(error).splitlines()
    return f"{type(error).__name__}: {lines[0][:200] if lines else ''}"
