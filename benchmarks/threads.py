"""Threads: do 8 of them read and make what one does, byte for byte?

    python benchmarks/threads.py [--texts 2000] [--scenes 200] [--threads 8] [--mcp 40]

Texts are the requests of `robustness.py`, the examples and these with words left out, so that many
are refused; scenes are made of the requests with several seeds, without the refiner. Each is done
by several threads at a time and then by one, from an empty cache of plans, and the digests are
compared; then tools of `scenewright mcp` are called from as many threads at once. Exit code 1
if anything differs or raises.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from pathlib import Path
from typing import Any

from robustness import REQUESTS

from scenewright import plan, synthesize
from scenewright.backends.builtin import planner
from scenewright.errors import ScenewrightError
from scenewright.graph.scene_files import encode_proof, encode_scene

ROOT = Path(__file__).parent.parent


def list_texts(count: int) -> list[str]:
    """Requests, examples, and these without one of their words each."""
    examples = (ROOT / "examples" / "instructions.txt").read_text(encoding="utf-8").splitlines()
    texts = [*REQUESTS.values(), *(line for line in examples if line and line[0] != "#")]
    words = [text.split() for text in texts]
    longest = max(map(len, words))
    texts += [
        " ".join([*each[:k], *each[k + 1 :]])
        for k in range(longest)
        for each in words
        if k < len(each)
    ]
    return [texts[n % len(texts)] + " " * (n // len(texts)) for n in range(count)]


def digest_plan(text: str) -> str:
    """Of what is understood."""
    try:
        told: Any = plan(text)
    except ScenewrightError as error:
        told = str(error)
    return sha256(json.dumps(told, default=str, sort_keys=True).encode()).hexdigest()


def digest_scene(job: tuple[str, int]) -> str:
    """Of scene.json and proof.json, or of the reason why there is none."""
    text, seed = job
    try:
        made = synthesize(text, seed=seed, refiner="none", time_limit=None)
    except ScenewrightError as error:
        return sha256(str(error).encode()).hexdigest()
    return sha256(encode_scene(made.record) + encode_proof(made.proof)).hexdigest()


def run_in_threads(
    work: Callable[[Any], str], jobs: Sequence[Any], threads: int
) -> tuple[list[str], float, float]:
    """Results in order, wall and processor seconds; a traceback is a result of its own."""

    def run_caught(job: Any) -> str:
        try:
            return work(job)
        except Exception:
            return f"raised: {traceback.format_exc()}"

    planner._KNOWN._known.clear()
    wall, processor = time.perf_counter(), time.process_time()
    with ThreadPoolExecutor(threads) as pool:
        found = list(pool.map(run_caught, jobs))
    return found, time.perf_counter() - wall, time.process_time() - processor


def compare(name: str, work: Callable[[Any], str], jobs: Sequence[Any], threads: int) -> int:
    """How many results differ or were raised; prints a line."""
    many, wall, processor = run_in_threads(work, jobs, threads)
    one, alone, own = run_in_threads(work, jobs, 1)
    raised = sum(each.startswith("raised") for each in (*one, *many))
    other = sum(a != b for a, b in zip(one, many, strict=True))
    print(
        f"{len(jobs)} {name}: {other} differ, {raised} raised; {threads} threads {wall:.1f} s "
        f"({processor:.1f} s of processor), one {alone:.1f} s ({own:.1f} s)"
    )
    for each in [each for each in many if each.startswith("raised")][:1]:
        print(each)
    return other + raised


def call_tools(count: int, threads: int) -> int:
    """How many calls of tools of one `scenewright mcp` raised; prints a line."""
    from scenewright.cli.mcp import _ClientState
    from scenewright.cli.options import SessionOptions

    def call(n: int) -> str:
        if n % 2:
            return json.dumps(desk.make_scene("A car yields to a pedestrian at 8 am"), default=str)
        return json.dumps(desk.verify_scene(), default=str) if n % 4 else digest_plan("Two cars")

    with tempfile.TemporaryDirectory() as folder:
        options = SessionOptions(threads=str(Path(folder) / "threads.sqlite"))
        desk = _ClientState(options, thread="t", out=None)
        desk.make_scene("A car yields to a pedestrian at 8 am")
        found, wall, _ = run_in_threads(call, range(count), threads)
    raised = [each for each in found if each.startswith("raised")]
    print(f"{count} calls of tools over {threads} threads: {len(raised)} raised; {wall:.1f} s")
    for each in raised[:1]:
        print(each)
    return len(raised)


def main() -> None:
    """Compares, and says how many differ."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--texts", type=int, default=2000)
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--threads", type=int, default=8)
    parser.add_argument("--mcp", type=int, default=40)
    asked = parser.parse_args()
    requests = list(REQUESTS.values())
    jobs = [(requests[n % len(requests)], n // len(requests)) for n in range(asked.scenes)]
    faults = compare("texts", digest_plan, list_texts(asked.texts), asked.threads)
    faults += compare("scenes", digest_scene, jobs, asked.threads)
    faults += call_tools(asked.mcp, asked.threads) if asked.mcp else 0
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
