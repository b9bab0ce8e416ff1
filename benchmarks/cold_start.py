"""Processor time and memory of commands in a fresh process, beside an earlier commit.

    python benchmarks/cold_start.py COMMIT [--runs 5]

Old and new take turns, after one run of each that compiles its machine code. Prints medians and
their ratio. Needs `git`, and what both commits need installed.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from _earlier import check_out

TEXT = "A car hits a pedestrian"


def list_commands(folder: Path) -> dict[str, list[str]]:
    rows = folder / "rows.jsonl"
    rows.write_text(f'{{"id": "one", "text": "{TEXT}"}}\n', encoding="utf-8")
    make = ["make", TEXT, "--quiet", "--force", "--out", str(folder / "scene")]
    bare = ["--no-picture", "--no-recording", "--refiner", "none"]
    return {
        "make": make,
        "make, bare": [*make, *bare],
        "plan": ["plan", str(rows)],
        "--help": ["--help"],
    }


def measure(words: list[str], environment: dict[str, str]) -> tuple[float, float]:
    """Processor time [s] and peak memory [MB] of one command."""
    command = [sys.executable, "-m", "scenewright", *words]
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(words)} ended with {process.returncode}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("commit")
    parser.add_argument("--runs", type=int, default=5)
    asked = parser.parse_args()
    with check_out(asked.commit) as environments, tempfile.TemporaryDirectory() as folder:
        for name, words in list_commands(Path(folder)).items():
            found: dict[str, list[tuple[float, float]]] = {each: [] for each in environments}
            for run in range(asked.runs + 1):
                for each, environment in environments.items():
                    figures = measure(words, environment)
                    if run:
                        found[each].append(figures)
            old, new = (
                [statistics.median(f) for f in zip(*each, strict=True)] for each in found.values()
            )
            print(
                f"{name}: {old[0]:.2f} s, {old[1]:.0f} MB -> {new[0]:.2f} s, {new[1]:.0f} MB: "
                f"ratio {new[0] / old[0]:.2f} (n = {asked.runs})"
            )


if __name__ == "__main__":
    main()
