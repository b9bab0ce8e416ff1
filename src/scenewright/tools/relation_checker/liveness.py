"""Agents that stand without a reason: on green, through a walk phase, or all the time."""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np

from scenewright.scene.events import Finding
from scenewright.tools.relation_checker.events import SceneObservation
from scenewright.tools.relation_checker.footprints import compute_offsets
from scenewright.tools.relation_checker.trajectory import Trajectory, find_runs
from scenewright.tools.relation_checker.yielding import STANDING

MOST_ON_GREEN = 4.0
"""How long an agent may stand on green with nobody before it [s]."""
LEAST_WAY = 1.0
"""An agent that is there for longer than that and moves less [m] never moves."""
AT_LINE = 4.0
"""Whose front is no farther than this from the line or kerb [m] stands at it."""
_AHEAD = {"vehicle": (15.0, 3.0), "pedestrian": (6.0, 1.5)}
"""How far ahead, and how far beside its course, another agent is a reason to stand [m]."""


def check_liveness(
    observed: SceneObservation, *, background: Container[int]
) -> tuple[Finding, ...]:
    """Agents of the background that stand where traffic would move; wrecks may.

    Args:
        background: their ids.
    """
    hits = [event for event in observed.events if event.type == "collision"]
    wrecks = {agent for each in hits for agent in (each.from_, each.to)}
    found, lights = [], observed.lights
    for track in observed.tracks:
        if track.id not in background or track.id in wrecks:
            continue
        if track.end - track.start > MOST_ON_GREEN and track.s[-1] < LEAST_WAY:
            found.append(_report("never_moves", track, track.start, "never moves"))
            continue
        for begin, end in find_standstills(track):
            if end - begin <= MOST_ON_GREEN:
                continue
            light, away = lights.find_light_after(track, end)
            if light is None or away > AT_LINE:
                continue
            green = next((
                first for start, stop in lights.list_green_spans(light)
                for first, last in [(max(start, begin), min(stop, end))]
                if last - first > MOST_ON_GREEN
                and not _is_blocked(track, first, last, observed.tracks)
            ), None)  # fmt: skip
            if green is not None:
                rule = "stands_on_green" if track.is_vehicle else "misses_walk_phase"
                detail = f"stands on green from {green:.1f} s on, with nobody before it"
                found.append(_report(rule, track, green, detail))
    return tuple(found)


def _report(rule: str, track: Trajectory, time: float, detail: str) -> Finding:
    words = f"{track.type} {track.id} {detail}"
    return Finding(rule=rule, agents=(track.id,), time=round(time, 3), detail=words)


def _is_blocked(track: Trajectory, first: float, last: float, tracks: Sequence[Trajectory]) -> bool:
    """Whether another agent is before one that stands, at any time of a span [s]."""
    k = int(np.searchsorted(track.times, first))
    ahead, aside = _AHEAD["vehicle" if track.is_vehicle else "pedestrian"]
    for other in tracks:
        there = (other.times >= first) & (other.times <= last)
        if other.id == track.id or not there.any():
            continue
        along, beside = compute_offsets(other.xy[there], track.xy[k], track.heading[k])
        if np.any((along > 0.0) & (along < ahead + track.nose) & (np.abs(beside) < aside)):
            return True
    return False


LEAST_STAND = 0.5
"""A shorter standstill is none [s]."""


def find_standstills(track: Trajectory) -> list[tuple[float, float]]:
    """From when to when an agent stands [s], in order."""
    spans = [
        (float(track.times[begin]), float(track.times[end - 1]))
        for begin, end in find_runs(track.speed <= STANDING)
    ]
    return [span for span in spans if span[1] - span[0] >= LEAST_STAND - 1e-6]
