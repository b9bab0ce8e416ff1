"""Builds the map of a right-angled, signalised four-leg intersection from a few measures.

`build_map()` gives the shipped `amsterdam_120`, modelled on Amsterdam Avenue and West 120th
Street, New York. Pure and deterministic; coordinates are rounded to a millimetre.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np

from lab.bundle.four_leg_plan import (
    AMSTERDAM_120,
    BEARINGS,
    LEGS,
    FourLegPlan,
    locate_point,
)
from scenewright.scene.base import Colour, Compass, FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import (
    Crosswalk,
    GoalRegion,
    Lanelet,
    Leg,
    Polyline,
    SignalGroup,
    SignalPhase,
    SignalProgram,
    StopLine,
    VehicleMovement,
)
from scenewright.tools.map_import.compass import find_sides, rotate_compass
from scenewright.tools.map_import.map_parts import (
    build_area,
    build_conflict_zones,
    build_lanelet,
    build_pedestrian_routes,
    build_ring,
    build_vehicle_route,
    geos,
    round_points,
)

Turn = Literal["straight", "left", "right"]
_Side = Literal["approach", "exit"]

_TURNS: tuple[tuple[Turn, int], ...] = (("left", 2), ("straight", 4), ("right", 6))
"""Each turn, and how many eighths clockwise of the entry its exit lies."""
_LANE_NAMES = ("inner", "outer")
_HANDLE = 0.62
"""Bezier handle of a turn: 0.55 is an ellipse; more eases into the curve."""


def build_map(plan: FourLegPlan = AMSTERDAM_120) -> IntersectionMap:
    """The whole map of a four-leg intersection."""
    road = _build_road(plan)
    crosswalks = tuple(_build_crosswalk(plan, leg, road) for leg in LEGS)
    turns = [(leg, turn, rotate_compass(leg, step)) for leg in LEGS for turn, step in _TURNS]
    movements = tuple(_build_movement(plan, *each) for each in turns)
    lines = {
        m.id: [np.array(_build_whole_line(plan, m.entry, m.exit, *pair)) for pair in pairs]
        for m, pairs in zip(movements, (_pair_lanes(plan, *t[:2]) for t in turns), strict=True)
    }
    return IntersectionMap(
        name=plan.name,
        map_id=plan.map_id,
        title=plan.title,
        extent=plan.extent,
        legs=tuple(Leg(name=e, road=plan.get_road(e).name, bearing=BEARINGS[e]) for e in LEGS),
        lanelets=tuple(_build_lanelets(plan)),
        stop_lines=tuple(_build_stop_line(plan, leg) for leg in LEGS),
        crosswalks=crosswalks,
        road=(build_area(road),),
        walkable=tuple(build_area(_build_sidewalk(plan, leg, road)) for leg in LEGS),
        goal_regions=tuple(_build_goal_regions(plan)),
        movements=movements,
        conflict_zones=tuple(build_conflict_zones(lines, movements, crosswalks)),
        signals=_build_signals(plan, movements, crosswalks),
        routes=(*map(build_vehicle_route, movements), *build_pedestrian_routes(LEGS)),
    )


def write_map(folder: Path, plan: FourLegPlan = AMSTERDAM_120) -> IntersectionMap:
    """Build the map and write it as `map.json` into a bundle's folder."""
    built = build_map(plan)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "map.json").write_text(built.model_dump_json() + "\n", encoding="utf-8")
    return built


def _build_box(leg: Compass, along: tuple[float, float], across: tuple[float, float]) -> Any:
    (a, b), (c, d) = along, across
    return geos.Polygon([locate_point(leg, *p) for p in ((a, c), (b, c), (b, d), (a, d))])


def _build_road(plan: FourLegPlan) -> Any:
    e, a, s = plan.extent, plan.avenue.half_width, plan.street.half_width
    strips = [_build_box("north", (-e, e), (-a, a)), _build_box("east", (-e, e), (-s, s))]
    return geos.unary_union([*strips, *(_build_fillet(plan, leg) for leg in LEGS)])


def _build_fillet(plan: FourLegPlan, leg: Compass) -> Any:
    """The piece of road that the rounded kerb adds in the corner clockwise of a leg."""
    r = plan.corner_radius
    near, side = plan.get_crossed_road(leg).half_width, plan.get_road(leg).half_width
    square = _build_box(leg, (near - 0.01, near + r), (-side - r, -side + 0.01))
    return square.difference(geos.Point(locate_point(leg, near + r, -side - r)).buffer(r, 16))


def _build_sidewalk(plan: FourLegPlan, leg: Compass, road: Any) -> Any:
    """The sidewalks that meet in the corner clockwise of a leg, with the corner."""
    other = rotate_compass(leg, 2)
    strips = [
        _build_box(
            leg, (plan.get_road(other).half_width, plan.extent), plan.measure_sidewalk(leg, -1)
        ),
        _build_box(
            other, (plan.get_road(leg).half_width, plan.extent), plan.measure_sidewalk(other, 1)
        ),
    ]
    return geos.unary_union(strips).difference(road)


