"""Parts of maps that both builders make: rounded geometry, lanelets, conflict zones, routes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from itertools import combinations, pairwise, product
from typing import Any

from scenewright.geometry.polyline import compute_normals
from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.map_elements import (
    ConflictZone,
    Crosswalk,
    Lanelet,
    PolygonWithHoles,
    Polyline,
    Route,
    VehicleMovement,
)
from scenewright.tools.map_import.compass import find_sides

geos: Any = import_module("shapely")
"""Shapely's functions carry no types; one name keeps that in one place."""
_ops: Any = import_module("shapely.ops")

RouteLines = Mapping[str, Sequence[FloatArray]]
"""By route id, the middles of the paths that a route may take, one for each lane [m]."""

SIDEWALKS = ("along", "leg")
"""Sidewalks that a pedestrian comes from or goes to: `along` in line with the crosswalk (beside
the other road), `leg` beside the leg that is crossed."""
_SWEEP = 1.0
"""Half the width that a movement sweeps, for conflict zones [m]."""
_MERGE_LENGTH = 5.0
"""How much of a shared path counts as a conflict zone [m] (SEMANTICS section 4)."""


def round_points(line: Iterable[Iterable[float]]) -> Polyline:
    """Points to the millimetre, without negative zeros."""
    return tuple((round(float(x), 3) + 0.0, round(float(y), 3) + 0.0) for x, y in line)


def build_ring(polygon: Any) -> Polyline:
    """A polygon's exterior: counter-clockwise, open, to the millimetre, no doubled points."""
    points = round_points(geos.geometry.polygon.orient(polygon).exterior.coords)
    return tuple(p for p, q in pairwise(points) if p != q)


def build_area(polygon: Any) -> PolygonWithHoles:
    """A polygon with its holes; see `build_ring`."""
    holes = tuple(build_ring(geos.Polygon(hole)) for hole in polygon.interiors)
    return PolygonWithHoles(exterior=build_ring(polygon), holes=holes)


def list_lines(geometry: Any) -> list[Any]:
    """The line strings of any geometry."""
    parts = getattr(geometry, "geoms", [geometry])
    return [p for p in parts if p.geom_type == "LineString" and p.length]


def list_points(geometry: Any) -> Iterator[Any]:
    """The points of any geometry, and the middles of its other parts."""
    for part in getattr(geometry, "geoms", [geometry]):
        if not part.is_empty:
            yield part if part.geom_type == "Point" else part.centroid


def build_lanelet(line: FloatArray, *, width: float, speed_limit: float, **fields: Any) -> Lanelet:
    """A lanelet about its middle [P, 2] [m]."""
    aside = compute_normals(line) * width / 2
    return Lanelet(
        left=round_points(line + aside),
        right=round_points(line - aside),
        centreline=round_points(line),
        width=round(width, 3),
        speed_limit=round(speed_limit, 3),
        **fields,
    )


def build_conflict_zones(
    lines: RouteLines, movements: Sequence[VehicleMovement], crosswalks: Sequence[Crosswalk]
) -> Iterator[ConflictZone]:
    """Where movements of different legs, and movements and crosswalks, overlap.

    Args:
        lines: by movement, the middle line of every path it may take.
    """
    known = {name: [geos.LineString(line) for line in own] for name, own in lines.items()}
    for first, second in combinations(movements, 2):
        if first.entry != second.entry:
            pairs = product(known[first.id], known[second.id])
            yield from _build_zones(first.id, second.id, [_intersect(a, b) for a, b in pairs])
    for movement, crosswalk in product(movements, crosswalks):
        area = geos.Polygon(crosswalk.polygon)
        pieces = [_sweep(line).intersection(area) for line in known[movement.id]]
        yield from _build_zones(movement.id, crosswalk.id, pieces)


def _sweep(line: Any) -> Any:
    return line.buffer(_SWEEP, cap_style="flat")


def _intersect(first: Any, second: Any) -> Any:
    """The overlap of two swept paths; of a merge only its beginning."""
    overlap = _sweep(first).intersection(_sweep(second))
    inside = first.intersection(overlap)
    if overlap.is_empty or inside.is_empty or inside.length < 2 * _MERGE_LENGTH:
        return overlap
    points = [geos.Point(c) for part in getattr(inside, "geoms", [inside]) for c in part.coords]
    start = min(first.project(point) for point in points)
    return overlap.intersection(_sweep(_ops.substring(first, start - 2.0, start + _MERGE_LENGTH)))


def _build_zones(first: str, second: str, pieces: Sequence[Any]) -> Iterator[ConflictZone]:
    """Each connected overlap as a zone; slivers are no conflict."""
    merged = geos.unary_union(pieces)
    parts = [p for p in getattr(merged, "geoms", [merged]) if p.area > 0.5]
    for number, part in enumerate(sorted(parts, key=lambda p: p.bounds[:2]), start=1):
        name = f"{first}|{second}#{number}"
        yield ConflictZone(id=name, first=first, second=second, polygon=build_ring(part))


def build_vehicle_route(movement: VehicleMovement) -> Route:
    """The route of a movement."""
    return Route(
        id=f"vehicle:{movement.id}",
        type="vehicle",
        entry=movement.entry,
        exit=movement.exit,
        movement=movement.turn,
        movement_id=movement.id,
    )


def build_pedestrian_routes(legs: Iterable[Compass]) -> Iterator[Route]:
    """Every crosswalk both ways, for each pair of sidewalks; then jaywalking over every leg."""
    ways = [(leg, pair) for leg in legs for pair in (find_sides(leg), find_sides(leg)[::-1])]
    sides = map(">".join, product(SIDEWALKS, SIDEWALKS))
    for (leg, (entry, exit_)), side in (*product(ways, sides), *product(ways, (None,))):
        yield Route(
            id=f"pedestrian:{leg}:{entry}>{exit_}:{side or 'jaywalk'}",
            type="pedestrian",
            entry=entry,
            exit=exit_,
            movement="crossing" if side else "jaywalking",
            crosswalk=leg,
            side=side,
        )
