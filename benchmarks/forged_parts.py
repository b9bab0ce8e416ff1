"""Forgeries of doors, chains, groups, lane changes, reactions, sights, order and accounts.

    python benchmarks/forged_parts.py [--seed 3] [--json FILE]

Where `forgeries.py` and `forged_proofs.py` change one value, these tell another story with all that
belongs to it: the door opens elsewhere, the pushed car rolls further than momentum explains, the
object no longer hides the child. Each forgery is verified without a proof, so that tracks, map and
the file's own fields alone decide, as after a forger has written a new digest and a new proof.
Listed is what they do not betray; docs/checker.md says why.
"""

from __future__ import annotations

import copy
import json
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from forged_proofs import make_scene
from forgeries import Forgery, Json, chain, change, forge_as_asked, remove, verify_forgery

STEP = 0.1
SCENES = {
    "door": "A cyclist is doored by a parked van",
    "chain": "A truck rear-ends a car and pushes it into the van ahead",
    "cut in": "A car cuts in ahead of a bus with a headway of 0.6 s",
    "sideswipe": "A car changing lanes sideswipes a truck",
    "couple": "A couple crosses the north crosswalk and a car turning right yields to them",
    "hidden": "A child runs out from behind a parked van and is hit by a car",
    "order": "A car passes first and a pedestrian crosses just behind it, a near miss",
    "distracted": "A distracted driver rear-ends a car",
    "lead brakes": "A car brakes hard and the van behind it rear-ends it",
    "object": "A car goes round a double-parked truck",
}


def find(scene: Json, number: int) -> Json:
    """The agent of this id."""
    agent: Json = next(each for each in scene["agents"] if each["id"] == number)
    return agent


def edit_agent(number: int, edit: Callable[[Json], object]) -> Forgery:
    """Changes one agent."""

    def forge(scene: Json) -> None:
        edit(find(scene, number))

    return forge


def edit_object(kind: str, **more: float) -> Forgery:
    """Adds to figures of the first object of a kind."""

    def forge(scene: Json) -> None:
        one = next(each for each in scene["objects"] if each["kind"] == kind)
        for key, plus in more.items():
            one[key] += plus

    return forge


def delay(seconds: float) -> Callable[[Json], None]:
    """The agent so much later, its segments with it."""

    def edit(agent: Json) -> None:
        agent["spawn_time"] = round(agent["spawn_time"] + seconds, 3)
        for segment in agent["segments"]:
            segment["start"] += seconds
            segment["end"] += seconds

    return edit


def move(x: float, y: float) -> Callable[[Json], None]:
    """The whole track aside, goal and waypoints with it."""

    def edit(agent: Json) -> None:
        for key in ("trajectory", "waypoints"):
            agent[key] = [[a + x, b + y] for a, b in agent[key]]
        agent["goal"] = [agent["goal"][0] + x, agent["goal"][1] + y]

    return edit


def straighten(agent: Json) -> None:
    """No lateral movement: the first half of the track lies beside its second half's line."""
    (x0, y0), (x1, y1) = agent["trajectory"][-11], agent["trajectory"][-1]
    size = max(((x1 - x0) ** 2 + (y1 - y0) ** 2) ** 0.5, 1e-9)
    ux, uy = (x1 - x0) / size, (y1 - y0) / size
    along = [(x - x1) * ux + (y - y1) * uy for x, y in agent["trajectory"]]
    agent["trajectory"] = [[round(x1 + s * ux, 3), round(y1 + s * uy, 3)] for s in along]
    agent["heading"] = [agent["heading"][-1]] * len(along)
    agent["waypoints"] = []


def stretch_end(samples: int, factor: float) -> Callable[[Json], None]:
    """The last samples go so many times as far."""

    def edit(agent: Json) -> None:
        track = agent["trajectory"]
        x0, y0 = track[-samples - 1]
        tail = [[x0 + (x - x0) * factor, y0 + (y - y0) * factor] for x, y in track[-samples:]]
        agent["trajectory"] = track[:-samples] + [[round(x, 3), round(y, 3)] for x, y in tail]

    return edit


def run_on(samples: int) -> Callable[[Json], None]:
    """The track goes on as fast as it ended."""

    def edit(agent: Json) -> None:
        (x0, y0), (x1, y1) = agent["trajectory"][-2:]
        more = [[x1 + k * (x1 - x0), y1 + k * (y1 - y0)] for k in range(1, samples + 1)]
        agent["trajectory"] += [[round(x, 3), round(y, 3)] for x, y in more]
        agent["heading"] += [agent["heading"][-1]] * samples

    return edit


def cut_end(samples: int) -> Callable[[Json], None]:
    """The track ends so much earlier."""

    def edit(agent: Json) -> None:
        agent["trajectory"], agent["heading"] = (
            agent["trajectory"][:-samples],
            agent["heading"][:-samples],
        )

    return edit


