"""Which reader reads which file of a simulator or motion dataset."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import PurePath

from scenewright.errors import InputError
from scenewright.tools.track_io.argoverse2 import read_argoverse2
from scenewright.tools.track_io.commonroad import read_commonroad
from scenewright.tools.track_io.fcd import read_fcd
from scenewright.tools.track_io.openscenario import read_openscenario
from scenewright.tools.track_io.osi import read_osi
from scenewright.tools.track_io.sampled_recording import SampledRecording
from scenewright.tools.track_io.scenarionet import read_scenarionet
from scenewright.tools.track_io.womd import read_womd
from scenewright.tools.track_io.xml_reading import parse_xml

_HEAD = 100_000
"""Within so many bytes a CommonRoad file begins."""
DATABASE_FILES = ("dataset_summary.pkl", "dataset_mapping.pkl")
"""What lists the scenarios of a ScenarioNet database and holds no tracks."""


def read_xml(data: bytes, *, name: str) -> list[SampledRecording]:
    """Tracks in XML: CommonRoad, or SUMO's floating car data; the root element says which.

    Raises:
        InputError: neither, or damaged.
    """
    if b"<commonRoad" not in data[:_HEAD]:
        return read_fcd(data, name=name)
    return read_commonroad(parse_xml(data, name=name), name=name)


Reader = Callable[..., list[SampledRecording]]
_READERS: tuple[tuple[str, Reader], ...] = (
    (r"\.xosc", read_openscenario),
    (r"\.pkl", read_scenarionet),
    (r"\.xml", read_xml),
    (r"\.tfrecord(-\d+-of-\d+)?", read_womd),
    (r"\.parquet", read_argoverse2),
    (r"\.mcap", read_osi),
)
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
