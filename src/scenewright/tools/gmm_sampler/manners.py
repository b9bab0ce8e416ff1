"""Reading and writing how people give way: `manners.json` of a bundle.

A bundle without one borrows the shipped bundle's: how people let others pass is less a matter of
the place than how fast they drive there.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import cast

from pydantic import TypeAdapter, ValidationError

from scenewright.errors import InputError
from scenewright.intersections import bundle_folder, check_bundle
from scenewright.scene.base import AgentClass
from scenewright.scene.manners import LEVELS, Habits, Manners

FILE = "manners.json"
_LENDS = "amsterdam_120"
_Stored = TypeAdapter(dict[str, Manners])


def load_manners(folder: Path) -> Habits:
    """The habits of a bundle, or those it borrows.

    Raises:
        InputError: damaged, or of another form.
    """
    here = folder if (folder / FILE).is_file() else bundle_folder(_LENDS)
    if not (here / FILE).is_file():
        return {}
    check_bundle(here, FILE)
    try:
        stored = _Stored.validate_json((here / FILE).read_bytes())
    except (OSError, ValidationError) as fault:
        raise InputError(f"cannot read {FILE} of {here.name!r}: {fault}") from None
    return {_key(name): _checked(manners, here) for name, manners in stored.items()}


def to_json(habits: Habits) -> str:
    """The text of `manners.json`."""
    named = {f"{giver} to {other}": asdict(each) for (giver, other), each in habits.items()}
    return json.dumps(named, indent=1) + "\n"


def _key(name: str) -> tuple[AgentClass, AgentClass]:
    giver, _, other = name.partition(" to ")
    return cast(AgentClass, giver), cast(AgentClass, other)


def _checked(manners: Manners, folder: Path) -> Manners:
    for name, values in asdict(manners).items():
        if name != "rolls" and (len(values) != len(LEVELS) or list(values) != sorted(values)):
            raise InputError(
                f"{FILE} of {folder.name!r}: {name} needs {len(LEVELS)} ascending quantiles"
            )
    return manners
