"""A small model's life: `python benchmarks/small_model.py [runs per row]`.

Answers that fit the schema but are drawn at random, and right answers in which one field is wrong,
go through the real stages and retry edges. Every run must end in a scene that the checker confirms
once more, with the labels that it finds, or in a refusal; anything else is printed and fails. One
row per case: how often it ended in a scene, how often in a refusal, and after how many answers of
the model. The other stages are answered by rule.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np
from inlined_schema import inline_references

from scenewright import synthesize, verify
from scenewright.backends import STAGE_OF, TASKS, Backend, Prompt, Question, Task, load_backend
from scenewright.backends.choosing import StagedBackend
from scenewright.backends.text_backend import Completion, TextBackend
from scenewright.errors import InputError, Unsatisfiable
from scenewright.graph.run import Scene
from scenewright.nodes.scene_planner.reply import ID, TIME

REQUESTS = (
    "A car yields to a pedestrian",
    "A car turning left collides with an oncoming car",
    "A car narrowly misses a pedestrian with a PET of 1.0 seconds",
    "A car follows a bus",
    "A pedestrian waits for a car and then crosses",
    "A car rear-ends another car",
)
OTHERS = " with four other cars around."
WORDS = ("not", "a", "scene", "here", "it", "cannot", "be")
Rng = np.random.Generator


def draw_answer(schema: dict[str, Any], rng: Rng) -> Any:
    """Any value that fits the schema, shorter ones more often."""
    if "anyOf" in schema:
        return draw_answer(_choose_one(schema["anyOf"], rng), rng)
    if "enum" in schema:
        return _choose_one(schema["enum"], rng)
    match schema["type"]:
        case "object":
            needed, keys = schema.get("required", ()), schema["properties"]
            return {
                k: draw_answer(s, rng) for k, s in keys.items() if k in needed or rng.random() < 0.4
            }
        case "array":
            least = schema.get("minItems", 0)
            size = int(rng.integers(least, min(schema["maxItems"], least + 3) + 1))
            return [draw_answer(schema["items"], rng) for _ in range(size)]
        case "boolean":
            return bool(rng.random() < 0.5)
        case "integer":
            return int(rng.integers(schema["minimum"], schema["maximum"] + 1))
        case "number":
            return round(float(rng.uniform(schema["minimum"], schema["maximum"])), 2)
    if schema["pattern"] == TIME:
        return f"{rng.integers(24):02d}:{rng.integers(60):02d}"
    if schema["pattern"] == ID:
        return f"{_choose_one(('vehicle', 'pedestrian'), rng)}-{rng.integers(1, 7)}"
    return " ".join(_choose_one(WORDS, rng) for _ in range(4))


def spoil_answer(value: dict[str, Any], rng: Rng) -> dict[str, Any]:
    """The answer with one field wrong: another value, none, of another type, left out, or new."""
    copy = deepcopy(value)
    holder, key = _choose_one(list(_list_fields(copy)), rng)
    match int(rng.integers(5)):
        case 0:
            holder[key] = None
        case 1:
            holder[key] = _choose_one((-1, 1e9, "", "north", "vehicle-9", "moon", [], {}), rng)
        case 2:
            holder[key] = _draw_other(holder[key], rng)
        case 3 if isinstance(holder, dict):
            del holder[key]
        case _ if isinstance(holder, dict):
            holder["note"] = "x"
        case _:
            holder.append(holder[key])
    return copy


def _list_fields(value: Any) -> Iterator[tuple[Any, Any]]:
    keys = value if isinstance(value, dict) else range(len(value))
    for key in list(keys):
        yield value, key
        if isinstance(value[key], dict | list):
            yield from _list_fields(value[key])


def _draw_other(value: Any, rng: Rng) -> Any:
    """Another value of the same kind."""
    match value:
        case bool():
            return not value
        case int() | float():
            return round(value + float(rng.normal(0.0, 3.0)), 2)
        case str():
            words = ("south", "left", "stop", "vehicle-2", "vehicle-1", "goal", "keep", "contact")
            return _choose_one(words, rng)
        case list():
            return value[:-1]
    return value


def _choose_one(values: Any, rng: Rng) -> Any:
    return values[int(rng.integers(len(values)))]


class Small:
    """A small model: answers as `how` has it, and counts its answers."""

    def __init__(self, how: Callable[[Question, Prompt, Rng], Any], seed: int) -> None:
        self.name = f"small model {seed}"
        self.calls = 0
        self._how, self._rng = how, np.random.default_rng(seed)

    def complete(self, question: Question, prompt: Prompt) -> Completion:
        self.calls += 1
        return Completion(json.dumps(self._how(question, prompt, self._rng)))


def answer_at_random(question: Question, prompt: Prompt, rng: Rng) -> Any:
    del question
    return draw_answer(inline_references(prompt.schema), rng)


def answer_one_wrong(question: Question, prompt: Prompt, rng: Rng) -> Any:
    del prompt
    return spoil_answer(_answer_right(question), rng)


def answer_first_wrong(question: Question, prompt: Prompt, rng: Rng) -> Any:
    """Answer wrong until the error is reported."""
    right = _answer_right(question)
    return right if question.rejections else answer_one_wrong(question, prompt, rng)


def _answer_right(question: Question) -> dict[str, Any]:
    """The rule's answer."""
    return load_backend("builtin").answer(question)


