"""What a scene that is read from a file must keep to, so that no reader fills the memory with it.

These are no claims about traffic, which the checker judges; whatever is within them can be drawn,
exported and checked.
"""

from __future__ import annotations

from itertools import chain

from scenewright.scene.record import SceneRecord
from scenewright.scene.social import MOST_RELATIONS

STEPS = (0.001, 1.0)
"""Shortest and longest time between two samples [s]."""
MOST_STEPS = 10_000
"""Samples from the start of a scene to its end."""
FARTHEST = 20_000.0
"""Positions are within this of the map's origin [m]; maps reach half as far."""
MOST_BOUND = 1_000
"""Relations, ties and sights of a scene, however many pairs of agents it has."""
MOST_STANDING = 100
"""Objects of a scene; a request places six at most."""


def find_excess(record: SceneRecord) -> str | None:
    """Say what of a scene is out of bounds, and how to mend it; None if nothing is."""
    meta, count = record.meta, len(record.agents)
    pairs = min(max(count * (count - 1) // 2, MOST_RELATIONS), MOST_BOUND)
    for name, most in (
        *(("relations", pairs), ("ties", pairs), ("sights", pairs)),
        ("objects", MOST_STANDING),
    ):
        if (found := len(getattr(record, name))) > most:
            return f"it has {found} {name}; a scene of {count} agents has at most {most}"
    if not STEPS[0] <= meta.step <= STEPS[1]:
        return f"meta.step must be {STEPS[0]} to {STEPS[1]:g} seconds, not {meta.step:g}"
    ends = [abs(agent.spawn_time) + meta.step * len(agent.trajectory) for agent in record.agents]
    for last in (meta.duration, *ends):
        if not last <= MOST_STEPS * meta.step:  # which NaN is not either
            return (
                f"it would last {last:.4g} s in steps of {meta.step:g} s; a scene has at most "
                f"{MOST_STEPS} steps, and times are seconds since its start"
            )
    for event in record.events:
        if event.time is not None and not 0.0 <= event.time <= MOST_STEPS * meta.step:
            return f"an event happens at {event.time:.4g} s; times are seconds since its start"
    for agent in record.agents:
        if len(agent.trajectory) != len(agent.heading):
            return (
                f"agent {agent.id} has {len(agent.trajectory)} positions but {len(agent.heading)} "
                "headings; give one each"
            )
        points = chain(agent.trajectory, agent.waypoints, (agent.goal,))
        if not all(abs(value) <= FARTHEST for value in chain.from_iterable(points)):
            return (
                f"agent {agent.id} has a position further than {FARTHEST:g} m from the middle of "
                "the map; positions are metres in the map's frame"
            )
    return None
