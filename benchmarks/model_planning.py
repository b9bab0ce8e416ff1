"""Planning accuracy and ISR of any model through the real prompts, beside the builtin planner.

    python benchmarks/model_planning.py ask FOLDER [--n 80] [--seed 1]
    python benchmarks/model_planning.py score FOLDER --model NAME

A model is asked by file: `ask` takes N labelled instructions of the test half, runs each as far as
the answers reach and writes the questions that are still open to FOLDER/questions.jsonl, one JSON
object each: key, task, system, user, schema. The answers go to FOLDER/answers.jsonl with one
line per question, {"key": ..., "reply": "..."}, the reply as the model gave it; more files named
answers*.jsonl are read as well. Then `ask` again, until it says that no question is open: the
questions of later stages, and those of the retry edges, come up only when the earlier ones are
answered. `score` reports; with a backend in place of a file, as in

    python benchmarks/model_planning.py score FOLDER --backend openai:MODEL [--base-url URL]

the model is asked at once. Without arguments the builtin planner is scored alone.

Accuracy is over the first plans of a run (at most three attempts each), ISR over the scenes of
those instructions that are not labelled as refusals, made with seed 0 and no refiner. A refusal of
an instruction that is none counts as a failure in both.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal

from _planning_score import compare, score

from scenewright import synthesize
from scenewright.backends import TASKS, Backend, Prompt, Question, load_backend
from scenewright.backends.text_backend import Completion, TextBackend, compute_key
from scenewright.cli.plan import ATTEMPTS, build_refusal
from scenewright.errors import BackendFault, InputError, Rejected, Unsatisfiable
from scenewright.evals.bootstrap import Figure
from scenewright.evals.planning import load
from scenewright.graph.arguments import DEFAULT_INTERSECTION
from scenewright.intersections import load_map
from scenewright.nodes.scene_planner import ask_for_plan, describe_routes
from scenewright.nodes.scene_planner.prompts import render_plan_prompt
from scenewright.scene.plan_row import plan_to_row
from scenewright.scene.social import Plan

NAME = "a model by file"
Part = Literal["development", "test"]


class OpenError(BackendFault):
    """A question without an answer yet."""


class ByFile:
    """Says what the answers hold, and writes down what they do not."""

    name = NAME

    def __init__(self, folder: Path) -> None:
        self._answers = dict(_read_answers(folder))
        self.open: dict[str, dict[str, Any]] = {}

    def complete(self, question: Question, prompt: Prompt) -> Completion:
        key = compute_key(NAME, question, prompt)
        if key in self._answers:
            return Completion(self._answers[key], asked=1)
        self.open[key] = {
            "key": key,
            "task": question.task,
            "system": prompt.system,
            "user": prompt.user,
            "schema": prompt.schema,
        }
        raise OpenError(f"no answer to {key} yet", final=True)


def _read_answers(folder: Path) -> Iterable[tuple[str, str]]:
    for file in sorted(folder.glob("answers*.jsonl")):
        for number, line in enumerate(file.read_text("utf-8").splitlines(), start=1):
            if line.strip():
                try:
                    row = json.loads(line)
                    reply = row["reply"]
                    yield row["key"], reply if isinstance(reply, str) else json.dumps(reply)
                except (ValueError, KeyError, TypeError) as error:
                    raise SystemExit(f"{file}, line {number}: {error!r}") from None


def choose_rows(n: int, seed: int, *, part: Part = "test") -> list[dict[str, Any]]:
    """N labelled instructions of one half, spread by a hash that knows nothing of them.

    Without the ids `v4-` and `v5-`, which came later, a seed means the rows answers were kept for.
    """
    rows = [row for row in load(part) if not row["id"].startswith(("v4-", "v5-"))]
    rows.sort(key=lambda row: hashlib.sha256(f"{seed}:{row['id']}".encode()).digest())
    return rows[:n]


def plan_rows(rows: Sequence[dict[str, Any]], backend: Backend) -> tuple[list[dict[str, Any]], int]:
    """The rows as understood, as far as there are answers, and how many wait for one."""
    done, waiting = [], 0
    for row in rows:
        try:
            done.append(plan_to_row(row["id"], _plan(row, backend)))
        except OpenError:
            waiting += 1
    return done, waiting


def _plan(row: dict[str, Any], backend: Backend) -> Plan:
    """As in a run: the same words, and the same number of attempts."""
    intersection_map = load_map(DEFAULT_INTERSECTION)
    wrong: tuple[str, ...] = ()
    ways, text, previous = describe_routes(intersection_map), row["text"], row.get("previous")
    facts = {
        "instruction": text,
        "previous": previous,
        "legs": [leg.name for leg in intersection_map.legs],
    }
    for _ in range(1 if backend.deterministic else ATTEMPTS):
        prompt = partial(render_plan_prompt, text, previous, ways, rejections=wrong)
        question = Question("plan", facts, wrong, prompt=prompt)
        try:
            return ask_for_plan(backend, question, ways)
        except Rejected as error:
            wrong = (*wrong, error.rejection.detail)
    return build_refusal(f"no usable plan: {wrong[-1]}")


def make_scenes(rows: Sequence[dict[str, Any]], backend: Backend) -> tuple[dict[str, str], int]:
    """Make scenes: verified as labelled, verified, or why there is none; and how many wait."""
    found: dict[str, str] = {}
    waiting = 0
    for row in rows:
        if row["expected"]["refused"]:
            continue
        try:
            found[row["id"]] = _make_scene(row, backend)
        except OpenError:
            waiting += 1
    return found, waiting


def _make_scene(row: dict[str, Any], backend: Backend) -> str:
    try:
        scene = synthesize(
            row["text"], backend=backend, previous=row.get("previous"), refiner="none"
        )
    except (Unsatisfiable, InputError) as error:
        return f"refused: {error}"
    made = plan_to_row(row["id"], scene.state["social_graph"])
    right = compare(row["expected"], made)
    return "as labelled" if right.get("relations") and right.get("agents") else "otherwise"


def format_share(share: Figure) -> str:
    return f"{share.count} of {share.n} ({share:.1%})"


def report(name: str, rows: Sequence[dict[str, Any]], backend: Backend) -> None:
    plans, waiting = plan_rows(rows, backend)
    made, later = make_scenes(rows, backend)
    if waiting + later:
        print(f"{name}: {waiting + later} instructions still wait for answers", file=sys.stderr)
    labelled = [row for row in rows if row["id"] in {each["id"] for each in plans}]
    result = score(labelled, plans)
    print(f"== {name}")
    print(f"planning, every field right: {format_share(result.all_fields)}")
    print(", ".join(f"{field} {s.count}/{s.n}" for field, s in result.fields.items()))
    kinds = Counter(each.partition(":")[0] for each in made.values())
    right = Figure.of_count(kinds["as labelled"], len(made))
    print(f"ISR, verified with agents and relations as labelled: {format_share(right)}")
    verified = Figure.of_count(kinds["as labelled"] + kinds["otherwise"], len(made))
    print(f"verified at all: {format_share(verified)}")
    for key, fields in result.wrong.items():
        text = next(row["text"] for row in rows if row["id"] == key)
        print(f"  wrong {', '.join(fields)}: {text[:110]}")
    for key, why in made.items():
        if why != "as labelled":
            text = next(row["text"] for row in rows if row["id"] == key)
            print(f"  {why[:120]}: {text[:90]}")


def ask(folder: Path, n: int, seed: int) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    text_model, rows = ByFile(folder), choose_rows(n, seed)
    backend = TextBackend(text_model)
    plan_rows(rows, backend)
    make_scenes(rows, backend)
    lines = "".join(
        json.dumps(each, ensure_ascii=False) + "\n" for each in text_model.open.values()
    )
    (folder / "questions.jsonl").write_text(lines, "utf-8")
    (folder / "setting.json").write_text(json.dumps({"n": n, "seed": seed}))
    count = Counter(each["task"] for each in text_model.open.values())
    words = ", ".join(f"{count[task]} {task}" for task in TASKS if count[task])
    print(
        f"{len(text_model.open)} questions open ({words or 'none'}): {folder / 'questions.jsonl'}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("ask", "score", "builtin"), nargs="?", default="builtin")
    parser.add_argument("folder", type=Path, nargs="?", default=Path("model_planning"))
    parser.add_argument("--n", type=int, default=80)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--model", default=NAME, help="what to call who answered")
    parser.add_argument("--backend", action="append", help="ask this backend, not the file")
    parser.add_argument("--base-url")
    told_by = parser.parse_args()
    if told_by.what == "ask":
        ask(told_by.folder, told_by.n, told_by.seed)
        return
    if told_by.what == "builtin":
        report("builtin", choose_rows(told_by.n, told_by.seed), load_backend("builtin"))
        return
    setting = {"n": told_by.n, "seed": told_by.seed}
    if told_by.backend is None:
        setting = json.loads((told_by.folder / "setting.json").read_text())
        backend: Backend = TextBackend(ByFile(told_by.folder))
    else:
        backend = load_backend(told_by.backend, base_url=told_by.base_url)
    rows = choose_rows(setting["n"], setting["seed"])
    report(told_by.model if told_by.backend is None else backend.name, rows, backend)
    report("builtin", rows, load_backend("builtin"))


if __name__ == "__main__":
    main()
