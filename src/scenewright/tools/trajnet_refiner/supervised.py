"""Training as the pipeline uses the network: with places to be at, and when, all along the way.

In a scene the edited prior supervises: every agent has a row of waypoints on it, each due at its
time. Here the same rows are drawn from recorded tracks, so that what is learned is how people get
from one to the next: when they brake and start, how even their speed is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from torch import Tensor

from scenewright.tools.track_io import Recording, cut_windows
from scenewright.tools.trajnet_refiner.config import CLASSES
from scenewright.tools.trajnet_refiner.model import Scenes
from scenewright.tools.trajnet_refiner.train import Recipe
from scenewright.tools.trajnet_refiner.windows import Window, build_batches

_STANDING = 0.25
"""Weight of agents that stand all the while: there is little to learn from them."""
_STANDS = 0.5
"""Who gets no further than that [m] in a window stands."""
RECIPE = Recipe(
    epochs=12, agents=192, rate=3e-3, likelihood=0.1, stretch=0.1, unseen=0.1, goals=0.9
)
"""How the networks of bundles are trained."""


def cut_recorded_windows(
    recordings: Sequence[Recording], *, observed: int, predicted: int, stride: int | None = None
) -> list[Window]:
    """Stretches of recordings for training, with a second horizon behind the first for waypoints.

    Args:
        stride: network steps from one stretch's start to the next; None for `predicted`, so that
            every moment is predicted once.
    """
    steps, every = observed + 2 * predicted, 4
    windows = []
    for recording in recordings:
        for cut in cut_windows(
            recording, steps=steps, every=every, stride=every * (stride or predicted), least_whole=0
        ):
            now = cut.present[:, observed - 1] & cut.present[:, observed]
            if not now.any():
                continue
            xy = np.where(cut.present[now][..., None], cut.xy[now], np.nan)
            kinds = [recording.agents[i].shape.type for i in cut.members[now]]
            way = np.nanmax(xy, axis=1) - np.nanmin(xy, axis=1)
            ends = [recording.agents[i].track.xy[-1] for i in cut.members[now]]
            windows.append(
                Window(
                    xy,
                    np.array([CLASSES.index(kind) for kind in kinds], dtype=np.int64),
                    np.array(ends),
                    np.where(way.max(axis=1) < _STANDS, _STANDING, 1.0),
                )
            )
    return windows


def reverse_windows(windows: Sequence[Window], *, observed: int) -> list[Window]:
    """The same stretches backwards in time, as far as agents are seen at the present then.

    People who walk backwards keep clear of one another as they did.
    """
    turned = []
    for window in windows:
        xy = window.xy[:, ::-1]
        now = ~np.isnan(xy[:, observed - 1 : observed + 1]).any(axis=(1, 2))
        if now.any():
            xy = np.ascontiguousarray(xy[now])
            turned.append(Window(xy, window.classes[now], window.xy[now, 0], window.weight[now]))
    return turned


def build_supervised_batches(
    windows: Sequence[Window], **how: Any
) -> Iterator[tuple[Scenes, Tensor, Tensor]]:
    """As `build_batches`, for windows with a second horizon, a share of them with waypoints."""
    return build_batches(windows, rows=True, **how)
