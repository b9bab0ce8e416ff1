"""A plus-shaped intersection and a scene on it whose every position is known by hand.

Avenue north-south, two lanes per direction; street east-west, one per direction; lanes 3.3 m.
A car from the south stops before the north crosswalk for a walker, then drives on.
"""

from __future__ import annotations

from functools import cache
from math import pi

import numpy as np
import pytest

from scenewright.scene.account import AccountEntry
from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.events import Event, Proof
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import (
    ConflictZone,
    Crosswalk,
    GoalRegion,
    Lanelet,
    Leg,
    PolygonWithHoles,
    Polyline,
    SignalGroup,
    SignalPhase,
    SignalProgram,
    StopLine,
    VehicleMovement,
)
from scenewright.scene.record import (
    AgentRecord,
    EventRecord,
    RelationRecord,
    SceneMeta,
    SceneRecord,
    SegmentRecord,
    SignalRecord,
)

EXTENT = 60.0
LANE = 3.3
AVENUE = 2 * LANE
STREET = LANE
WALK = 4.0
CURB = 4.0
BEARING: dict[Compass, float] = {"east": 0.0, "north": pi / 2, "west": pi, "south": -pi / 2}
HALF: dict[Compass, float] = {"north": AVENUE, "south": AVENUE, "east": STREET, "west": STREET}
DEPTH: dict[Compass, float] = {"north": STREET, "south": STREET, "east": AVENUE, "west": AVENUE}


def turned(points: list[tuple[float, float]], leg: Compass) -> Polyline:
    """Leg coordinates (along the leg outwards, to its left) in the map frame."""
    along = np.array([np.cos(BEARING[leg]), np.sin(BEARING[leg])])
    left = np.array([-along[1], along[0]])
    rows = [a * along + b * left for a, b in points]
    return tuple((round(float(x), 6), round(float(y), 6)) for x, y in rows)


def polygon_at(leg: Compass, near: float, far: float, right: float, left: float) -> Polyline:
    return turned([(near, right), (far, right), (far, left), (near, left)], leg)


def lanelets_of(leg: Compass) -> list[Lanelet]:
    """Driving on the right: seen outwards, exits lie right (b < 0), approaches left (b > 0)."""
    lanes = []
    count = round(HALF[leg] / LANE)
    start = DEPTH[leg] + CURB + WALK + 1.0
    for i in range(count):
        low, high = i * LANE, (i + 1) * LANE
        inner, outer = (
            turned([(EXTENT, low), (start, low)], leg),
            turned([(EXTENT, high), (start, high)], leg),
        )
        middle = turned([(EXTENT, (low + high) / 2), (start, (low + high) / 2)], leg)
        lanes.append(_lanelet(f"{leg}-in-{i}", "approach", leg, inner, outer, middle))
        inner, outer = (
            turned([(start, -low), (EXTENT, -low)], leg),
            turned([(start, -high), (EXTENT, -high)], leg),
        )
        middle = turned([(start, -(low + high) / 2), (EXTENT, -(low + high) / 2)], leg)
        lanes.append(_lanelet(f"{leg}-out-{i}", "exit", leg, inner, outer, middle))
    return lanes


def _lanelet(name, kind, leg, *lines: Polyline) -> Lanelet:
    left, right, middle = lines
    return Lanelet(
        id=name, kind=kind, leg=leg, left=left, right=right, centreline=middle,
        width=LANE, speed_limit=11.2,
    )  # fmt: skip


def crosswalk_of(leg: Compass) -> Crosswalk:
    near = DEPTH[leg] + CURB
    ends = turned([(near + WALK / 2, HALF[leg]), (near + WALK / 2, -HALF[leg])], leg)
    sides: dict[Compass, tuple[Compass, Compass]] = {
        "north": ("west", "east"),
        "south": ("east", "west"),
        "east": ("north", "south"),
        "west": ("south", "north"),
    }
    return Crosswalk(
        id=f"crosswalk-{leg}",
        leg=leg,
        polygon=polygon_at(leg, near, near + WALK, -HALF[leg], HALF[leg]),
        centreline=(ends[0], ends[1]),
        sides=sides[leg],
        width=WALK,
    )


