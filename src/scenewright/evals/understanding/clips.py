"""Clips: scenes cut so that every event in them can be foreseen, and the cut betrays none.

A clip lasts 10 s. It begins 2 to 6 s before the conflict of the scene's event can be seen coming,
and both parties are in view within its first second. Every other event lies outside of it or fits
it in the same way, so that all of them count. For each clip with an event one without is cut, from
any scene: two road users are in view within the first second and come near one another, nothing
happens, and as many agents are to be seen. Neither lengths nor counts say which clip is which.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np

from scenewright.evals.understanding.cases import RELATIONS, SceneCase, hash_scene, read_case
from scenewright.evals.understanding.scoring import AGENT_CLASSES
from scenewright.scene.base import RIDERS, FloatArray
from scenewright.scene.events import Event
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker import (
    build_trajectories,
    compute_path_ttc,
    find_common_times,
    read_users,
)

LENGTH = 10.0
"""Length of a clip [s]."""
BEFORE = (2.0, 6.0)
"""A clip begins so long before the conflict can be seen coming [s]."""
IN_VIEW = 1.0
"""Both parties are in view within so much of the clip's beginning [s]."""
SOONEST = 5.0
"""No event happens earlier in a clip [s]: it is to be foreseen in every window, not watched."""
THREAT, LOOK_BACK = 3.0, 6.0
"""A conflict can be seen coming from the first path TTC below this, at most so early [s]."""
OVER = 2.0
"""An event is over so long after its time [s]."""
NEAR = 10.0
"""Two agents that come this near one another [m] are the parties of a normal clip."""
_COUNTED = (0.0, IN_VIEW, 4.0)
"""The agents in view by these times [s] are counted, class by class."""
_UNLIKE = 2
"""A normal clip may differ by so many in all counts together, and in none of riders."""
_GRID = 5
"""Normal clips begin at every fifth sample."""


@dataclass(frozen=True)
class ForeseenEvent:
    """An event with the time from which it can be seen coming [s]."""

    event: Event
    decided: float

    def lies_outside(self, start: float) -> bool:
        """Whether a clip that begins then [s] has nothing of it."""
        return self.decided > start + LENGTH or self.event.time + OVER < start


@dataclass(frozen=True, eq=False)
class ClipSource:
    """A scene to cut clips from.

    Attributes:
        events: collisions, near misses and yields of all agents; named: the gravest asked for.
        spans: [A, 2] when each agent is there [s]; classes: [A] its class.
        near: ids of two, not both on foot, and at which `_GRID`-th samples they are near [s].
    """

    case: SceneCase
    events: tuple[ForeseenEvent, ...]
    named: ForeseenEvent | None
    spans: dict[int, tuple[float, float]]
    near: tuple[tuple[int, int, FloatArray], ...]


def read_source(folder: Path) -> ClipSource:
    """Read a scene, and measure when its events can be foreseen and which agents come near one
    another.

    Raises:
        InputError: a file is missing or is not what it should be.
    """
    case = read_case(folder)
    tracks = {track.id: track for track in build_trajectories(read_users(case.record))}
    found = [e for e in (*case.proof.events, *case.proof.incidental) if e.type in RELATIONS]
    foreseen = []
    for event in found:
        # It can be seen coming from a path TTC below 3 s, or from slowing for it.
        one, two = tracks[event.from_], tracks[event.to]
        times = find_common_times(one, two)
        times = times[(times >= event.time - LOOK_BACK) & (times <= event.time + 1e-6)]
        decided = min(float(event.evidence.get("begins_to_slow", event.time)), event.time)
        if len(times):
            ttc = compute_path_ttc(one, two, times=times, horizon=THREAT)
            decided = min([decided, *times[ttc < THREAT][:1].tolist()])
        foreseen.append(ForeseenEvent(event, decided))
    events = tuple(foreseen)
    asked = [e for e in events if e.event in case.proof.events]
    named = min(asked, key=lambda e: RELATIONS.index(e.event.type), default=None)
    spans = {k: (float(t.times[0]), float(t.times[-1])) for k, t in tracks.items()}
    near = []
    for one, two in combinations(tracks.values(), 2):
        times = find_common_times(one, two)[::_GRID]
        if len(times) and (one.is_vehicle or two.is_vehicle):
            apart = np.hypot(*(one.at(times)[0] - two.at(times)[0]).T)
            if (apart < NEAR).any():
                near.append((one.id, two.id, times[apart < NEAR]))
    return ClipSource(case, events, named, spans, tuple(near))


def list_event_starts(source: ClipSource) -> list[float]:
    """Times [s] at which a clip of the named event may begin, by samples."""
    if source.named is None:
        return []
    decided = source.named.decided
    last = min(decided - BEFORE[0], source.case.record.meta.duration - LENGTH)
    found = []
    for start in _list_times(max(decided - BEFORE[1], 0.0), last):
        inside = [event for event in source.events if not event.lies_outside(start)]
        if all(
            _are_in_view(source, (each.event.from_, each.event.to), start)
            and each.decided >= start + BEFORE[0]
            and start + SOONEST <= each.event.time <= start + LENGTH
            for each in inside
        ):
            found.append(start)
    return found


