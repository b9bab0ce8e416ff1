"""Forged scenes: how many does `verify` catch, and by what?

    python benchmarks/forgeries.py [--seed 3] [--json FILE]

Scenes of seven kinds are made; every field of their scene.json is changed in several ways (taken
out, emptied, moved, exchanged with another's), and so are whole parts together, as a forger would
who wants a scene to say something else. Each forgery is verified twice: alone, where tracks, the
map and the other fields can betray it (`content`), and beside the honest proof.json, with --strict
(`digest`). What the content alone cannot betray is listed with how often it did; the exit code is 1
if a forgery passes --strict. Needs about two minutes.
"""

from __future__ import annotations

import argparse
import copy
import json
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from scenewright import synthesize, verify
from scenewright.errors import InputError

Json = dict[str, Any]
Forgery = Callable[[Json], None]
SCENES = {
    "yield": "A vehicle yields to a pedestrian at 8 am",
    "strike": "A car turning left hits a pedestrian on the north crosswalk in medium traffic",
    "rear-end": "A car rear-ends a truck on the south approach at noon",
    "near miss": "A van from the north narrowly misses a man on the east crosswalk",
    "red light": "A car runs the red light and crashes into a car from the left",
    "follow": "A car follows a bus straight through from the west",
    "normal": "Light traffic at 5 am, nothing happens",
}


def change(*path: str | int, to: Any) -> Forgery:
    """Puts a value, or what a function makes of the present one, in a place."""

    def forge(scene: Json) -> None:
        *outer, last = path
        place: Any = scene
        for key in outer:
            place = place[key]
        place[last] = to(place[last]) if callable(to) else to

    return forge


def remove(*path: str | int) -> Forgery:
    """Takes a key out."""

    def forge(scene: Json) -> None:
        *outer, last = path
        place: Any = scene
        for key in outer:
            place = place[key]
        del place[last]

    return forge


def swap(part: str, first: str, second: str) -> Forgery:
    """Exchanges two fields of every row of a part."""

    def forge(scene: Json) -> None:
        for row in scene[part]:
            row[first], row[second] = row[second], row[first]

    return forge


def chain(*forgeries: Forgery) -> Forgery:
    """Chain forgeries one after the other."""

    def forge(scene: Json) -> None:
        for each in forgeries:
            each(scene)

    return forge


def list_generic(scene: Json) -> Iterator[tuple[str, Forgery]]:
    """Every field of the file, changed in a few ways; of lists of rows, the first row's."""
    for part, rows in scene.items():
        yield f"{part}: gone", remove(part)
        yield f"{part}: empty", change(part, to=[] if isinstance(rows, list) else {})
        if not rows:
            continue
        where: tuple[str | int, ...] = (part,) if part == "meta" else (part, 0)
        row = rows if part == "meta" else rows[0]
        if isinstance(rows, list):
            yield f"{part}: first row gone", remove(part, 0)
            yield f"{part}: first row twice", change(part, to=lambda old: [old[0], *old])
        for key, value in row.items():
            yield f"{part}.{key}: gone", remove(*where, key)
            for how, other in list_values(value):
                yield f"{part}.{key}: {how}", change(*where, key, to=other)


def list_values(value: Any) -> Iterator[tuple[str, Any]]:
    """Other values that a field may be given."""
    if value is not None:
        yield "null", None
    match value:
        case bool():
            yield "turned", not value
        case int():
            yield "other number", value + 1
        case float():
            yield "10 % more", value * 1.1 + 0.05
            yield "50 more", value + 50.0
            yield "a tenth more", value + 0.1
        case str():
            yield "other text", value[:-1] + ("x" if value[-1:] != "x" else "y")
            yield "empty text", ""
        case [float() | int(), float() | int()]:
            yield "moved 50 m", [value[0] + 50.0, value[1]]
            yield "moved 1 m", [value[0] + 1.0, value[1]]
        case [[_, _], *_]:
            yield "moved 50 m", [[x + 50.0, y] for x, y in value]
            yield "moved 1 m", [[x + 1.0, y] for x, y in value]
            yield "one point moved", [[x + 5.0 * (k == 4), y] for k, (x, y) in enumerate(value)]
            yield "turned round", value[::-1]
            yield "last point gone", value[:-1]
        case [float(), *_]:
            yield "turned by 1 rad", [each + 1.0 for each in value]


