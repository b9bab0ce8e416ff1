"""Whether a scene shows what its instruction's label says, and nothing else that is dangerous."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from scenewright.dataset.batch.rows import choose_folder
from scenewright.dataset.tables.markdown import format_table
from scenewright.errors import InputError
from scenewright.evals.bootstrap import Figure
from scenewright.evals.planning import does_time_fit
from scenewright.geometry.map_areas import geos
from scenewright.graph.scene_files import load_scene
from scenewright.graph.verify import load_tracks, verify, verify_tracks
from scenewright.intersections import load_map
from scenewright.scene.base import Compass
from scenewright.scene.events import Event
from scenewright.scene.map import IntersectionMap
from scenewright.tools.relation_checker import RoadUser, build_trajectory, read_users
from scenewright.tools.relation_checker.legs import find_entry_leg, find_exit_leg

Label = Mapping[str, Any]
_DIRECTED = frozenset({"yielding", "follow"})
_BACKGROUND_PET = 1.0
"""Agents that the instruction does not name pass one another with more than this [s]."""


@dataclass(frozen=True)
class Submission:
    """One scene as it is judged.

    Attributes:
        agents, events: what the tracks show; time_of_day: HH:MM or a range, None if not given.
        fault: what speaks against the scene whatever it shows, such as words left out.
    """

    agents: Sequence[SeenAgent]
    events: Sequence[Event]
    time_of_day: Any = None
    fault: str | None = None


@dataclass(frozen=True)
class Verdict:
    """What came of one instruction: satisfied, wrong, refused, or rightly_refused; and why."""

    id: str
    outcome: str
    reason: str | None = None


def judge(row: Mapping[str, Any], submission: Submission | None) -> Verdict:
    """One row of the set, {"id", "expected"}, with the scene that was submitted for it."""
    label, name = row["expected"], row["id"]
    if submission is None:
        return Verdict(name, "rightly_refused" if label["refused"] else "refused")
    if label["refused"]:
        return Verdict(name, "wrong", "no scene can show this instruction, yet there is one")
    reason = submission.fault or _find_fault(label, submission)
    return Verdict(name, "satisfied" if reason is None else "wrong", reason)


def _find_fault(label: Label, submission: Submission) -> str | None:
    """Why a scene is not what its label says; None if it is."""
    time = label["context"]["time_of_day"]
    ours = submission.time_of_day
    if time is not None and ours is not None and not does_time_fit(time, ours):
        return f"is at {ours}, not at {time}"
    relations = [each for each in label["relations"] if each["type"] != "normal"]
    missing = "what was asked for does not happen between such agents"
    for bound, pairs in _list_bindings(relations, label, submission):
        named = frozenset(bound.values())
        # What the certificate of no other interaction forbids (SEMANTICS 4).
        stray = [
            event
            for event in submission.events
            if event.type != "follow"
            and _pair(event) not in pairs
            and (
                event.type == "collision"
                or float(event.evidence.get("pet", 0.0)) <= _BACKGROUND_PET
                or _pair(event) & named
            )
        ]
        if stray:
            first = stray[0]
            missing = f"unasked {first.type} of {first.from_} and {first.to} at {first.time:.1f} s"
            continue
        # Agents without events must be found among the tracks that are left.
        left = [agent for agent in submission.agents if agent.id not in bound.values()]
        for wanted in (each for each in label["agents"] if each["id"] not in bound):
            found = next((each for each in left if is_like(wanted, each)), None)
            if found is None:
                missing = "an agent that was asked for is not there"
                break
            left.remove(found)
        else:
            return None
    return missing


def _list_bindings(
    relations: Sequence[Mapping[str, Any]], label: Label, submission: Submission
) -> Iterator[tuple[dict[str, int], set[frozenset[int]]]]:
    """Every way of giving the relations' agents to tracks so that each relation is an event."""
    wanted = {each["id"]: each for each in label["agents"]}
    seen = {agent.id: agent for agent in submission.agents}
    choices: list[list[dict[str, int]]] = []
    for relation in relations:
        names = relation["from"], relation["to"]
        ends = [(e.from_, e.to) for e in submission.events if e.type == relation["type"]]
        # Labels name the yielding and the following agent, not always the striking one.
        turned = () if relation["type"] in _DIRECTED else (pair[::-1] for pair in ends)
        given = (dict(zip(names, pair, strict=True)) for pair in (*ends, *turned))
        choices.append(
            [own for own in given if all(is_like(wanted[k], seen[n]) for k, n in own.items())]
        )
    for chosen in product(*choices):
        named = {item for pair in chosen for item in pair.items()}
        bound = dict(named)
        # Names and tracks stay one to one.
        if len(named) == len(bound) == len({*bound.values()}):
            yield bound, {frozenset(pair.values()) for pair in chosen}


def _pair(event: Event) -> frozenset[int]:
    return frozenset((event.from_, event.to))


def is_like(wanted: Mapping[str, Any], seen: SeenAgent) -> bool:
    """Whether nothing that a track shows contradicts what the label says of an agent."""
    if wanted["type"] != seen.type:
        return False
    if seen.type == "pedestrian":
        leg = wanted["crosswalk"]
        crossing = wanted["movement"] in (None, seen.movement) or seen.movement is None
        return crossing and (leg is None or not seen.crosswalks or leg in seen.crosswalks)
    pairs = ((wanted[key], getattr(seen, key)) for key in ("entry", "exit", "movement"))
    return all(a is None or b is None or a == b for a, b in pairs)