@dataclass
class Tally:
    """How the runs of one case ended."""

    scenes: int = 0
    refused: int = 0
    false: int = 0
    broken: Counter[str] = field(default_factory=Counter)
    calls: list[int] = field(default_factory=list)
    mended: int = 0


def holds(scene: Scene) -> bool:
    """Whether the labels are those that the checker finds again in what was written."""
    proof = verify(scene)
    asked = {(each.type, frozenset((each.from_, each.to))) for each in scene.record.relations}
    seen = {(each.type, frozenset((each.from_, each.to))) for each in proof.events}
    labels = {
        (each.type, frozenset((each.from_, each.to)))
        for each in scene.record.events
        if each.type != "normal"
    }
    return proof.verified and asked <= seen and labels == seen


def run(tasks: tuple[Task, ...], how: Any, seed: int, tally: Tally) -> None:
    small = Small(how, seed)
    rule, spoken = load_backend("builtin"), TextBackend(small)
    speakers: dict[Task, Backend] = {task: spoken if task in tasks else rule for task in TASKS}
    text = REQUESTS[seed % len(REQUESTS)] + OTHERS
    try:
        scene = synthesize(text, backend=StagedBackend(speakers), seed=seed, refiner="none")
    except (Unsatisfiable, InputError):
        tally.refused += 1
    except Exception as error:  # what must not happen is counted, not hidden
        tally.broken[f"{type(error).__name__}: {str(error)[:80]}"] += 1
    else:
        tally.scenes += 1
        tally.false += not holds(scene)
        stages = {STAGE_OF[task] for task in tasks} | {"scene_verifier"}
        tally.mended += any(each["stage"] in stages for each in scene.provenance["rejections"])
    tally.calls.append(small.calls)


def main() -> int:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    cases = [("random", answer_at_random), ("one field wrong, always", answer_one_wrong)]
    cases.append(("one field wrong, until reported", answer_first_wrong))
    asked: list[tuple[str, tuple[Task, ...]]] = [("plan", ("plan",))]
    start, bad, total = perf_counter(), 0, 0
    print(
        "| answers | of | runs | scenes | of them after a refusal | refused | answers: mean, most |"
    )
    print("|---|---|---|---|---|---|---|")
    for case, how in cases:
        for name, tasks in asked:
            tally = Tally()
            for seed in range(runs):
                run(tasks, how, seed, tally)
            mean, most = sum(tally.calls) / runs, max(tally.calls)
            print(
                f"| {case} | {name} | {runs} | {tally.scenes} | {tally.mended} | {tally.refused} "
                f"| {mean:.1f}, {most} |",
                flush=True,
            )
            for what, count in tally.broken.items():
                print(f"BROKEN {count}x {what}", flush=True)
            bad += tally.false + sum(tally.broken.values())
            total += runs
    seconds = (perf_counter() - start) / total
    print(f"{total} runs, {bad} false labels or tracebacks, {seconds:.2f} s a run")
    return 1 if bad else 0


if __name__ == "__main__":
    raise SystemExit(main())
