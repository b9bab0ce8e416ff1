"""Hourly arrivals of vehicles and pedestrians, and from where.

`demand.json` in a bundle keeps the numbers, so that a corpus can be made again without the raw
counts. What no count says is assumed in the fields' defaults.
"""

from __future__ import annotations

from pathlib import Path

from pydantic import Field, ValidationError

from scenewright.errors import InputError
from scenewright.scene.base import Compass, Model

HOURS = 24

Hourly = tuple[float, ...]


class Demand(Model):
    """Mean hourly arrivals and the shares that split them.

    Attributes:
        vehicles: [24] vehicles per hour by entry leg, mean of the counted working days.
        day_spread: relative standard deviation of an hour's count between days, by entry leg.
        pedestrians: [24] pedestrians per hour and crosswalk, both directions together.
        turn_shares: (left, straight, right) by entry leg; assumed.
        subtype_shares: of vehicles; assumed. Buses keep to the avenue, straight on.
        side_shares: of the pairs of sidewalks that pedestrians use; assumed.
        pedestrian_level: factor from the mean of the ten busiest counted signals to this one;
            assumed, as pedestrians were not counted here.
        sources: where the numbers come from, and under which terms.
    """

    vehicles: dict[Compass, Hourly]
    day_spread: dict[Compass, float]
    pedestrians: Hourly
    turn_shares: dict[Compass, tuple[float, float, float]] = Field(
        default={
            "north": (0.10, 0.78, 0.12),
            "south": (0.10, 0.78, 0.12),
            "east": (0.30, 0.36, 0.34),
            "west": (0.30, 0.36, 0.34),
        }
    )
    subtype_shares: dict[str, float] = Field(
        default={"car": 0.86, "truck": 0.07, "bus": 0.03, "motorcycle": 0.04}
    )
    side_shares: dict[str, float] = Field(
        default={"along>along": 0.40, "along>leg": 0.22, "leg>along": 0.22, "leg>leg": 0.16}
    )
    pedestrian_level: float = 2.0
    sources: tuple[str, ...] = (
        "Entry south and north: NYC DOT Traffic Volume Counts (NYC Open Data), Amsterdam Avenue "
        "between West 118 and West 119 Street, NB and SB, working days of 2012 and 2017.",
        "Entry east and west (assumed equal in shape and size): the same source, Morningside "
        "Drive between West 120 and West 121 Street, WB and EB, working days of 2015; West 120 "
        "Street itself was not counted.",
        "Pedestrians: mean hourly crossings at the ten busiest signals of ped-signal-data "
        "(Utah State University, Apache-2.0), times pedestrian_level.",
    )


def read_demand(path: Path) -> Demand:
    """The demand kept in a bundle's `demand.json`; InputError where it cannot be read."""
    try:
        return Demand.model_validate_json(path.read_bytes())
    except (OSError, ValidationError) as fault:
        raise InputError(
            f"cannot read demand {path.name!r}: {str(fault).splitlines()[0]}"
        ) from None
