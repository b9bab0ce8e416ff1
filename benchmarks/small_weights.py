"""A small language model's own words: `make test-small-weights`.

    python benchmarks/small_weights.py ENVIRONMENT [--plans 60] [--runs 30] [--part test]

ENVIRONMENT is a virtual environment with llama-cpp-python's server and a package that holds
weights (*.gguf). The model is served on this machine and reached as any OpenAI-compatible endpoint
is, with the real prompts, schemas and retry edges. Two things are asked of it: plans of labelled
instructions, and whole runs. Every run must end in a scene
that the checker confirms once more, with the labels that it finds, or in a refusal that names its
reason; anything else is printed and fails. Without arguments nothing is run.
"""

from __future__ import annotations

import argparse
import os
import socket
import subprocess
import sys
import time
import urllib.request
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from _planning_score import compare, score
from model_planning import choose_rows, format_share
from small_model import holds

from scenewright import synthesize
from scenewright.backends import TASKS, Backend, Question, Task, load_backend
from scenewright.backends.choosing import StagedBackend
from scenewright.cli.plan import ask_for_plan
from scenewright.errors import BackendFault, InputError, Unsatisfiable
from scenewright.evals.bootstrap import Figure
from scenewright.graph.arguments import DEFAULT_INTERSECTION
from scenewright.intersections import load_map
from scenewright.scene.plan_row import plan_to_row

NAME = "small"
STARTS_WITHIN, ANSWERS_WITHIN = 300.0, 600.0
"""Of the server and of one reply on a busy machine [s]."""

UNUSABLE = "The backend gave no usable plan"
NOTE = "needs an environment with weights: make test-small-weights"


class Counting:
    """Hands questions on and counts the answers, by task."""

    deterministic = False

    def __init__(self, backend: Backend) -> None:
        self.name = backend.name
        self.answers: Counter[Task] = Counter()
        self._backend = backend

    def answer(self, question: Question) -> dict[str, Any]:
        self.answers[question.task] += 1
        return self._backend.answer(question)


@contextmanager
def serve_weights(environment: Path) -> Iterator[str]:
    """The address of a server of the environment's weights."""
    weights = sorted(environment.glob("lib/python*/site-packages/**/*.gguf"))
    if not weights:
        raise SystemExit(f"{environment} holds no weights (*.gguf)")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [
        str(environment / "bin" / "python"), "-m", "llama_cpp.server", "--model", str(weights[0]),
        "--model_alias", NAME, "--n_ctx", "4096", "--n_threads", "1", "--n_threads_batch", "1",
        "--verbose", "false", "--host", "127.0.0.1", "--port", str(port),
    ]  # fmt: skip
    log = environment / "server.log"
    with log.open("wb") as out:
        server = subprocess.Popen(command, stdout=out, stderr=out)
    try:
        url = f"http://127.0.0.1:{port}/v1"
        _wait_for(f"{url}/models", server, log)
        yield url
    finally:
        server.terminate()
        server.wait(60)


def _wait_for(url: str, server: Any, log: Path) -> None:
    until = time.monotonic() + STARTS_WITHIN
    while time.monotonic() < until and server.poll() is None:
        try:
            with urllib.request.urlopen(url, timeout=5):
                return
        except OSError:
            time.sleep(0.5)
    raise SystemExit(f"the server did not come up:\n{log.read_text(errors='replace')[-2000:]}")


@dataclass
class Ends:
    """How runs ended, after how many answers, and what must not have happened."""

    ends: Counter[str] = field(default_factory=Counter)
    calls: list[int] = field(default_factory=list)
    reasons: Counter[str] = field(default_factory=Counter)
    bad: list[str] = field(default_factory=list)


