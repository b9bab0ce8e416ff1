"""The arguments of a run: their defaults, what the environment says in their place, limits."""

from __future__ import annotations

import os

from scenewright.errors import InputError
from scenewright.intersections import SHIPPED, ships_refiner
from scenewright.nodes.prompts import LONGEST_REQUEST
from scenewright.nodes.trajectory_refiner import NO_WEIGHTS

DEFAULT_INTERSECTION = SHIPPED
REFINERS = ("none", "trajnet")
DEFAULT_REFINER = "trajnet"
MAX_SEED = 2**63 - 1


def find_refiner_gap(intersection: str, refiner: str) -> str | None:
    """Why nothing would be refined though it is asked for; None where a network serves."""
    served = ships_refiner(intersection) or ships_refiner(DEFAULT_INTERSECTION)
    return NO_WEIGHTS if refiner == "trajnet" and not served else None


def choose_refiner(name: str | None) -> str:
    """The refiner that is named, else what SCENEWRIGHT_REFINER says, else `trajnet`."""
    return name or os.environ.get("SCENEWRIGHT_REFINER") or DEFAULT_REFINER


def choose_max_agents(most: int | None) -> int | None:
    """The most agents of a scene that are named, else what SCENEWRIGHT_MAX_AGENTS says, else None.

    Raises:
        InputError: it is no whole number from 1.
    """
    limit = os.environ.get("SCENEWRIGHT_MAX_AGENTS") if most is None else str(most)
    if not limit:
        return None
    if not limit.isdecimal() or int(limit) < 1:
        raise InputError(f"the most agents of a scene is a whole number from 1, got {limit}")
    return int(limit)


def check_arguments(seed: int, refiner: str) -> None:
    """Raises InputError for a seed or a refiner that there is not."""
    if not 0 <= seed <= MAX_SEED:
        raise InputError(f"a seed is a whole number from 0 to 2^63 - 1, got {seed}")
    if refiner not in REFINERS:
        raise InputError(f"there is no refiner {refiner!r}; choose one of: {', '.join(REFINERS)}")


def check_length(instruction: str) -> None:
    """Raises InputError for an instruction that is too long to be one."""
    if len(instruction) > LONGEST_REQUEST:
        raise InputError(
            f"the instruction has {len(instruction):,} characters; at most {LONGEST_REQUEST:,} "
            "are read"
        )
