"""Groups of pedestrians: all members walk beside or behind the first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenewright.geometry.polyline import resample_to_count, rotate_left
from scenewright.scene.candidates import AgentCandidates, Candidate

_BESIDE, _BEHIND = 0.75, 0.8
"""From one member to the next: beside it, and in the row behind [m]; discs of 0.6 m."""


_COMPANION, _HALF_A_STEP = (0.85, 1.1), 0.35
"""Two who walk together: how far apart, and how far one is behind at most [m]."""


def form_group(leader: AgentCandidates, names: list[str]) -> dict[str, AgentCandidates]:
    """The other members of a group, by name: rows of two, the first beside the leader."""
    rows = [(aside, row * _BEHIND) for row in range(1, 4) for aside in (0.0, _BESIDE)]
    return {
        name: replace(leader, name=name, build=_Shifted(leader, aside, behind))
        for name, (aside, behind) in zip(names, [(_BESIDE, 0.0), *rows], strict=False)
    }


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
        path, aside = candidate.path, self._aside if m >= 0 else -self._aside
        ahead = np.column_stack([np.cos(path.heading), np.sin(path.heading)])
        # To the left, and begun so much earlier on its straight start.
        path = replace(path, xy=path.xy + aside * rotate_left(ahead) - self._behind * ahead)
        waypoints = resample_to_count(path.xy, len(candidate.waypoints))
        return replace(candidate, path=path, waypoints=waypoints)
