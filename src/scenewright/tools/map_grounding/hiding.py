"""On which routes an object can hide a pedestrian or rider from a driver, and where none is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import product

import numpy as np

from scenewright.errors import Rejected
from scenewright.scene.base import RIDERS, Compass
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Route
from scenewright.scene.objects import is_high
from scenewright.scene.rejection import Rejection
from scenewright.scene.social import STANDING_VEHICLES, ObjectNode, SocialGraph
from scenewright.tools.map_grounding.object_places import Side, find_places


def can_hide(
    graph: SocialGraph, routes: Mapping[str, Route], intersection_map: IntersectionMap
) -> bool:
    """Whether those that are to be hidden come from the kerb where the object stands.

    It stands beside the lanes on which the vehicle comes to the crossing, so the hidden one must
    come onto the road from that side: on the leg by which the vehicle enters; between crossings, or
    where the vehicle turns to that side and one object suffices, also on that by which it leaves.
    """
    gaps = {scene_object.beyond for scene_object in graph.objects}
    return all(
        _is_coming_from_kerb(
            routes[str(scene_object.hides)], routes[str(scene_object.hidden_from)],
            intersection_map, between=scene_object.id in gaps,
        )
        for scene_object in graph.objects
        if scene_object.hides in routes and scene_object.hidden_from in routes
    )  # fmt: skip


def _is_coming_from_kerb(
    walker: Route, vehicle: Route, intersection_map: IntersectionMap, *, between: bool
) -> bool:
    if walker.crosswalk is None:
        return False
    enters = walker.crosswalk == vehicle.entry
    kerbward = "left" if intersection_map.left_hand_traffic else "right"
    leaves = walker.crosswalk == vehicle.exit and (
        walker.movement == "jaywalking" or (vehicle.movement == kerbward and not between)
    )
    return (enters or leaves) and walker.entry == find_kerb_side(
        intersection_map, walker.crosswalk, "entry" if enters else "exit"
    )


def find_kerb_side(intersection_map: IntersectionMap, leg: Compass, side: Side) -> Compass | None:
    """The compass side of the kerb beside the lanes by which vehicles come, or leave, on a leg."""
    crosswalk = next((each for each in intersection_map.crosswalks if each.leg == leg), None)
    arm = next((each for each in intersection_map.legs if each.name == leg), None)
    if crosswalk is None or arm is None:
        return None
    travel = arm.bearing + (np.pi if side == "entry" else 0.0)
    kerbward = travel + (np.pi / 2 if intersection_map.left_hand_traffic else -np.pi / 2)
    (x, y), (u, v) = crosswalk.centreline
    first = (x - u) * np.cos(kerbward) + (y - v) * np.sin(kerbward) > 0
    return crosswalk.sides[0] if first else crosswalk.sides[1]


def refuse_unhidden(
    graph: SocialGraph,
    intersection_map: IntersectionMap,
    *,
    playable: Callable[[SocialGraph], bool],
) -> None:
    """Refuse objects for which the map has no room, or that cannot hide an agent as asked.

    Raises:
        Rejected: `ungroundable`, with the reason.
    """
    riders = {agent.id for agent in graph.agents if agent.type in RIDERS}
    hiding_riders = {
        scene_object.id for scene_object in graph.objects if scene_object.hides in riders
    }
    for node in graph.objects:
        if node.beyond in hiding_riders:
            raise Rejected(_refuse(node, "a rider comes out on a crosswalk, which has a parked "
                                         "vehicle on one side only; ask for one from behind a "
                                         "parked vehicle, not between two"))  # fmt: skip
        if node.hides is not None and not is_high(node):
            words = node.subtype or node.kind
            raise Rejected(_refuse(node, f"a {words} is too low to hide a road user; ask for "
                                         "something taller, such as a parked truck"))  # fmt: skip
        legs = [leg.name for leg in intersection_map.legs if node.leg in (None, leg.name)]
        sides: tuple[Side, ...] = ("entry", "exit") if node.side is None else (node.side,)
        if not any(
            find_places(node, intersection_map, leg=leg, side=side)
            for leg, side in product(legs, sides)
        ):
            where = f" on the {node.leg} leg" if node.leg else ""
            raise Rejected(_refuse(node, f"there is no room for a {_describe(node)}{where} at "
                                         f"{intersection_map.title}"))  # fmt: skip
    hiding = [scene_object for scene_object in graph.objects if scene_object.hides is not None]
    bare = graph.model_copy(update={"objects": ()})
    if hiding and playable(bare) and not playable(graph):
        raise Rejected(
            _refuse(
                hiding[0],
                f"nothing can hide {hiding[0].hides} from {hiding[0].hidden_from} there: what "
                "hides a road user stands at the kerb before the crossing, so the hidden one "
                "must come from that kerb, on the leg by which the vehicle comes or, round the "
                "corner at that kerb, leaves",
            )
        )


def _describe(node: ObjectNode) -> str:
    """An object in words.

    >>> _describe(ObjectNode(id="object-1", kind="double_parked", subtype="truck"))
    'double-parked truck'
    """
    if node.kind == "bus_stop":
        return "bus at a stop"
    kind = node.kind.replace("_", "-")
    return f"{kind} {node.subtype or 'car'}" if node.kind in STANDING_VEHICLES else kind


def _refuse(node: ObjectNode, detail: str) -> Rejection:
    agents = tuple(each for each in (node.hidden_from, node.hides) if each is not None)
    return Rejection(
        stage="scene_planner", code="ungroundable", agents=agents, detail=f"{node.id}: {detail}"
    )
