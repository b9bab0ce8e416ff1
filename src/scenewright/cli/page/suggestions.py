"""What the page offers to say: examples for a place, and words to complete what is typed."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any

from scenewright.intersections import list_intersections, load_map
from scenewright.scene.map import IntersectionMap

EVENTS = (
    "hits", "is hit by", "rear-ends", "is rear-ended by", "sideswipes", "T-bones",
    "collides head-on with", "narrowly misses", "yields to", "follows", "cuts off",
    "runs the red light", "turning left", "turning right", "going straight", "crosses",
    "jaywalks", "brakes hard", "hidden behind a parked truck", "in light traffic",
    "in heavy traffic", "at night", "at noon", "at rush hour",
)  # fmt: skip


def list_places() -> list[dict[str, Any]]:
    """The intersections: name, title, examples that can happen there, and words for places."""
    places = [load_map(each) for each in list_intersections()]
    return [
        {"name": each.name, "title": each.title, "examples": write_examples(each),
         "words": _name_places(each)}
        for each in places
    ]  # fmt: skip


@cache
def list_words() -> list[str]:
    """Road users and events, shorter ones first."""
    source = files("scenewright.tools.account").joinpath("words.toml").read_text("utf-8")
    nouns = {
        word.lstrip("=") for group in tomllib.loads(source)["nouns"].values() for word in group
    }
    return sorted({*nouns, *EVENTS}, key=lambda each: (len(each), each))


def write_examples(place: IntersectionMap) -> list[str]:
    """Sentences whose ways there are on this map."""
    walked = {each.leg for each in place.crosswalks}
    ways = {
        each.turn: each
        for each in reversed(place.movements)
        if each.turn == "straight" or each.exit in walked
    }
    wanted = {
        "left": "A car from the {0} turning left narrowly misses a pedestrian on the {1} crosswalk "
        "at 8 am",
        "straight": "A van is rear-ended by a car on the approach from the {0}",
        "right": "A truck from the {0} turning right yields to a pedestrian on the {1} crosswalk",
    }
    found = [text.format(ways[t].entry, ways[t].exit) for t, text in wanted.items() if t in ways]
    return [*found, "A taxi hits a cyclist at night", "A normal morning in dense traffic"]


def _name_places(place: IntersectionMap) -> list[str]:
    legs = [f"from the {each.name}" for each in place.legs]
    walks = [f"on the {each.leg} crosswalk" for each in place.crosswalks]
    streets = [f"on {each.road}" for each in place.legs if each.road]
    return list(dict.fromkeys([*legs, *walks, *streets]))