def relabel_crosswalk(scene: Json) -> None:
    """A pedestrian's crosswalk, with route and goal to match."""
    other = {"north": "south", "south": "north", "east": "west", "west": "east"}
    agent = next(each for each in scene["agents"] if each["movement"] == "crossing")
    old = agent["crosswalk"]
    agent["crosswalk"] = other[old]
    agent["route"] = agent["route"].replace(f":{old}:", f":{other[old]}:", 1)
    agent["goal"] = [agent["goal"][0], -agent["goal"][1]]


def make_background(scene: Json) -> None:
    """Make every agent a background agent."""
    for agent in scene["agents"]:
        agent["role"] = "background"


def delete_relations(scene: Json) -> None:
    """What was asked for and what happened, as if nothing had been."""
    make_background(scene)
    scene["relations"] = []
    scene["events"] = [dict.fromkeys(("type", "from", "to", "time", "location"))]
    scene["events"][0]["type"] = "normal"


def forget_words(scene: Json) -> None:
    """The same, and the account with it."""
    delete_relations(scene)
    scene["said"] = []


def keep_on(scene: Json) -> None:
    """Every stop a keep."""
    for agent in scene["agents"]:
        for segment in agent["segments"]:
            segment["status"] = "keep" if segment["status"] == "stop" else segment["status"]


def stop_always(scene: Json) -> None:
    """Every keep a stop."""
    for agent in scene["agents"]:
        for segment in agent["segments"]:
            segment["status"] = "stop" if segment["status"] == "keep" else segment["status"]


def empty_all(key: str) -> Forgery:
    """Empties a list of every agent."""

    def forge(scene: Json) -> None:
        for agent in scene["agents"]:
            agent[key] = []

    return forge


def exchange_agents(scene: Json) -> None:
    """The tracks of two agents of one class, exchanged."""
    vehicles = [each for each in scene["agents"] if each["type"] == "vehicle"]
    first, second = vehicles[0], vehicles[-1]
    for key in ("trajectory", "heading", "spawn_time"):
        first[key], second[key] = second[key], first[key]


def delay_first(seconds: float) -> Forgery:
    """The first agent later or earlier, its segments with it."""

    def forge(scene: Json) -> None:
        agent = scene["agents"][0]
        agent["spawn_time"] += seconds
        for segment in agent["segments"]:
            segment["start"] += seconds
            segment["end"] += seconds

    return forge


def rename_all(scene: Json) -> None:
    """Names exchanged between the first two agents of a class."""
    vehicles = [each for each in scene["agents"] if each["type"] == "vehicle"]
    vehicles[0]["name"], vehicles[-1]["name"] = vehicles[-1]["name"], vehicles[0]["name"]


def set_all_green(scene: Json) -> None:
    """Set every light to green."""
    for signal in scene["signals"]:
        signal["colour"] = "green"


