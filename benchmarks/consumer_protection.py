"""How many cells of the consumer-protection set a batch has made, and how exactly.

`scenewright batch examples/consumer_protection.jsonl --out DIR` makes them;
`python benchmarks/consumer_protection.py DIR` counts. A cell is made if its scene is verified and
every speed lies within 0.5 km/h, every point of impact within 5 % of the width, of what was asked.
"""

from __future__ import annotations

import argparse
import json
import re
from collections import defaultdict
from pathlib import Path

CATALOGUE = Path(__file__).parents[1] / "examples" / "consumer_protection.jsonl"
EXACT = {"m/s": 0.5 / 3.6 + 0.005, "%": 5.0}
"""How far a figure may be from what was asked; evidence is rounded to 0.01 m/s."""

_RANGE = re.compile(r"in \[([\d.]+), ([\d.]+)\] (m/s|%)$")
_SEEN = re.compile(r" is ([\d.]+) (?:m/s|%)$")


def is_made(folder: Path) -> bool:
    """Whether the scene of a cell is there, verified, and as exact as the set wants it."""
    path = folder / "proof.json"
    if not path.exists():
        return False
    proof = json.loads(path.read_text("utf-8"))
    entries = [each for each in proof["said"] if each["became"] == "measure"]
    return bool(proof["verified"] and entries) and all(map(is_exact, entries))


def is_exact(entry: dict[str, str]) -> bool:
    """Whether a figure of the account is near enough to the middle of its range."""
    asked, seen = _RANGE.search(entry["value"]), _SEEN.search(entry["evidence"] or "")
    if asked is None or seen is None:
        return False
    middle = (float(asked[1]) + float(asked[2])) / 2
    return abs(float(seen[1]) - middle) <= EXACT[asked[3]]


def main() -> None:
    """Prints how many cells of each test are made, and those that are not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    made: dict[str, list[bool]] = defaultdict(list)
    for line in CATALOGUE.read_text("utf-8").splitlines():
        cell = json.loads(line)["id"]
        made[cell.split("-")[0].upper()].append(is_made(folder / cell))
        if not made[cell.split("-")[0].upper()][-1]:
            print(f"not made: {cell}")
    for name, cells in made.items():
        print(f"{name}: {sum(cells)} of {len(cells)}")
    every = [each for cells in made.values() for each in cells]
    print(f"all: {sum(every)} of {len(every)}")


if __name__ == "__main__":
    main()
