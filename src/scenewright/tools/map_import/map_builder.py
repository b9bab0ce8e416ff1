"""Builds the map of a right-angled, signalised four-leg intersection from a few measures.

`build_map()` gives the shipped `amsterdam_120`, modelled on Amsterdam Avenue and West 120th
Street, New York: widths and signal times are typical values of that street type, not a survey.
Pure and deterministic; coordinates are rounded to a millimetre.

Every leg has a frame of its own: `along` metres outwards from the middle, `across` metres to the
left of the outward direction. Approaching traffic (right-hand) therefore has `across` > 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from scenewright.scene.base import Compass, FloatArray, Point
from scenewright.scene.map import (
    ConflictZone,
    Crosswalk,
    GoalRegion,
    IntersectionMap,
    Lanelet,
    Leg,
    PolygonWithHoles,
    Polyline,
    Route,
    SignalGroup,
    SignalPhase,
    SignalProgram,
    StopLine,
    VehicleMovement,
)

if TYPE_CHECKING:
    from pathlib import Path

Turn = Literal["straight", "left", "right"]
_Side = Literal["approach", "exit"]

LEGS: tuple[Compass, ...] = ("north", "east", "south", "west")
_BEARING: dict[Compass, float] = {
    "north": math.pi / 2,
    "east": 0.0,
    "south": -math.pi / 2,
    "west": math.pi,
}
_TURNS: tuple[tuple[Turn, int], ...] = (("left", 1), ("straight", 2), ("right", 3))
_LANE_NAMES = ("inner", "outer")
_SWEEP = 1.0
"""Half the width that a movement sweeps, for conflict zones [m]."""
_MERGE_LENGTH = 5.0
"""How much of a shared path counts as a conflict zone [m] (SEMANTICS section 4)."""
_HANDLE = 0.62
"""Bezier handle of a turn: 0.55 is an ellipse; more eases into the curve."""


@dataclass(frozen=True)
class RoadPlan:
    """One of the two streets, the same on both sides of its middle line.

    Attributes:
        name: for people.
        lanes: widths of the driving lanes of one direction, from the middle outwards [m].
        parking: width of the kerbside lane [m].
        sidewalk: width of the sidewalk [m].
    """

    name: str
    lanes: tuple[float, ...]
    parking: float
    sidewalk: float

    @property
    def half_width(self) -> float:
        """From the middle line to the kerb [m]."""
        return sum(self.lanes) + self.parking

    def lane_middle(self, index: int) -> float:
        """From the middle line to the middle of a lane, 0 being the innermost [m]."""
        return sum(self.lanes[:index]) + self.lanes[index] / 2


@dataclass(frozen=True)
class FourLegPlan:
    """The measures of a four-leg intersection [m, s, m/s].

    Attributes:
        avenue, street: the north-south and the east-west road.
        extent: half the side of the square that the map covers.
        pedestrian_extent: half the side of the square in which pedestrians are tracked.
        corner_radius: of the kerb.
        crosswalk_setback: from the kerb line of the other road to the near edge of the crosswalk.
        stop_gap: from the far edge of the crosswalk to the stop line.
        green: of the avenue and of the street; walk: green for those walking across the street
            (beside avenue traffic) and across the avenue (beside street traffic).
    """

    name: str
    map_id: int
    title: str
    avenue: RoadPlan
    street: RoadPlan
    extent: float = 50.0
    pedestrian_extent: float = 22.0
    corner_radius: float = 3.6
    crosswalk_width: float = 4.0
    crosswalk_setback: float = 0.8
    stop_gap: float = 1.2
    speed_limit: float = 11.18
    green: tuple[float, float] = (38.0, 26.0)
    walk: tuple[float, float] = (28.0, 14.0)
    yellow: float = 3.0
    all_red: float = 2.0

    def road(self, leg: Compass) -> RoadPlan:
        """The road that a leg belongs to."""
        return self.avenue if leg in ("north", "south") else self.street

    def crossed(self, leg: Compass) -> RoadPlan:
        """The road that runs across a leg's end."""
        return self.street if leg in ("north", "south") else self.avenue

    def crosswalk_near(self, leg: Compass) -> float:
        """Where the crosswalk of a leg begins, from the middle outwards [m]."""
        return self.crossed(leg).half_width + self.crosswalk_setback

    def stop(self, leg: Compass) -> float:
        """Where the stop line of a leg lies, from the middle outwards [m]."""
        return self.crosswalk_near(leg) + self.crosswalk_width + self.stop_gap


