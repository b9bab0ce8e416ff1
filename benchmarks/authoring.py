"""Edits in conversation: how many are made, how many agents stay unchanged, how long they take.

Every instruction of examples/instructions.txt is made once, and every edit below is said about it.

    python benchmarks/authoring.py [SEED]
"""

from __future__ import annotations

import platform
import sys
import time
from collections import Counter
from pathlib import Path
from statistics import median
from typing import Any

from scenewright.authoring.session import Session
from scenewright.backends import load_backend
from scenewright.errors import ScenewrightError
from scenewright.memory.threads import Threads

EDITS = (
    "add three cars", "add two pedestrians", "make it 5 pm", "slow the first vehicle down",
    "make it a near miss", "now have it be a collision", "stop one metre later",
    "make the first vehicle a truck", "wait two seconds longer", "no background traffic",
    "try another path for the first vehicle", "make it busier",
)  # fmt: skip
INSTRUCTIONS = Path(__file__).parents[1] / "examples" / "instructions.txt"


def main(seed: int) -> None:
    made: Counter[str] = Counter()
    told: Counter[str] = Counter()
    codes: Counter[str] = Counter()
    seconds: list[float] = []
    kept = others = 0
    for n, text in enumerate(INSTRUCTIONS.read_text("utf-8").splitlines()):
        session = start_session(text, seed, str(n))
        before = session.find_version()
        if before is None:
            continue
        for edit in EDITS:
            begin = time.perf_counter()
            reply: dict[str, Any] = session.say(edit)
            seconds.append(time.perf_counter() - begin)
            told[edit] += 1
            if reply["kind"] != "made":
                codes[str(reply.get("code", reply["kind"]))] += 1
                continue
            made[edit] += 1
            after = session.find_version()
            assert after is not None
            assert after.proof.verified
            same, untouched = count_unmoved(before, after)
            kept, others = kept + same, others + untouched
            session.undo()
    print(f"{platform.python_version()} on {platform.machine()}, seed {seed}")
    for edit in EDITS:
        print(f"  {edit:42s} {made[edit]:3d} of {told[edit]:3d}")
    print(f"made {sum(made.values())} of {sum(told.values())}; not made: {dict(codes)}")
    print(f"agents not spoken of: {kept} of {others} bit for bit as before")
    print(f"seconds a turn: median {median(seconds):.2f}, most {max(seconds):.1f}")


def start_session(text: str, seed: int, name: str) -> Session:
    heading: Any = {"intersection": "amsterdam_120", "seed": seed, "refiner": "none"}
    session = Session(Threads(":memory:"), name, backend=load_backend("builtin"), setting=heading)
    try:
        session.say(text)
    except ScenewrightError as error:
        print(f"not made: {text}: {error}")
    return session


def count_unmoved(before: Any, after: Any) -> tuple[int, int]:
    """Count the agents of the version before that the edit does not name: unchanged, and all."""
    edits = str(after.version["edits"])
    old = {each.name: each for each in before.record.agents}
    new = {each.name: each for each in after.record.agents}
    if "'pedestrians': 0" in edits:  # no other pedestrian was to be left
        old = {name: each for name, each in old.items() if each.role == "foreground"}
    rest = [name for name in old if f"'{name}'" not in edits]
    return sum(new.get(name) == old[name] for name in rest), len(rest)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1)
