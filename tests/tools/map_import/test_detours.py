"""A way that turns back to where it came past is no way between two legs."""

from __future__ import annotations

import numpy as np
import pytest

from scenewright.tools.map_import.read_sumo import is_detour


@pytest.mark.parametrize(
    ("corners", "detour"),
    [
        ([(0, 0), (30, 0), (30, -30)], False),  # a right turn
        ([(0, 0), (20, 0), (30, 4), (60, 4)], False),  # a shifted lane
        ([(0, 0), (20, 0), (20, 30), (24, 30), (24, -30)], True),  # left, round, and back
        ([(0, 0), (30, 0), (30, 20), (0, 20)], False),  # a U-turn in two steps
    ],
)
def test_a_way_round_a_banned_turn_is_told(corners: list[tuple[int, int]], detour: bool) -> None:
    assert is_detour(np.array(corners, dtype=float)) is detour
