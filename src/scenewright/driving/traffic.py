"""The ways in which the others may move, by name."""

from __future__ import annotations

from typing import Literal, get_args

from scenewright.driving.reactive import Reactive
from scenewright.driving.resolve import Resolve
from scenewright.driving.world import Replay, TrafficModel
from scenewright.errors import InputError

OthersMode = Literal["replay", "reactive", "resolve"]
OTHERS_MODES: tuple[OthersMode, ...] = get_args(OthersMode)


def make_traffic(others: OthersMode) -> TrafficModel:
    """The traffic model of a mode.

    Raises:
        InputError: no such mode.
    """
    if others not in OTHERS_MODES:
        raise InputError(f"no way {str(others)[:40]!r} for the others; {', '.join(OTHERS_MODES)}")
    models: dict[OthersMode, type[Replay] | type[Reactive]] = {
        "replay": Replay,
        "reactive": Reactive,
        "resolve": Resolve,
    }
    return models[others]()
