"""What each format calls the kinds of road users: the one table that all exporters read.

A new kind is one entry of `ROAD_USERS`. Kinds are the subtypes of `scene.json`, and for an agent
without a subtype its class.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from scenewright.errors import InputError


@dataclass(frozen=True)
class RoadUserNames:
    """One kind of road user in the words of each format.

    Attributes:
        height: [m], which scenes do not state: a usual one.
        tracks: class in a CSV of tracks and in TrajNet++ lines.
        sumo: vClass; openscenario: VehicleCategory; None for pedestrians and objects.
        scenarionet: MetaDriveType; commonroad: obstacle type; argoverse2: object type.
        womd: number of Track.ObjectType (1 vehicle, 2 pedestrian, 3 cyclist).
        osi: MovingObject.Type and VehicleClassification.Type.
    """

    height: float
    tracks: str
    sumo: str
    openscenario: str | None
    scenarionet: str
    commonroad: str
    womd: int
    argoverse2: str
    osi: tuple[int, int]

    @property
    def is_vehicle(self) -> bool:
        """Whether it has wheels: neither a pedestrian nor a box, a bin or a container."""
        return self.openscenario is not None


_CAR = RoadUserNames(
    1.5, "car", "passenger", "car", "VEHICLE", "car", 1, "vehicle", (2, 4)
)  # fmt: skip
_BICYCLE = RoadUserNames(
    1.7, "bicycle", "bicycle", "bicycle", "CYCLIST", "bicycle", 3, "cyclist", (2, 11)
)  # fmt: skip
_TRUCK = RoadUserNames(
    3.2, "truck", "truck", "truck", "VEHICLE", "truck", 1, "vehicle", (2, 7)
)  # fmt: skip
_MOTORCYCLE = RoadUserNames(
    1.6, "motorcycle", "motorcycle", "motorbike", "VEHICLE", "motorcycle", 1, "motorcyclist",
    (2, 10),
)  # fmt: skip
_EMERGENCY = replace(_CAR, height=2.5, sumo="emergency", commonroad="priorityVehicle", osi=(2, 4))
_BOX = RoadUserNames(
    2.0, "box", "", None, "TRAFFIC_BARRIER", "unknown", 4, "static", (0, 0)
)  # fmt: skip
ROAD_USERS: dict[str, RoadUserNames] = {
    "vehicle": _CAR,
    "car": _CAR,
    "taxi": replace(_CAR, sumo="taxi", commonroad="taxi"),
    "van": replace(_CAR, height=2.2, tracks="van", sumo="delivery", openscenario="van", osi=(2, 6)),
    "emergency": _EMERGENCY,
    "ambulance": _EMERGENCY,
    "fire_engine": replace(_TRUCK, sumo="emergency", commonroad="priorityVehicle", osi=(2, 7)),
    "police_car": replace(_EMERGENCY, height=1.5),
    "truck": _TRUCK,
    "bus": RoadUserNames(3.1, "bus", "bus", "bus", "VEHICLE", "bus", 1, "bus", (2, 12)),
    "motorcycle": _MOTORCYCLE,
    "cyclist": _BICYCLE,
    "bicycle": _BICYCLE,
    "scooter": replace(_BICYCLE, sumo="scooter", osi=(2, 17)),
    "pedestrian": RoadUserNames(
        1.75, "pedestrian", "pedestrian", None, "PEDESTRIAN", "pedestrian", 2, "pedestrian", (3, 0)
    ),
    "box": _BOX,
    "bin": replace(_BOX, height=1.1, tracks="bin"),
    "container": replace(_BOX, height=2.6, tracks="container"),
    "door": replace(_BOX, height=1.2),
}
"""Names by kind."""


def find_kind(agent_class: str, subtype: str | None) -> str:
    """The kind of an agent, a key of `ROAD_USERS`.

    Raises:
        InputError: a kind that is not in the table.
    """
    kind = subtype or agent_class
    if kind not in ROAD_USERS:
        raise InputError(f"a {kind[:40]} cannot be exported; known: {', '.join(ROAD_USERS)}")
    return kind