def test_plans(rows: Sequence[dict[str, Any]], model: Counting) -> None:
    """Plans as in a run: at most three answers each."""
    intersection_map = load_map(DEFAULT_INTERSECTION)
    made, calls, unusable, empty = [], [], 0, 0
    for row in rows:
        model.answers.clear()
        plan = ask_for_plan(row, model, intersection_map=intersection_map)
        calls.append(model.answers["plan"])
        unusable += UNUSABLE in str(getattr(plan, "reason", ""))
        empty += getattr(plan, "agents", None) == () and not row["expected"]["refused"]
        made.append(plan_to_row(row["id"], plan))
        wrong = [key for key, right in compare(row["expected"], made[-1]).items() if not right]
        found = f"wrong in {', '.join(wrong)}" if wrong else "right"
        print(f"  {found} after {calls[-1]}: {row['text'][:80]}", flush=True)
    result, n = score(rows, made), len(rows)
    first = sum(count == 1 for count in calls)
    print(f"plans of {n} instructions, {sum(calls)} answers")
    print(f"  of use at the first answer: {format_share(Figure.of_count(first, n))}")
    print(f"  of use within three answers: {format_share(Figure.of_count(n - unusable, n))}")
    print(f"  without agents where some are named: {format_share(Figure.of_count(empty, n))}")
    print(f"  every field right: {format_share(result.all_fields)}")
    for name, share in result.fields.items():
        print(f"    {name}: {format_share(share)}")


def test_runs(rows: Sequence[dict[str, Any]], model: Counting, *, asked: Sequence[Task]) -> Ends:
    """Whole runs in which the model is asked these questions, and the rule the others."""
    found, rule = Ends(), load_backend("builtin")
    speakers: dict[Task, Backend] = {task: model if task in asked else rule for task in TASKS}
    for row in rows:
        model.answers.clear()
        end = _end(row, StagedBackend(speakers), found)
        found.ends[end] += 1
        found.calls.append(sum(model.answers.values()))
        print(f"  {end} after {dict(model.answers)}: {row['text'][:80]}", flush=True)
    return found


def _end(row: dict[str, Any], backend: Backend, found: Ends) -> str:
    try:
        scene = synthesize(
            row["text"], previous=row.get("previous"), backend=backend, seed=0, refiner="none"
        )
    except BackendFault:
        raise
    except (Unsatisfiable, InputError) as error:
        found.reasons[" ".join(str(error).split())[:90]] += 1
        if not str(error):
            found.bad.append("a refusal without a word")
        return "refused"
    except Exception as error:  # what must not happen is counted, not hidden
        found.bad.append(f"{type(error).__name__}: {str(error)[:80]}")
        return "broken"
    if not holds(scene):
        found.bad.append(f"a false label: {row['text'][:80]}")
    made = plan_to_row(row["id"], scene.state["social_graph"])
    right = compare(row["expected"], made)
    if right.get("relations") and right.get("agents"):
        return "verified, agents and relations as labelled"
    return "verified, something else" if made["relations"] else "verified, nothing happens"


def report(name: str, found: Ends) -> None:
    n = len(found.calls)
    print(
        f"{name}: {n} runs, answers {sum(found.calls) / n:.1f} on average, {max(found.calls)} most"
    )
    for end, count in found.ends.most_common():
        print(f"  {end}: {format_share(Figure.of_count(count, n))}")
    for why, count in found.reasons.most_common(6):
        print(f"    {count} x {why}")
    print(f"  false labels, tracebacks, refusals without a word: {len(found.bad)}")
    for each in found.bad:
        print(f"BAD {each}")


def measure_server(url: str, options: argparse.Namespace) -> int:
    rows = choose_rows(options.plans, options.seed, part=options.part)
    wanted = [row for row in rows if not row["expected"]["refused"]][: options.runs]
    os.environ.setdefault("SCENEWRIGHT_API_KEY", "none")
    model = Counting(
        load_backend(f"openai:{NAME}", base_url=url, timeout=ANSWERS_WITHIN, record=options.record)
    )
    test_plans(rows, model)
    whole = test_runs(wanted, model, asked=TASKS)
    report("every question put to the model", whole)
    return 1 if whole.bad else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("environment", type=Path, nargs="?")
    parser.add_argument("--url", help="ask a server that runs already")
    parser.add_argument("--record", type=Path, help="keep answers there, to go on where it was")
    parser.add_argument("--plans", type=int, default=60)
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--part", choices=("development", "test"), default="test")
    options = parser.parse_args()
    if options.url is not None:
        return measure_server(options.url, options)
    if options.environment is None:
        print(NOTE)
        return 0
    start = time.monotonic()
    with serve_weights(options.environment) as url:
        code = measure_server(url, options)
    print(f"{(time.monotonic() - start) / 60:.0f} minutes")
    return code


if __name__ == "__main__":
    sys.exit(main())