AMSTERDAM_120 = FourLegPlan(
    name="amsterdam_120",
    map_id=120,
    title="Amsterdam Avenue and West 120th Street, New York (modelled)",
    avenue=RoadPlan("Amsterdam Avenue", (3.3, 3.3), 2.4, 4.0),
    street=RoadPlan("West 120th Street", (3.5,), 2.3, 4.0),
)

PLANS: Mapping[str, FourLegPlan] = {AMSTERDAM_120.name: AMSTERDAM_120}
"""Every intersection that can be rebuilt, by name."""


def build_map(plan: FourLegPlan = AMSTERDAM_120) -> IntersectionMap:
    """The whole map of a four-leg intersection."""
    road = _road(plan)
    crosswalks = tuple(_crosswalk(plan, leg, road) for leg in LEGS)
    movements = tuple(_movement(plan, leg, turn, step) for leg in LEGS for turn, step in _TURNS)
    return IntersectionMap(
        name=plan.name,
        map_id=plan.map_id,
        title=plan.title,
        extent=plan.extent,
        legs=tuple(Leg(name=e, road=plan.road(e).name, bearing=_BEARING[e]) for e in LEGS),
        lanelets=tuple(_lanelets(plan)),
        stop_lines=tuple(_stop_line(plan, leg) for leg in LEGS),
        crosswalks=crosswalks,
        road=(area_of(road),),
        walkable=tuple(area_of(_sidewalk(plan, leg, road)) for leg in LEGS),
        goal_regions=tuple(_goal_regions(plan)),
        movements=movements,
        conflict_zones=tuple(
            conflict_zones({m.id: _lane_lines(plan, m) for m in movements}, movements, crosswalks)
        ),
        signals=_signals(plan, movements, crosswalks),
        routes=(*map(vehicle_route, movements), *_pedestrian_routes()),
    )


def write_map(folder: Path, plan: FourLegPlan = AMSTERDAM_120) -> IntersectionMap:
    """Build the map and write it as `map.json` into a bundle's folder."""
    built = build_map(plan)
    folder.mkdir(parents=True, exist_ok=True)
    text = built.model_dump_json()
    (folder / "map.json").write_text(text + "\n", encoding="utf-8")
    return built


def neighbour(leg: Compass, step: int) -> Compass:
    """The leg that lies `step` legs clockwise of this one."""
    return LEGS[(LEGS.index(leg) + step) % len(LEGS)]


def leg_point(leg: Compass, along: float, across: float) -> Point:
    """A place in a leg's own frame, in the map frame [m]."""
    c, s = round(math.cos(_BEARING[leg])), round(math.sin(_BEARING[leg]))
    return (round(c * along - s * across, 3) + 0.0, round(s * along + c * across, 3) + 0.0)


def _shapely() -> Any:
    """The geometry library, loaded on first use; its names carry no types."""
    import shapely
    import shapely.geometry.polygon
    import shapely.ops

    return shapely


def _box(leg: Compass, along: tuple[float, float], across: tuple[float, float]) -> Any:
    (a, b), (c, d) = along, across
    return _shapely().Polygon([leg_point(leg, *p) for p in ((a, c), (b, c), (b, d), (a, d))])


def ring(polygon: Any) -> Polyline:
    """A polygon's exterior: counter-clockwise, open, to the millimetre, no doubled points."""
    points = [
        (round(x, 3) + 0.0, round(y, 3) + 0.0)
        for x, y in _shapely().geometry.polygon.orient(polygon).exterior.coords
    ]
    return tuple(p for p, q in pairwise(points) if p != q)


def area_of(polygon: Any) -> PolygonWithHoles:
    """A polygon with its holes; see `ring`."""
    holes = [_shapely().Polygon(hole) for hole in polygon.interiors]
    return PolygonWithHoles(exterior=ring(polygon), holes=tuple(ring(each) for each in holes))


