"""Exporters: a scene in the formats that other simulators, planners and viewers read.

`FORMATS` is the registry, one module per format. Every exporter is a function from an
`ExportedScene` to the files that it becomes; packages that only one format needs are imported by
it alone. docs/exports.md says per format what frames, units, times and ids mean.
"""

from scenewright.tools.exporters.exported_scene import ExportedScene, prepare_scene
from scenewright.tools.exporters.registry import (
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
