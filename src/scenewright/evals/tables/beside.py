"""Windows of a corpus beside the scenes of a dataset: as long, and with as many vehicles.

The spread of speeds and the times of events depend on the number of agents and the length of the
scene: quiet hours of a corpus have 0.6 of the spread of speed that all of its hours have together.
What a dataset is compared with therefore has to be cut to its scenes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.realism.scenes import SceneTracks
from scenewright.scene.base import FloatArray
from scenewright.tools.relation_checker import RoadUser


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
        length, vehicles = _get_length(scene), len(_list_starts(scene))
        number = _find_nearest(starts, length, vehicles, taken)
        taken[number] += 1
        found.append(shorten_scene(windows[number], length))
    return found


def _find_nearest(
    starts: Sequence[FloatArray], length: float, vehicles: int, taken: NDArray[np.intp]
) -> int:
    seen = np.array([np.searchsorted(each, length) for each in starts])
    return int(np.lexsort((taken, np.abs(seen - vehicles)))[0])


def shorten_scene(scene: SceneTracks, length: float) -> SceneTracks:
    """Cut a scene to its first seconds; agents with less than two samples are left out."""
    users = (_shorten_user(user, length) for user in scene.users)
    return replace(scene, users=tuple(user for user in users if len(user.track.xy) > 1))


def _shorten_user(user: RoadUser, length: float) -> RoadUser:
    track = user.track
    kept = max(int(np.floor((length - track.start) / track.step + 1e-6)) + 1, 0)
    cut = replace(track, xy=track.xy[:kept], heading=track.heading[:kept])
    return replace(user, track=cut)


def _list_starts(scene: SceneTracks) -> FloatArray:
    """List when each vehicle is first seen [s], sorted."""
    first = [user.track.start for user in scene.users if user.shape.type == "vehicle"]
    return np.sort(np.array(first, dtype=np.float64))


def _get_length(scene: SceneTracks) -> float:
    return max((user.track.end for user in scene.users), default=0.0)
