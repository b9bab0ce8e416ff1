"""Formats of other programs and of data sets, one module each that writes and reads.

`FORMATS` is the registry. A writer is a function from an `ExportedScene` to the files that it
becomes, a reader one from bytes to `SampledRecording`s; packages that only one format needs are
imported by it alone. docs/exports.md says per format what frames, units, times and ids mean.
"""

from scenewright.tools.formats.exported_scene import ExportedScene, prepare_scene
from scenewright.tools.formats.registry import (
    FORMATS,
    Format,
    find_format,
    write_index,
    write_scene,
)

__all__ = [
    "FORMATS",
    "ExportedScene",
    "Format",
    "find_format",
    "prepare_scene",
    "write_index",
    "write_scene",
]