def _road(plan: FourLegPlan) -> Any:
    e, a, s = plan.extent, plan.avenue.half_width, plan.street.half_width
    strips = [_box("north", (-e, e), (-a, a)), _box("east", (-e, e), (-s, s))]
    return _shapely().unary_union([*strips, *(_fillet(plan, leg) for leg in LEGS)])


def _fillet(plan: FourLegPlan, leg: Compass) -> Any:
    """The piece of road that the rounded kerb adds in the corner clockwise of a leg."""
    r = plan.corner_radius
    near, side = plan.crossed(leg).half_width, plan.road(leg).half_width
    square = _box(leg, (near - 0.01, near + r), (-side - r, -side + 0.01))
    return square.difference(_shapely().Point(leg_point(leg, near + r, -side - r)).buffer(r, 16))


def _sidewalk(plan: FourLegPlan, leg: Compass, road: Any) -> Any:
    """The sidewalks that meet in the corner clockwise of a leg, with the corner."""
    other = neighbour(leg, 1)
    strips = [
        _box(leg, (plan.road(other).half_width, plan.extent), _kerb_to_wall(plan, leg, -1)),
        _box(other, (plan.road(leg).half_width, plan.extent), _kerb_to_wall(plan, other, 1)),
    ]
    return _shapely().unary_union(strips).difference(road)


def _kerb_to_wall(plan: FourLegPlan, leg: Compass, sign: int) -> tuple[float, float]:
    kerb = plan.road(leg).half_width
    return (sign * kerb, sign * (kerb + plan.road(leg).sidewalk))


def _lanelets(plan: FourLegPlan) -> Iterator[Lanelet]:
    for leg in LEGS:
        for index in range(len(plan.road(leg).lanes)):
            yield _straight_lanelet(plan, leg, index, "approach")
            yield _straight_lanelet(plan, leg, index, "exit")
        yield from (_parking(plan, leg, kind) for kind in ("approach", "exit"))
    for leg in LEGS:
        for turn, step in _TURNS:
            for lane_in, lane_out in _lane_pairs(plan, leg, turn):
                yield _connector(plan, leg, neighbour(leg, step), lane_in, lane_out)


def lanelet_id(plan: FourLegPlan, leg: Compass, side: _Side, index: int) -> str:
    """The name of a driving lane, e.g. `north:approach:inner`."""
    lanes = plan.road(leg).lanes
    return f"{leg}:{side}" + (f":{_LANE_NAMES[index]}" if len(lanes) > 1 else "")


def _connector_id(plan: FourLegPlan, leg: Compass, to: Compass, lane: int) -> str:
    name = f":{_LANE_NAMES[lane]}" if len(plan.road(leg).lanes) > 1 else ""
    return f"{leg}>{to}{name}"


def _lane_pairs(plan: FourLegPlan, leg: Compass, turn: Turn) -> list[tuple[int, int]]:
    """Which lane leads into which, commonest first: turns hug their own side of the road."""
    outer_in, outer_out = len(plan.road(leg).lanes) - 1, len(plan.crossed(leg).lanes) - 1
    if turn == "straight":
        return [(i, i) for i in reversed(range(outer_in + 1))]
    return [(0, 0)] if turn == "left" else [(outer_in, outer_out)]


def _straight_lanelet(plan: FourLegPlan, leg: Compass, index: int, side: _Side) -> Lanelet:
    road = plan.road(leg)
    middle, width = road.lane_middle(index), road.lanes[index]
    return _strip(
        plan,
        leg,
        side,
        middle,
        id=lanelet_id(plan, leg, side, index),
        width=width,
        kind=side,
        successors=_successors(plan, leg, index) if side == "approach" else (),
    )


def _successors(plan: FourLegPlan, leg: Compass, index: int) -> tuple[str, ...]:
    return tuple(
        _connector_id(plan, leg, neighbour(leg, step), index)
        for turn, step in _TURNS
        if any(lane == index for lane, _ in _lane_pairs(plan, leg, turn))
    )


def _parking(plan: FourLegPlan, leg: Compass, side: _Side) -> Lanelet:
    road = plan.road(leg)
    middle = road.half_width - road.parking / 2
    name = f"{leg}:parking:{side}"
    return _strip(plan, leg, side, middle, id=name, width=road.parking, kind="parking")


