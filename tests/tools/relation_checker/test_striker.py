"""Who strikes whom: what a relation says is held against the tracks."""

from __future__ import annotations

import pytest

from checker_tracks import EAST, NORTH, distance, line, list_rules, mirrored, resampled, scene
from scenewright.tools.relation_checker import RoadUser, check

STRUCK = line(1, (-40.0, 0.0), EAST, distance(8.0, (0.0, 5.2)))
STRIKES = line(2, (0.0, -42.2), NORTH, distance(8.0, (0.0, 5.2)))
"""The second reaches the side of the first, which is ahead by some decimetres."""

COPIES = {
    "as it is": lambda user: user,
    "mirrored": mirrored,
    "resampled": lambda user: resampled(user, 0.08),
}


def prove(users: list[RoadUser], striker: int) -> set[str]:
    asked = scene(users, ("collision", striker, 3 - striker, {"strikes": striker}))
    return list_rules(check(asked)) & {"relation_not_realised"}


@pytest.mark.parametrize("copy", COPIES)
def test_the_other_one_is_no_striker(copy: str) -> None:
    users = [COPIES[copy](each) for each in (STRUCK, STRIKES)]
    assert prove(users, 2) == set()
    assert prove(users, 1) == {"relation_not_realised"}


def test_one_who_stands_strikes_nobody() -> None:
    standing = line(1, (0.0, 0.0), EAST, distance(0.0, (0.0, 5.2)))
    assert prove([standing, STRIKES], 2) == set()
    assert prove([standing, STRIKES], 1) == {"relation_not_realised"}