def put(**values: Any) -> Callable[[Json], None]:
    """Fields of an agent."""
    return lambda agent: agent.update(values)


def swap_relation(scene: Json) -> None:
    """Roles of the first relation and its event exchanged, the account with them."""
    for row in (scene["relations"][0], scene["events"][0]):
        row["from"], row["to"] = row["to"], row["from"]
    for entry in scene["said"]:
        if len(entry["agents"]) == 2:
            entry["agents"] = entry["agents"][::-1]


def drop_entries(became: str) -> Forgery:
    """Entries of the account of one kind gone."""

    def forge(scene: Json) -> None:
        kept = [each for each in scene["said"] if each["became"] != became]
        if len(kept) == len(scene["said"]):
            raise KeyError(became)
        scene["said"] = kept

    return forge


def edit_entry(kind: str, **values: Any) -> Forgery:
    """Changes the first entry of a kind."""

    def forge(scene: Json) -> None:
        next(each for each in scene["said"] if each["became"] == kind).update(values)

    return forge


def add_entry(became: str, agents: list[int], value: str | None) -> Forgery:
    """The account claims that the last word says this as well."""

    def forge(scene: Json) -> None:
        scene["said"].append({**scene["said"][-1], "became": became, "agents": agents,
                              "value": value})  # fmt: skip

    return forge


def reword(old: str, new: str, **values: Any) -> Forgery:
    """The instruction says something else, and so does the entry; later entries are moved."""

    def forge(scene: Json) -> None:
        text = scene["meta"]["user_prompt"]
        at, more = text.index(old), len(new) - len(old)
        scene["meta"]["user_prompt"] = text.replace(old, new, 1)
        for entry in scene["said"]:
            for key in ("start", "end"):
                entry[key] += more if entry[key] > at else 0
            if old in entry["words"]:
                entry.update(words=entry["words"].replace(old, new, 1), **values)

    return forge


def join_stranger(scene: Json) -> None:
    """A pedestrian that walks elsewhere joins the group; without one, the vehicle does."""
    member = {each["id"] for each in scene["agents"] if each.get("group")}
    walkers = [each for each in scene["agents"]
               if each["type"] == "pedestrian" and each["id"] not in (1, *member)]  # fmt: skip
    (walkers or [find(scene, 2)])[0]["group"] = 1


def drop_object(kind: str) -> Forgery:
    """An object gone, whatever names it left."""

    def forge(scene: Json) -> None:
        scene["objects"] = [each for each in scene["objects"] if each["kind"] != kind]

    return forge


ALL_ACCOUNTS = {
    "account: an agent of another class": edit_entry("agent", value="bus"),
    "account: another agent": edit_entry("agent", agents=[4]),
    "account: no agents": edit_entry("agent", agents=[]),
    "account: a movement that was not made": add_entry("movement", [1], "uturn"),
    "account: a speed that was not measured": add_entry(
        "measure", [1], "speed(vehicle-1) in [10, 12] m/s"
    ),
    "account: a cause that was not seen": add_entry("cause", [1], "red_light_run"),
    "account: an object that is not there": add_entry("object", [], "object-9 parked bus"),
    "account: a reaction that is not asked for": add_entry("reaction", [2], "none"),
    "account: a motion that is not asked for": add_entry("motion", [2], "runs"),
    "account: a relation that is not there": add_entry("relation", [1, 4], "collide_at"),
    "account: a group of five": add_entry("agent", [1], "group of 5"),
    "account: a manoeuvre that is not asked for": add_entry("manoeuvre", [1, 2], "tailgates"),
    "account: a place that it is not": add_entry("entry", [1], "uphill"),
    "account: an order the other way round": add_entry("order", [4, 1], None),
    "account: a sight that is not asked for": add_entry("sight", [1, 2], "object-9"),
    "account: an encounter that is not there": add_entry("encounter", [2], "object-1 doored"),
    "account: a word of another text": edit_entry("agent", words="A tram"),
    "account: another span": edit_entry("agent", start=3, end=9),
    "account: of a kind that is not": edit_entry("agent", became="weather"),
    "account: a later time of day": add_entry("time", [], "23:59"),
    "account: denser traffic": add_entry("density", [], "high"),
    "instruction: of a bus": reword("car", "bus", value="bus"),
}  # fmt: skip

