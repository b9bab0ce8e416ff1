"""`python -m scenewright.evals.realism`: makes scenes, judges them, prints the tables."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from scenewright.errors import InputError
from scenewright.evals.realism.judge import judge
from scenewright.evals.realism.scenes import make_scenes, read_scenes
from scenewright.files import write_atomically
from scenewright.graph.run import make_folder
from scenewright.intersections import load_map
from scenewright.tools.track_io import load_recordings
from scenewright.tools.track_io.taf_bw import read_taf_bw


def main(argv: Sequence[str] | None = None) -> int:
    """Make scenes if asked to, then judge all sets that are named."""
    words = _build_parser().parse_args(argv)
    try:
        if words.make:
            counts = make_scenes(
                make_folder(words.into), words.make, intersection=words.intersection,
                refiner=words.refiner,
            )  # fmt: skip
            print(f"{words.into}: {counts}", file=sys.stderr)
        if words.corpus:
            _judge(words)
    except InputError as fault:
        print(fault, file=sys.stderr)
        return fault.exit_code
    return 0


def _build_parser() -> argparse.ArgumentParser:
    words = argparse.ArgumentParser(prog="python -m scenewright.evals.realism", description=__doc__)
    words.add_argument("--intersection", default="amsterdam_120")
    words.add_argument("--make", type=int, metavar="N", help="scenes to make into --into")
    words.add_argument("--into", type=Path, default=Path("scenes"))
    words.add_argument("--refiner", default="none", help="of the scenes that are made")
    words.add_argument("--corpus", type=Path, help="file of `intersections corpus`")
    words.add_argument(
        "--scenes", action="append", default=[], metavar="NAME=FOLDER",
        help="a set of scenes; the first is what later ones are compared with",
    )  # fmt: skip
    words.add_argument("--taf-bw", type=Path, help="folder of real tracks")
    words.add_argument("--out", type=Path, help="JSON file to write")
    words.add_argument("--draws", type=int, default=200, help="resamplings for intervals")
    words.add_argument("--seed", type=int, default=0)
    return words


def _judge(words: argparse.Namespace) -> None:
    sets = dict(_parse_named_folder(each) for each in words.scenes)
    corpus = load_recordings(words.corpus, split="test")
    if not sets or not corpus:
        raise InputError("name a set with --scenes NAME=FOLDER, and a corpus with test hours")
    report = judge(
        {name: read_scenes(folder) for name, folder in sets.items()},
        corpus,
        intersection_map=load_map(words.intersection),
        real=read_taf_bw(words.taf_bw) if words.taf_bw else None,
        draws=words.draws,
        seed=words.seed,
    )
    print(report.format_markdown(), end="")
    if words.out:
        text = json.dumps(report.to_json(), ensure_ascii=False, indent=1, allow_nan=False)
        write_atomically(words.out, (text + "\n").encode("utf-8"))


def _parse_named_folder(word: str) -> tuple[str, Path]:
    name, separator, folder = word.partition("=")
    if not (name and separator and folder):
        raise InputError(f"--scenes takes NAME=FOLDER, got {word!r}")
    return name, Path(folder)


if __name__ == "__main__":
    raise SystemExit(main())