def _strip(plan: FourLegPlan, leg: Compass, side: _Side, middle: float, **fields: Any) -> Lanelet:
    """A straight lane between map edge and stop line, in driving direction."""
    sign = 1 if side == "approach" else -1
    ends = [plan.extent, plan.stop(leg)][::sign]
    half = fields["width"] / 2

    def line(across: float) -> Polyline:
        return tuple(leg_point(leg, along, sign * across) for along in ends)

    return Lanelet(
        leg=leg,
        left=line(middle - half),
        right=line(middle + half),
        centreline=line(middle),
        speed_limit=plan.speed_limit,
        **fields,
    )


def _connector(
    plan: FourLegPlan, leg: Compass, to: Compass, lane_in: int, lane_out: int
) -> Lanelet:
    curve = _curve(plan, leg, to, lane_in, lane_out)
    width = min(plan.road(leg).lanes[lane_in], plan.road(to).lanes[lane_out])
    return Lanelet(
        id=_connector_id(plan, leg, to, lane_in),
        kind="connector",
        leg=None,
        left=_points(_offset(curve, width / 2)),
        right=_points(_offset(curve, -width / 2)),
        centreline=_points(curve),
        width=width,
        speed_limit=plan.speed_limit,
        successors=(lanelet_id(plan, to, "exit", lane_out),),
    )


def _curve(plan: FourLegPlan, leg: Compass, to: Compass, lane_in: int, lane_out: int) -> FloatArray:
    """[P, 2] middle of the way through the junction, from stop line to the exit lane."""
    start = np.array(leg_point(leg, plan.stop(leg), plan.road(leg).lane_middle(lane_in)))
    end = np.array(leg_point(to, plan.stop(to), -plan.road(to).lane_middle(lane_out)))
    if to == neighbour(leg, 2):
        return np.linspace(start, end, 9)
    inwards = np.array(leg_point(leg, -1.0, 0.0))
    corner = start + inwards * float((end - start) @ inwards)
    t = np.linspace(0.0, 1.0, 25)[:, None]
    first, second = start + _HANDLE * (corner - start), end + _HANDLE * (corner - end)
    curve = (1 - t) ** 3 * start + 3 * (1 - t) ** 2 * t * first
    return np.asarray(curve + 3 * (1 - t) * t**2 * second + t**3 * end)