def stop_line_of(leg: Compass) -> StopLine:
    at = DEPTH[leg] + CURB + WALK + 1.0
    ends = turned([(at, 0.0), (at, HALF[leg])], leg)
    lanes = tuple(lane.id for lane in lanelets_of(leg) if lane.kind == "approach")
    return StopLine(id=f"stop-{leg}", leg=leg, lanelets=lanes, line=(ends[0], ends[1]))


def _road() -> PolygonWithHoles:
    a, s, e, c = AVENUE, STREET, EXTENT, CURB
    corner = [(a, e), (a, s + c), (a + 0.3 * c, s + 0.3 * c), (a + c, s), (e, s)]
    ring: list[tuple[float, float]] = []
    for sx, sy in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
        part = [(sx * x, sy * y) for x, y in corner]
        ring += part if sx * sy > 0 else part[::-1]
    return PolygonWithHoles(exterior=tuple(ring[::-1]))


def _walkable() -> tuple[PolygonWithHoles, ...]:
    a, s, e, c, w = AVENUE, STREET, EXTENT, CURB, 5.0
    ring = [(a, e), (a, s + c), (a + 0.3 * c, s + 0.3 * c), (a + c, s), (e, s),
            (e, s + w), (a + w, s + w), (a + w, e)]  # fmt: skip
    parts = []
    for sx, sy in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
        part = [(sx * x, sy * y) for x, y in ring]
        parts.append(PolygonWithHoles(exterior=tuple(part if sx * sy > 0 else part[::-1])))
    return tuple(parts)


def _movements() -> tuple[VehicleMovement, ...]:
    out: list[VehicleMovement] = []
    opposite: dict[Compass, Compass] = {
        "north": "south", "south": "north", "east": "west", "west": "east",
    }  # fmt: skip
    for entry, leave in opposite.items():
        offset = LANE / 2 if HALF[entry] == STREET else 1.5 * LANE
        line = turned([(EXTENT, offset), (-EXTENT, offset)], entry)
        group = "avenue" if entry in ("north", "south") else "street"
        out.append(
            VehicleMovement(
                id=f"{entry}>{leave}",
                entry=entry,
                exit=leave,
                turn="straight",
                lanelets=(),
                stop_line=f"stop-{entry}",
                centreline=line,
                signal_group=group,
            )
        )
    return tuple(out)


@cache
def plus_map() -> IntersectionMap:
    """The intersection, 120 m across."""
    legs: tuple[Compass, ...] = ("north", "east", "south", "west")
    movements = _movements()
    groups = (
        SignalGroup(id="avenue", movements=("north>south", "south>north"),
                    crosswalks=("crosswalk-east", "crosswalk-west")),
        SignalGroup(id="street", movements=("east>west", "west>east"),
                    crosswalks=("crosswalk-north", "crosswalk-south")),
    )  # fmt: skip
    phases = tuple(
        SignalPhase(duration=d, colours={"avenue": a, "street": s})
        for d, a, s in ((30, "green", "red"), (4, "yellow", "red"), (22, "red", "green"))
    )
    return IntersectionMap(
        name="plus",
        map_id=1,
        title="A plus: two-way avenue, two-way street",
        extent=EXTENT,
        legs=tuple(
            Leg(
                name=leg,
                road="Avenue" if leg in ("north", "south") else "Street",
                bearing=BEARING[leg],
            )
            for leg in legs
        ),
        lanelets=tuple(lane for leg in legs for lane in lanelets_of(leg)),
        stop_lines=tuple(stop_line_of(leg) for leg in legs),
        crosswalks=tuple(crosswalk_of(leg) for leg in legs),
        road=(_road(),),
        walkable=_walkable(),
        goal_regions=tuple(
            GoalRegion(
                id=f"goal-{leg}",
                type="vehicle",
                leg=leg,
                polygon=polygon_at(leg, EXTENT - 4, EXTENT, -HALF[leg], 0.0),
            )
            for leg in legs
        ),
        movements=movements,
        conflict_zones=(
            ConflictZone(
                id="zone-1",
                first="south>north",
                second="crosswalk-north",
                polygon=polygon_at("north", 7.3, 11.3, -AVENUE, -LANE),
            ),
        ),
        signals=SignalProgram(groups=groups, phases=phases),
        routes=(),
    )


