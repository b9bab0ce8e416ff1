"""The paper's dataset and every table on it, in one command.

`python benchmarks/dataset.py --out DIR --scale 1 --corpus F.npz --taf-bw FOLDER` makes the paper's
composition in DIR, or goes on with it, checks it from end to end, and prints Tables 1 to 5 beside
the paper's, realism and diversity. Tables that need a corpus or real tracks say so where there are
none. Each `--backend` gets its 40 collisions and 50 yields. Without options a small one is tried.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def run_command(*words: str) -> None:
    """Run one command of scenewright; exit where it fails."""
    print(f"$ scenewright {' '.join(words)}", flush=True)
    begin = time.perf_counter()
    code = subprocess.run([sys.executable, "-m", "scenewright", *words], check=False).returncode
    print(f"({time.perf_counter() - begin:.1f} s)\n", flush=True)
    if code:
        raise SystemExit(code)


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("--out", type=Path)
    words.add_argument("--scale", default="0.05")
    words.add_argument("--seed", default="0")
    words.add_argument("--refiner", default="none")
    words.add_argument("--backend", action="append", default=[])
    words.add_argument("--writer", default="builtin")
    words.add_argument("--corpus")
    words.add_argument("--taf-bw")
    given = words.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        out = str(given.out or Path(folder) / "dataset")
        who = [word for name in given.backend for word in ("--backend", name)]
        how = ["--scale", given.scale, "--seed", given.seed, "--refiner", given.refiner]
        run_command("dataset", "paper", "--out", out, *how, "--writer", given.writer, *who)
        run_command("dataset", "check", out)
        against = ["--corpus", given.corpus] if given.corpus else []
        against += ["--taf-bw", given.taf_bw] if given.taf_bw else []
        run_command("evals", "tables", out, *against)


if __name__ == "__main__":
    main()