def _build_lanelets(plan: FourLegPlan) -> Iterator[Lanelet]:
    for leg in LEGS:
        for index in range(len(plan.get_road(leg).lanes)):
            yield _build_approach(plan, leg, index)
            yield _build_driving_lane(plan, leg, index, "exit", ())
        yield from (_build_parking(plan, leg, side) for side in ("approach", "exit"))
    for leg in LEGS:
        for turn, step in _TURNS:
            for pair in _pair_lanes(plan, leg, turn):
                yield _build_connector(plan, leg, rotate_compass(leg, step), *pair)


def _name_lane(plan: FourLegPlan, leg: Compass, side: _Side, index: int) -> str:
    """The name of a driving lane, e.g. `north:approach:inner`."""
    lanes = plan.get_road(leg).lanes
    return f"{leg}:{side}" + (f":{_LANE_NAMES[index]}" if len(lanes) > 1 else "")


def _name_connector(plan: FourLegPlan, leg: Compass, to: Compass, lane: int) -> str:
    return f"{leg}>{to}" + (f":{_LANE_NAMES[lane]}" if len(plan.get_road(leg).lanes) > 1 else "")


def _pair_lanes(plan: FourLegPlan, leg: Compass, turn: Turn) -> list[tuple[int, int]]:
    """Which lane leads into which, commonest first: turns keep to their own side of the road."""
    outer_in, outer_out = (
        len(plan.get_road(leg).lanes) - 1,
        len(plan.get_crossed_road(leg).lanes) - 1,
    )
    if turn == "straight":
        return [(i, i) for i in reversed(range(outer_in + 1))]
    return [(0, 0)] if turn == "left" else [(outer_in, outer_out)]


def _build_approach(plan: FourLegPlan, leg: Compass, index: int) -> Lanelet:
    onwards = tuple(
        _name_connector(plan, leg, rotate_compass(leg, step), index)
        for turn, step in _TURNS
        if any(lane == index for lane, _ in _pair_lanes(plan, leg, turn))
    )
    return _build_driving_lane(plan, leg, index, "approach", onwards)


def _build_driving_lane(
    plan: FourLegPlan, leg: Compass, index: int, side: _Side, successors: tuple[str, ...]
) -> Lanelet:
    road, name = plan.get_road(leg), _name_lane(plan, leg, side, index)
    fields = {"width": road.lanes[index], "kind": side, "successors": successors}
    return _build_strip(plan, leg, side, road.measure_lane_middle(index), id=name, **fields)


def _build_parking(plan: FourLegPlan, leg: Compass, side: _Side) -> Lanelet:
    road, name = plan.get_road(leg), f"{leg}:parking:{side}"
    middle = road.half_width - road.parking / 2
    return _build_strip(plan, leg, side, middle, id=name, width=road.parking, kind="parking")


def _build_strip(
    plan: FourLegPlan, leg: Compass, side: _Side, middle: float, **fields: Any
) -> Lanelet:
    """A straight lane between map edge and stop line, in driving direction."""
    sign = 1 if side == "approach" else -1
    ends = [plan.extent, plan.measure_stop(leg)][::sign]
    line = np.array([locate_point(leg, along, sign * middle) for along in ends])
    return build_lanelet(line, leg=leg, speed_limit=plan.speed_limit, **fields)


def _build_connector(
    plan: FourLegPlan, leg: Compass, to: Compass, lane_in: int, lane_out: int
) -> Lanelet:
    return build_lanelet(
        _build_curve(plan, leg, to, lane_in, lane_out),
        id=_name_connector(plan, leg, to, lane_in),
        kind="connector",
        leg=None,
        width=min(plan.get_road(leg).lanes[lane_in], plan.get_road(to).lanes[lane_out]),
        speed_limit=plan.speed_limit,
        successors=(_name_lane(plan, to, "exit", lane_out),),
    )


def _build_curve(
    plan: FourLegPlan, leg: Compass, to: Compass, lane_in: int, lane_out: int
) -> FloatArray:
    """[P, 2] middle of the path through the junction, from stop line to the exit lane."""
    start = np.array(
        locate_point(leg, plan.measure_stop(leg), plan.get_road(leg).measure_lane_middle(lane_in))
    )
    end = np.array(
        locate_point(to, plan.measure_stop(to), -plan.get_road(to).measure_lane_middle(lane_out))
    )
    if to == rotate_compass(leg, 4):
        return np.linspace(start, end, 9)
    inwards = np.array(locate_point(leg, -1.0, 0.0))
    corner = start + inwards * float((end - start) @ inwards)
    t = np.linspace(0.0, 1.0, 25)[:, None]
    first, second = start + _HANDLE * (corner - start), end + _HANDLE * (corner - end)
    curve = (1 - t) ** 3 * start + 3 * (1 - t) ** 2 * t * first
    return np.asarray(curve + 3 * (1 - t) * t**2 * second + t**3 * end)


