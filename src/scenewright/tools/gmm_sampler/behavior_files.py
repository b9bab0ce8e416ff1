"""Reading and writing how people give way, and set off and brake: `manners.json` of a bundle.

A bundle without one borrows the shipped bundle's ways of giving way: how people let others pass is
less a matter of the place than how fast they drive there. How briskly they set off and brake is
taken from its own file alone; its time laws have been fitted or borrowed before.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, cast

from pydantic import TypeAdapter

from scenewright.errors import InputError
from scenewright.intersections import check_bundle, find_bundle_folder
from scenewright.scene.base import AgentClass
from scenewright.scene.yielding_behavior import LEVELS, YieldingBehavior, YieldingModel

FILE = "manners.json"
_LENDS = "amsterdam_120"
_TO = " to "
BRISKEST = {"vehicle": (2.5, 3.0), "pedestrian": (2.5, 2.5)}
"""Strongest start and braking that are drawn [m/s^2], well inside SEMANTICS section 5."""


@dataclass(frozen=True)
class Pace:
    """How briskly those of a class set off and brake.

    Attributes:
        starts, brakes: median [m/s^2], and standard deviation of the logarithm.
    """

    starts: tuple[float, float]
    brakes: tuple[float, float]


Paces = Mapping[AgentClass, Pace]
_Habits, _Paces = TypeAdapter(dict[str, YieldingBehavior]), TypeAdapter(dict[str, Pace])


def load_manners(folder: Path) -> YieldingModel:
    """The habits of a bundle, or those it borrows.

    Raises:
        InputError: damaged, or of another form.
    """
    here = folder if (folder / FILE).is_file() else find_bundle_folder(_LENDS)
    if not (here / FILE).is_file():
        return {}
    check_bundle(here, FILE)
    stored = _read(here, _Habits, pairs=True)
    return {_key(name): _checked(manners, here) for name, manners in stored.items()}


def load_paces(folder: Path) -> Paces:
    """How briskly people set off and brake here; empty if the bundle does not say.

    Raises:
        InputError: damaged, or of another form.
    """
    if not (folder / FILE).is_file():
        return {}
    check_bundle(folder, FILE)
    stored: dict[AgentClass, Pace] = _read(folder, _Paces, pairs=False)
    for name, pace in stored.items():
        if name not in BRISKEST or min(*pace.starts, *pace.brakes) <= 0.0:
            raise InputError(
                f"{FILE} of {folder.name!r}: {name} needs a positive median and spread of starts "
                "and of brakes"
            )
    return stored


def _read(folder: Path, form: TypeAdapter[Any], *, pairs: bool) -> dict[Any, Any]:
    """The entries of the file about pairs of classes, or those about a class."""
    try:
        stored = json.loads((folder / FILE).read_bytes())
        if not isinstance(stored, dict):
            raise ValueError("it holds no object")
        chosen = {name: told for name, told in stored.items() if (_TO in name) == pairs}
        return dict(form.validate_json(json.dumps(chosen)))
    except (OSError, ValueError) as fault:
        raise InputError(f"cannot read {FILE} of {folder.name!r}: {fault}") from None


def to_json(habits: YieldingModel, paces: Paces | None = None) -> str:
    """The text of `manners.json`."""
    named = {f"{giver}{_TO}{other}": asdict(each) for (giver, other), each in habits.items()}
    rates = {name: asdict(pace) for name, pace in (paces or {}).items()}
    return json.dumps({**named, **rates}, indent=1) + "\n"


def _key(name: str) -> tuple[AgentClass, AgentClass]:
    giver, _, other = name.partition(_TO)
    return cast(AgentClass, giver), cast(AgentClass, other)


def _checked(manners: YieldingBehavior, folder: Path) -> YieldingBehavior:
    for name, values in asdict(manners).items():
        if name != "rolls" and (len(values) != len(LEVELS) or list(values) != sorted(values)):
            raise InputError(
                f"{FILE} of {folder.name!r}: {name} needs {len(LEVELS)} ascending quantiles"
            )
    return manners
