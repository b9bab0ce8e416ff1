"""`scenewright.driving`: a text or a scene as an environment to drive in."""

from __future__ import annotations

import re
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenewright.driving.ego_motion import ACTION_MODES, ActionMode
from scenewright.driving.policies import BUILT_IN, Policy
from scenewright.driving.reactive import Temper
from scenewright.driving.scenario import Scenario, build_scenario
from scenewright.driving.traffic import OthersMode, make_traffic
from scenewright.errors import InputError
from scenewright.graph.arguments import DEFAULT_INTERSECTION
from scenewright.graph.run import Scene, synthesize
from scenewright.graph.scene_files import load_scene
from scenewright.intersections import load_map
from scenewright.scene.record import SceneRecord
from scenewright.time_limit import DEFAULT_LIMIT

if TYPE_CHECKING:
    import gymnasium

    from scenewright.driving.env import DriveEnv

Drivable = Scene | SceneRecord | str | Path


def drive(
    text_or_scene: Drivable,
    *,
    ego: str | None = None,
    others: OthersMode = "replay",
    temperament: Temper = "obedient",
    actions: ActionMode = "bicycle",
    raster: bool = False,
    seed: int = 0,
    intersection: str = DEFAULT_INTERSECTION,
) -> DriveEnv:
    """A `gymnasium.Env` in which the ego of a scene is driven by actions.

    Args:
        text_or_scene: an instruction, a scene, or the path of a scene.json or of its folder.
        ego: agent to drive, such as `vehicle-1`; None: the first vehicle that takes part.
        others: `replay`, what the scene says; `reactive`, they brake and give way to the ego;
            `resolve`, the agents bound to the ego are re-timed so that the asked conflict comes
            about for this ego.
        temperament: of reactive others: `obedient`, `hasty` or `careless`.
        actions: `bicycle` [2] acceleration [m/s^2] and steering [rad]; `route` [1] acceleration;
            `waypoints` [6, 2] places after 0.5, 1.0, ... 3.0 s in the ego's frame [m].
        raster: add a bird's-eye picture to the observation.
        seed: of the scene made from a text, and of the reactions of the others.
        intersection: where a scene made from a text is.

    Raises:
        InputError: nothing to drive there, no such ego or mode, or gymnasium is not installed.
        Unsatisfiable: no scene can be made of the text.
    """
    from scenewright.driving.env import DriveEnv

    make_traffic(others, temperament)  # refuses what there is none of before a scene is made
    if actions not in ACTION_MODES:
        raise InputError(f"actions are {', '.join(ACTION_MODES)}, not {actions[:40]!r}")
    scenario = load_scenario(text_or_scene, ego=ego, seed=seed, intersection=intersection)
    return DriveEnv(
        scenario, others=others, temperament=temperament, mode=actions, raster=raster, seed=seed
    )


def drive_many(scenes: Sequence[Drivable], **options: Any) -> gymnasium.vector.SyncVectorEnv:
    """Several scenes stepped together, each begun anew when it is over; options as of `drive`.

    Raises:
        InputError: as `drive`.
    """
    envs = [drive(scene, **options) for scene in scenes]
    from gymnasium.vector import SyncVectorEnv

    return SyncVectorEnv([lambda env=env: env for env in envs])  # type: ignore[misc]


def load_scenario(
    text_or_scene: Drivable,
    *,
    ego: str | None = None,
    seed: int = 0,
    intersection: str = DEFAULT_INTERSECTION,
    time_limit: float = DEFAULT_LIMIT,
) -> Scenario:
    """A text, made within `time_limit` [s], or a scene as arrays; see `drive`."""
    if isinstance(text_or_scene, SceneRecord):
        record = text_or_scene
    elif isinstance(text_or_scene, Scene):
        record = text_or_scene.record
    elif isinstance(text_or_scene, Path) or _names_scene(text_or_scene):
        record = load_scene(text_or_scene)
    else:
        record = synthesize(
            text_or_scene, seed=seed, intersection=intersection, time_limit=time_limit
        ).record
    return build_scenario(record, load_map(record.meta.intersection), ego=ego)


def _names_scene(text: str) -> bool:
    """Whether a text is the path of something rather than an instruction."""
    if text.endswith(".json") or ("/" in text and not re.search(r"\s", text.strip())):
        return True
    try:
        return bool(text.strip()) and Path(text).exists()
    except OSError:
        return False


def load_policy(name: str) -> Policy:
    """A built-in ego by its name, or an own one as `module:Class`.

    Raises:
        InputError: there is none so named, or it cannot be made.
    """
    if name in BUILT_IN:
        return BUILT_IN[name]()
    module, _, attribute = name.partition(":")
    if not attribute:
        raise InputError(f"no policy {name[:60]!r}; {', '.join(BUILT_IN)}, or module:Class")
    try:
        make = getattr(import_module(module), attribute)
    except Exception as error:
        raise InputError(f"cannot import the policy {name[:60]}: {_say(error)}") from error
    try:
        policy: Policy = make()
    except Exception as error:
        raise InputError(f"cannot make the policy {name[:60]}: {_say(error)}") from error
    missing = [each for each in ("mode", "reset", "act") if not hasattr(policy, each)]
    if missing:
        raise InputError(f"the policy {name[:60]} has no {missing[0]}; see the Policy protocol")
    return policy


def _say(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())[:160]}"
