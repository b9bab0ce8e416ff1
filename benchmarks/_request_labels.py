"""Labels of the requests of `robustness.py`, written by hand, and a check of scenes against them.

The gate compares a scene with what the planner understood; this compares it with the words.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from scenewright.graph.run import Scene

OPPOSITE = {"north": "south", "south": "north", "east": "west", "west": "east"}
LEFT = {"north": "east", "east": "south", "south": "west", "west": "north"}
"""The side to the left of a driver coming from a side."""

SYMMETRIC = ("collision", "near_miss")


@dataclass(frozen=True)
class Label:
    """The label of a request.

    Attributes:
        events: type, from and to of every event, agents as v1, p1, ...
        kind: of the collision; cause: of the first event, and by whom.
        entries: how that of v2 lies to that of v1: same, opposite, lateral or left.
        moves: movement by agent.
        red: all red-light runners; None where the text leaves that open.
    """

    events: tuple[str, ...] = ()
    kind: str | None = None
    cause: tuple[str, str] | None = None
    entries: str | None = None
    moves: dict[str, str] = field(default_factory=dict)
    red: tuple[str, ...] | None = None


STRIKE = "pedestrian_strike"
LABELS = {
    "strike, through": Label(("collision v1 p1",), STRIKE, moves={"v1": "straight"}),
    "strike, left turn": Label(("collision v1 p1",), STRIKE, moves={"v1": "left"}),
    "strike, right turn": Label(("collision v1 p1",), STRIKE, moves={"v1": "right"}),
    "strike, jaywalker": Label(("collision v1 p1",), STRIKE, moves={"p1": "jaywalking"}),
    "angle": Label(("collision v1 v2",), "angle"),
    "left turn": Label(
        ("collision v1 v2",), "left_turn", entries="opposite", moves={"v1": "left"}
    ),
    "rear-end": Label(("collision v1 v2",), "rear_end", entries="same"),
    "head-on": Label(("collision v1 v2",), "head_on", entries="opposite"),
    "sideswipe": Label(("collision v1 v2",), "sideswipe", entries="same"),
    "near miss, pedestrian": Label(("near_miss v1 p1",)),
    "near miss, vehicle": Label(("near_miss v1 v2",)),
    "near miss, pedestrian, TTC": Label(("near_miss v1 p1",)),
    "near miss, vehicle, TTC": Label(("near_miss v1 v2",)),
    "near miss, hard braking": Label(("near_miss v1 p1",), cause=("late_brake", "v1")),
    "strike, impact speed": Label(("collision v1 p1",), STRIKE),
    "angle, impact speed": Label(("collision v1 v2",), "angle"),
    "rear-end, impact speed": Label(("collision v1 v2",), "rear_end", entries="same"),
    "angle, point of impact": Label(("collision v1 v2",)),
    "strike, point of impact": Label(("collision v1 p1",), STRIKE),
    "yield, PET": Label(("yielding v1 p1",)),
    "yield, vehicle to pedestrian": Label(("yielding v1 p1",)),
    "yield, pedestrian to vehicle": Label(("yielding p1 v1",)),
    "yield, left turn to oncoming": Label(
        ("yielding v1 v2",), entries="opposite", moves={"v1": "left"}
    ),
    "yield, right turn": Label(("yielding v1 v2",), entries="lateral", moves={"v1": "right"}),
    "follow": Label(("follow v1 v2",), entries="same"),
    "normal": Label(red=()),
    "chain, yield then rear-end": Label(
        ("yielding v1 p1", "collision v2 v1"), "rear_end", entries="same"
    ),
    "chain, follow and yield": Label(("follow v1 v2", "yielding v2 p1"), entries="same"),
    "two yields": Label(("yielding v1 p1", "yielding v1 p2")),
    "near miss, head-on": Label(("near_miss v1 v2",), entries="opposite"),
    "near miss, from its left": Label(("near_miss v1 v2",), entries="left"),
    "collision, cross street": Label(("collision v1 v2",), entries="lateral"),
    "red light, vehicle": Label(
        ("collision v1 v2",), cause=("red_light_run", "v1"), red=("v1",)
    ),
    "red light, left turn": Label(
        ("collision v1 v2",), "left_turn", ("red_light_run", "v1"), "opposite", {"v1": "left"},
        ("v1",),
    ),
    "red light, pedestrian": Label(
        ("collision v1 p1",), STRIKE, ("red_light_run", "p1"), red=("p1",)
    ),
    "red light, yield": Label(("yielding v1 p1",), cause=("red_light_run", "p1"), red=("p1",)),
    "red light, nobody hit": Label(red=("v1",)),
    "chain, yield then strike": Label(("yielding v1 v2", "collision v1 p1"), STRIKE),
    "chain, yield then near miss": Label(("yielding v1 p1", "near_miss v1 p2")),
    "chain, follow a striker": Label(("follow v1 v2", "collision v2 p1"), STRIKE, entries="same"),
    "chain, rear-end of a yielder": Label(
        ("collision v1 v2", "yielding v2 p1"), "rear_end", entries="same"
    ),
    "chain, wait then strike": Label(("yielding p1 v1", "collision v1 p2"), STRIKE),
    "two near misses": Label(("near_miss v1 p1", "near_miss v2 p2")),
    "three in a row": Label(("follow v2 v1", "follow v3 v2"), entries="same"),
}  # fmt: skip


def find_faults(scene: Scene, label: Label) -> list[str]:
    """List where a scene differs from its request's label; empty if nowhere."""
    names = {each.id: _shorten(each.name) for each in scene.record.agents}
    agents = {names[each.id]: each for each in scene.record.agents}
    events = scene.proof.events
    found = [] if _list_events(scene, names) == _list_wanted(label) else ["events"]
    kinds = [each.kind for each in events if each.type == "collision"]
    if label.kind is not None and kinds != [label.kind]:
        found.append(f"kind {kinds}")
    if label.cause is not None and label.cause not in _list_causes(scene, names):
        found.append("cause")
    if label.entries is not None and not _do_entries_lie(
        label.entries, agents["v1"].entry, agents["v2"].entry
    ):
        found.append("entries")
    for name, movement in label.moves.items():
        if agents[name].movement != movement:
            found.append(f"movement of {name}")
    ran = {names[each["agent"]] for each in scene.proof.figures["red_light_runs"]}
    if label.red is not None and ran != set(label.red):
        found.append("red light")
    return found


