"""Path TTC of two placed agents: time to contact at their present speeds (SEMANTICS 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.scene.base import FloatArray
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
    meet = pair.clearance <= 0.0
    touch = np.zeros((len(pair.s_a) + 1, len(pair.s_b) + 1), dtype=np.bool_)
    touch[pair.i[meet], pair.j[meet]] = True
    now_a, now_b = _compute_state(a, times), _compute_state(b, times)
    near = _reaches(now_a, pair.s_a[pair.i[meet]], horizon)
    near &= _reaches(now_b, pair.s_b[pair.j[meet]], horizon)
    ahead = np.arange(0.0, horizon + _LOOK / 2, _LOOK)
    hits = touch[
        _find_nodes(now_a[near], ahead, pair.s_a), _find_nodes(now_b[near], ahead, pair.s_b)
    ]
    ttc = np.full(len(times), np.inf)
    ttc[near] = np.where(hits.any(axis=1), ahead[np.argmax(hits, axis=1)], np.inf)
    return PathTtc(times, ttc)


def _compute_state(of: ScheduledAgent, times: FloatArray) -> FloatArray:
    """Compute arc length [m] and speed [m/s] [T, 2] at scene times."""
    local, clock = times - of.enters, of.motion.clock
    return np.column_stack(
        [of.motion.compute_positions(local), np.interp(local, clock, of.motion.speed)]
    )


def _reaches(now: FloatArray, nodes: FloatArray, horizon: float) -> NDArray[np.bool_]:
    """Return [T] whether it may come among the nodes within the horizon at its present speed."""
    s, speed = now.T
    result: NDArray[np.bool_] = (s + speed * horizon >= nodes.min() - 1.0) & (
        s <= nodes.max() + 1.0
    )
    return result


def _find_nodes(now: FloatArray, ahead: FloatArray, s: FloatArray) -> NDArray[np.intp]:
    """Find the node [T, A] where it would be that much later; one past the last beyond the path."""
    node = np.rint((now[:, :1] + now[:, 1:] * ahead) / (s[1] - s[0]))
    result: NDArray[np.intp] = np.minimum(node, len(s)).astype(np.intp)
    return result