RATES: Mapping[str, str] = {
    "satisfied": "instruction satisfaction rate: scenes that show what was said and nothing else",
    "false": "scenes that show something else than was said, of all that were submitted",
    "refused": "instructions without a scene although one could show them",
    "rightly refused": "instructions that no scene can show, and without one",
}
"""Figure -> what it is."""


def count_verdicts(
    verdicts: Sequence[Verdict], rows: Sequence[Mapping[str, Any]]
) -> dict[str, Figure]:
    """The figures of `RATES`, each with its n."""
    counts = Counter(verdict.outcome for verdict in verdicts)
    impossible = sum(bool(row["expected"]["refused"]) for row in rows)
    possible, made = len(rows) - impossible, counts["satisfied"] + counts["wrong"]
    return {
        "satisfied": Figure.of_count(counts["satisfied"], possible),
        "false": Figure.of_count(counts["wrong"], made),
        "refused": Figure.of_count(counts["refused"], possible),
        "rightly refused": Figure.of_count(counts["rightly_refused"], impossible),
    }


def to_markdown(shares: Mapping[str, Figure], verdicts: Sequence[Verdict]) -> str:
    """The figures, and why scenes are wrong."""
    rows = [[RATES[name], f"{s.count} / {s.n}", f"{s:.1%}"] for name, s in shares.items()]
    reasons = Counter[str]()
    for verdict in verdicts:
        if verdict.outcome == "wrong":  # counted without numbers, names and quotes
            words = (verdict.reason or "").split()
            reasons[" ".join(words[: 2 if words[:1] == ["unasked"] else 4])] += 1
    parts = [format_table(["figure", "count", "share [95 %]"], rows)]
    if reasons:
        parts.append(format_table(["why scenes are wrong", "scenes"], reasons.most_common()))
    return "\n\n".join(parts) + "\n"


def read_submission(folder: Path, identity: str, *, intersection: str) -> Submission | None:
    """What was submitted for an instruction; None where nothing was.

    Args:
        folder: holds `ID/scene.json` (as `scenewright batch` writes it) or `ID.SUFFIX`, tracks in
            any format that `verify` reads.
        intersection: map of the tracks; a scene.json names its own.

    Raises:
        InputError: more than one file for an instruction.
    """
    name = choose_folder(identity)
    if (folder / name / "scene.json").is_file():
        # A scene of ours: its tracks, and whether its proof and its account of words hold.
        record, proof, fault = load_scene(folder / name), verify(folder / name), None
        if not proof.verified:
            fault = "the checker does not confirm the scene"
        elif proof.verdict == "partly":
            fault = proof.describe_verdict()
        agents = see_agents(read_users(record), load_map(record.meta.intersection))
        events = (*proof.events, *proof.incidental)
        return Submission(agents, events, record.meta.time_of_day, fault)
    files = sorted(path for path in folder.glob(f"{name}.*") if path.is_file())
    if len(files) > 1:
        raise InputError(f"{files[0]} and {files[1]} are both for {identity}; keep one")
    if not files:
        return None
    try:
        tracks = load_tracks(files[0])
    except InputError as error:  # what cannot be read speaks against it
        return Submission((), (), fault=f"cannot be read: {error}")
    agents = see_agents(tracks.users, load_map(intersection))
    return Submission(agents, verify_tracks(tracks, intersection=intersection))


_CROSSED = 2.0
"""A pedestrian crosses where at least this much of its way lies on the crosswalk or road [m]."""


@dataclass(frozen=True)
class SeenAgent:
    """What the track of one road user shows.

    Attributes:
        id: its number; type: class, such as vehicle or pedestrian.
        entry, exit: leg that a vehicle comes from and leaves by; None where the track does not
            show it.
        movement: the turn between the two; crossing or jaywalking of a pedestrian; None as above.
        crosswalks: legs whose crosswalk a pedestrian uses.
    """

    id: int
    type: str
    entry: str | None
    exit: str | None
    movement: str | None
    crosswalks: frozenset[Compass]


def see_agents(users: Iterable[RoadUser], intersection: IntersectionMap) -> list[SeenAgent]:
    """Every road user of a scene, as the map lets its track be read."""
    found = []
    turns: dict[tuple[str | None, str | None], str] = {
        (each.entry, each.exit): each.turn for each in intersection.movements
    }
    for user in users:
        if user.shape.type == "pedestrian":
            xy = user.track.xy
            way = geos.LineString(xy) if len(xy) > 1 else geos.LineString()
            walks = (
                (crosswalk.leg, geos.Polygon(crosswalk.polygon))
                for crosswalk in intersection.crosswalks
            )
            used = frozenset(leg for leg, area in walks if way.intersection(area).length > _CROSSED)
            road = (geos.Polygon(area.exterior, area.holes) for area in intersection.road)
            on_road = sum(way.intersection(area).length for area in road) > _CROSSED
            movement = "crossing" if used else "jaywalking" if on_road else None
            found.append(SeenAgent(user.id, "pedestrian", None, None, movement, used))
            continue
        track = build_trajectory(user)
        legs = find_entry_leg(track, intersection), find_exit_leg(track, intersection)
        found.append(SeenAgent(user.id, user.shape.type, *legs, turns.get(legs), frozenset()))
    return found
