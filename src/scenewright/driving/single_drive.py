"""One drive of a policy from begin to end, kept also where the policy fails."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from scenewright.driving.ego_motion import ACTION_MODES, read_action
from scenewright.driving.observation import Observer
from scenewright.driving.policies import Policy
from scenewright.driving.reactive import Temper
from scenewright.driving.scenario import Scenario
from scenewright.driving.traffic import OthersMode, make_traffic
from scenewright.driving.world import TrafficModel, World, list_ego_points, start_world
from scenewright.errors import InputError
from scenewright.time_limit import raise_after

DEFAULT_STEP_LIMIT = 5.0
"""Longest that a policy may take for one answer [s]."""


class PolicyError(Exception):
    """A policy raised or hung; the message is a line."""


@dataclass(frozen=True, eq=False)
class Drive:
    """A drive that is over.

    Attributes:
        world: the run, up to where it ended.
        fault: what the policy did wrong, one line; None if nothing.
        policy: name of the policy; others: how the others moved; seed: of the drive.
        temperament: of the others.
        obstacles: of a rehearsed drive, by name of each agent that the ego is to meet, why physics
            does not allow it; None: it does.
        tries: how many times the policy drove until this drive was kept; None: not rehearsed.
    """

    world: World
    policy: str
    others: OthersMode
    seed: int
    fault: str | None = None
    obstacles: Mapping[str, str | None] = field(default_factory=dict)
    tries: int | None = None
    temperament: Temper = "obedient"

    @property
    def scenario(self) -> Scenario:
        """What was driven."""
        return self.world.scenario

    @property
    def digest(self) -> str:
        """SHA-256 of all states: the same seed and policy give the same."""
        found = hashlib.sha256(list_ego_points(self.world.history).tobytes())
        for now in self.world.record:
            found.update(np.column_stack([now.xy, now.heading, now.speed, now.present]).tobytes())
        return found.hexdigest()


def drive_once(
    scenario: Scenario,
    policy: Policy,
    *,
    name: str = "policy",
    others: OthersMode = "replay",
    temperament: Temper = "obedient",
    seed: int = 0,
    step_limit: float = DEFAULT_STEP_LIMIT,
    traffic: TrafficModel | None = None,
) -> Drive:
    """Drive a scenario with a policy, one time; `run_drive` rehearses as well.

    Args:
        traffic: what moves the others in the way `others` names; None: a new model of that way.
        step_limit: longest that the policy may take for one answer [s]; kept in the main thread
            of a process on Unix.

    Returns:
        The drive. Where the policy fails it ends there, and `fault` says how in one line.

    Raises:
        InputError: the policy gives no such actions, or others move in no such way.
    """
    mode = getattr(policy, "mode", None)
    if mode not in ACTION_MODES:
        raise InputError(f"the policy's mode must be one of {', '.join(ACTION_MODES)}")
    model = make_traffic(others, temperament) if traffic is None else traffic
    world = start_world(scenario, model, mode, rng=np.random.default_rng(seed))
    observer = Observer(scenario)
    fault: str | None = None
    try:
        _ask(lambda: policy.reset(scenario, seed), step_limit, "reset")
        while world.end is None:
            seen = observer.observe(world)
            action = _ask(lambda: policy.act(seen), step_limit, "act")  # noqa: B023
            world.advance(read_action(action, mode))
    except (PolicyError, InputError) as error:
        world.end, fault = "policy_failed", f"at {world.step * scenario.step:.1f} s {error}"
    return Drive(world, name, others, seed, fault, temperament=temperament)


def _ask(call: Callable[[], Any], limit: float, method: str) -> Any:
    """What a method of the policy returns, within the time.

    Raises:
        PolicyError: it raised or took too long.
    """
    try:
        with raise_after(limit, PolicyError(f"{method} took more than {limit:g} s")):
            return call()
    except PolicyError:
        raise
    except (Exception, SystemExit) as error:
        words = " ".join(str(error).split())[:200]
        raise PolicyError(f"{method} raised {type(error).__name__}: {words}") from error
