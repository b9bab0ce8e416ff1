"""The measures of a right-angled, signalised four-leg intersection: the shipped `amsterdam_120`.

Widths and signal times are typical values of that street type, not a survey. Every leg has a frame
of its own: `along` metres outwards from the middle, `across` metres to the left of the outward
direction. Approaching traffic (right-hand) therefore has `across` > 0.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from scenewright.scene.base import Compass, Point

LEGS: tuple[Compass, ...] = ("north", "east", "south", "west")


BEARINGS: dict[Compass, float] = {
    "north": math.pi / 2,
    "east": 0.0,
    "south": -math.pi / 2,
    "west": math.pi,
}


@dataclass(frozen=True)
class RoadPlan:
    """One of the two streets, the same on both sides of its middle line.

    Attributes:
        name: as shown.
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

    def measure_lane_middle(self, index: int) -> float:
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

    def get_road(self, leg: Compass) -> RoadPlan:
        """The road that a leg belongs to."""
        return self.avenue if leg in ("north", "south") else self.street

    def get_crossed_road(self, leg: Compass) -> RoadPlan:
        """The road that runs across a leg's end."""
        return self.street if leg in ("north", "south") else self.avenue

    def measure_crosswalk_near(self, leg: Compass) -> float:
        """Where the crosswalk of a leg begins, from the middle outwards [m]."""
        return self.get_crossed_road(leg).half_width + self.crosswalk_setback

    def measure_stop(self, leg: Compass) -> float:
        """Where the stop line of a leg lies, from the middle outwards [m]."""
        return self.measure_crosswalk_near(leg) + self.crosswalk_width + self.stop_gap

    def measure_sidewalk(self, leg: Compass, sign: int) -> tuple[float, float]:
        """Kerb and wall of a sidewalk of a leg, across [m]; sign 1 is the left one."""
        kerb = self.get_road(leg).half_width
        return (sign * kerb, sign * (kerb + self.get_road(leg).sidewalk))


AMSTERDAM_120 = FourLegPlan(
    name="amsterdam_120",
    map_id=120,
    title="Amsterdam Avenue and West 120th Street, New York (modelled)",
    avenue=RoadPlan("Amsterdam Avenue", (3.3, 3.3), 2.4, 4.0),
    street=RoadPlan("West 120th Street", (3.5,), 2.3, 4.0),
)


PLANS: Mapping[str, FourLegPlan] = {AMSTERDAM_120.name: AMSTERDAM_120}
"""Every intersection that can be rebuilt, by name."""


def locate_point(leg: Compass, along: float, across: float) -> Point:
    """A place in a leg's own frame, in the map frame [m]."""
    c, s = round(math.cos(BEARINGS[leg])), round(math.sin(BEARINGS[leg]))
    return (round(c * along - s * across, 3) + 0.0, round(s * along + c * across, 3) + 0.0)
