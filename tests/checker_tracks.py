"""Hand-made tracks and a hand-made intersection: every answer can be worked out on paper."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.events import Proof
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Crosswalk, Leg, PolygonWithHoles, StopLine
from scenewright.scene.record import (
    AgentRecord,
    RelationRecord,
    SceneMeta,
    SceneRecord,
    SignalRecord,
)
from scenewright.scene.track import PEDESTRIAN, Shape, Track, get_vehicle_shape
from scenewright.tools.relation_checker import RoadUser

CAR = get_vehicle_shape("car")
EAST, NORTH, WEST, SOUTH = (k * np.pi / 2 for k in range(4))


def list_rules(proof: Proof) -> set[str]:
    """List the rules that the findings of a proof break."""
    groups = (proof.missing, proof.interference, proof.implausible, proof.signal_violations)
    return {finding.rule for group in groups for finding in group}


def distance(v0: float, *phases: tuple[float, float]) -> FloatArray:
    """[T] distance driven every 0.1 s: from speed v0 through phases (acceleration, duration)."""
    total = sum(duration for _, duration in phases)
    times = np.round(np.arange(0.0, total + 1e-9, 0.1), 3)
    s, result = 0.0, np.zeros(len(times))
    begin, v = 0.0, v0
    for a, duration in phases:
        inside = (times >= begin - 1e-9) & (times <= begin + duration + 1e-9)
        t = times[inside] - begin
        result[inside] = s + v * t + a * t * t / 2
        s += v * duration + a * duration**2 / 2
        v += a * duration
        begin += duration
    return result


def line(
    n: int,
    start: tuple[float, float],
    angle: float,
    s: FloatArray,
    *,
    at: float = 0.0,
    shape: Shape = CAR,
) -> RoadUser:
    """A road user on a straight line."""
    xy = np.array(start) + s[:, None] * np.array((np.cos(angle), np.sin(angle)))
    return RoadUser(n, Track(np.round(xy, 3), np.full(len(s), angle), at), shape)


def along(
    n: int, points: FloatArray, s: FloatArray, *, at: float = 0.0, shape: Shape = CAR
) -> RoadUser:
    """A road user along a dense polyline."""
    step = np.hypot(*np.diff(points, axis=0).T)
    total = np.concatenate(([0.0], np.cumsum(step)))
    xy = np.stack([np.interp(s, total, points[:, k]) for k in (0, 1)], axis=1)
    angle = np.unwrap(np.arctan2(*np.gradient(points, axis=0).T[::-1]))
    return RoadUser(n, Track(np.round(xy, 3), np.interp(s, total, angle), at), shape)


def bend(
    start: tuple[float, float],
    angle: float,
    before: float,
    *turning: float,
) -> FloatArray:
    """Points every 5 cm or so: straight, an arc (radius, turn > 0 is left), straight."""
    radius, turn, after = turning
    k, ds = np.sign(turn) / radius, 0.05
    lengths = (before, radius * abs(turn), after)
    curvature = np.concatenate(
        [np.full(int(n / ds), c) for n, c in zip(lengths, (0.0, k, 0.0), strict=True)]
    )
    heading = angle + np.concatenate(([0.0], np.cumsum(curvature) * ds))
    middle = (heading[1:] + heading[:-1]) / 2
    steps = ds * np.stack((np.cos(middle), np.sin(middle)), axis=1)
    return np.array(start) + np.concatenate((np.zeros((1, 2)), np.cumsum(steps, axis=0)))


def walk(
    n: int, start: tuple[float, float], angle: float, s: FloatArray, *, at: float = 0.0
) -> RoadUser:
    """A pedestrian on a straight line."""
    return line(n, start, angle, s, at=at, shape=PEDESTRIAN)


def moved(
    user: RoadUser, *, turn: float = 0.0, shift: tuple[float, float] = (0.0, 0.0)
) -> RoadUser:
    """Rotated about the origin, then shifted."""
    c, s = np.cos(turn), np.sin(turn)
    xy = user.track.xy @ np.array(((c, s), (-s, c))) + np.array(shift)
    track = Track(xy, user.track.heading + turn, user.track.start, user.track.step)
    return RoadUser(user.id, track, user.shape)


def mirrored(user: RoadUser) -> RoadUser:
    """With north and south exchanged."""
    track = user.track
    return RoadUser(
        user.id, Track(track.xy * np.array((1.0, -1.0)), -track.heading, track.start), user.shape
    )


def later(user: RoadUser, seconds: float) -> RoadUser:
    """The same track, delayed."""
    track = user.track
    return RoadUser(user.id, Track(track.xy, track.heading, track.start + seconds), user.shape)


def resampled(user: RoadUser, step: float) -> RoadUser:
    """The same motion at another time step."""
    track = user.track
    times = np.arange(track.start, track.end + 1e-9, step)
    xy = np.stack([np.interp(times, track.times, track.xy[:, k]) for k in (0, 1)], axis=1)
    heading = np.interp(times, track.times, track.heading)
    return RoadUser(user.id, Track(xy, heading, track.start, step), user.shape)


def scene(
    users: Sequence[RoadUser],
    *relations: tuple[Any, ...],
    background: Sequence[int] = (),
    signals: Sequence[SignalRecord] = (),
    duration: float = 30.0,
    **changes: Any,
) -> SceneRecord:
    """A scene record; relations are (type, from, to) or (type, from, to, {more})."""
    return SceneRecord(
        meta=SceneMeta(
            scene_id="t", map_id=0, timestamp=43200.0, user_prompt="", intersection="plus",
            step=0.1, duration=duration, time_of_day="12:00", seed=0,
        ),
        agents=tuple(agent(u, background=u.id in background, **changes) for u in users),
        events=(),
        relations=tuple(
            RelationRecord.model_validate(
                {"type": r[0], "from": r[1], "to": r[2], **(r[3] if len(r) > 3 else {})}
            )
            for r in relations
        ),
        signals=tuple(signals),
    )  # fmt: skip


def agent(user: RoadUser, *, background: bool = False, **changes: Any) -> AgentRecord:
    """An agent record; its journey is arbitrary on purpose."""
    values: dict[str, Any] = {
        "id": user.id, "type": user.shape.type, "spawn_time": round(user.track.start, 3),
        "goal": (0.0, 0.0), "trajectory": tuple(map(tuple, user.track.xy.round(3).tolist())),
        "role": "background" if background else "foreground",
        "name": f"{user.shape.type}-{user.id}", "route": "r",
        "entry": "west", "exit": "east", "movement": "straight",
        "heading": tuple(user.track.heading.tolist()), "length": user.shape.length,
        "width": user.shape.width,
    }  # fmt: skip
    return AgentRecord.model_validate({**values, **changes})


def box(west: float, south: float, east: float, north: float) -> tuple[tuple[float, float], ...]:
    return ((west, south), (east, south), (east, north), (west, north))


@cache
def plus_map() -> IntersectionMap:
    """Two roads 7 m wide that cross at the origin; a stop line and a crosswalk on the west leg."""
    corner = 100.0
    return IntersectionMap(
        name="plus", map_id=0, title="plus", extent=100.0,
        legs=(Leg(name="west", road="a", bearing=np.pi), Leg(name="east", road="a", bearing=0.0)),
        lanelets=(),
        stop_lines=(
            StopLine(id="west:stop", leg="west", lanelets=(), line=((-12.0, -3.5), (-12.0, 0.0))),
        ),
        crosswalks=(
            Crosswalk(
                id="west:crosswalk", leg="west", polygon=box(-10.0, -3.5, -6.0, 3.5),
                centreline=((-8.0, -3.5), (-8.0, 3.5)), sides=("south", "north"), width=4.0,
            ),
        ),
        road=(
            PolygonWithHoles(exterior=box(-corner, -3.5, corner, 3.5)),
            PolygonWithHoles(exterior=box(-3.5, -corner, 3.5, corner)),
        ),
        walkable=(
            PolygonWithHoles(exterior=box(-corner, 3.5, -3.5, 20.0)),
            PolygonWithHoles(exterior=box(-corner, -20.0, -3.5, -3.5)),
        ),
        goal_regions=(), movements=(), conflict_zones=(), signals=None, routes=(),
    )  # fmt: skip


def light(colour: str, start: float, end: float, *, crosswalk: bool = False) -> SignalRecord:
    name = {"crosswalk": "west:crosswalk"} if crosswalk else {"stop_line": "west:stop"}
    return SignalRecord.model_validate({**name, "start": start, "end": end, "colour": colour})


def yielding_car(n: int = 1) -> RoadUser:
    """East along y = -1.75: 10 m/s, brakes at 3 m/s^2 from x = -29.667 at 2.033 s, stands with its
    centre at x = -13 from 5.367 s to 8.967 s, then goes on at 2 m/s^2."""
    s = distance(10.0, (0.0, 61 / 30), (-3.0, 10 / 3), (0.0, 3.6), (2.0, 4.0), (0.0, 5.0))
    return line(n, (-50.0, -1.75), EAST, s)


def crossing_walker(n: int = 2, *, at: float = 3.0) -> RoadUser:
    """North along x = -8 at 1.4 m/s, at y = -6 at that time, and in sight for 3 s by then."""
    early = min(at, 3.0)
    return walk(
        n, (-8.0, -6.0 - 1.4 * early), NORTH, distance(1.4, (0.0, 9.0 + early)), at=at - early
    )
