"""The one who is said to strike is the striker of the scene, or there is none."""

from __future__ import annotations

import pytest

from scenewright import synthesize


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("A right-turning van hits a cyclist going straight; nobody else is around.", "sideswipe"),
        ("A cyclist runs into the side of a right-turning van; nobody else is around.", "angle"),
    ],
)
def test_in_a_right_hook_either_strikes_as_said(text: str, kind: str) -> None:
    scene = synthesize(text, seed=0, refiner="none")
    (event,) = scene.proof.events
    (said,) = [each for each in scene.record.said if each.became == "striker"]
    assert (event.kind, said.agents) == (kind, (event.from_, event.to))
