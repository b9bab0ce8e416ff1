"""How agents yield, start and brake at a bundle's intersection: its file `manners.json`.

A bundle without one borrows the shipped bundle's yielding behaviour, which differs less between
places than speeds do. How agents start and brake is taken from its own file alone: its driving
profiles have been fitted or borrowed before.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, cast

from pydantic import TypeAdapter

from scenewright.errors import InputError
from scenewright.intersections import SHIPPED, check_bundle, find_bundle_folder
from scenewright.scene.base import AgentClass
from scenewright.scene.yielding_behavior import LEVELS, YieldingBehavior, YieldingModel

FILE = "manners.json"
_TO = " to "
MAX_ACCELERATIONS = {"vehicle": (2.5, 3.0), "pedestrian": (2.5, 2.5)}
"""Strongest start and braking that are drawn [m/s^2], well inside SEMANTICS section 5."""


@dataclass(frozen=True)
class AccelerationProfile:
    """How agents of a class start and brake.

    Attributes:
        starts, brakes: median [m/s^2], and standard deviation of the logarithm.
    """

    starts: tuple[float, float]
    brakes: tuple[float, float]


AccelerationProfiles = Mapping[AgentClass, AccelerationProfile]
_Model = TypeAdapter(dict[str, YieldingBehavior])
_Profiles = TypeAdapter(dict[AgentClass, AccelerationProfile])


def load_yielding_model(folder: Path) -> YieldingModel:
    """The yielding behaviour of a bundle, or the one it borrows.

    Raises:
        InputError: damaged, or of another form.
    """
    source = folder if (folder / FILE).is_file() else find_bundle_folder(SHIPPED)
    stored = _read_entries(source, _Model, pairs=True)
    for behavior in stored.values():
        for field, values in asdict(behavior).items():
            if field != "rolls" and (len(values) != len(LEVELS) or list(values) != sorted(values)):
                raise InputError(
                    f"{FILE} of {source.name!r}: {field} needs {len(LEVELS)} ascending quantiles"
                )
    pairs = (name.partition(_TO) for name in stored)
    keys = [(cast(AgentClass, giving), cast(AgentClass, other)) for giving, _, other in pairs]
    return dict(zip(keys, stored.values(), strict=True))


def load_acceleration_profiles(folder: Path) -> AccelerationProfiles:
    """How agents start and brake, by class; empty if the bundle does not say.

    Raises:
        InputError: damaged, or of another form.
    """
    stored: AccelerationProfiles = _read_entries(folder, _Profiles, pairs=False)
    for name, profile in stored.items():
        if min(*profile.starts, *profile.brakes) <= 0.0:
            raise InputError(
                f"{FILE} of {folder.name!r}: {name} needs a positive median and spread of starts "
                "and of brakes"
            )
    return stored


def _read_entries(folder: Path, form: TypeAdapter[Any], *, pairs: bool) -> Any:
    """The entries of the file about pairs of classes, or those about a class; {} without a file."""
    if not (folder / FILE).is_file():
        return {}
    check_bundle(folder, FILE)
    try:
        stored = json.loads((folder / FILE).read_bytes())
        if not isinstance(stored, dict):
            raise ValueError("it holds no object")
        chosen = {name: entry for name, entry in stored.items() if (_TO in name) == pairs}
        return form.validate_json(json.dumps(chosen))
    except (OSError, ValueError) as fault:
        reason = " ".join(str(fault).split())
        raise InputError(f"cannot read {FILE} of {folder.name!r}: {reason}") from None
