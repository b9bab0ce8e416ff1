"""Whether a change of the code left every scene as it was: digests of 300 runs, made and compared.

    python benchmarks/same_behaviour.py write FILE
    python benchmarks/same_behaviour.py compare FILE [--quick]

The runs are the requests of `robustness.py`, the examples, imported maps (where TAF-BW lies in
`SCENEWRIGHT_TAF_BW`) and conversations with edits, all through the command line. `--quick` makes
one run of each request. The exit code is 1 if any digest differs.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from hashlib import sha256
from itertools import chain
from pathlib import Path

from robustness import REQUESTS

from scenewright.files import format_json_line

ROOT = Path(__file__).parent.parent
FILES = ("scene.json", "proof.json")
CHATS = (
    ("A car yields to a pedestrian at 8 am", "make it a van", "at night instead", "undo"),
    ("Two cars collide", "add a pedestrian who crosses in the north", "the first car is slower"),
    ("A car follows another car", "the second one is a truck", "make it rush hour"),
    ("A vehicle nearly hits a pedestrian", "she waits for the car instead", "redo"),
)
MAPS = {"one": "k729_2022", "other": "k733_2018"}


def list_rows(seeds: int) -> list[dict[str, object]]:
    """One row for each request and seed."""
    examples = (ROOT / "examples" / "instructions.txt").read_text(encoding="utf-8").splitlines()
    texts = [*REQUESTS.values(), *(line for line in examples if line and line[0] != "#")]
    return [
        {"id": f"{number:03d}-{seed}", "text": text, "seed": seed}
        for number, text in enumerate(texts)
        for seed in range(seeds)
    ]


def run_command(*words: object, text: str = "") -> str:
    """What `scenewright` prints; its exit code may be anything, as rows may be refused."""
    command = [sys.executable, "-m", "scenewright", *map(str, words)]
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=False)
    if "Traceback" in done.stderr:
        raise SystemExit(done.stderr)
    return done.stdout


def digest_batch(
    name: str, rows: list[dict[str, object]], scratch: Path, *options: object
) -> dict[str, str]:
    """Digests of the files of a batch, by `name`, row and file."""
    source, out = scratch / f"{name}.jsonl", scratch / name
    source.write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")
    run_command("batch", source, "--out", out, "--quiet", *options)
    found = sorted(chain.from_iterable(out.rglob(each) for each in FILES))
    return {f"{name}/{path.relative_to(out)}": digest_file(path) for path in found}


def digest_file(path: Path) -> str:
    """Of a proof without the digest of its scene, which older proofs lack and the scene betrays."""
    data = path.read_bytes()
    if path.name == "proof.json":
        proof = json.loads(data)
        proof.pop("scene_digest", None)
        data = format_json_line(proof)
    return digest(data)


def digest(data: bytes) -> str:
    """The first half of a SHA-256, in hexadecimal."""
    return sha256(data).hexdigest()[:32]


def digest_chats(scratch: Path) -> dict[str, str]:
    """Digests of what conversations end with."""
    found: dict[str, str] = {}
    for number, lines in enumerate(CHATS):
        out = scratch / f"chat-{number}"
        words = ("chat", "--threads", scratch / "threads.sqlite", "--thread", number, "--out", out)
        run_command(*words, "--no-memory", "--quiet", text="\n".join([*lines, "/save", "/quit\n"]))
        paths = sorted(chain.from_iterable(out.rglob(each) for each in FILES))
        found |= {f"chat/{number}/{path.name}": digest_file(path) for path in paths}
    return found


def digest_maps(rows: list[dict[str, object]], scratch: Path) -> dict[str, str]:
    """Digests of scenes at imported intersections; none where the data is absent."""
    root = os.environ.get("SCENEWRIGHT_TAF_BW")
    if root is None:
        return {}
    (scratch / "intersections").mkdir(exist_ok=True)
    os.environ["SCENEWRIGHT_INTERSECTIONS"] = str(scratch / "intersections")
    found: dict[str, str] = {}
    for name, part in MAPS.items():
        path = next(Path(root).rglob(f"*{part}*.osm"))
        run_command("intersections", "import", path, "--name", name)
        found |= digest_batch(name, rows, scratch, "--intersection", name)
    return found


def digest_all(*, quick: bool) -> dict[str, str]:
    """Digests of all runs."""
    with tempfile.TemporaryDirectory() as folder:
        scratch, rows = Path(folder), list_rows(1 if quick else 3)
        found = digest_batch("plain", rows, scratch, "--refiner", "none")
        found |= digest_batch("refined", [r for r in rows if r["seed"] == 0], scratch)
        if not quick:
            found |= digest_batch("map", rows[::4], scratch, "--selection", "map")
            found |= digest_maps(rows[::6], scratch)
        return found | digest_chats(scratch)


def main() -> None:
    """Writes the digests, or compares them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task", choices=("write", "compare"))
    parser.add_argument("file", type=Path)
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args()
    found = digest_all(quick=options.quick)
    if options.task == "write":
        options.file.write_text(json.dumps(found, indent=0), encoding="utf-8")
        print(f"{len(found)} files of {len(found) // 2} runs")
        return
    known = json.loads(options.file.read_text(encoding="utf-8"))
    known = {name: known[name] for name in known if not options.quick or name in found}
    other = sorted(name for name in {*known, *found} if known.get(name) != found.get(name))
    print(f"{len(known)} files, {len(other)} differ", *other, sep="\n")
    sys.exit(1 if other else 0)


if __name__ == "__main__":
    main()