STORIES: dict[str, dict[str, Forgery]] = {
    "door": {
        "door opens a second earlier": edit_object("door", since=-1.0),
        "door opens 2 s earlier": edit_object("door", since=-2.0),
        "door opens after the contact": edit_object("door", since=1.0),
        "door 1 m further on": edit_object("door", y=1.0),
        "door on the other side": edit_object("door", x=3.0),
        "door away from the van": edit_object("door", x=-1.0),
        "door closed, the encounter stays": drop_object("door"),
        "van gone, the door stays": drop_object("parked"),
        "van 1 m from its door": edit_object("parked", x=1.0),
        "rider 0.6 m aside": edit_agent(1, move(-0.6, 0.0)),
        "rider goes on": edit_agent(1, run_on(10)),
        "rider ends before the door": edit_agent(1, cut_end(5)),
        "rider a second later": edit_agent(1, delay(1.0)),
        "no dooring, but the van is hit": change("encounters", 0, "how", to="hits"),
        "another is doored": change("encounters", 0, "agent", to=2),
        "doored by the door": change("encounters", 0, "object", to="object-1-door"),
        "a door twice as long": edit_object("door", length=1.0),
        "dooring and its words forgotten": chain(
            change("encounters", to=[]), drop_entries("encounter")
        ),
    },
    "chain": {
        "second collision not pushed": remove("relations", 1, "manoeuvre"),
        "pushed by the last": chain(
            change("relations", 1, "from", to=3), change("relations", 1, "to", to=2)
        ),
        "first collision forgotten": chain(remove("relations", 0), remove("events", 0)),
        "second collision forgotten": chain(remove("relations", 1), remove("events", 1)),
        "pushed car is a truck": edit_agent(2, put(subtype="truck")),
        "pushed car rolls twice as far": edit_agent(2, stretch_end(3, 2.0)),
        "pushed car shifted 0.5 s": edit_agent(2, delay(0.5)),
        "pushed car is already under way": edit_agent(2, stretch_end(30, 1.5)),
        "striker 0.3 s later": edit_agent(1, delay(0.3)),
        "striker ends before the contact": edit_agent(1, cut_end(5)),
        "struck one goes on": edit_agent(3, run_on(10)),
        "first collision is pushed too": change("relations", 0, "manoeuvre", to="pushed"),
        "struck one half a metre ahead": edit_agent(3, move(0.5, 0.0)),
    },
    "cut in": {
        "roles exchanged": swap_relation,
        "never in another lane": edit_agent(1, straighten),
        "tailgates instead": change("relations", 0, "manoeuvre", to="tailgates"),
        "leader brakes instead": change("relations", 0, "manoeuvre", to="lead_brakes"),
        "headway of 2 s": chain(
            change("measures", 0, "low", to=1.85), change("measures", 0, "high", to=2.15)
        ),
        "headway of the leader": chain(
            change("measures", 0, "agent", to=1), change("measures", 0, "other", to=2)
        ),
        "bus 0.5 s later": edit_agent(2, delay(0.5)),
        "bus 0.5 s earlier": edit_agent(2, delay(-0.3)),
        "bus passes first": change("relations", 0, "first", to=2),
        "headway forgotten": chain(change("measures", to=[]), drop_entries("measure")),
        "a post-encroachment time of 3 s": change("relations", 0, "within", to={"pet": [2.5, 3.5]}),
        "collision instead": chain(
            change("relations", 0, "type", to="collision"),
            change("events", 0, "type", to="collision"),
        ),
    },
    "sideswipe": {
        "roles exchanged": swap_relation,
        "rear-end instead": chain(
            change("relations", 0, "kind", to="rear_end"),
            change("events", 0, "kind", to="rear_end"),
        ),
        "near miss instead": chain(
            change("relations", 0, "type", to="near_miss"),
            change("events", 0, "type", to="near_miss"), change("events", 0, "kind", to=None),
        ),
        "struck one goes on": edit_agent(2, run_on(8)),
        "0.4 s apart": edit_agent(1, delay(-0.4)),
        "pushed instead": change("relations", 0, "manoeuvre", to="pushed"),
    },
    "couple": {
        "one walks 2 m aside": edit_agent(3, move(0.0, 2.0)),
        "one 3 s later": edit_agent(3, delay(3.0)),
        "one is no member": edit_agent(3, put(group=None)),
        "member of no group": edit_agent(3, put(group=99)),
        "members of one another": edit_agent(1, put(group=3)),
        "member of a car's group": edit_agent(3, put(group=2)),
        "a stranger joins": join_stranger,
        "the group's member alone is given way to": change("relations", 0, "to", to=3),
        "group of 3": edit_entry("agent", value="group of 3"),
        "one event of two": remove("events", 1),
        "the couple gives way": swap_relation,
        "other crosswalk in the account": edit_entry("crosswalk", value="south"),
    },
    "hidden": {
        "van 6 m further on": edit_object("parked", y=6.0),
        "van across the road": edit_object("parked", x=15.0),
        "van that is seen over": change("objects", 0, "height", to="low"),
        "van gone, the sight stays": drop_object("parked"),
        "hidden until 0.2 s before": change("sights", 0, "lead", to=[0.0, 0.2]),
        "hidden until 4 s before": change("sights", 0, "lead", to=[3.0, 4.0]),
        "hidden from the child": chain(
            change("sights", 0, "observer", to=1), change("sights", 0, "subject", to=2)
        ),
        "another is hidden": change("sights", 0, "subject", to=3),
        "hidden by nothing": change("sights", 0, "object", to="object-7"),
        "child walks": edit_agent(1, put(motion=None)),
        "child turns back": edit_agent(1, put(motion="turns_back")),
        "child on the crosswalk": edit_agent(1, put(movement="crossing")),
        "child a second earlier": edit_agent(1, delay(-1.0)),
        "child 0.5 m further on": edit_agent(1, move(0.5, 0.0)),
        "sight and its words forgotten": chain(change("sights", to=[]), drop_entries("sight")),
    },
    "order": {
        "the other first": change("relations", 0, "first", to=2),
        "the other first, account too": chain(
            change("relations", 0, "first", to=2), edit_entry("order", agents=[2, 1])
        ),
        "account alone the other way round": edit_entry("order", agents=[2, 1]),
        "pedestrian 2 s earlier": edit_agent(2, delay(-2.0)),
        "pedestrian 1 s later": edit_agent(2, delay(1.0)),
        "order forgotten": chain(change("relations", 0, "first", to=None), drop_entries("order")),
        "a third first": change("relations", 0, "first", to=4),
    },
    "distracted": {
        "the other is distracted": chain(
            edit_agent(1, put(reaction=None)), edit_agent(2, put(reaction="none"))
        ),
        "distraction in the account alone": edit_agent(1, put(reaction=None)),
        "attentive and said so": chain(
            edit_agent(1, put(reaction=None)), edit_entry("reaction", value="brakes")
        ),
        "roles exchanged": swap_relation,
        "late braking as the cause": change("relations", 0, "cause", to="late_brake"),
        "a red light as the cause": chain(
            change("relations", 0, "cause", to="red_light_run"),
            change("events", 0, "cause", to="red_light_run"),
        ),
        "striker twice as fast at the end": edit_agent(1, stretch_end(2, 2.0)),
    },
    "lead brakes": {
        "roles exchanged": swap_relation,
        "tailgates instead": change("relations", 0, "manoeuvre", to="tailgates"),
        "cuts in instead": change("relations", 0, "manoeuvre", to="cuts_in"),
        "follower does not react": edit_agent(2, put(reaction="none")),
        "follower 0.5 s later": edit_agent(2, delay(0.5)),
        "leader 0.5 s later": edit_agent(1, delay(0.5)),
    },
    "object": {
        "truck 8 m further on": edit_object("double_parked", y=8.0),
        "truck out of the way": edit_object("double_parked", x=4.0),
        "truck gone": drop_object("double_parked"),
        "waits behind instead": change("encounters", 0, "how", to="waits_behind"),
        "stops short instead": change("encounters", 0, "how", to="stops_short"),
        "hits it instead": change("encounters", 0, "how", to="hits"),
        "waits, then passes instead": change("encounters", 0, "how", to="waits_then_passes"),
        "another goes round": change("encounters", 0, "agent", to=3),
        "car 1.5 m aside": edit_agent(1, move(1.5, 0.0)),
        "a car parked there": change("objects", 0, "subtype", to="car"),
        "encounter and its words forgotten": chain(
            change("encounters", to=[]), drop_entries("encounter")
        ),
    },
}  # fmt: skip


