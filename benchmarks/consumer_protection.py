"""How many points of the catalogue of consumer tests and regulations are made, and how exactly.

`scenewright catalogue make --all --out DIR` makes them; `python benchmarks/consumer_protection.py
DIR` counts. A point is exact if every speed lies within 0.5 km/h, every point of impact within 5 %
of the width, of what was asked.
"""

from __future__ import annotations

import argparse
import csv
import json
from collections import Counter
from pathlib import Path

EXACT = {"speed": 0.5 / 3.6 + 0.005, "front_point": 5.0}
"""How far a figure may be from what was asked; positions are rounded to 1 mm."""


def is_exact(folder: Path) -> bool:
    """Whether the figures of a scene are as near to the middle of their ranges as tests want."""
    scene, proof = (
        json.loads((folder / f"{n}.json").read_text("utf-8")) for n in ("scene", "proof")
    )
    asked = scene.get("measures") or ()
    return all(
        abs(value - (each["low"] + each["high"]) / 2) <= EXACT[each["kind"]]
        for each, found in zip(asked, proof["figures"].get("measures", ()), strict=True)
        for value in found["values"]
    )


def main() -> None:
    """Prints how many points of each plan are made, exact, and not feasible."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder, total = parser.parse_args().folder, Counter[str]()
    for table in sorted(folder.glob("*/points.csv")):
        rows = list(csv.DictReader(table.read_text("utf-8").splitlines()))
        made = [table.parent / row["folder"] for row in rows if row["status"] == "made"]
        counts = {"points": len(rows), "made": len(made), "exact": sum(map(is_exact, made))}
        total.update(counts)
        print(table.parent.name, counts)
    print("all", dict(total))


if __name__ == "__main__":
    main()