def timed(points: list[tuple[float, float, float]]) -> tuple[float, FloatArray, FloatArray]:
    """Start, xy [T, 2] and heading [T] of a motion through (t, x, y), linear in between."""
    knots = np.array(points)
    times = np.arange(knots[0, 0], knots[-1, 0] + 1e-9, 0.1)
    xy = np.stack([np.interp(times, knots[:, 0], knots[:, i]) for i in (1, 2)], axis=1)
    step = np.gradient(xy, axis=0)
    heading = np.zeros(len(xy))
    last = np.arctan2(*(knots[1, 1:] - knots[0, 1:])[::-1])
    for i, (dx, dy) in enumerate(step):
        last = np.arctan2(dy, dx) if np.hypot(dx, dy) > 1e-3 else last
        heading[i] = last
    return float(times[0]), np.round(xy, 3), np.unwrap(heading)


def agent(number: int, points: list[tuple[float, float, float]], **keys: object) -> AgentRecord:
    start, xy, heading = timed(points)
    kind = keys.get("type", "vehicle")
    size = {"length": 4.6, "width": 1.85} if kind == "vehicle" else {"length": 0.6, "width": 0.6}
    base: dict[str, object] = {
        "id": number, "type": kind, "spawn_time": start, "goal": tuple(xy[-1]),
        "trajectory": xy.tolist(), "role": "background", "name": f"{kind}-{number}",
        "movement": "straight" if kind == "vehicle" else "crossing", "route": "plain",
        "heading": heading.tolist(), **size,
    }  # fmt: skip
    return AgentRecord.model_validate(base | keys)


def _yielding_car() -> AgentRecord:
    x, brake = 1.5 * LANE, np.linspace(0, 1, 12)
    slow = [(5.0 + 3.2 * u, x, -22.0 + 26.0 * (1 - (1 - u) ** 2)) for u in brake]
    away = [(12.4 + 6.0 * u, x, 4.0 + 55.0 * u**1.8) for u in np.linspace(0, 1, 12)]
    return agent(
        1, [(0.0, x, -60.0), *slow, (12.3, x, 4.0), *away], role="foreground", subtype="car",
        entry="south", exit="north",
        segments=(
            SegmentRecord(start=0, end=5.0, anchor="stop-south", status="keep"),
            SegmentRecord(start=5.0, end=12.4, anchor="crosswalk-north", status="stop"),
            SegmentRecord(start=12.4, end=18.4, anchor="exit-north", status="proceed"),
        ),
    )  # fmt: skip


def _crossing_walker() -> AgentRecord:
    return agent(
        2, [(2.0, 9.5, 25.0), (7.0, 9.0, 11.0), (8.0, 7.5, 9.4), (19.0, -8.0, 9.3),
            (24.0, -9.0, 16.0)],
        type="pedestrian", role="foreground", entry="east", exit="west", crosswalk="north",
        segments=(
            SegmentRecord(start=2.0, end=8.0, anchor="crosswalk-north", status="keep"),
            SegmentRecord(start=8.0, end=24.0, anchor="goal-west", status="proceed"),
        ),
    )  # fmt: skip


