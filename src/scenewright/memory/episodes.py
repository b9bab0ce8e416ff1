"""Episodes: accepted scenes, kept between runs and recalled as examples for prompts.

One JSON object a line in a file of bounded length. What is alike is found by counting groups of
letters that two requests share, hashed into a vector of fixed length: the same on every machine,
with no model and no network.
"""

from __future__ import annotations

import json
import math
import re
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from scenewright.errors import InputError
from scenewright.files import write_atomically

MOST_EPISODES = 500
"""More are kept no longer: the oldest go first."""

_LONGEST_REQUEST, _LONGEST_GRAPH = 2000, 20_000
_DIMENSIONS = 512
_GRAMS = (3, 4)
_LEAST_ALIKE = 0.25
"""Cosine below which a request is no example for another."""


@dataclass(frozen=True)
class Episode:
    """An accepted scene.

    Attributes:
        request: what was said; graph: the social graph that it led to, as plain JSON.
        taxonomy: leaves of the taxonomy that it shows.
    """

    request: str
    graph: dict[str, Any]
    taxonomy: tuple[str, ...]


_EPISODE = TypeAdapter(Episode)


class Episodes:
    """The episodes of one file.

    Args:
        path: the file; a memory that is not there is empty.
        most: how many are kept.
    """

    def __init__(self, path: str | Path, *, most: int = MOST_EPISODES) -> None:
        self.path, self.most = Path(path), most

    def list_all(self) -> list[Episode]:
        """Every episode, oldest first; lines that are none are passed over.

        Raises:
            InputError: the file cannot be read.
        """
        try:
            lines = self.path.read_text("utf-8", "replace").splitlines()
        except FileNotFoundError:
            return []
        except OSError as error:
            raise InputError(f"cannot read {self.path}: {error.strerror or error}") from error
        found = (_parse_episode(line) for line in lines[-2 * self.most :])
        return [each for each in found if each is not None][-self.most :]

    def accept(self, *, request: str, graph: Mapping[str, Any], taxonomy: Sequence[str]) -> None:
        """Keeps an episode; the same request takes the place of its earlier one.

        Raises:
            InputError: the file cannot be written.
        """
        new = Episode(request[:_LONGEST_REQUEST], dict(graph), tuple(taxonomy))
        if len(json.dumps(new.graph)) > _LONGEST_GRAPH:
            return
        kept = [each for each in self.list_all() if each.request != new.request]
        lines = [json.dumps(vars(each), allow_nan=False) for each in [*kept, new][-self.most :]]
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        except OSError as error:
            raise InputError(f"cannot write {self.path}: {error.strerror or error}") from error
        write_atomically(self.path, "".join(f"{line}\n" for line in lines).encode())

    def wipe(self) -> int:
        """Forgets everything; how many episodes that were."""
        count = len(self.list_all())
        self.path.unlink(missing_ok=True)
        return count

    def recall(self, text: str, k: int = 3) -> tuple[Episode, ...]:
        """The episodes most like the text, at most one of each kind of scene first.

        Of two that are equally alike, the later one; one that shows what is there already comes
        after others, so that three examples are not three times the same.
        """
        wanted = embed_text(text)
        scored: list[tuple[float, int, Episode]] = []
        for n, each in enumerate(self.list_all()):
            own = embed_text(each.request)
            cosine = sum(value * own.get(place, 0.0) for place, value in wanted.items())
            scored.append((cosine, n, each))
        near = sorted((s for s in scored if s[0] >= _LEAST_ALIKE), key=lambda s: (-s[0], -s[1]))
        shown: set[tuple[str, ...]] = set()
        first: list[Episode] = []
        later: list[Episode] = []
        for _, _, episode in near:
            (later if episode.taxonomy in shown else first).append(episode)
            shown.add(episode.taxonomy)
        return tuple((*first, *later)[:k])


def embed_text(text: str) -> dict[int, float]:
    """The text as a sparse vector of length one: hashed groups of letters, damped counts."""
    plain = " ".join(re.findall(r"[a-z0-9]+", text.lower()[:_LONGEST_REQUEST]))
    padded = f" {plain} "
    counts: dict[int, float] = {}
    for size in _GRAMS:
        for at in range(len(padded) - size + 1):
            place = zlib.crc32(padded[at : at + size].encode()) % _DIMENSIONS
            counts[place] = counts.get(place, 0.0) + 1.0
    damped = {place: 1.0 + math.log(count) for place, count in counts.items()}
    length = math.sqrt(sum(value * value for value in damped.values()))
    return {place: value / length for place, value in damped.items()} if length else {}


def _parse_episode(line: str) -> Episode | None:
    """Parse the episode of a line; None if it is none."""
    if len(line) > 2 * (_LONGEST_REQUEST + _LONGEST_GRAPH):
        return None
    try:
        return _EPISODE.validate_json(line)
    except ValidationError:
        return None
