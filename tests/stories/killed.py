"""Kills itself with SIGKILL in a turn, at one point after the other; prints what is left.

A program of its own: it loads everything once and forks for every point, so that each death is a
real one. Usage: killed.py FILE
"""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Callable

from scenewright.authoring.session import Session
from scenewright.backends import load_backend
from scenewright.memory.threads import Threads

FIRST = "A car yields to a pedestrian at 5 am with no background traffic"
SECOND = "make it a near miss"
STAGES = (
    "scene_planner", "agent_generator", "waypoint_filter", "event_reasoner",
    "trajectory_refiner", "scene_verifier",
)  # fmt: skip
POINTS = (*STAGES, "keep 1", "keep 3", "put 1", "put 2", "put 3")


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def opened(file: str, log: Callable[[str, str], None] | None = None) -> tuple[Threads, Session]:
    threads = Threads(file)
    heading = {"intersection": "amsterdam_120", "seed": 1, "refiner": "none"}
    session = Session(threads, "story", backend=load_backend("builtin"), setting=heading, log=log)
    return threads, session


def die_at(point: str, file: str, words: str) -> None:
    """Says the words and dies at the point, in this process."""
    threads, session = opened(
        file, lambda stage, line: die() if stage == point and line[:7] != "refused" else None
    )
    name, _, count = point.partition(" ")
    if count:
        owner = threads if name == "keep" else threads.saver
        real, calls = getattr(owner, name), []

        def counted(*args: object, **named: object) -> object:
            calls.append(1)
            if len(calls) == int(count):
                die()
            return real(*args, **named)

        setattr(owner, name, counted)
    session.say(words)


def seen(file: str) -> dict[str, object]:
    threads, session = opened(file)
    shown = session.find_version()
    found = {
        "version": None if shown is None else shown.version["number"],
        "scene": None if shown is None else shown.scene_json.decode(),
        "verified": shown is not None and shown.proof.verified,
        "interrupted": session.interrupted,
    }
    threads.close()
    return found


def killed(point: str, file: str, words: str) -> dict[str, object]:
    child = os.fork()
    if child == 0:
        die_at(point, file, words)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    died = os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGKILL
    return {"point": point, "died": died, **seen(file)}


def main(file: str) -> None:
    from scenewright import synthesize

    synthesize(FIRST, seed=1, refiner="none")  # everything is loaded before the forks
    rows = [killed(point, file, FIRST) for point in ("scene_verifier", "keep 3")]
    threads, session = opened(file)
    session.say(FIRST)
    threads.close()
    before = seen(file)
    rows += [killed(point, file, SECOND) for point in POINTS]
    threads, session = opened(file)
    reply = session.say(SECOND)
    threads.close()
    print(json.dumps({"before": before, "rows": rows, "reply": reply, "after": seen(file)}))


if __name__ == "__main__":
    main(sys.argv[1])
