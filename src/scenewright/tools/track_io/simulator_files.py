"""Which reader reads which file of a simulator or motion dataset."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import PurePath

from scenewright.errors import InputError
from scenewright.tools.track_io.openscenario import read_openscenario
from scenewright.tools.track_io.sampled_recording import SampledRecording

Reader = Callable[..., list[SampledRecording]]
_READERS: tuple[tuple[str, Reader], ...] = ((r"\.xosc", read_openscenario),)
"""(how a file's name ends, reader)."""


def find_reader(name: str) -> Reader | None:
    """The reader of a file, by its name; None where there is none."""
    file = PurePath(name).name.lower()
    return next((read for end, read in _READERS if re.search(f"{end}$", file)), None)


def read_simulator_file(data: bytes, *, name: str) -> list[SampledRecording]:
    """The scenarios of a file.

    Raises:
        InputError: no known kind of file, or nothing in it that can be read.
    """
    reader = find_reader(name)
    if reader is None:
        raise InputError(f"{name} is of no kind that can be read")
    recordings = reader(data, name=name)
    if not any(each.agents for each in recordings):
        raise InputError(f"{name} holds no tracks of road users")
    return recordings