TOGETHER: dict[str, Forgery] = {
    "crosswalk, route and goal relabelled": relabel_crosswalk,
    "striker and struck exchanged": chain(
        swap("relations", "from", "to"), swap("events", "from", "to"),
        swap("relations", "point_from", "point_to"),
    ),
    "events exchanged": swap("events", "from", "to"),
    "all background": make_background,
    "relation and event deleted, all background": delete_relations,
    "relation, event and words deleted, all background": forget_words,
    "subtype submarine": change("agents", 0, "subtype", to="submarine"),
    "subtype exchanged": change(
        "agents", 0, "subtype", to=lambda old: "bus" if old == "car" else "car"
    ),
    "time of day and timestamp": chain(
        change("meta", "timestamp", to=3600.0), change("meta", "time_of_day", to="01:00")
    ),
    "density high": change("meta", "density", to="high"),
    "instruction of another scene": change("meta", "user_prompt", to="Two buses collide"),
    "instruction and words of another scene": chain(
        change("meta", "user_prompt", to="Two buses collide"), change("said", to=[])
    ),
    "another intersection": change("meta", "intersection", to="nowhere"),
    "every stop a keep": keep_on,
    "every keep a stop": stop_always,
    "segments deleted": empty_all("segments"),
    "waypoints deleted": empty_all("waypoints"),
    "tracks exchanged": exchange_agents,
    "names exchanged": rename_all,
    "first agent 0.1 s later": delay_first(0.1),
    "first agent 2 s later": delay_first(2.0),
    "first agent 2 s earlier": delay_first(-2.0),
    "last agent deleted": lambda scene: scene["agents"].pop() and None,
    "first agent deleted": remove("agents", 0),
    "lights all green": set_all_green,
    "lights deleted": change("signals", to=[]),
    "agent smaller": chain(
        change("agents", 0, "length", to=lambda old: old * 0.8),
        change("agents", 0, "width", to=lambda old: old * 0.8),
    ),
    "a NaN in the track": change("agents", 0, "trajectory", 3, 0, to=float("nan")),
    "a NaN in a waypoint": change("agents", 0, "waypoints", 3, 0, to=float("nan")),
    "scene of the future": change("meta", "schema_version", to=2),
    "a key of nobody": change("agents", 0, to=lambda old: {**old, "colour": "red"}),
}  # fmt: skip


def verify_forgery(scene: Json, proof: bytes | None, folder: Path) -> str | None:
    """What betrays a forged file; None if nothing does."""
    (folder / "scene.json").write_text(json.dumps(scene))
    (folder / "proof.json").unlink(missing_ok=True)
    if proof is not None:
        (folder / "proof.json").write_bytes(proof)
    try:
        found = verify(folder, strict=proof is not None)
    except InputError as error:
        return f"unusable: {error}"
    against = (*found.missing, *found.interference, *found.implausible, *found.signal_violations)
    return None if found.verified else against[0].rule


def forge_all(folder: Path, seed: int) -> Iterator[tuple[str, str, str | None, str | None]]:
    """Scene, forgery, what its content betrays, what the digest betrays."""
    for name, text in SCENES.items():
        synthesize(text, seed=seed, refiner="none").save(folder)
        proof = (folder / "proof.json").read_bytes()
        honest = json.loads((folder / "scene.json").read_bytes())
        if verify_forgery(honest, proof, folder) is not None:
            raise SystemExit(f"the honest scene {name} is not verified")
        for what, forge in (*TOGETHER.items(), *list_generic(honest)):
            scene = copy.deepcopy(honest)
            try:
                forge(scene)
            except (KeyError, IndexError, StopIteration):
                continue  # this scene has no such field
            if json.dumps(scene) != json.dumps(honest):
                alone = verify_forgery(scene, None, folder)
                yield name, what, alone, verify_forgery(scene, proof, folder)


def forge_as_asked(
    about: str | None, forge: Callable[[Path, int], Iterator[tuple[Any, ...]]]
) -> list[tuple[Any, ...]]:
    """All forgeries of the seed that the command line names, written to its file if it names one.

    Args:
        about: the benchmark's own description, for --help.
    """
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--json", type=Path, help="file for every forgery and its outcome")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        rows = list(forge(Path(scratch), asked.seed))
    if asked.json:
        asked.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    return rows


def main() -> None:
    """Forges, verifies and prints a table."""
    rows = forge_as_asked(__doc__, forge_all)
    kinds: dict[str, list[bool]] = defaultdict(list)
    for _, what, alone, _ in rows:
        kinds[what].append(alone is not None)
    passed = [f"{name}: {what}" for name, what, _, strict in rows if strict is None]
    betrayed = sum(each[2] is not None for each in rows)
    print(f"{len(rows)} forgeries of {len(kinds)} kinds")
    print(f"caught with --strict: {len(rows) - len(passed)}; by content alone: {betrayed}")
    print("not always caught by content alone (caught / forged):")
    for what, caught in sorted(kinds.items()):
        if not all(caught):
            print(f"  {what}: {sum(caught)} / {len(caught)}")
    if passed:
        sys.exit("passed --strict: " + "; ".join(passed))


if __name__ == "__main__":
    main()
