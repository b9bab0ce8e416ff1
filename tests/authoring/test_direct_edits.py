"""Changes made by hand become typed edits; what is none is refused before anything is tried."""

from __future__ import annotations

import pytest

from scenewright.authoring.direct_edits import read_direct_edits
from scenewright.errors import InputError
from scenewright.scene.edits import ChangeAgent, ComeLater, MoveStop
from scenewright.scene.social import SocialGraph

GRAPH = SocialGraph.model_validate(
    {
        "agents": [
            {"id": "vehicle-1", "type": "vehicle", "subtype": "truck", "entry": "north"},
            {"id": "pedestrian-1", "type": "pedestrian", "crosswalk": "east"},
        ],
        "relations": [{"type": "yield_to", "from": "vehicle-1", "to": "pedestrian-1"}],
    }
)


def test_a_way_is_chosen_and_all_else_of_the_agent_stays() -> None:
    way = {"entry": "south", "exit": "east", "movement": "right"}
    edits, words = read_direct_edits([{"edit": "choose_way", "agent": "vehicle-1", **way}], GRAPH)
    (edit,) = edits
    assert isinstance(edit, ChangeAgent)
    assert edit.node == GRAPH.agent("vehicle-1").model_copy(update=way)
    assert words == "vehicle-1 goes from the south to the east"


def test_stops_and_times_are_edits_of_their_own() -> None:
    asked = [
        {"edit": "move_stop", "agent": "vehicle-1", "metres": -1.5},
        {"edit": "come_later", "agent": "pedestrian-1", "seconds": 2},
    ]
    edits, words = read_direct_edits(asked, GRAPH)
    assert edits == (
        MoveStop(agent="vehicle-1", metres=-1.5), ComeLater(agent="pedestrian-1", seconds=2),
    )  # fmt: skip
    assert words == "vehicle-1 stops 1.5 m earlier; pedestrian-1 comes 2 s later"


@pytest.mark.parametrize(
    "asked",
    [
        None, [], {}, [1], [{"edit": "remove_agent", "agent": "vehicle-1"}],
        [{"edit": "move_stop", "agent": "vehicle-1", "metres": 99}],
        [{"edit": "move_stop", "agent": "<b>", "metres": 1}],
        [{"edit": "choose_way", "agent": "vehicle-9", "entry": "south", "exit": "east",
          "movement": "right"}],
    ],
)  # fmt: skip
def test_what_is_no_change_is_refused(asked: object) -> None:
    with pytest.raises(InputError):
        read_direct_edits(asked, GRAPH)
