"""A batch to which everything happens: is any row lost, doubled or half-written?

    python benchmarks/batch_faults.py FOLDER [--rows 10000] [--kills 50] [--refiner trajnet]

Rows without a word for the traffic, so that streets are full. While the command runs, at random
numbers of rows done: a worker is killed (`kill -9`, as often as `--kills` says, every fifth time
the command itself), the disk is full twice (the file system of FOLDER is filled up to the last
byte until the command ends, then emptied again), the clock is set back by a day once (for the rest
of that run the command is given an earlier time, and what it has written lies in the future), and
once the same command is started a second time on the same folder. After each end the command is
given again. FOLDER/fs should be a file system of its own; `--mount MB` makes one in memory, which
takes root. Killed itself, the same line goes on: FOLDER/happened.json says what happened so far.

In the end: every row has one entry that is not `failed`, every folder is whole, the audit of the
dataset finds no fault, and rows drawn at random and made again alone have the same bytes.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from batch import build_command, count_done, list_children

from scenewright.dataset.batch.answering import PLAINLY
from scenewright.dataset.batch.audit import audit_dataset
from scenewright.dataset.batch.publish import is_whole
from scenewright.dataset.batch.rows import read_source
from scenewright.dataset.batch.worker import Options, build_job, work
from scenewright.time_limit import LONGEST_LIMIT

TEXTS = (
    "A vehicle yields to a pedestrian",
    "A car turning left yields to an oncoming car at 8 am",
    "A car hits a pedestrian on the north crosswalk at noon",
    "Two cars collide at a right angle",
    "A van rear-ends a car waiting at the light at 5 pm",
    "A car narrowly misses a pedestrian at 3 pm",
    "A right-turning car yields to a cyclist going straight",
    "A car follows a bus through the intersection in the evening",
    "Ordinary traffic, nothing happens",
    "A jaywalker is hit by a westbound bus late at night",
)
SHIM = """import time
_now, _now_ns = time.time, time.time_ns
time.time, time.time_ns = lambda: _now() - 86400.0, lambda: _now_ns() - 86_400_000_000_000
"""
AGAIN = 10
"""Rows that are made again alone."""


class Happenings:
    """What is to happen after how many rows, and what has, kept in a file."""

    def __init__(self, file: Path, rows: int, kills: int) -> None:
        rng = random.Random(f"{rows} {kills}")
        kinds = ["full", "full", "clock", "second"]
        kinds += ["command" if k % 5 == 4 else "worker" for k in range(kills)]
        moments = sorted(rng.choices(range(1, max(rows - 2, 2)), k=len(kinds)))
        rng.shuffle(kinds)
        self.plan = list(zip(moments, kinds, strict=True))
        self.file, self.seen = file, list[dict[str, Any]]()
        if file.is_file():
            self.seen = json.loads(file.read_text())

    def get_due(self, done: int) -> str | None:
        """Return the next event, if it is due."""
        left = self.plan[len(self.seen) :]
        return left[0][1] if left and left[0][0] <= done else None

    def note(self, kind: str, done: int, **more: Any) -> None:
        """Remembers that it happened."""
        self.seen.append({"kind": kind, "rows_done": done, **more})
        self.file.write_text(json.dumps(self.seen, indent=1))
        print(json.dumps(self.seen[-1]), flush=True)


def write_rows(path: Path, count: int) -> None:
    """Rows without a word for the traffic."""
    rows = ({"id": f"scene-{k:06d}", "text": TEXTS[k % len(TEXTS)]} for k in range(count))
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))


def start(words: list[str], *, earlier: Path | None = None) -> subprocess.Popen[bytes]:
    """The command; with the clock of yesterday if a folder with that clock is named."""
    found = dict(os.environ)
    if earlier is not None:
        found["PYTHONPATH"] = f"{earlier}:{found.get('PYTHONPATH', '')}"
    return subprocess.Popen(
        words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=found, start_new_session=True
    )


def end(run: subprocess.Popen[bytes], *, within: float) -> tuple[int, str]:
    """Exit code and the last line of stderr."""
    _, told = run.communicate(timeout=within)
    return run.returncode, (told.decode(errors="replace").strip().splitlines() or [""])[-1][:200]


def kill_worker(pid: int) -> bool:
    """Kills one worker of the command, if it has one."""
    workers = [p for p in list_children(pid) if b"spawn_main" in _read_command_line(p)]
    if not workers:
        return False
    with suppress(ProcessLookupError):
        os.kill(random.choice(workers), signal.SIGKILL)
    return True


def _read_command_line(pid: int) -> bytes:
    with suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    return b""


def fill(folder: Path) -> Path:
    """A file that takes all that is left of the file system."""
    ballast = folder.parent / "ballast"
    with suppress(OSError), ballast.open("wb", buffering=0) as file:
        for size in (1 << 20, 1 << 12, 1):
            with suppress(OSError):
                while file.write(b"\0" * size) == size:
                    pass
    return ballast


def set_forward(folder: Path) -> None:
    """The files of a folder lie a day in the future."""
    later = time.time() + 86400.0
    for path in folder.glob("*"):
        os.utime(path, (later, later))


def carry_out(words: list[str], out: Path, happenings: Happenings, clock: Path) -> int:
    """Gives the command until it ends well; how often it was given."""
    given, back = 0, False
    while True:
        run, given = start(words, earlier=clock if back else None), given + 1
        while run.poll() is None:
            time.sleep(0.1)
            done = count_done(out)
            kind = happenings.get_due(done)
            if kind is not None and not apply_event(kind, run, words, out, happenings, done):
                continue
            if kind in ("command", "full", "clock"):
                back = kind == "clock"
                break
        else:
            code, line = end(run, within=60)
            if code == 0 and happenings.get_due(count_done(out)) is None:
                return given
            if code != 0:
                print(f"ended with {code}: {line}", flush=True)
                if given > 3 * len(happenings.plan) + 20:
                    sys.exit("the command does not end well")
            elif len(happenings.seen) < len(happenings.plan):
                return given  # all rows are done; what was still to happen cannot any more


def apply_event(
    kind: str,
    run: subprocess.Popen[bytes],
    words: list[str],
    out: Path,
    happenings: Happenings,
    done: int,
) -> bool:
    """Apply the event; return whether that was possible."""
    if kind == "worker":
        if not kill_worker(run.pid):
            return False
        happenings.note(kind, done)
    elif kind == "second":
        code, line = end(start(words), within=300)
        happenings.note(kind, done, code=code, line=line)
    elif kind == "full":
        ballast = fill(out)
        try:
            code, line = end(run, within=600)
        finally:
            ballast.unlink()
        happenings.note(kind, done, code=code, line=line)
    else:
        run.kill()
        run.communicate()
        if kind == "clock":
            set_forward(out)
        happenings.note(kind, done)
    return True


def check(rows: Path, out: Path, refiner: str) -> dict[str, Any]:
    """What was lost, doubled or broken."""
    source = read_source(rows)
    entries: dict[int, list[dict[str, Any]]] = {}
    for line in (out / "journal.jsonl").read_text().splitlines()[1:]:
        entry = json.loads(line)
        entries.setdefault(entry["number"], []).append(entry)
    last = [each[-1] for each in entries.values()]
    final = [[e for e in each if e["status"] != "failed"] for each in entries.values()]
    made = [entry for entry in last if entry["status"] == "made"]
    options = Options("amsterdam_120", refiner=refiner)
    jobs = {
        named.number: replace(build_job(named, options, PLAINLY), time_limit=LONGEST_LIMIT)
        for named in source
    }
    picked = random.Random(1).sample(made, min(AGAIN, len(made)))
    differ = [
        entry["key"]
        for entry in picked
        for name, data in work(
            replace(jobs[entry["number"]], time_limit=LONGEST_LIMIT)
        ).files.items()
        if (out / entry["folder"] / name).read_bytes() != data
    ]
    found = audit_dataset(out)
    return {
        "rows": source.rows,
        "made": len(made),
        "refused": sum(entry["status"] == "refused" for entry in last),
        "failed": sum(entry["status"] == "failed" for entry in last),
        "lost": source.rows - len(last),
        "done_twice": sum(len(each) > 1 for each in final),
        "not_whole": sum(not is_whole(out / e["folder"], e["sha256"]) for e in made),
        "made_again": len(picked),
        "differ": differ,
        "audit": {"scenes": found.scenes, "verified": found.verified, "faults": len(found.faults)},
        "first_faults": [f"{each.where}: {each.what}" for each in found.faults[:3]],
    }


def main() -> None:
    """Runs the batch, and says what became of it; exit code 1 if anything is lost or broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--rows", type=int, default=10_000)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--refiner", default="trajnet")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--time-limit", type=float, default=30.0, help="Seconds for each row.")
    parser.add_argument("--mount", type=int, metavar="MB", help="Size of a file system in memory.")
    asked = parser.parse_args()
    place = asked.folder / "fs"
    place.mkdir(parents=True, exist_ok=True)
    if asked.mount and not os.path.ismount(place):
        size = f"size={asked.mount}m"
        subprocess.run(["mount", "-t", "tmpfs", "-o", size, "tmpfs", str(place)], check=True)
    clock = asked.folder / "clock"
    clock.mkdir(exist_ok=True)
    (clock / "sitecustomize.py").write_text(SHIM)
    rows, out = asked.folder / "rows.jsonl", place / "out"
    write_rows(rows, asked.rows)
    options = ["--workers", str(asked.workers), "--refiner", asked.refiner, "--quiet"]
    options += ["--time-limit", str(asked.time_limit)]
    happenings = Happenings(asked.folder / "happened.json", asked.rows, asked.kills)
    begin = time.perf_counter()
    given = carry_out(build_command(rows, out, options), out, happenings, clock)
    took = time.perf_counter() - begin
    found = check(rows, out, asked.refiner)
    kinds = [each["kind"] for each in happenings.seen]
    found |= {"given": given, "seconds": round(took), **{k: kinds.count(k) for k in set(kinds)}}
    (asked.folder / "found.json").write_text(json.dumps(found, indent=1) + "\n")
    print(json.dumps(found, indent=1))
    broken = found["lost"] or found["done_twice"] or found["not_whole"] or found["differ"]
    sys.exit(1 if broken or found["failed"] or found["audit"]["faults"] else 0)


if __name__ == "__main__":
    main()
