"""Which moments of a scene an animation shows, and how slowly."""

from __future__ import annotations

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.record import SceneRecord

SLOW = 1 / 3
"""Speed at which the moments round an event are shown, as a share of real time."""
BEFORE, AFTER = 1.2, 0.8
"""How long [s] before and after an event the animation is slow."""
ENDING = 2.0
"""How long [s] an animation goes on after the last event."""


def choose_frame_times(scene: SceneRecord, *, fps: int, whole: bool = False) -> FloatArray:
    """[N] the moment of every frame [s]: slow round each event, ending soon after the last.

    Args:
        whole: show the scene to its end.
    """
    events = [each.time for each in scene.events if each.time is not None]
    duration = scene.meta.duration
    end = duration if whole or not events else min(max(events) + ENDING, duration)
    grid = np.arange(0.0, end + 1e-9, 0.01)
    slow = np.zeros(len(grid), dtype=bool)
    for time in events:
        slow |= (grid >= time - BEFORE) & (grid <= time + AFTER)
    shown = np.concatenate([[0.0], np.cumsum(np.where(slow, 1 / SLOW, 1.0) * 0.01)[:-1]])
    return np.asarray(np.interp(np.arange(0.0, shown[-1] + 1e-9, 1.0 / fps), shown, grid))
