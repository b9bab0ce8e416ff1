"""Recordings: whole tracks of all agents at one place, on one clock, from any source.

`recording` is the value, its file, and scenes cut out of it; `taf_bw` reads real tracks, `cleaning`
frees real tracks of what no road user does.
"""

from scenewright.tools.track_io.recording import (
    RecordedAgent,
    Recording,
    RecordingWindow,
    Split,
    cut_windows,
    load_recordings,
    save_recordings,
)

__all__ = [
    "RecordedAgent",
    "Recording",
    "RecordingWindow",
    "Split",
    "cut_windows",
    "load_recordings",
    "save_recordings",
]
