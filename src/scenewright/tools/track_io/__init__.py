"""Recordings: whole tracks of all agents at one place, on one clock, from any source.

`recording` is the value, `archive` its file, `windows` cuts scenes out of it, `taf_bw` reads real
tracks, `cleaning` frees real tracks of what no road user does.
"""

from scenewright.tools.track_io.archive import load_recordings, save_recordings
from scenewright.tools.track_io.recording import RecordedAgent, Recording, Split
from scenewright.tools.track_io.windows import RecordingWindow, cut_windows

__all__ = [
    "RecordedAgent",
    "Recording",
    "RecordingWindow",
    "Split",
    "cut_windows",
    "load_recordings",
    "save_recordings",
]
