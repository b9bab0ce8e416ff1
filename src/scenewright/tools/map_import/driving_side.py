"""On which side of the road traffic drives, and how that is known."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from itertools import combinations

import numpy as np

from scenewright.geometry.geographic import LatLon
from scenewright.geometry.polyline import measure_courses, rotate_left
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.opendrive_features import OpenDriveFile
from scenewright.tools.map_import.osm_file import OsmFile
from scenewright.tools.map_import.survey import ASSUMED_SIDE, DrivingSide

_LEFT_HAND = (
    "AG AI AU BB BD BM BN BS BT BW CC CK CX CY DM FJ FK GB GD GG GY HK ID IE IM IN JE JM JP KE KI "
    "KN KY LC LK LS MO MS MT MU MV MW MY MZ NA NF NP NR NU NZ PG PK PN SB SC SG SH SR SZ TC TH TK "
    "TL TO TT TV TZ UG VC VG VI WS ZA ZM ZW"
)
"""ISO 3166 codes of countries and territories in which traffic drives on the left."""
_COUNTRY_KEYS = ("addr:country", "is_in:country_code", "country_code", "ISO3166-1:alpha2")
_CARRIAGEWAY_GAP = (4.0, 40.0)
"""Least and largest distance between the carriageways of one street [m]."""
_PLACEHOLDER_DEGREES = 0.05
"""Coordinates that are closer to zero are placeholders [deg]."""


def find_opendrive_side(drive: OpenDriveFile) -> DrivingSide:
    """The side that most of the roads with a `rule` have; right-hand traffic without a majority."""
    left, right = drive.rules.get("LHT", 0), drive.rules.get("RHT", 0)
    if not left + right:
        return DrivingSide(False, "OpenDRIVE's default, no road of the file has a rule")
    rule, other = ("LHT", "RHT") if left > right else ("RHT", "LHT")
    against = f'{min(left, right)} have rule="{other}"' if left and right else None
    reason = f'{max(left, right)} roads of the file have rule="{rule}"'
    return DrivingSide(left > right, reason, is_known=left != right, against=against)


def find_osm_side(osm: OsmFile, origin: LatLon) -> DrivingSide:
    """By the tags of the file, else its place, else how its one-way roads lie."""
    # How many roundabouts and pairs of carriageways are drawn for each side.
    drawn = {"left": 0, "right": 0}
    streets: dict[str, list[FloatArray]] = {}
    for _, tags, nodes in osm.list_roads():
        line = np.array([osm.nodes[n] for n in nodes if n in osm.nodes])
        if len(line) < 2:
            continue
        if tags.get("junction") == "roundabout":
            courses = measure_courses(line)
            drawn["left" if courses[-1] < courses[0] else "right"] += 1
        elif tags.get("oneway") in ("yes", "1", "true") and tags.get("name"):
            streets.setdefault(tags["name"], []).append(line)
    for lines in streets.values():
        for side in _count_oncoming(lines):
            drawn[side] += 1
    found = _read_tags(osm) or find_side_of_place(origin)
    left = drawn["left"] > drawn["right"]
    if found is None:
        if drawn["left"] == drawn["right"]:
            return ASSUMED_SIDE
        return DrivingSide(left, _describe_lanes(drawn), is_known=False)
    clear = max(drawn.values()) >= 3 * min(drawn["left"], drawn["right"]) + 2
    against = _describe_lanes(drawn) if clear and left != found.left_hand else None
    return DrivingSide(found.left_hand, found.reason, against=against)


def find_lane_side(lines: Sequence[FloatArray]) -> DrivingSide:
    """By the lanes: in right-hand traffic oncoming lanes are on the left.

    Args:
        lines: [P, 2] middles of lanes in driving direction [m]; of more than 600, every nth counts.
    """
    counts = Counter(_count_oncoming(lines[:: len(lines) // 600 + 1]))
    if counts["left"] == counts["right"]:
        return ASSUMED_SIDE
    left = counts["left"] > counts["right"]
    return DrivingSide(left, f"{max(counts.values())} pairs of opposite lanes indicate it")


def _read_tags(osm: OsmFile) -> DrivingSide | None:
    """What the elements of the file say of the side, else of the country."""
    tags = [*osm.node_tags.values(), *(tags for tags, _ in osm.ways.values())]
    sides = Counter(own["driving_side"] for own in tags if "driving_side" in own)
    left, right = sides["left"], sides["right"]
    if left != right:
        return DrivingSide(left > right, f"driving_side is tagged on {max(left, right)} elements")
    codes = Counter(own[key].upper() for own in tags for key in _COUNTRY_KEYS if key in own)
    known = [(-n, code) for code, n in codes.items() if len(code) == 2 and code.isalpha()]
    if not known:
        return None
    count, code = min(known)
    left_hand = code in _LEFT_HAND.split()
    return DrivingSide(left_hand, f"{-count} elements of the file say country {code}")


def find_side_of_place(origin: LatLon) -> DrivingSide | None:
    """By the country of the nearest town; None where the list of towns is not installed."""
    if max(map(abs, origin)) < _PLACEHOLDER_DEGREES:
        return None
    try:
        towns = import_module("reverse_geocode")
    except ImportError:
        return None
    town = towns.get(origin)
    code, name = str(town["country_code"]), str(town["city"])
    return DrivingSide(code in _LEFT_HAND.split(), f"the place is near {name}, in country {code}")


def _count_oncoming(lines: Sequence[FloatArray]) -> Iterator[str]:
    """For each two lines beside one another in opposite directions, the side driven on."""
    for a, b in combinations(lines, 2):
        ahead = a[-1] - a[0]
        back = b[-1] - b[0]
        lengths = float(np.hypot(*ahead)), float(np.hypot(*back))
        if min(lengths) < 5.0 or float(ahead @ back) / math.prod(lengths) > -0.9:
            continue
        between = b.mean(axis=0) - a.mean(axis=0)
        ahead = ahead / lengths[0]
        aside, along = float(between @ rotate_left(ahead)), abs(float(between @ ahead))
        if _CARRIAGEWAY_GAP[0] / 2 < abs(aside) < _CARRIAGEWAY_GAP[1] and along < sum(lengths) / 2:
            yield "right" if aside > 0 else "left"


def _describe_lanes(drawn: Mapping[str, int]) -> str:
    side = max(drawn, key=lambda each: drawn[each])
    return f"{drawn[side]} roundabouts and pairs of carriageways are drawn for the {side}"