def _offset(curve: FloatArray, distance: float) -> FloatArray:
    tangent = np.gradient(curve, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.asarray(curve + distance * np.stack([-tangent[:, 1], tangent[:, 0]], axis=1))


def _points(curve: FloatArray) -> Polyline:
    return tuple((round(float(x), 3) + 0.0, round(float(y), 3) + 0.0) for x, y in curve)


def _stop_line(plan: FourLegPlan, leg: Compass) -> StopLine:
    lanes = plan.road(leg).lanes
    ends = (leg_point(leg, plan.stop(leg), 0.0), leg_point(leg, plan.stop(leg), sum(lanes)))
    ids = tuple(lanelet_id(plan, leg, "approach", index) for index in range(len(lanes)))
    return StopLine(id=f"{leg}:stop", leg=leg, lanelets=ids, line=ends)


def _crosswalk(plan: FourLegPlan, leg: Compass, road: Any) -> Crosswalk:
    near, reach = plan.crosswalk_near(leg), plan.road(leg).half_width + plan.corner_radius
    middle = near + plan.crosswalk_width / 2
    polygon = _box(leg, (near, near + plan.crosswalk_width), (-reach, reach)).intersection(road)
    kerb = _kerb(plan, leg, middle)
    return Crosswalk(
        id=f"{leg}:crosswalk",
        leg=leg,
        polygon=ring(polygon),
        centreline=(leg_point(leg, middle, kerb), leg_point(leg, middle, -kerb)),
        sides=(neighbour(leg, 3), neighbour(leg, 1)),
        width=plan.crosswalk_width,
    )


def _kerb(plan: FourLegPlan, leg: Compass, along: float) -> float:
    """How far the kerb is from the middle line of a leg, `along` metres out."""
    r = plan.corner_radius
    depth = max(plan.crossed(leg).half_width + r - along, 0.0)
    return plan.road(leg).half_width + r - math.sqrt(r * r - depth * depth)


def _goal_regions(plan: FourLegPlan) -> Iterator[GoalRegion]:
    for leg in LEGS:
        edge, walk_edge, lanes = plan.extent, plan.pedestrian_extent, sum(plan.road(leg).lanes)
        area = _box(leg, (edge - 4.0, edge), (-lanes, 0.0))
        yield GoalRegion(id=f"{leg}:goal", type="vehicle", leg=leg, polygon=ring(area))
        for sign, step in ((1, 3), (-1, 1)):
            area = _box(leg, (walk_edge - 3.0, walk_edge), _kerb_to_wall(plan, leg, sign))
            name = f"{leg}:goal:{neighbour(leg, step)}_sidewalk"
            yield GoalRegion(id=name, type="pedestrian", leg=leg, polygon=ring(area))


def _movement(plan: FourLegPlan, leg: Compass, turn: Turn, step: int) -> VehicleMovement:
    to = neighbour(leg, step)
    pairs = _lane_pairs(plan, leg, turn)
    ids: list[str] = []
    for lane_in, lane_out in pairs:
        ids += [
            lanelet_id(plan, leg, "approach", lane_in),
            _connector_id(plan, leg, to, lane_in),
            lanelet_id(plan, to, "exit", lane_out),
        ]
    return VehicleMovement(
        id=f"{leg}>{to}:{turn}",
        entry=leg,
        exit=to,
        turn=turn,
        lanelets=tuple(ids),
        stop_line=f"{leg}:stop",
        centreline=_whole_line(plan, leg, to, *pairs[0]),
        signal_group="avenue" if leg in ("north", "south") else "street",
    )


def _whole_line(
    plan: FourLegPlan, leg: Compass, to: Compass, lane_in: int, lane_out: int
) -> Polyline:
    start = leg_point(leg, plan.extent, plan.road(leg).lane_middle(lane_in))
    end = leg_point(to, plan.extent, -plan.road(to).lane_middle(lane_out))
    return (start, *_points(_curve(plan, leg, to, lane_in, lane_out)), end)


def conflict_zones(
    lines: Mapping[str, list[Any]],
    movements: tuple[VehicleMovement, ...],
    crosswalks: tuple[Crosswalk, ...],
) -> Iterator[ConflictZone]:
    """Where movements of different legs, and movements and crosswalks, overlap.

    Args:
        lines: by movement, the middle line of every way it may take, as shapely lines.
    """
    for first, second in combinations(movements, 2):
        if first.entry != second.entry:
            pieces = _overlaps(lines[first.id], lines[second.id])
            yield from _named_zones(first.id, second.id, pieces)
    for movement in movements:
        for crosswalk in crosswalks:
            area = _shapely().Polygon(crosswalk.polygon)
            pieces = [_swept(line).intersection(area) for line in lines[movement.id]]
            yield from _named_zones(movement.id, crosswalk.id, pieces)


def _lane_lines(plan: FourLegPlan, movement: VehicleMovement) -> list[Any]:
    turn: Turn = "straight" if movement.turn == "uturn" else movement.turn
    return [
        _shapely().LineString(_whole_line(plan, movement.entry, movement.exit, *pair))
        for pair in _lane_pairs(plan, movement.entry, turn)
    ]


def _swept(line: Any) -> Any:
    return line.buffer(_SWEEP, cap_style="flat")


def _overlaps(first: list[Any], second: list[Any]) -> list[Any]:
    """Overlaps of swept paths; of a merge only its beginning."""
    return [_beginning(a, _swept(a).intersection(_swept(b))) for a in first for b in second]


def _beginning(line: Any, overlap: Any) -> Any:
    inside = line.intersection(overlap)
    if overlap.is_empty or inside.is_empty or inside.length < 2 * _MERGE_LENGTH:
        return overlap
    start = line.project(_first_point(line, inside))
    return overlap.intersection(
        _swept(_shapely().ops.substring(line, start - 2.0, start + _MERGE_LENGTH))
    )


def _first_point(line: Any, inside: Any) -> Any:
    parts: Iterable[Any] = getattr(inside, "geoms", [inside])
    points = [_shapely().Point(c) for part in parts for c in part.coords]
    return min(points, key=line.project)


def _named_zones(first: str, second: str, pieces: list[Any]) -> Iterator[ConflictZone]:
    """Each connected overlap as a zone; slivers are no conflict."""
    merged = _shapely().unary_union(pieces)
    parts = [p for p in getattr(merged, "geoms", [merged]) if p.area > 0.5]
    for number, part in enumerate(sorted(parts, key=_corner_key), start=1):
        name = f"{first}|{second}#{number}"
        yield ConflictZone(id=name, first=first, second=second, polygon=ring(part))


def _corner_key(part: Any) -> tuple[float, float]:
    return (float(part.bounds[0]), float(part.bounds[1]))


def _signals(
    plan: FourLegPlan,
    movements: tuple[VehicleMovement, ...],
    crosswalks: tuple[Crosswalk, ...],
) -> SignalProgram:
    """Two phases; a crosswalk's yellow is its clearance: finish crossing, do not begin."""

    def legs_of(group: str) -> tuple[Compass, Compass]:
        return ("north", "south") if "avenue" in group else ("east", "west")

    def vehicles(name: str) -> SignalGroup:
        ids = tuple(m.id for m in movements if m.entry in legs_of(name))
        return SignalGroup(id=name, movements=ids)

    def walkers(name: str) -> SignalGroup:
        ids = tuple(c.id for c in crosswalks if c.leg in legs_of(name))
        return SignalGroup(id=name, crosswalks=ids)

    groups = (*map(vehicles, _GROUPS[:2]), *map(walkers, _GROUPS[2:]))
    return SignalProgram(groups=groups, phases=tuple(_phases(plan)))


_GROUPS = ("avenue", "street", "walk_across_street", "walk_across_avenue")


def _phases(plan: FourLegPlan) -> Iterator[SignalPhase]:
    for half in (0, 1):
        steps: tuple[tuple[float, str, str], ...] = (
            (plan.walk[half], "green", "green"),
            (plan.green[half] - plan.walk[half], "green", "yellow"),
            (plan.yellow, "yellow", "red"),
            (plan.all_red, "red", "red"),
        )
        for duration, drive, walk in steps:
            colours: dict[str, Any] = dict.fromkeys(_GROUPS, "red")
            colours |= {_GROUPS[half]: drive, _GROUPS[2 + half]: walk}
            yield SignalPhase(duration=duration, colours=colours)


def vehicle_route(movement: VehicleMovement) -> Route:
    """The route of a movement."""
    return Route(
        id=f"vehicle:{movement.id}",
        type="vehicle",
        entry=movement.entry,
        exit=movement.exit,
        movement=movement.turn,
        movement_id=movement.id,
    )


def _pedestrian_routes() -> Iterator[Route]:
    """Every crosswalk both ways, for each pair of sidewalks; and jaywalking over every leg.

    A side is `along` where the person walks in line with the crosswalk (on the sidewalk of the
    other road), `leg` where it walks on the sidewalk of the leg that it crosses.
    """
    sides = ("along", "leg")
    for leg, entry, exit_ in _crossings():
        for before in sides:
            for after in sides:
                yield pedestrian_route(leg, entry, exit_, f"{before}>{after}")
    for leg, entry, exit_ in _crossings():
        yield pedestrian_route(leg, entry, exit_, None)


def _crossings() -> Iterator[tuple[Compass, Compass, Compass]]:
    for leg in LEGS:
        first, last = neighbour(leg, 3), neighbour(leg, 1)
        yield leg, first, last
        yield leg, last, first


def pedestrian_route(leg: Compass, entry: Compass, exit_: Compass, side: str | None) -> Route:
    """Over a leg's crosswalk from sidewalk to sidewalk; without a side, over its roadway."""
    return Route(
        id=f"pedestrian:{leg}:{entry}>{exit_}:{side or 'jaywalk'}",
        type="pedestrian",
        entry=entry,
        exit=exit_,
        movement="crossing" if side else "jaywalking",
        crosswalk=leg,
        side=side,
    )
