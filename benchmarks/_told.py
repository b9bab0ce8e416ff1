"""What each request of `robustness.py` says, set down by hand, and whether a scene is that.

The gate compares a scene with what the planner understood; this compares it with the words.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from scenewright.graph.run import Scene

OPPOSITE = {"north": "south", "south": "north", "east": "west", "west": "east"}
LEFT = {"north": "east", "east": "south", "south": "west", "west": "north"}
"""What lies to the left of who comes from a side."""

SYMMETRIC = ("collision", "near_miss")


@dataclass(frozen=True)
class Told:
    """What a request says.

    Attributes:
        events: type, from and to of every event, agents as v1, p1, ...
        kind: of the collision; cause: of the first event, and by whom.
        entries: how that of v2 lies to that of v1: same, opposite, lateral or left.
        moves: movement by agent.
        red: everybody who runs a red light; None where the text leaves that open.
    """

    events: tuple[str, ...] = ()
    kind: str | None = None
    cause: tuple[str, str] | None = None
    entries: str | None = None
    moves: dict[str, str] = field(default_factory=dict)
    red: tuple[str, ...] | None = None


STRIKE = "pedestrian_strike"
TOLD = {
    "strike, through": Told(("collision v1 p1",), STRIKE, moves={"v1": "straight"}),
    "strike, left turn": Told(("collision v1 p1",), STRIKE, moves={"v1": "left"}),
    "strike, right turn": Told(("collision v1 p1",), STRIKE, moves={"v1": "right"}),
    "strike, jaywalker": Told(("collision v1 p1",), STRIKE, moves={"p1": "jaywalking"}),
    "angle": Told(("collision v1 v2",), "angle"),
    "left turn": Told(
        ("collision v1 v2",), "left_turn", entries="opposite", moves={"v1": "left"}
    ),
    "rear-end": Told(("collision v1 v2",), "rear_end", entries="same"),
    "head-on": Told(("collision v1 v2",), "head_on", entries="opposite"),
    "sideswipe": Told(("collision v1 v2",), "sideswipe", entries="same"),
    "near miss, pedestrian": Told(("near_miss v1 p1",)),
    "near miss, vehicle": Told(("near_miss v1 v2",)),
    "near miss, pedestrian, TTC": Told(("near_miss v1 p1",)),
    "near miss, vehicle, TTC": Told(("near_miss v1 v2",)),
    "near miss, hard braking": Told(("near_miss v1 p1",), cause=("late_brake", "v1")),
    "strike, impact speed": Told(("collision v1 p1",), STRIKE),
    "angle, impact speed": Told(("collision v1 v2",), "angle"),
    "rear-end, impact speed": Told(("collision v1 v2",), "rear_end", entries="same"),
    "angle, point of impact": Told(("collision v1 v2",)),
    "strike, point of impact": Told(("collision v1 p1",), STRIKE),
    "yield, PET": Told(("yielding v1 p1",)),
    "yield, vehicle to pedestrian": Told(("yielding v1 p1",)),
    "yield, pedestrian to vehicle": Told(("yielding p1 v1",)),
    "yield, left turn to oncoming": Told(
        ("yielding v1 v2",), entries="opposite", moves={"v1": "left"}
    ),
    "yield, right turn": Told(("yielding v1 v2",), entries="lateral", moves={"v1": "right"}),
    "follow": Told(("follow v1 v2",), entries="same"),
    "normal": Told(red=()),
    "chain, yield then rear-end": Told(
        ("yielding v1 p1", "collision v2 v1"), "rear_end", entries="same"
    ),
    "chain, follow and yield": Told(("follow v1 v2", "yielding v2 p1"), entries="same"),
    "two yields": Told(("yielding v1 p1", "yielding v1 p2")),
    "near miss, head-on": Told(("near_miss v1 v2",), entries="opposite"),
    "near miss, from its left": Told(("near_miss v1 v2",), entries="left"),
    "collision, cross street": Told(("collision v1 v2",), entries="lateral"),
    "red light, vehicle": Told(
        ("collision v1 v2",), cause=("red_light_run", "v1"), red=("v1",)
    ),
    "red light, left turn": Told(
        ("collision v1 v2",), "left_turn", ("red_light_run", "v1"), "opposite", {"v1": "left"},
        ("v1",),
    ),
    "red light, pedestrian": Told(
        ("collision v1 p1",), STRIKE, ("red_light_run", "p1"), red=("p1",)
    ),
    "red light, yield": Told(("yielding v1 p1",), cause=("red_light_run", "p1"), red=("p1",)),
    "red light, nobody hit": Told(red=("v1",)),
    "chain, yield then strike": Told(("yielding v1 v2", "collision v1 p1"), STRIKE),
    "chain, yield then near miss": Told(("yielding v1 p1", "near_miss v1 p2")),
    "chain, follow a striker": Told(("follow v1 v2", "collision v2 p1"), STRIKE, entries="same"),
    "chain, rear-end of a yielder": Told(
        ("collision v1 v2", "yielding v2 p1"), "rear_end", entries="same"
    ),
    "chain, wait then strike": Told(("yielding p1 v1", "collision v1 p2"), STRIKE),
    "two near misses": Told(("near_miss v1 p1", "near_miss v2 p2")),
    "three in a row": Told(("follow v2 v1", "follow v3 v2"), entries="same"),
}  # fmt: skip


def faults(scene: Scene, told: Told) -> list[str]:
    """Where a scene is not what its request says; empty if it is."""
    names = {each.id: _short(each.name) for each in scene.record.agents}
    agents = {names[each.id]: each for each in scene.record.agents}
    events = scene.proof.events
    found = [] if _happened(scene, names) == _wanted(told) else ["events"]
    kinds = [each.kind for each in events if each.type == "collision"]
    if told.kind is not None and kinds != [told.kind]:
        found.append(f"kind {kinds}")
    if told.cause is not None and told.cause not in _causes(scene, names):
        found.append("cause")
    if told.entries is not None and not _lie(told.entries, agents["v1"].entry, agents["v2"].entry):
        found.append("entries")
    for name, movement in told.moves.items():
        if agents[name].movement != movement:
            found.append(f"movement of {name}")
    ran = {names[each["agent"]] for each in scene.proof.figures["red_light_runs"]}
    if told.red is not None and ran != set(told.red):
        found.append("red light")
    return found


def _short(name: str) -> str:
    kind, _, number = name.rpartition("-")
    return (kind[0] if kind in ("vehicle", "pedestrian") else kind) + number


def _happened(scene: Scene, names: dict[int, str]) -> list[tuple[str, ...]]:
    return sorted(
        _undirected(each.type, names[each.from_], names[each.to]) for each in scene.proof.events
    )


def _wanted(told: Told) -> list[tuple[str, ...]]:
    return sorted(_undirected(*each.split()) for each in told.events)


def _undirected(type_: str, *pair: str) -> tuple[str, ...]:
    return (type_, *(sorted(pair) if type_ in SYMMETRIC else pair))


def _causes(scene: Scene, names: dict[int, str]) -> list[tuple[str | None, str | None]]:
    """Every cause that was seen, and whose it is; late braking may come on top of another one."""
    seen = [(each.cause, each.evidence.get("cause_agent")) for each in scene.proof.events]
    seen += [("late_brake", each.evidence.get("late_brake")) for each in scene.proof.events]
    return [(cause, names.get(who or 0)) for cause, who in seen]


def _lie(side: str, one: str, two: str) -> bool:
    return {
        "same": two == one,
        "opposite": two == OPPOSITE[one],
        "lateral": two not in (one, OPPOSITE[one]),
        "left": two == LEFT[one],
    }[side]
