"""Many scenes in one run: killed at random and gone on with, memory, cost per scene.

`python benchmarks/batch.py --rows 1000 --kills 20`: one run undisturbed, one killed (`kill -9` on
the command, its workers left to find out) so many times at random moments and gone on with; every
file but the journal must be the same. `--kills 0 --memory 100 1000 3000 10000` prints, for each
number of rows, the peak memory of the command and of its largest worker, and what a row costs:
processor time of all processes, seconds, disk, and how long the same command needs to find that
nothing is left to do.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import platform
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from scenewright.dataset.batch.rows import read_source

TEXTS = (
    "A vehicle yields to a pedestrian in medium traffic",
    "A car turning left yields to an oncoming car in medium traffic",
    "A car hits a pedestrian on the north crosswalk in medium traffic",
    "Two cars collide at a right angle in medium traffic",
    "A van rear-ends a car waiting at the light in medium traffic",
    "A car narrowly misses a pedestrian in medium traffic",
    "A car follows a bus through the intersection in medium traffic",
    "Ordinary traffic, nothing happens, medium density",
)


def write_rows(path: Path, count: int) -> Path:
    lines = (
        json.dumps({"id": f"scene-{k:06d}", "text": TEXTS[k % len(TEXTS)]}) for k in range(count)
    )
    path.write_text("".join(f"{line}\n" for line in lines))
    assert read_source(path).rows == count
    return path


def build_command(rows: Path, out: Path, words: list[str]) -> list[str]:
    return [sys.executable, "-m", "scenewright", "batch", str(rows), "--out", str(out), *words]


def start(rows: Path, out: Path, words: list[str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [*build_command(rows, out, words), "--quiet"],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )  # fmt: skip


def count_done(out: Path) -> int:
    """Count the lines of the journal but its header."""
    try:
        return (out / "journal.jsonl").read_bytes().count(b"\n") - 1
    except FileNotFoundError:
        return 0


def run_with_kills(rows: Path, out: Path, words: list[str], kills: int, count: int) -> list[int]:
    """Run to the end through so many kills; return the rows done at each of them."""
    moments = sorted(random.Random(0).sample(range(count), kills))
    seen: list[int] = []
    for moment in moments:
        run = start(rows, out, words)
        # A random moment between two rows, at start-up where the kill before came later.
        while run.poll() is None and count_done(out) < moment:
            time.sleep(0.01)
        time.sleep(random.random() * 0.2)
        assert run.poll() is None, "over before it was killed"
        os.kill(run.pid, signal.SIGKILL)
        run.wait()
        seen.append(count_done(out))
    run = start(rows, out, words)
    _, error = run.communicate()
    assert run.returncode == 0, error.decode()
    return seen


def compute_hashes(out: Path) -> dict[str, str]:
    """Hash every file that counts."""
    return {
        str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(out.rglob("*"))
        if path.is_file() and not path.name.startswith((".", "journal"))
    }


class Memory(threading.Thread):
    """Peak resident memory of a process and of its children, looked at every 50 ms [MB]."""

    def __init__(self, pid: int) -> None:
        super().__init__(daemon=True)
        self.pid, self.parent, self.child, self.total = pid, 0.0, 0.0, 0.0

    def run(self) -> None:
        while parent := measure_resident(self.pid):
            children = [measure_resident(pid) for pid in list_children(self.pid)]
            self.parent = max(self.parent, parent)
            self.child = max(self.child, *children, 0.0)
            self.total = max(self.total, parent + sum(children))
            time.sleep(0.05)


def measure_resident(pid: int) -> float:
    try:
        fields = Path(f"/proc/{pid}/statm").read_text().split()
    except OSError:
        return 0.0
    return int(fields[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def list_children(pid: int) -> list[int]:
    try:
        return [int(p) for p in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


def benchmark_kills(count: int, kills: int, words: list[str]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        rows = write_rows(Path(folder) / "rows.jsonl", count)
        whole, broken = Path(folder) / "whole", Path(folder) / "broken"
        begin = time.perf_counter()
        run = start(rows, whole, words)
        _, error = run.communicate()
        assert run.returncode == 0, error.decode()
        undisturbed = time.perf_counter() - begin
        begin = time.perf_counter()
        seen = run_with_kills(rows, broken, words, kills, count)
        disturbed = time.perf_counter() - begin
        ours, theirs = compute_hashes(whole), compute_hashes(broken)
        same = sum(ours[name] == theirs.get(name) for name in ours)
        made = json.loads((whole / "manifest.json").read_bytes())["rows"]
    print(f"{count} rows ({made}), undisturbed {undisturbed:.0f} s")
    print(f"killed {kills} times, with {', '.join(map(str, seen))} rows done: {disturbed:.0f} s")
    print(f"files the same: {same} of {len(ours)}; files in the other run: {len(theirs)}")


def benchmark_memory(counts: list[int], words: list[str]) -> None:
    titles = (
        "rows", "command", "largest worker", "all processes", "processor time a row",
        "seconds a row", "disk a row", "said again, nothing to do",
    )  # fmt: skip
    print(f"| {' | '.join(titles)} |\n" + "|---" * len(titles) + "|", flush=True)
    for count in counts:
        with tempfile.TemporaryDirectory() as folder:
            rows, out = write_rows(Path(folder) / "rows.jsonl", count), Path(folder) / "out"
            watch, seconds, cpu = measure_run(rows, out, words)
            made = json.loads((out / "manifest.json").read_bytes())["rows"]["made"]
            assert made == count, f"{made} of {count} made"
            disk = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
            _, again, _ = measure_run(rows, out, words)
        print(
            f"| {count} | {watch.parent:.0f} MB | {watch.child:.0f} MB | {watch.total:.0f} MB "
            f"| {1000 * cpu / count:.0f} ms | {1000 * seconds / count:.0f} ms "
            f"| {disk / count / 1000:.0f} kB | {again:.1f} s |",
            flush=True,
        )


def measure_run(rows: Path, out: Path, words: list[str]) -> tuple[Memory, float, float]:
    """Watch a run to its end; return wall and processor seconds of all its processes."""
    begin = time.perf_counter()
    run = start(rows, out, words)
    watch = Memory(run.pid)
    watch.start()
    _, status, used = os.wait4(run.pid, 0)
    assert os.waitstatus_to_exitcode(status) == 0, run.stderr and run.stderr.read().decode()
    run.returncode = 0
    # A worker counts for the command once it has been waited for, and all have been.
    return watch, time.perf_counter() - begin, used.ru_utime + used.ru_stime


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("--rows", type=int, default=60)
    words.add_argument("--kills", type=int, default=4)
    words.add_argument("--memory", type=int, nargs="*", default=[30, 120])
    words.add_argument("--workers", type=int, default=2)
    words.add_argument("--refiner", default="none")
    given = words.parse_args()
    options = ["--workers", str(given.workers), "--refiner", given.refiner]
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    if given.kills:
        benchmark_kills(given.rows, given.kills, options)
    benchmark_memory(given.memory, options)


if __name__ == "__main__":
    main()