def list_normal_starts(source: ClipSource) -> list[float]:
    """Times [s] at which a clip in which nothing happens may begin."""
    starts = _list_times(0.0, source.case.record.meta.duration - LENGTH)[::_GRID]
    return [
        start
        for start in starts
        if all(event.lies_outside(start) for event in source.events)
        and any(
            _are_in_view(source, (one, two), start)
            and ((times >= start + SOONEST) & (times <= start + LENGTH)).any()
            for one, two, times in source.near
        )
    ]


def _list_times(first: float, last: float) -> list[float]:
    """Samples from the first to the last time [s]."""
    low, high = int(np.ceil(first / STEP - 1e-6)), int(np.floor(last / STEP + 1e-6))
    return [round(STEP * k, 3) for k in range(low, high + 1)]


def _are_in_view(source: ClipSource, agents: tuple[int, int], start: float) -> bool:
    spans = [source.spans[agent] for agent in agents]
    return all(first <= start + IN_VIEW + 1e-6 and last >= start + IN_VIEW for first, last in spans)


def count_agents(source: ClipSource, start: float) -> FloatArray:
    """[C] how many agents of each class are in view by the times that are counted.

    A rider counts for more than clips may differ by: few riders are in no event.
    """
    types = {agent.id: agent.type for agent in source.case.record.agents}
    weights = {kind: 1 + _UNLIKE * (kind in RIDERS) for kind in AGENT_CLASSES}
    seen = [
        [types[agent] for agent, (first, last) in source.spans.items()
         if first <= start + by + 1e-6 and last >= start]
        for by in _COUNTED
    ]  # fmt: skip
    return np.array(
        [weights[kind] * each.count(kind) for each in seen for kind in AGENT_CLASSES],
        dtype=np.float64,
    )


def cut_clips(sources: Iterable[ClipSource]) -> list[SceneCase]:
    """Cut a clip with an event and one alike without, as often as scenes allow, by their codes.

    A scene gives one clip with an event and one without at most; a clip with an event for which no
    other scene has one alike is left out.
    """
    listed = sorted(sources, key=lambda source: source.case.code)
    # Clips in which nothing happens, of which each scene gives one.
    normal = {
        n: (source, starts, np.array([count_agents(source, start) for start in starts]))
        for n, source in enumerate(listed)
        if (starts := list_normal_starts(source))
    }
    found = []
    for source in listed:
        starts = list_event_starts(source)
        if not starts or source.named is None or not normal:
            continue
        # One of them, by a hash of the scene's id.
        start = starts[int(hash_scene(f"{source.case.id} begins")[:8], 16) % len(starts)]
        counts = count_agents(source, start)
        apart = {n: np.abs(known - counts).sum(axis=1) for n, (_, _, known) in normal.items()}
        nearest = min(normal, key=lambda n: float(apart[n].min()))
        k = int(apart[nearest].argmin())
        if apart[nearest][k] <= _UNLIKE:
            other, others, _ = normal.pop(nearest)
            named = source.named.event.type
            found += [cut_clip(source, start, named=named), cut_clip(other, others[k])]
    return sorted(found, key=lambda case: case.code)


def cut_clip(source: ClipSource, start: float, named: str | None = None) -> SceneCase:
    """Cut the clip that begins at `start` [s]; its times count from there."""
    record, case = source.case.record, source.case
    agents = []
    for agent in record.agents:
        first = max(int(np.ceil((start - agent.spawn_time) / STEP - 1e-6)), 0)
        spawn = round(agent.spawn_time + STEP * first - start, 3)
        last = first + int(np.floor((LENGTH - spawn) / STEP + 1e-6)) + 1
        if first < len(agent.trajectory) and last > first:
            kept = {
                "trajectory": agent.trajectory[first:last],
                "heading": agent.heading[first:last],
            }
            agents.append(agent.model_copy(update={"spawn_time": spawn, **kept}))
    signals = []
    for light in record.signals:
        if light.end > start and light.start < start + LENGTH:
            begins, ends = max(light.start - start, 0.0), min(light.end - start, LENGTH)
            span = {"start": round(begins, 3), "end": round(ends, 3)}
            signals.append(light.model_copy(update=span))
    meta = record.meta.model_copy(update={"duration": LENGTH})
    name = f"{case.id} from {start:.1f} s"
    cut = record.model_copy(
        update={"meta": meta, "agents": tuple(agents), "signals": tuple(signals)}
    )
    shifted = [
        event.event.model_copy(update={"time": round(event.event.time - start, 3)})
        for event in source.events
        if start <= event.event.time <= start + LENGTH
    ]
    proof = case.proof.model_copy(update={"events": tuple(shifted), "incidental": ()})
    return replace(case, id=name, record=cut, proof=proof, named=named)
