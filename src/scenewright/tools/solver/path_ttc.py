"""Path TTC of two placed agents: time to contact at their present speeds (SEMANTICS 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.solver.path_conflict import PathConflict
from scenewright.tools.solver.scheduled_agent import ScheduledAgent, get_shared_times
from scenewright.work_limit import count_work

_LOOK = 0.05
"""How finely the time ahead is searched for a contact [s]."""


@dataclass(frozen=True, eq=False)
class PathTtc:
    """Path TTC over time.

    Attributes:
        times: [T] at which both are in the scene [s].
        ttc: [T] time to contact [s]; inf where there is none within the horizon.
    """

    times: FloatArray
    ttc: FloatArray

    @property
    def least(self) -> float:
        """Least path TTC [s]; inf if the two never approach one another."""
        return float(self.ttc.min(initial=np.inf))

    @property
    def when(self) -> float:
        """When it is least [s]."""
        return float(self.times[int(np.argmin(self.ttc))])


def compute_path_ttc(
    pair: PathConflict, a: ScheduledAgent, b: ScheduledAgent, *, horizon: float
) -> PathTtc:
    """Compute the path TTC of two agents, up to `horizon` [s], from the nodes at which they
    touch."""
    count_work()
    times = get_shared_times(a, b)
    if times is None or not pair.touches:
        return PathTtc(np.empty(0), np.empty(0))
    first_a, first_b = (round((times[0] - each.enters) / STEP) for each in (a, b))
    ttc = _search_contacts(
        pair.touching, float(pair.s_a[1]), float(pair.s_b[1]),
        a.motion.s[first_a:], a.motion.speed[first_a:], b.motion.s[first_b:],
        b.motion.speed[first_b:], np.arange(0.0, horizon + _LOOK / 2, _LOOK), len(times),
    )  # fmt: skip
    return PathTtc(times, ttc)


@compiled
def _search_contacts(
    touching: NDArray[np.bool_],
    spacing_a: float,
    spacing_b: float,
    s_a: FloatArray,
    speed_a: FloatArray,
    s_b: FloatArray,
    speed_b: FloatArray,
    ahead: FloatArray,
    count: int,
) -> FloatArray:
    """Search the times ahead [A] for the first at which nodes touch, at [T] samples; inf: none.

    Args:
        touching: see `PathConflict`; spacing_a, spacing_b: between its nodes [m].
        s_a, speed_a, s_b, speed_b: arc length [m] and speed [m/s] of both since the first sample.
    """
    ttc, (last_a, last_b) = np.full(count, np.inf), touching.shape
    for t in range(count):
        for k in range(len(ahead)):
            node_a = int(np.rint((s_a[t] + speed_a[t] * ahead[k]) / spacing_a))
            node_b = int(np.rint((s_b[t] + speed_b[t] * ahead[k]) / spacing_b))
            if node_a >= last_a or node_b >= last_b:
                break  # beyond the end of a path
            if touching[node_a, node_b]:
                ttc[t] = ahead[k]
                break
    return ttc
