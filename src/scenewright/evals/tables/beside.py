"""Windows of a corpus beside the scenes of a dataset: as long, and with as many vehicles.

The spread of speeds and the times of events depend on the number of agents and the length of the
scene: quiet hours of a corpus have 0.6 of the spread of speed that all of its hours have together.
What a dataset is compared with therefore has to be cut to its scenes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scenewright.evals.realism.scenes import SceneTracks
from scenewright.scene.base import FloatArray


def match_windows(
    scenes: Sequence[SceneTracks], windows: Sequence[SceneTracks], *, least: int
) -> list[SceneTracks]:
    """Find for every scene a window with as many vehicles, cut to the scene's length.

    Where no window has as many, one whose number is nearest; of several, the one that was taken
    least often. Few scenes get several windows each, so that there are at least `least` in all.
    """
    if not (scenes and windows):
        return []
    starts = [_list_starts(window) for window in windows]
    taken = np.zeros(len(windows), dtype=np.intp)
    found = []
    for scene in [*scenes] * -(-least // len(scenes)):
        length = max((user.track.end for user in scene.users), default=0.0)
        seen = np.array([np.searchsorted(each, length) for each in starts])
        number = int(np.lexsort((taken, np.abs(seen - len(_list_starts(scene)))))[0])
        taken[number] += 1
        found.append(shorten_scene(windows[number], length))
    return found


def shorten_scene(scene: SceneTracks, length: float) -> SceneTracks:
    """Cut a scene to its first seconds; agents with less than two samples are left out."""
    users = []
    for user in scene.users:
        track = user.track
        kept = int(np.floor((length - track.start) / track.step + 1e-6)) + 1
        if kept > 1 and len(track.xy) > 1:
            cut = replace(track, xy=track.xy[:kept], heading=track.heading[:kept])
            users.append(replace(user, track=cut))
    return replace(scene, users=tuple(users))


def _list_starts(scene: SceneTracks) -> FloatArray:
    """List when each vehicle is first seen [s], sorted."""
    first = [user.track.start for user in scene.users if user.shape.type == "vehicle"]
    return np.sort(np.array(first, dtype=np.float64))
