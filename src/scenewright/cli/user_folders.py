"""Where scenewright keeps what is the user's own: threads, memory, history."""

from __future__ import annotations

from pathlib import Path

from scenewright.intersections import find_data_folder


def find_threads_file(path: str | None) -> Path:
    """The file of threads: the one named, else that of the data folder."""
    return Path(path) if path else find_data_folder() / "threads.sqlite"


def find_memory_file() -> Path:
    """The file of episodes."""
    return find_data_folder() / "memory.jsonl"