def forge_all(folder: Path, seed: int) -> Iterator[tuple[str, str, str | None]]:
    """Scene, kind of forgery, and what betrays it."""
    for name, text in SCENES.items():
        make_scene(text, folder, seed)
        honest = json.loads((folder / "scene.json").read_bytes())
        if verify_forgery(honest, None, folder) is not None:
            raise SystemExit(f"the honest scene {name} is not verified")
        for kind, forge in (*STORIES[name].items(), *ALL_ACCOUNTS.items()):
            forged = copy.deepcopy(honest)
            try:
                forge(forged)
            except (KeyError, IndexError, StopIteration, ValueError):
                continue  # this scene has no such part
            if forged != honest:
                shown = kind if kind in ALL_ACCOUNTS else f"{name}: {kind}"
                yield name, shown, verify_forgery(forged, None, folder)


def main() -> None:
    """Forges, verifies and prints what was not caught."""
    rows = forge_as_asked(__doc__, forge_all)
    kinds: dict[str, list[bool]] = defaultdict(list)
    for _, kind, found in rows:
        kinds[kind].append(found is not None)
    caught = sum(found is not None for _, _, found in rows)
    print(f"{len(rows)} forgeries of {len(kinds)} kinds, {caught} caught")
    for kind, each in sorted(kinds.items()):
        if not all(each):
            print(f"  {kind}: {sum(each)} / {len(each)}")


if __name__ == "__main__":
    main()
