"""Where scenewright keeps what is the user's own: threads, memory, history."""

from __future__ import annotations

from pathlib import Path

from scenewright.intersections import find_data_folder


def threads_file(told: str | None) -> Path:
    """The file of threads: the one named, else that of the data folder."""
    return Path(told) if told else find_data_folder() / "threads.sqlite"


def memory_file() -> Path:
    """The file of episodes."""
    return find_data_folder() / "memory.jsonl"
