"""The ways in which the others may move, by name."""

from __future__ import annotations

from typing import Literal, get_args

from scenewright.driving.reactive import TEMPERAMENTS, Reactive, Temper
from scenewright.driving.resolve import Resolve
from scenewright.driving.world import Replay, TrafficModel
from scenewright.errors import InputError

OthersMode = Literal["replay", "reactive", "resolve"]
OTHERS_MODES: tuple[OthersMode, ...] = get_args(OthersMode)


def make_traffic(others: OthersMode, temperament: Temper = "obedient") -> TrafficModel:
    """The traffic model of a mode.

    Raises:
        InputError: no such mode or temperament, or a temperament of others that do not react.
    """
    if others not in OTHERS_MODES:
        raise InputError(f"no way {str(others)[:40]!r} for the others; {', '.join(OTHERS_MODES)}")
    if temperament not in TEMPERAMENTS:
        known = ", ".join(TEMPERAMENTS)
        raise InputError(f"no temperament {str(temperament)[:40]!r} for the others; {known}")
    if temperament != "obedient" and others == "replay":
        raise InputError("a temperament is for others that react; these replay the scene")
    if others == "replay":
        return Replay()
    model = Resolve() if others == "resolve" else Reactive()
    model.temperament = TEMPERAMENTS[temperament]
    return model