def _shorten(name: str) -> str:
    kind, _, number = name.rpartition("-")
    return (kind[0] if kind in ("vehicle", "pedestrian") else kind) + number


def _list_events(scene: Scene, names: dict[int, str]) -> list[tuple[str, ...]]:
    return sorted(
        _order_pair(each.type, names[each.from_], names[each.to]) for each in scene.proof.events
    )


def _list_wanted(label: Label) -> list[tuple[str, ...]]:
    return sorted(_order_pair(*each.split()) for each in label.events)


def _order_pair(type_: str, *pair: str) -> tuple[str, ...]:
    return (type_, *(sorted(pair) if type_ in SYMMETRIC else pair))


def _list_causes(scene: Scene, names: dict[int, str]) -> list[tuple[str | None, str | None]]:
    """List observed causes and their agents; late braking may come on top of another one."""
    seen = [(each.cause, each.evidence.get("cause_agent")) for each in scene.proof.events]
    seen += [("late_brake", each.evidence.get("late_brake")) for each in scene.proof.events]
    return [(cause, names.get(who or 0)) for cause, who in seen]


def _do_entries_lie(side: str, one: str, two: str) -> bool:
    return {
        "same": two == one,
        "opposite": two == OPPOSITE[one],
        "lateral": two not in (one, OPPOSITE[one]),
        "left": two == LEFT[one],
    }[side]
