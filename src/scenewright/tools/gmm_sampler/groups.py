"""Groups of pedestrians: all members walk beside or behind the first."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from scenewright.geometry.polyline import resample_to_count
from scenewright.scene.candidates import AgentCandidates, Candidate, Path

_BESIDE, _BEHIND = 0.75, 0.8
"""From one member to the next: beside it, and in the row behind [m]; discs of 0.6 m."""


_COMPANION, _HALF_A_STEP = (0.85, 1.1), 0.35
"""Two who walk together: how far apart, and how far one is behind at most [m]."""


def form_group(leader: AgentCandidates, names: list[str]) -> dict[str, AgentCandidates]:
    """The other members of a group, by name: rows of two, the first beside the leader."""
    return {
        name: replace(leader, name=name, build=_Shifted(leader, aside, behind))
        for name, (aside, behind) in zip(names, _draw_places(), strict=False)
    }


def _draw_places() -> Iterator[tuple[float, float]]:
    """How far to the left and behind the leader [m], member after member."""
    yield _BESIDE, 0.0
    for row in range(1, 4):
        yield 0.0, row * _BEHIND
        yield _BESIDE, row * _BEHIND


def walk_beside(leader: AgentCandidates, name: str, rng: np.random.Generator) -> AgentCandidates:
    """A background pedestrian that walks with another, on either side of it."""
    aside = float(rng.uniform(*_COMPANION)) * float(rng.choice((-1.0, 1.0)))
    behind = float(rng.uniform(0.0, _HALF_A_STEP))
    build = _Shifted(leader, aside, behind)
    return replace(leader, name=name, build=build, beside=leader.name)


class _Shifted:
    """Makes the m-th candidate of a member from that of the leader."""

    def __init__(self, leader: AgentCandidates, aside: float, behind: float) -> None:
        self._leader, self._aside, self._behind = leader, aside, behind

    def __call__(self, m: int) -> Candidate:
        """The m-th; for `~m` the same on the leader's other side."""
        candidate = self._leader.build(max(m, ~m))
        path = _shift(candidate.path, self._aside if m >= 0 else -self._aside, self._behind)
        waypoints = resample_to_count(path.xy, len(candidate.waypoints))
        return replace(candidate, path=path, waypoints=waypoints)


def _shift(path: Path, aside: float, behind: float) -> Path:
    """A path to the left of another one, that begins so much earlier on its straight start."""
    normal = np.column_stack([-np.sin(path.heading), np.cos(path.heading)])
    xy = path.xy + aside * normal
    back = np.column_stack([np.cos(path.heading), np.sin(path.heading)])
    return replace(path, xy=xy - behind * back)
