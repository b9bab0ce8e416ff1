"""Answers in a file: replayed bit for bit, shared by runs, mended after a kill, free of keys."""

from __future__ import annotations

import json
import threading
from pathlib import Path
from typing import Any

import pytest

from backends.misbehaving import KEY
from scenewright import synthesize
from scenewright.backends import Prompt, Question, Task, load_backend
from scenewright.backends.choosing import StagedBackend
from scenewright.backends.recorded import Answers, record_answers, replay_answers
from scenewright.backends.text_backend import Completion
from scenewright.errors import BackendFault, InputError
from scenewright.graph.scene_files import encode_scene
from scenewright.nodes.revision import Turn, read_by_model
from scenewright.nodes.scene_planner import FOUR_LEGS
from scenewright.scene.edits import AgentView, Edits, Situation
from scenewright.scene.social import SocialGraph
from scripted import build_scripted_backend

YIELD = "A car from the south turning right yields to a pedestrian. Nobody else is around."
TASKS: tuple[Task, ...] = ("plan", "constraints", "behavior")


def asked(seed: int = 0, words: str = "x") -> Question:
    prompt = Prompt("You answer.", words, {"type": "object"})
    return Question("plan", {}, seed=seed, prompt=lambda: prompt)


def a_model(*replies: Any, forever: bool = True) -> dict[Any, Any]:
    return dict.fromkeys(
        TASKS, build_scripted_backend({"plan": replies}, name="a model", forever=forever)
    )


def test_a_run_is_replayed_bit_for_bit(tmp_path: Path) -> None:
    file = tmp_path / "answers.jsonl"
    live = synthesize(YIELD, backend=load_backend(record=file), seed=4, refiner="none")
    again = synthesize(YIELD, backend=f"recorded:{file}", seed=4, refiner="none")
    assert encode_scene(again.record) == encode_scene(live.record)
    assert again.proof == live.proof
    assert list(again.provenance["models"]) == ["plan"]
    assert again.provenance["models"]["plan"]["requests"] == 0


def test_a_file_of_an_earlier_version_is_replayed_and_added_to(tmp_path: Path) -> None:
    """It names who answers a question that is not asked any more, and holds unused answers."""
    file = tmp_path / "answers.jsonl"
    live = synthesize(YIELD, backend=load_backend(record=file), seed=4, refiner="none")
    head, plan, *_ = map(json.loads, file.read_text().splitlines())
    head["speakers"]["summary"] = head["speakers"]["behavior"]
    others = [
        {**plan, "task": task, "key": task} for task in ("constraints", "summary", "behavior")
    ]
    file.write_text("".join(json.dumps(each) + "\n" for each in (head, plan, *others)))
    again = synthesize(YIELD, backend=f"recorded:{file}", seed=4, refiner="none")
    assert encode_scene(again.record) == encode_scene(live.record)
    synthesize(YIELD, backend=load_backend(record=file), seed=5, refiner="none")
    assert len(file.read_text().splitlines()) == 6


def test_a_reply_that_was_none_is_replayed_too(tmp_path: Path) -> None:
    """The whole way to a refusal, with what was said at every turn."""
    file = tmp_path / "answers.jsonl"
    script = ["{", Completion("", fault="the reply was cut off"), '{"agents": 3}']
    live = StagedBackend(record_answers(a_model(*script), file))
    with pytest.raises(BackendFault) as first:
        synthesize(YIELD, backend=live, seed=1, refiner="none")
    with pytest.raises(BackendFault) as second:
        synthesize(YIELD, backend=f"recorded:{file}", seed=1, refiner="none")
    assert first.value.rejections == second.value.rejections
    assert len(first.value.rejections) == 3


def test_a_question_that_was_never_put_is_one_clear_line(tmp_path: Path) -> None:
    file = tmp_path / "answers.jsonl"
    synthesize(YIELD, backend=load_backend(record=file), seed=4, refiner="none")
    with pytest.raises(BackendFault, match=r"holds no answer to this plan question of seed 5"):
        synthesize(YIELD, backend=f"recorded:{file}", seed=5, refiner="none")


