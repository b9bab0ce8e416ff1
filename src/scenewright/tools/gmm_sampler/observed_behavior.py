"""How road users of a place yield, start and brake: the `manners.json` of a bundle."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from pydantic import TypeAdapter

from scenewright.errors import InputError
from scenewright.intersections import SHIPPED, check_bundle, find_bundle_folder
from scenewright.scene.base import AgentClass
from scenewright.scene.reaction_behavior import LEVELS, YieldingBehavior, YieldingModel
from scenewright.tools.gmm_sampler.priors import DrivingProfilePrior

OBSERVED_FILE = "manners.json"
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
    source = folder if (folder / OBSERVED_FILE).is_file() else find_bundle_folder(SHIPPED)
    stored = _read_entries(source, _Model, pairs=True)
    for behavior in stored.values():
        for name, values in asdict(behavior).items():
            if name != "rolls" and (len(values) != len(LEVELS) or list(values) != sorted(values)):
                raise InputError(
                    f"{OBSERVED_FILE} of {source.name!r}: {name} needs {len(LEVELS)} "
                    "ascending quantiles"
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
                f"{OBSERVED_FILE} of {folder.name!r}: {name} needs a positive median and spread "
                "of starts and of brakes"
            )
    return stored


def _read_entries(folder: Path, form: TypeAdapter[Any], *, pairs: bool) -> Any:
    """The entries of the file about pairs of classes, or those about a class; {} without a file."""
    if not (folder / OBSERVED_FILE).is_file():
        return {}
    check_bundle(folder, OBSERVED_FILE)
    try:
        stored = json.loads((folder / OBSERVED_FILE).read_bytes())
        if not isinstance(stored, dict):
            raise ValueError("it holds no object")
        chosen = {name: entry for name, entry in stored.items() if (_TO in name) == pairs}
        return form.validate_json(json.dumps(chosen))
    except (OSError, ValueError) as fault:
        reason = " ".join(str(fault).split())
        raise InputError(f"cannot read {OBSERVED_FILE} of {folder.name!r}: {reason}") from None


def replace_accelerations(
    profiles: Mapping[str, DrivingProfilePrior], observed: AccelerationProfiles
) -> dict[str, DrivingProfilePrior]:
    """Driving profiles by route id, with acceleration and braking as observed by class."""
    found = dict(profiles)
    for route, prior in profiles.items():
        kind = cast(AgentClass, route.partition(":")[0])
        if kind in observed:
            own, low = observed[kind], prior.low
            (start, start_spread), (brake, brake_spread) = own.starts, own.brakes
            high = np.array([prior.high[0], *MAX_ACCELERATIONS[kind], prior.high[3]])
            median = np.array([prior.median[0], start, brake, prior.median[3]])
            spread = np.array([prior.spread[0], start_spread, brake_spread, prior.spread[3]])
            found[route] = replace(
                prior, median=np.clip(median, low, high), spread=spread, high=high
            )
    return found