def _background() -> list[AgentRecord]:
    return [
        agent(3, [(0.0, -40.0, -1.65), (7.0, -16.5, -1.65), (26.0, -16.5, -1.65),
                  (30.0, -2.0, -1.65)], subtype="car", entry="west", exit="east"),
        agent(4, [(0.0, -4.95, 58.0), (10.0, -4.95, -50.0)], subtype="truck",
              entry="north", exit="south", length=8.5, width=2.5),
        agent(5, [(3.0, -9.0, -45.0), (30.0, -9.0, -10.0)], type="pedestrian",
              entry="south", exit="north"),
        agent(6, [(0.0, 40.0, 6.0), (24.0, 12.0, 6.0)], type="pedestrian",
              entry="east", exit="west"),
        agent(7, [(9.0, -20.0, -1.65), (14.0, 40.0, -1.65)], subtype="car",
              entry="west", exit="east"),
    ]  # fmt: skip


def _signals() -> tuple[SignalRecord, ...]:
    rows = []
    for leg, (first, then) in (
        ("north", ("green", "red")), ("south", ("green", "red")),
        ("east", ("red", "green")), ("west", ("red", "green")),
    ):  # fmt: skip
        line, walk = f"stop-{leg}", f"crosswalk-{leg}"
        rows += [
            SignalRecord(stop_line=line, start=0.0, end=26.0, colour=first),
            SignalRecord(stop_line=line, start=26.0, end=30.0, colour=then),
            SignalRecord(crosswalk=walk, start=0.0, end=26.0, colour=then),
            SignalRecord(crosswalk=walk, start=26.0, end=30.0, colour=first),
        ]
    return tuple(rows)


PROMPT = (
    "A car coming from the south yields to a pedestrian who walks west over the north "
    "crosswalk, with light traffic around noon."
)


@cache
def yielding_record() -> SceneRecord:
    """A car gives way to a walker at t = 8.2 s; four background agents."""
    return SceneRecord(
        meta=SceneMeta(
            scene_id="plus-000001", map_id=1, timestamp=43200.0, user_prompt=PROMPT,
            intersection="plus", step=0.1, duration=30.0, time_of_day="12:00", density="low",
            seed=1,
        ),
        agents=(_yielding_car(), _crossing_walker(), *_background()),
        events=(
            EventRecord.model_validate(
                {"type": "yielding", "from": 1, "to": 2, "time": 8.2, "location": (4.95, 4.0)}
            ),
        ),
        relations=(RelationRecord.model_validate({"type": "yielding", "from": 1, "to": 2}),),
        signals=_signals(),
    )  # fmt: skip


@cache
def yielding_proof() -> Proof:
    event = Event.model_validate(
        {
            "type": "yielding",
            "from": 1,
            "to": 2,
            "time": 8.2,
            "location": (4.95, 4.0),
            "evidence": {"pet": 2.4, "clearance": 2.1, "lowest_speed": 0.0},
        }
    )
    return Proof(
        verified=True,
        events=(event,),
        account=(account_entry("car", "seen", claim="class car", agents=(1,)),),
        figures={"vehicles": 4, "pedestrians": 3},
    )


def account_entry(words: str, state: str, text: str = PROMPT, **fields: object) -> AccountEntry:
    """The entry of words of a text."""
    start = text.index(words)
    return AccountEntry.model_validate(
        {"start": start, "end": start + len(words), "words": words, "state": state, **fields}
    )


@pytest.fixture
def partly(proof: Proof) -> Proof:
    """The proof where two words of the prompt are not shown."""
    amber = (account_entry("coming", "not_shown"), account_entry("light", "not_shown"))
    return proof.model_copy(update={"account": (*proof.account, *amber)})


@pytest.fixture
def intersection() -> IntersectionMap:
    return plus_map()


@pytest.fixture
def scene() -> SceneRecord:
    return yielding_record()


@pytest.fixture
def proof() -> Proof:
    return yielding_proof()
