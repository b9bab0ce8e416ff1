"""What a change did beside what its words say."""

import pytest

from scenewright.graph.run import synthesize
from scenewright.scene.record import SceneRecord
from scenewright.tools.account import find_unasked_changes


@pytest.fixture(scope="module")
def kids() -> SceneRecord:
    """A bus yields to two children, of whom the second is a copy that stands for another."""
    scene = synthesize("A bus yields to a pedestrian.", seed=1, refiner="none").record
    (kid,) = (a for a in scene.agents if a.role == "foreground" and a.type == "pedestrian")
    other = kid.model_copy(update={"id": 90, "name": "pedestrian-2"})
    return scene.model_copy(update={"agents": (*scene.agents, other)})


def leave_out(scene: SceneRecord, *names: str) -> SceneRecord:
    return scene.model_copy(
        update={"agents": tuple(a for a in scene.agents if a.name not in names)}
    )


def test_nothing_changes_in_the_same_scene(kids: SceneRecord) -> None:
    assert find_unasked_changes(kids, kids, "make it brighter") == ()


def test_one_of_the_kids_goes_as_asked(kids: SceneRecord) -> None:
    after = leave_out(kids, "pedestrian-2")
    assert find_unasked_changes(kids, after, "remove one of the kids") == ()


def test_a_removal_that_removes_none_of_those_named_is_said(kids: SceneRecord) -> None:
    said = "pedestrian-1, pedestrian-2 would all stay"
    assert find_unasked_changes(kids, kids, "remove one of the kids") == (said,)


def test_who_goes_or_comes_unasked_is_said(kids: SceneRecord) -> None:
    fewer = leave_out(kids, "pedestrian-2")
    assert find_unasked_changes(kids, fewer, "slower") == ("pedestrian-2 would be gone",)
    assert find_unasked_changes(fewer, kids, "slower") == ("pedestrian-2 would be new",)
    assert find_unasked_changes(fewer, kids, "add another one") == ()


def test_background_that_is_gone_unasked_is_said(kids: SceneRecord) -> None:
    empty = leave_out(kids, *(a.name for a in kids.agents if a.role == "background"))
    vehicles = sum(a.role == "background" and a.type == "vehicle" for a in kids.agents)
    assert vehicles > 3
    (said,) = [
        each
        for each in find_unasked_changes(kids, empty, "make the bus a truck")
        if "vehicle" in each
    ]
    assert said == f"there would be 0 background vehicles and not {vehicles}"
    assert find_unasked_changes(kids, empty, "less traffic") == ()


def test_another_time_or_event_unasked_is_said(kids: SceneRecord) -> None:
    meta = kids.meta.model_copy(update={"time_of_day": "23:00"})
    night = kids.model_copy(update={"meta": meta})
    assert find_unasked_changes(kids, night, "slower") == ("the time would be 23:00",)
    assert find_unasked_changes(kids, night, "at night") == ()
    other = kids.model_copy(update={"relations": ()})
    assert find_unasked_changes(kids, other, "slower") == ("other events would be asked for",)


def test_more_traffic_is_more(kids: SceneRecord) -> None:
    some = leave_out(kids, *[a.name for a in kids.agents if a.role == "background"][:2])
    around = sum(a.role == "background" for a in kids.agents)
    said = f"there would be {around - 2} around and not {around}"
    assert find_unasked_changes(kids, some, "too quiet, give me more traffic") == (said,)
    assert find_unasked_changes(some, kids, "more traffic") == ()
    assert find_unasked_changes(kids, some, "less traffic") == ()


def test_who_goes_another_way_unasked_is_said(kids: SceneRecord) -> None:
    agents = tuple(
        a.model_copy(update={"entry": "west"}) if a.name == "vehicle-1" else a for a in kids.agents
    )
    turned = kids.model_copy(update={"agents": agents})
    (said,) = find_unasked_changes(kids, turned, "make it night")
    assert said.startswith("vehicle-1 would go from west to")
    assert find_unasked_changes(kids, turned, "let it come from the west") == ()
