"""A vLLM engine in the process, played by a stand-in: what is asked of it, and in which batches."""

from __future__ import annotations

import sys
import threading
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from scenewright.backends import Prompt, Question, engine, load_backend
from scenewright.errors import BackendFault, InputError, Rejected

SCHEMA = {"type": "object"}


class LLM:
    batches: list[int]
    asked: list[tuple[Any, Any]]

    def __init__(self, model: str, **settings: Any) -> None:
        if model == "broken":
            raise RuntimeError("no GPU\nfor you")
        type(self).batches, type(self).asked = [], []
        assert settings["max_model_len"] == 8192

    def chat(self, talks: list[Any], limits: list[Any], *, use_tqdm: bool) -> list[Any]:  # noqa: ARG002
        self.batches.append(len(talks))
        self.asked += zip(talks, limits, strict=True)
        if any("too long" in talk[1]["content"] for talk in talks):
            raise ValueError("the prompt is too long")
        return [self._reply(talk[1]["content"]) for talk in talks]

    def _reply(self, words: str) -> Any:
        ended = "length" if "endless" in words else "stop"
        reply = SimpleNamespace(text=f'{{"said": "{words}"}}', finish_reason=ended, token_ids=[1])
        return SimpleNamespace(outputs=[reply], prompt_token_ids=[1, 2, 3])


@pytest.fixture(autouse=True)
def vllm(monkeypatch: pytest.MonkeyPatch) -> None:
    module, sampling = ModuleType("vllm"), ModuleType("vllm.sampling_params")
    module.LLM = LLM  # type: ignore[attr-defined]
    sampling.SamplingParams = SimpleNamespace  # type: ignore[attr-defined]
    sampling.StructuredOutputsParams = SimpleNamespace  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "vllm", module)
    monkeypatch.setitem(sys.modules, "vllm.sampling_params", sampling)
    monkeypatch.setattr("scenewright.extras.find_spec", lambda _: module)


def asked(words: str, seed: int = 0) -> Question:
    prompt = Prompt("You answer.", words, SCHEMA)
    return Question("plan", {}, seed=seed, prompt=lambda: prompt)


def test_a_question_is_asked_under_its_schema() -> None:
    backend = load_backend("vllm:some/model")
    assert backend.name == "vllm:some/model"
    assert backend.answer(asked("x", seed=3)) == {"said": "x"}
    [(talk, limits)] = LLM.asked
    assert [each["role"] for each in talk] == ["system", "user"]
    assert (limits.temperature, limits.seed) == (0.0, 3)
    assert limits.structured_outputs.json == SCHEMA


def test_questions_that_wait_at_once_are_one_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "_GATHERED_FOR", 2.0)
    backend: Any = load_backend("vllm:m")
    backend.text_model.at_once = 12
    said: dict[int, Any] = {}

    def ask(n: int) -> None:
        said[n] = backend.answer(asked(f"question {n}"))

    threads = [threading.Thread(target=ask, args=(n,)) for n in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert LLM.batches == [12]
    assert said == {n: {"said": f"question {n}"} for n in range(12)}


def test_one_prompt_that_fails_does_not_cost_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "_GATHERED_FOR", 2.0)
    backend: Any = load_backend("vllm:m")
    backend.text_model.at_once = 2
    found: list[Any] = []
    other = threading.Thread(target=lambda: found.append(backend.answer(asked("fine"))))
    other.start()
    with pytest.raises(BackendFault, match="ValueError: the prompt is too long"):
        backend.answer(asked("too long"))
    other.join()
    assert found == [{"said": "fine"}]


def test_a_reply_cut_off_is_refused() -> None:
    with pytest.raises(Rejected, match="was cut off"):
        load_backend("vllm:m").answer(asked("endless"))


def test_an_engine_that_cannot_be_is_reported_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"vLLM cannot load broken: RuntimeError: no GPU$"):
        load_backend("vllm:broken")
    monkeypatch.setattr("scenewright.extras.find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"pip install 'scenewright\[vllm\]'"):
        load_backend("vllm:m")
