"""A model with random weights, constrained by the schemas: `make test-vllm`.

Served, or in the process for many prompts at once: whatever it says ends in a scene that is
verified or in a refusal that names its reason. The engine has an environment of its own, which also
holds the project, named by SCENEWRIGHT_VLLM; without it these tests are skipped.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import time
import urllib.request
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from scenewright import synthesize, verify
from scenewright.backends import load_backend
from scenewright.errors import InputError, Unsatisfiable

ENVIRONMENT = os.environ.get("SCENEWRIGHT_VLLM")
RUNS = int(os.environ.get("SCENEWRIGHT_VLLM_RUNS", "200"))
HERE = Path(__file__).parent
PROMPTS = sorted(HERE.parent.glob("golden/prompt_*.txt"))
STARTS_WITHIN = 1800.0
"""The engine may take this long to come up on a busy machine [s]."""

ROWS = 64
QUIET = {
    "HF_HUB_OFFLINE": "1",
    "VLLM_NO_USAGE_STATS": "1",
    "DO_NOT_TRACK": "1",
    "VLLM_CPU_KVCACHE_SPACE": "1",
    "TORCH_COMPILE_DISABLE": "1",
}
"""No network, a small cache, and nothing compiled for a model of this size."""

REQUESTS = (
    "A car yields to a pedestrian",
    "A car turning left collides with an oncoming car",
    "A car narrowly misses a pedestrian",
    "A car follows a bus",
)
STAGES = (
    ["openai:tiny"],
    ["planner=openai:tiny"],
    ["filter=openai:tiny"],
    ["reasoner=openai:tiny"],
)

pytestmark = pytest.mark.skipif(ENVIRONMENT is None, reason="SCENEWRIGHT_VLLM names no engine")


@pytest.fixture(autouse=True)
def _no_network() -> None:
    """Here the network is this machine's own server."""


@pytest.fixture(scope="module")
def python() -> str:
    return str(Path(str(ENVIRONMENT)) / "bin" / "python")


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory, python: str) -> Path:
    made = tmp_path_factory.mktemp("model") / "tiny"
    command = [python, str(HERE / "tiny_model.py"), str(made), *map(str, PROMPTS)]
    subprocess.run(command, check=True)
    return made


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory, python: str, model: Path) -> Iterator[str]:
    folder = tmp_path_factory.mktemp("vllm")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [
        python, "-m", "vllm.entrypoints.openai.api_server", "--model", str(model),
        "--served-model-name", "tiny", "--dtype", "float32", "--max-model-len", "8192",
        "--enforce-eager", "--max-num-seqs", "4", "--host", "127.0.0.1", "--port", str(port),
        "--structured-outputs-config.backend", "xgrammar",
        "--structured-outputs-config.disable_any_whitespace", "true",
    ]  # fmt: skip
    with (folder / "log").open("wb") as log:
        server = subprocess.Popen(
            command, env=os.environ | QUIET, stdout=log, stderr=log, cwd=folder
        )
        try:
            _wait_for(f"http://127.0.0.1:{port}/health", server, folder / "log")
            yield f"http://127.0.0.1:{port}/v1"
        finally:
            server.terminate()
            server.wait(300)


def _wait_for(url: str, server: Any, log: Path) -> None:
    until = time.monotonic() + STARTS_WITHIN
    while time.monotonic() < until:
        if server.poll() is not None:
            break
        try:
            with urllib.request.urlopen(url, timeout=5):
                return
        except OSError:
            time.sleep(1.0)
    pytest.fail(f"the engine did not come up:\n{log.read_text(errors='replace')[-3000:]}")


def test_random_weights_end_in_a_scene_or_a_refusal(endpoint: str) -> None:
    ends: Counter[str] = Counter()
    first: Counter[str] = Counter()
    asked = 0
    for run in range(RUNS):
        names = STAGES[run % len(STAGES)]
        backend = load_backend(names, base_url=endpoint, timeout=300)
        end, rejections = _end(REQUESTS[run % 7 % len(REQUESTS)], backend, run)
        ends[f"{names[0]}: {end}"] += 1
        first.update(each.code for each in rejections[:1])
        asked += len(rejections)
    print(json.dumps({"runs": RUNS, "ends": ends, "first": first, "rejections": asked}, indent=1))
    assert sum(ends.values()) == RUNS
    assert not any("without a word" in end for end in ends)


def _end(text: str, backend: Any, seed: int) -> tuple[str, tuple[Any, ...]]:
    try:
        scene = synthesize(text, backend=backend, seed=seed, refiner="none")
    except Unsatisfiable as error:
        return f"refused{'' if str(error) else ' without a word'}", error.rejections
    except InputError as error:
        return f"refused{'' if str(error) else ' without a word'}", ()
    proof = verify(scene)
    assert proof.verified
    assert {each.type for each in proof.events} <= {each.type for each in scene.record.events}
    kinds = ", ".join(sorted({each.type for each in scene.record.events}))
    return f"verified, {kinds}", ()


def test_many_prompts_in_one_process(model: Path, python: str, tmp_path: Path) -> None:
    """The batch path: every row is answered, by a plan or a refusal with its reason."""
    rows, planned = tmp_path / "rows.jsonl", tmp_path / "planned.jsonl"
    texts = [f"{REQUESTS[n % len(REQUESTS)]} at {n % 24}:{n % 60:02d}" for n in range(ROWS)]
    rows.write_text(
        "".join(f"{json.dumps({'id': str(n), 'text': t})}\n" for n, t in enumerate(texts))
    )
    command = [
        python, "-m", "scenewright", "plan", str(rows), "--out", str(planned),
        "--backend", f"planner=vllm:{model}",
    ]  # fmt: skip
    before = time.monotonic()
    done = subprocess.run(
        command, env=os.environ | QUIET, cwd=tmp_path, capture_output=True, text=True, check=False
    )
    seconds = time.monotonic() - before
    assert done.returncode == 0, done.stderr[-3000:]
    found = [json.loads(line) for line in planned.read_text("utf-8").splitlines()]
    [said] = [line for line in done.stderr.splitlines() if line.startswith(f"{ROWS} rows, ")]
    print(f"{said}, {seconds:.0f} s with the loading of the model")
    assert [each["id"] for each in found] == [str(n) for n in range(ROWS)]
    assert all(bool(each["reason"]) == each["refused"] for each in found)
    assert "Traceback" not in done.stderr