@pytest.mark.parametrize("change", [{"seed": 1}, {"words": "y"}])
def test_the_key_is_the_question_to_the_last_word(tmp_path: Path, change: dict[str, Any]) -> None:
    file = tmp_path / "answers.jsonl"
    backend = record_answers(a_model({"a": 1}), file)["plan"]
    assert backend.answer(asked()) == {"a": 1}
    assert replay_answers(file)["plan"].answer(asked()) == {"a": 1}
    with pytest.raises(BackendFault):
        replay_answers(file)["plan"].answer(asked(**change))


def test_what_the_file_holds_is_not_asked_again(tmp_path: Path) -> None:
    file = tmp_path / "answers.jsonl"
    record_answers(a_model({"a": 1}), file)["plan"].answer(asked())
    once_more = record_answers(a_model({"a": 2}), file)["plan"]
    assert once_more.answer(asked()) == {"a": 1}
    assert once_more.answer(asked(seed=1)) == {"a": 2}
    assert len(file.read_text().splitlines()) == 3


def test_a_line_cut_off_by_a_kill_costs_that_line_alone(tmp_path: Path) -> None:
    file = tmp_path / "answers.jsonl"
    record_answers(a_model({"a": 1}), file)["plan"].answer(asked())
    with file.open("a") as end:
        end.write('{"key": "half a li')
    assert replay_answers(file)["plan"].answer(asked()) == {"a": 1}
    record_answers(a_model({"a": 2}), file)["plan"].answer(asked(seed=1))
    assert [json.loads(line) for line in file.read_text().splitlines()][2]["seed"] == 1


def test_several_runs_may_share_a_file(tmp_path: Path) -> None:
    file = tmp_path / "answers.jsonl"
    backends = [record_answers(a_model({"a": 1}), file)["plan"] for _ in range(4)]

    def ask(first: int, backend: Any) -> None:
        for seed in range(first, 40, 4):
            backend.answer(asked(seed=seed))

    threads = [threading.Thread(target=ask, args=each) for each in enumerate(backends)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    replay = replay_answers(file)["plan"]
    assert all(replay.answer(asked(seed=seed)) == {"a": 1} for seed in range(40))


def test_a_file_of_anothers_answers_is_not_added_to(tmp_path: Path) -> None:
    file = tmp_path / "answers.jsonl"
    load_backend(record=file)
    with pytest.raises(InputError, match="holds the answers of builtin, not of a model"):
        record_answers(a_model({}), file)


def test_no_key_gets_into_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("langchain_openai")
    file = tmp_path / "answers.jsonl"
    load_backend("openai:m", base_url="http://127.0.0.1:9/v1", record=file)
    assert KEY not in file.read_text()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "holds no recorded answers"),
        ("{}\n", "line 1"),
        ('{"format": "scenewright answers", "version": 1, "speakers": {}}\n', "who answers"),
        ("not json\n", "line 1"),
        ("\udcff", "not UTF-8"),
    ],
)
def test_a_file_that_is_none_is_reported_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "answers.jsonl"
    file.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(InputError, match=words) as caught:
        Answers.read(file)
    assert "\n" not in str(caught.value)


def test_a_place_that_cannot_be_written_is_reported(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot write"):
        load_backend(record=tmp_path / "no" / "such" / "folder.jsonl")
    with pytest.raises(InputError, match="cannot"):
        load_backend(record=tmp_path)


def test_what_a_turn_was_read_as_is_replayed(tmp_path: Path) -> None:
    file = tmp_path / "answers.jsonl"
    car = AgentView(id="vehicle-1", number=0, type="vehicle", entry="north", exit="south",
                  movement="straight", role="foreground", speed=8.0)  # fmt: skip
    graph = SocialGraph.model_validate({"agents": [{"id": "vehicle-1", "type": "vehicle"}]})
    turn = Turn("a bit less haste", Situation(graph=graph, present=(car,)), "A car", FOUR_LEGS)
    slower = {"edits": [{"edit": "set_pace", "agent": "vehicle-1", "factor": 0.9}]}
    model = build_scripted_backend({"edits": ["no", slower]}, name="a model")
    live = StagedBackend(record_answers(dict.fromkeys(TASKS, model), file))
    first = read_by_model(turn, backend=live, seed=1)
    assert isinstance(first, Edits)
    assert read_by_model(turn, backend=load_backend(f"recorded:{file}"), seed=1) == first
    with pytest.raises(BackendFault, match="holds no answer"):
        read_by_model(turn, backend=load_backend(f"recorded:{file}"), seed=2)
