"""First contacts in OpenSCENARIO files that esmini plays, by its own clock and its own test.

esmini is in no package index: ESMINI names its libesminiLib.so. It holds one scenario at a time,
and a bad one ends its process.
"""

from __future__ import annotations

import ctypes
import json
import math
import os
import sys
from typing import Any

import numpy as np

STEPS = 5
"""Of esmini's own clock for one of the scene: an event begins a step after its trigger."""


class State(ctypes.Structure):
    """What esmini says of an object."""

    _fields_ = [
        ("id", ctypes.c_int), ("model", ctypes.c_int), ("control", ctypes.c_int),
        *((name, ctypes.c_double) for name in ("timestamp", "x", "y", "z", "h", "p", "r")),
        ("road", ctypes.c_uint32), ("junction", ctypes.c_uint32), ("t", ctypes.c_double),
        ("lane", ctypes.c_int),
        *((name, ctypes.c_double) for name in (
            "offset", "s", "speed", "ahead", "aside", "up", "width", "length", "height")),
        ("type", ctypes.c_int), ("category", ctypes.c_int),
        ("wheel_angle", ctypes.c_double), ("wheel_turn", ctypes.c_double),
        ("visible", ctypes.c_int),
    ]  # fmt: skip


def play(library: ctypes.CDLL, question: dict[str, Any]) -> dict[str, Any]:
    """Pairs and times of first contact, and how far the agents are from the scene's [m]."""
    library.SE_LogToConsole(False)
    library.SE_CollisionDetection(True)
    if library.SE_Init(question["file"].encode(), 0, 0, 0, 0):
        raise SystemExit(f"esmini does not play {question['file']}")
    step, found, worst = question["step"], dict[tuple[str, str], float](), 0.0
    known = {
        (name, round(t / step)): np.array(xy)
        for name, agent in question["agents"].items()
        for t, xy in zip(agent["t"], agent["xy"], strict=True)
    }
    for k in range(question["steps"]):
        here = [library.SE_GetId(n) for n in range(library.SE_GetNumberOfObjects())]
        names = {number: library.SE_GetObjectName(number).decode() for number in here}
        for number, name in names.items():
            for n in range(library.SE_GetObjectNumberOfCollisions(number)):
                other = names.get(library.SE_GetObjectCollision(number, n))
                if other is not None:
                    found.setdefault((min(name, other), max(name, other)), round(k * step, 3))
            if (name, k) in known:
                state = State()
                library.SE_GetObjectState(number, ctypes.byref(state))
                turn = np.array([math.cos(state.h), math.sin(state.h)])
                middle = np.array([state.x, state.y]) + state.ahead * turn
                worst = max(worst, float(np.hypot(*(middle - known[name, k]))))
        for _ in range(STEPS):
            library.SE_StepDT(ctypes.c_double(step / STEPS))
    library.SE_Close()
    return {
        "collisions": [[*pair, t] for pair, t in sorted(found.items())],
        "position_error": worst,
    }  # fmt: skip


def main() -> None:
    request = json.load(sys.stdin)
    library = ctypes.CDLL(os.environ["ESMINI"])
    library.SE_GetObjectName.restype = ctypes.c_char_p
    library.SE_SetLogFilePath(b"")
    answers = [play(library, each) for each in request["scenes"]]
    json.dump({"version": "at ESMINI", "scenes": answers}, sys.stdout)


if __name__ == "__main__":
    main()
