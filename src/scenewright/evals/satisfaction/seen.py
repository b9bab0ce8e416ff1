"""What tracks show of each road user: its class, where it comes from, goes to, and crosses."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from scenewright.dataset.batch.rows import choose_folder
from scenewright.errors import InputError
from scenewright.evals.satisfaction.judge import Submission
from scenewright.graph.run import load_scene, load_tracks, verify, verify_tracks
from scenewright.intersections import load_map
from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.tools.relation_checker import RoadUser, read_users

geos: Any = import_module("shapely")  # has no types of its own
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
        if user.shape.type == "pedestrian":
            found.append(_see_pedestrian(user, intersection))
            continue
        xy = user.track.xy
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


def _see_pedestrian(user: RoadUser, intersection: IntersectionMap) -> SeenAgent:
    way = geos.LineString(user.track.xy) if len(user.track.xy) > 1 else None
    used = frozenset(
        crosswalk.leg
        for crosswalk in intersection.crosswalks
        if way is not None and way.intersection(geos.Polygon(crosswalk.polygon)).length > _CROSSED
    )
    movement = "crossing" if used else None
    if way is not None and not used:
        on_road = sum(
            way.intersection(geos.Polygon(area.exterior, area.holes)).length
            for area in intersection.road
        )
        movement = "jaywalking" if on_road > _CROSSED else None
    return SeenAgent(user.id, "pedestrian", None, None, movement, used)


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
