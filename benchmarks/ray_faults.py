"""A batch on a Ray cluster of this machine that loses a node, and whose head is started anew.

    python benchmarks/ray_faults.py FOLDER [--rows 60]

Needs the extra `ray`. A head with one processor and a node with another are started; the command
carries out rows on them. After a quarter of the rows the node is killed (`kill -9` of all that is
of it), after half of them the head; then a new head is started on the same port and the command
is given again, until it ends well. In the end: every row has one entry that is not `failed`, every
folder is whole, the audit finds no fault, and rows made again in this process have the same bytes.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

from batch import build_command, count_done
from batch_faults import check, end, start

from scenewright.errors import InputError

TEXTS = (
    "A car follows a bus at 5 am",
    "Light traffic at dawn, no incidents.",
    "A car yields to a pedestrian at 5 am",
)
PORT = 46379
OPTIONS = ["--engine", "ray", "--workers", "2", "--refiner", "none", "--quiet"]
MOST_TIMES = 6
"""How often the command is given at most."""


class RayNode:
    """A head or a node, with all of its processes in a group of their own."""

    def __init__(self, folder: Path, *words: str) -> None:
        ray = Path(sys.executable).with_name("ray")
        given = [str(ray), "start", "--block", "--num-cpus=1", "--disable-usage-stats", *words]
        with (folder / "ray.log").open("ab") as log:
            self._run = subprocess.Popen(given, stdout=log, stderr=log, start_new_session=True)
        time.sleep(15.0)
        if self._run.poll() is not None:
            raise InputError(f"ray did not start: see {folder / 'ray.log'}")

    def kill(self) -> None:
        """Kills everything of it at once, as a power cut would."""
        for process in _list_session(self._run.pid):
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        self._run.wait()


def _list_session(leader: int) -> list[int]:
    """Processes of a session, and those that these started in sessions of their own."""
    parents: dict[int, tuple[int, int]] = {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            fields = entry.read_text().rpartition(")")[2].split()
            parents[int(entry.parent.name)] = (int(fields[1]), int(fields[3]))
    found = {pid for pid, (_, session) in parents.items() if session == leader}
    while more := {pid for pid, (parent, _) in parents.items() if parent in found} - found:
        found |= more
    return sorted(found)


def start_head(folder: Path) -> RayNode:
    """The head of a cluster, which runs tasks, too."""
    scratch = folder / "scratch"
    shutil.rmtree(scratch, ignore_errors=True)
    words = ("--head", f"--port={PORT}", "--include-dashboard=false", f"--temp-dir={scratch}")
    return RayNode(folder, *words)


def carry_out(folder: Path, rows: Path, out: Path, count: int) -> dict[str, object]:
    """Runs it all; what happened."""
    os.environ["RAY_ADDRESS"] = f"127.0.0.1:{PORT}"
    words, happened = build_command(rows, out, OPTIONS), dict[str, object]()
    head = start_head(folder)
    node = RayNode(folder, f"--address=127.0.0.1:{PORT}")
    try:
        for given in range(1, MOST_TIMES + 1):
            run = start(words)
            while run.poll() is None:
                time.sleep(0.2)
                done = count_done(out)
                if "node" not in happened and done >= count // 4:
                    node.kill()
                    happened["node"] = done
                elif "head" not in happened and done >= count // 2:
                    head.kill()
                    happened["head"] = done
                    code, line = end(run, within=300)
                    happened |= {"code": code, "line": line}
                    head = start_head(folder)
            if run.returncode == 0 and "head" in happened and count_done(out) >= count:
                return happened | {"given": given}
        raise SystemExit(f"the command does not end well: {end(run, within=60)}")
    finally:
        head.kill()
        node.kill()


def main() -> None:
    """Runs it, and says what became of the rows; exit code 1 if anything is lost or broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--rows", type=int, default=60)
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    rows, out = asked.folder / "rows.jsonl", asked.folder / "out"
    lines = ({"id": f"row-{k:04d}", "text": TEXTS[k % len(TEXTS)]} for k in range(asked.rows))
    rows.write_text("".join(json.dumps(line) + "\n" for line in lines))
    happened = carry_out(asked.folder.absolute(), rows, out, asked.rows)
    found = check(rows, out, "none") | happened
    print(json.dumps(found, indent=1))
    broken = found["lost"] or found["done_twice"] or found["not_whole"] or found["differ"]
    sys.exit(1 if broken or found["failed"] or found["audit"]["faults"] else 0)


if __name__ == "__main__":
    main()
