"""Whether a scene shows what its instruction's label says, and nothing else that is dangerous."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenewright.dataset.batch.rows import choose_folder
from scenewright.dataset.tables.markdown import format_table
from scenewright.errors import InputError
from scenewright.evals.planning import PlanningShare, does_time_fit
from scenewright.geometry.map_areas import geos
from scenewright.graph.scene_files import load_scene
from scenewright.graph.verify import load_tracks, verify, verify_tracks
from scenewright.intersections import load_map
from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.events import Event
from scenewright.scene.map import IntersectionMap
from scenewright.tools.relation_checker import RoadUser, read_users

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
    for bound, pairs in _list_bindings(relations, label, submission, {}, frozenset()):
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
        left = [each for each in submission.agents if each.id not in bound.values()]
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
    relations: Sequence[Mapping[str, Any]],
    label: Label,
    submission: Submission,
    bound: dict[str, int],
    pairs: frozenset[frozenset[int]],
) -> Iterator[tuple[dict[str, int], frozenset[frozenset[int]]]]:
    """Every way of giving the relations' agents to tracks so that each relation is an event."""
    if not relations:
        yield bound, pairs
        return
    first, *rest = relations
    wanted = {each["id"]: each for each in label["agents"]}
    seen = {each.id: each for each in submission.agents}
    for event in submission.events:
        if event.type != first["type"]:
            continue
        ends = [(event.from_, event.to)]
        # Labels name the yielding and the following agent, not always the striking one.
        if event.type not in _DIRECTED:
            ends.append((event.to, event.from_))
        for pair in ends:
            named = dict(zip((first["from"], first["to"]), pair, strict=True))
            both = {**bound, **named}
            # Names and tracks stay one to one.
            if len({*both.values()}) == len(both) and all(
                bound.get(name, n) == n and is_like(wanted[name], seen[n])
                for name, n in named.items()
            ):
                more = pairs | {_pair(event)}
                yield from _list_bindings(rest, label, submission, both, more)


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
) -> dict[str, PlanningShare]:
    """The figures of `RATES`, each with its n."""
    counts = Counter(each.outcome for each in verdicts)
    impossible = sum(bool(row["expected"]["refused"]) for row in rows)
    possible, made = len(rows) - impossible, counts["satisfied"] + counts["wrong"]
    return {
        "satisfied": PlanningShare(counts["satisfied"], possible),
        "false": PlanningShare(counts["wrong"], made),
        "refused": PlanningShare(counts["refused"], possible),
        "rightly refused": PlanningShare(counts["rightly_refused"], impossible),
    }


def to_markdown(shares: Mapping[str, PlanningShare], verdicts: Sequence[Verdict]) -> str:
    """The figures, and why scenes are wrong."""
    rows = [[RATES[name], f"{s.right} / {s.n}", format_share(s.to_json())]
            for name, s in shares.items()]  # fmt: skip
    reasons = Counter[str]()
    for each in verdicts:
        if each.outcome == "wrong":  # counted without numbers, names and quotes
            words = (each.reason or "").split()
            reasons[" ".join(words[: 2 if words[:1] == ["unasked"] else 4])] += 1
    parts = [format_table(["figure", "count", "share [95 %]"], rows)]
    if reasons:
        parts.append(format_table(["why scenes are wrong", "scenes"],
                                  [[k, str(n)] for k, n in reasons.most_common()]))  # fmt: skip
    return "\n\n".join(parts) + "\n"


def format_share(figure: Mapping[str, Any]) -> str:
    """Format `rate` and `interval` in percent."""
    if figure["rate"] is None:
        return "–"
    low, high = figure["interval"]
    return f"{100 * figure['rate']:.1f} % [{100 * low:.1f}, {100 * high:.1f}]"


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


_ALONG = math.radians(50.0)
"""A vehicle on a leg moves within this of the leg's direction."""
_BESIDE = math.radians(35.0)
"""A vehicle on a leg lies within this of the leg's bearing from the middle."""
_OUTSIDE = 12.0
"""Nearer to the middle than this a vehicle is on no leg [m]."""
_WAY = 1.0
"""Way over which the direction at an end of a track is measured [m]."""
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
    entry: Compass | None
    exit: Compass | None
    movement: str | None
    crosswalks: frozenset[Compass]


def see_agents(users: Iterable[RoadUser], intersection: IntersectionMap) -> list[SeenAgent]:
    """Every road user of a scene, as the map lets its track be read."""
    found = []
    turns = {(each.entry, each.exit): each.turn for each in intersection.movements}
    for user in users:
        xy = user.track.xy
        if user.shape.type == "pedestrian":
            way = geos.LineString(xy) if len(xy) > 1 else geos.LineString()
            walks = ((each.leg, geos.Polygon(each.polygon)) for each in intersection.crosswalks)
            used = frozenset(leg for leg, area in walks if way.intersection(area).length > _CROSSED)
            road = (geos.Polygon(area.exterior, area.holes) for area in intersection.road)
            on_road = sum(way.intersection(area).length for area in road) > _CROSSED
            movement = "crossing" if used else "jaywalking" if on_road else None
            found.append(SeenAgent(user.id, "pedestrian", None, None, movement, used))
            continue
        entry, leaving = _find_leg(xy, intersection), _find_leg(xy[::-1], intersection)
        movement = turns.get((entry, leaving)) if entry and leaving else None
        found.append(SeenAgent(user.id, user.shape.type, entry, leaving, movement, frozenset()))
    return found


def _find_leg(xy: FloatArray, intersection: IntersectionMap) -> Compass | None:
    """The leg on which a way begins (or, given backwards, ends); None where it is on none."""
    away = np.hypot(*(xy - xy[0]).T)
    if away.max() < _WAY or np.hypot(*xy[0]) < _OUTSIDE:
        return None
    ahead = xy[int(np.argmax(away >= _WAY))] - xy[0]
    outward = math.atan2(-ahead[1], -ahead[0])
    place = math.atan2(xy[0][1], xy[0][0])
    near = [
        (_differ(place, leg.bearing), leg.name)
        for leg in intersection.legs
        if _differ(place, leg.bearing) < _BESIDE and _differ(outward, leg.bearing) < _ALONG
    ]
    return min(near)[1] if near else None


def _differ(a: float, b: float) -> float:
    return abs(math.remainder(a - b, math.tau))
