"""The same rows on a local Ray cluster, with a worker killed; needs the extra `ray`."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="needs the extra ray: make ray"
)

SCRIPT = """
import os, pathlib, signal, sys
from scenewright.dataset.batch.carry_out import spread_on_ray

FLAG = pathlib.Path(sys.argv[1]) / "killed"

def work(job):
    if job == 11 and not FLAG.exists():
        FLAG.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return job * job

done = list(spread_on_ray(range(40), work, workers=2))
assert sorted(done) == [(k, k * k) for k in range(40)], done
assert FLAG.exists()
print("all there")
"""


def test_a_killed_worker_costs_nothing_and_doubles_nothing(tmp_path: Path) -> None:
    # A process of its own: the tests' ban on sockets would keep it from its own cluster.
    ran = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(tmp_path)],
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    assert "all there" in ran.stdout


ALONE = """
import os, signal, time
from scenewright.dataset.batch import carry_out
from scenewright.dataset.batch.pool import Died, Overdue

def work(job):
    if job == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    if job == 12:
        time.sleep(600)
    return job

def calm(job):
    carry_out.WARM_UP = 0.0
    return carry_out.run_within(1.0, work, job)

done = dict(carry_out.spread_on_ray(range(16), calm, workers=2))
assert done == {k: k for k in range(16)} | {3: Died(None), 12: Overdue(1.0)}, done
print("all there")
"""


def test_a_job_that_kills_its_worker_or_never_ends_costs_no_other() -> None:
    ran = subprocess.run(
        [sys.executable, "-c", ALONE], capture_output=True, text=True, timeout=300, check=False
    )
    assert ran.returncode == 0, ran.stderr
    assert "all there" in ran.stdout


def test_ray_makes_the_same_bytes_as_processes(tmp_path: Path) -> None:
    rows = tmp_path / "rows.jsonl"
    texts = ["A car follows a bus at 5 am", "Light traffic at dawn, no incidents.", "Sing a song."]
    lines = [json.dumps({"id": f"row-{k}", "text": text}) for k, text in enumerate(texts)]
    rows.write_text("\n".join(lines))
    for engine in ("process", "ray"):
        words = ["batch", str(rows), "--out", str(tmp_path / engine), "--engine", engine, "-q"]
        ran = subprocess.run(
            [sys.executable, "-m", "scenewright", *words, "--workers", "2"],
            capture_output=True, text=True, timeout=300, check=False,
        )  # fmt: skip
        assert ran.returncode == 0, ran.stderr
    assert contents(tmp_path / "ray") == contents(tmp_path / "process")


def contents(out: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(out)): path.read_bytes()
        for path in sorted(out.rglob("*"))
        if path.is_file() and not path.name.startswith((".", "journal"))
    }
