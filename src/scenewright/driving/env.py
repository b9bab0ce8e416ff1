"""The drive as a `gymnasium` environment."""

from __future__ import annotations

from functools import partial
from typing import Any, SupportsFloat

import numpy as np

from scenewright.errors import InputError

try:
    import gymnasium
except ImportError:
    raise InputError(
        "driving as an environment needs gymnasium: pip install 'scenewright[drive]'"
    ) from None

from scenewright.driving.ego_motion import ActionMode, find_action_bounds, read_action
from scenewright.driving.observation import FARTHEST, RASTER_SHAPE, SHAPES, Observation, Observer
from scenewright.driving.reactive import Temper
from scenewright.driving.scenario import Scenario
from scenewright.driving.traffic import OthersMode, make_traffic
from scenewright.driving.world import World, start_world
from scenewright.scene.base import FloatArray

COLLISION_REWARD = -1.0


class DriveEnv(gymnasium.Env[Observation, FloatArray]):
    """One scenario with the ego left to the actions.

    Observations: `driving.observation.SHAPES`. Actions: `drive.ego_motion.find_action_bounds`.
    Reward: the share of its route that the ego came ahead in the step, -1 for a collision. A
    drive terminates at a collision or at the end of the route, and is truncated at the scene's end.

    Attributes:
        scenario: what is driven; world: the drive in progress.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        scenario: Scenario,
        *,
        others: OthersMode = "replay",
        temperament: Temper = "obedient",
        mode: ActionMode = "bicycle",
        raster: bool = False,
        seed: int = 0,
        render_mode: str | None = None,
    ) -> None:
        self.scenario, self.render_mode = scenario, render_mode
        self._mode, self._seed = mode, seed
        self._make_traffic = partial(make_traffic, others, temperament)
        self._observer = Observer(scenario, raster=raster)
        low, high = (bound.astype(np.float32) for bound in find_action_bounds(mode))
        self.action_space: Any = gymnasium.spaces.Box(low, high, dtype=np.float32)
        spaces: dict[str, gymnasium.spaces.Space[Any]] = {
            name: gymnasium.spaces.Box(-FARTHEST, FARTHEST, shape, dtype=np.float32)
            for name, shape in SHAPES.items()
        }
        if raster:
            spaces["raster"] = gymnasium.spaces.Box(0, 255, RASTER_SHAPE, dtype=np.uint8)
        self.observation_space: Any = gymnasium.spaces.Dict(spaces)
        self.world: World | None = None

    def reset(
        self,
        *,
        seed: int | None = None,
        options: dict[str, Any] | None = None,  # noqa: ARG002
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin the drive anew; without a seed the one of the environment is used."""
        super().reset(seed=seed)
        rng = np.random.default_rng(self._seed if seed is None else seed)
        self.world = start_world(self.scenario, self._make_traffic(), self._mode, rng=rng)
        return self._observer.observe(self.world), self._build_info(self.world)

    def step(
        self, action: FloatArray
    ) -> tuple[Observation, SupportsFloat, bool, bool, dict[str, Any]]:
        """Advance the simulation by 0.1 s.

        Raises:
            InputError: no drive is in progress, or that is no action (`ego_motion.read_action`).
        """
        world = self.world
        if world is None or world.end is not None:
            raise InputError("call reset before step: no drive is in progress")
        before = world.ego.progress
        world.advance(read_action(action, self._mode))
        length = max(self.scenario.paths[self.scenario.ego].length, 1.0)
        reward = (world.ego.progress - before) / length
        reward += COLLISION_REWARD if world.hit is not None else 0.0
        terminated = world.end in ("collision", "arrived")
        seen = self._observer.observe(world)
        return seen, float(reward), terminated, world.end == "over", self._build_info(world)

    def render(self) -> Any:
        """The bird's-eye picture [96, 96, 3]."""
        from scenewright.driving.observation import draw_raster

        if self.world is None or self.render_mode is None:
            return None
        return draw_raster(self._observer.observe(self.world)).transpose(1, 2, 0)

    def _build_info(self, world: World) -> dict[str, Any]:
        hit = None if world.hit is None else self.scenario.names[world.hit]
        return {"time": round(world.step * self.scenario.step, 3), "end": world.end, "hit": hit}
