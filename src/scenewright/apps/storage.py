"""Where scenewright keeps what is the user's own: threads, memory, history."""

from __future__ import annotations

import os
import sys
from pathlib import Path

VARIABLE = "SCENEWRIGHT_DATA"


def data_folder() -> Path:
    """The folder for the user's own data, which the variable SCENEWRIGHT_DATA names otherwise."""
    told = os.environ.get(VARIABLE)
    if told:
        return Path(told)
    home = Path.home()
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local") / "scenewright"
    if sys.platform == "darwin":
        return home / "Library" / "Application Support" / "scenewright"
    return Path(os.environ.get("XDG_DATA_HOME") or home / ".local" / "share") / "scenewright"


def threads_file(told: str | None) -> Path:
    """The file of threads: the one named, else that of the data folder."""
    return Path(told) if told else data_folder() / "threads.sqlite"


def memory_file() -> Path:
    """The file of episodes."""
    return data_folder() / "memory.jsonl"