def _build_stop_line(plan: FourLegPlan, leg: Compass) -> StopLine:
    lanes = plan.get_road(leg).lanes
    ends = (
        locate_point(leg, plan.measure_stop(leg), 0.0),
        locate_point(leg, plan.measure_stop(leg), sum(lanes)),
    )
    ids = tuple(_name_lane(plan, leg, "approach", index) for index in range(len(lanes)))
    return StopLine(id=f"{leg}:stop", leg=leg, lanelets=ids, line=ends)


def _build_crosswalk(plan: FourLegPlan, leg: Compass, road: Any) -> Crosswalk:
    near, reach = (
        plan.measure_crosswalk_near(leg),
        plan.get_road(leg).half_width + plan.corner_radius,
    )
    middle = near + plan.crosswalk_width / 2
    area = _build_box(leg, (near, near + plan.crosswalk_width), (-reach, reach)).intersection(road)
    kerb = _measure_kerb(plan, leg, middle)
    return Crosswalk(
        id=f"{leg}:crosswalk",
        leg=leg,
        polygon=build_ring(area),
        centreline=(locate_point(leg, middle, kerb), locate_point(leg, middle, -kerb)),
        sides=find_sides(leg),
        width=plan.crosswalk_width,
    )


def _measure_kerb(plan: FourLegPlan, leg: Compass, along: float) -> float:
    """How far the kerb is from the middle line of a leg, `along` metres out."""
    r = plan.corner_radius
    depth = max(plan.get_crossed_road(leg).half_width + r - along, 0.0)
    return plan.get_road(leg).half_width + r - math.sqrt(r * r - depth * depth)


def _build_goal_regions(plan: FourLegPlan) -> Iterator[GoalRegion]:
    for leg in LEGS:
        edge, walk_edge, lanes = plan.extent, plan.pedestrian_extent, sum(plan.get_road(leg).lanes)
        area = build_ring(_build_box(leg, (edge - 4.0, edge), (-lanes, 0.0)))
        yield GoalRegion(id=f"{leg}:goal", type="vehicle", leg=leg, polygon=area)
        for sign, side in zip((1, -1), find_sides(leg), strict=True):
            area = build_ring(
                _build_box(leg, (walk_edge - 3.0, walk_edge), plan.measure_sidewalk(leg, sign))
            )
            name = f"{leg}:goal:{side}_sidewalk"
            yield GoalRegion(id=name, type="pedestrian", leg=leg, polygon=area)


def _build_movement(plan: FourLegPlan, leg: Compass, turn: Turn, to: Compass) -> VehicleMovement:
    pairs = _pair_lanes(plan, leg, turn)
    ids = [
        (
            _name_lane(plan, leg, "approach", lane_in),
            _name_connector(plan, leg, to, lane_in),
            _name_lane(plan, to, "exit", lane_out),
        )
        for lane_in, lane_out in pairs
    ]
    return VehicleMovement(
        id=f"{leg}>{to}:{turn}",
        entry=leg,
        exit=to,
        turn=turn,
        lanelets=tuple(name for way in ids for name in way),
        stop_line=f"{leg}:stop",
        centreline=_build_whole_line(plan, leg, to, *pairs[0]),
        signal_group="avenue" if leg in ("north", "south") else "street",
    )


def _build_whole_line(
    plan: FourLegPlan, leg: Compass, to: Compass, lane_in: int, lane_out: int
) -> Polyline:
    start = locate_point(leg, plan.extent, plan.get_road(leg).measure_lane_middle(lane_in))
    end = locate_point(to, plan.extent, -plan.get_road(to).measure_lane_middle(lane_out))
    return (start, *round_points(_build_curve(plan, leg, to, lane_in, lane_out)), end)


_GROUPS = ("avenue", "street", "walk_across_street", "walk_across_avenue")


def _build_signals(
    plan: FourLegPlan,
    movements: tuple[VehicleMovement, ...],
    crosswalks: tuple[Crosswalk, ...],
) -> SignalProgram:
    """Two phases; a crosswalk's yellow is its clearance: finish crossing, do not begin."""
    legs = {name: LEGS[0::2] if "avenue" in name else LEGS[1::2] for name in _GROUPS}
    drive = [
        SignalGroup(id=name, movements=tuple(m.id for m in movements if m.entry in legs[name]))
        for name in _GROUPS[:2]
    ]
    walk = [
        SignalGroup(id=name, crosswalks=tuple(c.id for c in crosswalks if c.leg in legs[name]))
        for name in _GROUPS[2:]
    ]
    return SignalProgram(groups=(*drive, *walk), phases=tuple(_build_phases(plan)))


def _build_phases(plan: FourLegPlan) -> Iterator[SignalPhase]:
    for half in (0, 1):
        steps: tuple[tuple[float, Colour, Colour], ...] = (
            (plan.walk[half], "green", "green"),
            (plan.green[half] - plan.walk[half], "green", "yellow"),
            (plan.yellow, "yellow", "red"),
            (plan.all_red, "red", "red"),
        )
        for duration, drive, walk in steps:
            colours: dict[str, Colour] = dict.fromkeys(_GROUPS, "red")
            colours |= {_GROUPS[half]: drive, _GROUPS[2 + half]: walk}
            yield SignalPhase(duration=duration, colours=colours)
