"""Where tracks begin and end (SEMANTICS section 9): at the edges, or beside the road."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
import pytest

from checker_tracks import (
    EAST,
    NORTH,
    SOUTH,
    box,
    crossing_walker,
    distance,
    line,
    list_rules,
    plus_map,
    scene,
    walk,
    yielding_car,
)
from scenewright import synthesize
from scenewright.intersections import load_map
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import GoalRegion, VehicleMovement
from scenewright.scene.objects import ObjectRecord
from scenewright.scene.record import AgentRecord, SceneRecord
from scenewright.scene.track import get_rider_shape
from scenewright.tools.relation_checker import check
from scenewright.tools.relation_checker.ground_raster import get_ground_raster

ENDS = {"appears", "vanishes"}


@cache  # what the checker prepares is kept by map
def gated_map(**changes: Any) -> IntersectionMap:
    """The plus with an exit in the east, its way through, and a goal beside the west crosswalk."""
    goals = (
        GoalRegion(id="e", type="vehicle", leg="east", polygon=box(90.0, -3.5, 100.0, 0.0)),
        GoalRegion(id="w", type="pedestrian", leg="west", polygon=box(-10.0, 4.0, -6.0, 8.0)),
    )
    way = VehicleMovement(
        id="m", entry="west", exit="east", turn="straight", lanelets=(), stop_line="west:stop",
        centreline=((-70.0, -1.75), (98.0, -1.75)), signal_group=None,
    )  # fmt: skip
    changes = {"goal_regions": goals, "movements": (way,), **changes}
    return plus_map().model_copy(update=changes)


def find_ends(record: SceneRecord, intersection_map: IntersectionMap | None = None) -> set[str]:
    return list_rules(check(record, intersection_map or gated_map())) & ENDS


class TestVehicles:
    @pytest.mark.parametrize(
        ("x", "at", "told"),
        [
            (1.7, 0.0, set()),  # there from the start
            (1.7, 0.1, {"appears"}),
            (1.7, 13.6, {"appears"}),
            (-97.0, 2.0, set()),  # the edge of the map
            (-95.0, 2.0, {"appears"}),
            (-73.0, 2.0, set()),  # where the way through begins
            (-75.0, 2.0, {"appears"}),
        ],
    )
    def test_begin_with_the_scene_or_at_an_edge(self, x: float, at: float, told: set[str]) -> None:
        car = line(1, (x, -1.75), EAST, distance(6.4, (0.0, 3.0)), at=at)
        assert find_ends(scene([car], duration=at + 3.0)) == told

    @pytest.mark.parametrize(("x", "told"), [(0.0, {"vanishes"}), (50.0, set())])
    def test_end_at_an_exit(self, x: float, told: set[str]) -> None:
        car = line(1, (x, -1.75), EAST, distance(10.0, (0.0, 4.0)))
        assert find_ends(scene([car])) == told

    def test_are_not_asked_without_goals(self) -> None:
        car = line(1, (1.7, -1.75), EAST, distance(6.4, (0.0, 3.0)), at=5.0)
        assert find_ends(scene([car]), gated_map(goal_regions=())) == set()


class TestRiders:
    @pytest.mark.parametrize(
        ("place", "told"),
        [((-8.0, 7.0), set()), ((-8.0, 3.0), {"appears"}), ((-30.0, 7.0), {"appears"}),
         ((-98.0, 7.0), set())],
    )  # fmt: skip
    def test_begin_at_an_edge_or_where_pedestrians_are_bound(
        self, place: tuple[float, float], told: set[str]
    ) -> None:
        shape = get_rider_shape("cyclist")
        rider = line(1, place, SOUTH, distance(3.0, (0.0, 2.0)), at=1.0, shape=shape)
        assert find_ends(scene([rider], duration=3.0)) == told


class TestPedestrians:
    @pytest.mark.parametrize(("y", "told"), [(-6.0, set()), (-3.0, {"appears"})])
    def test_begin_beside_the_road(self, y: float, told: set[str]) -> None:
        walker = walk(1, (-8.0, y), NORTH, distance(1.4, (0.0, 8.0)), at=4.0)
        assert find_ends(scene([walker], duration=12.0)) == told

    def test_or_beside_the_object_that_they_leave(self) -> None:
        walker = walk(1, (-30.0, -1.5), SOUTH, distance(1.4, (0.0, 4.0)), at=4.0)
        record = scene([walker], duration=8.0)
        taxi = ObjectRecord(
            id="o", kind="double_parked", height="high", length=4.6, width=1.85, x=-30.0, y=0.0,
            heading=0.0,
        )  # fmt: skip
        assert find_ends(record) == {"appears"}
        assert find_ends(record.model_copy(update={"objects": (taxi,)})) == set()

    @pytest.mark.parametrize(("y", "told"), [(3.4, {"vanishes"}), (3.6, set()), (6.0, set())])
    def test_never_end_on_the_road_however_near_their_goal(self, y: float, told: set[str]) -> None:
        walker = walk(1, (-8.0, y - 7.0), NORTH, distance(1.4, (0.0, 5.0)))
        assert find_ends(scene([walker])) == told

    @pytest.mark.parametrize(
        ("place", "at", "role", "told"),
        [
            ((-20.0, -8.0), 2.5, "background", {"appears"}),  # 2.8 s before it, 9 m away
            ((-20.0, -8.0), 2.2, "background", set()),  # 3.1 s
            ((-20.0, -8.0), 2.5, "foreground", set()),  # as those of an event, which are named
            ((-33.0, -8.0), 2.5, "background", set()),  # 21 m away
            ((-8.0, 5.0), 2.5, "background", set()),  # out of a goal region
        ],
    )
    def test_do_not_come_out_of_nowhere_by_a_conflict(
        self, place: tuple[float, float], at: float, role: str, told: set[str]
    ) -> None:
        away = NORTH if place[1] > 0 else SOUTH
        other = walk(3, place, away, distance(1.4, (0.0, 15.0)), at=at)
        users = [yielding_car(), crossing_walker(), other]
        background = [3] if role == "background" else []
        record = scene(users, ("yielding", 1, 2), background=background, duration=17.9)
        [event] = check(record, gated_map()).events
        assert event.time == pytest.approx(5.3)
        assert find_ends(record) == told


class TestLateBeginnings:
    """A car east at 10 m/s is beside a pedestrian that walks north into its side at 4.16 s."""

    @pytest.mark.parametrize(("earlier", "named"), [(0.0, True), (0.8, True), (0.9, False)])
    def test_of_agents_of_an_event_are_named(self, earlier: float, named: bool) -> None:
        car = line(1, (-50.0, -1.75), EAST, distance(10.0, (0.0, 4.4)))
        walker = walk(2, (-8.0, -6.0 - 1.4 * earlier), NORTH,
                      distance(1.4, (0.0, 2.3 + earlier)), at=2.0 - earlier)  # fmt: skip
        record = scene([car, walker], ("collision", 1, 2), duration=10.0)
        assert "late_beginnings" not in check(record).figures  # as in proofs of older scenes
        meta = record.meta.model_copy(update={"rules": 2})
        found = check(record.model_copy(update={"meta": meta})).figures.get("late_beginnings", [])
        lead = pytest.approx(2.16 + earlier, abs=0.03)
        assert found == ([{"agent": 2, "event": "collision", "lead": lead}] if named else [])


def cut(agent: AgentRecord, k: int, *, begins: bool) -> AgentRecord:
    """The agent from its k-th sample on, or up to it."""
    kept = slice(k, None) if begins else slice(0, k + 1)
    spawn = round(agent.spawn_time + 0.1 * k, 1) if begins else agent.spawn_time
    return agent.model_copy(
        update={"trajectory": agent.trajectory[kept], "heading": agent.heading[kept],
                "spawn_time": spawn}
    )  # fmt: skip


def list_forged(record: SceneRecord) -> Iterator[tuple[str, SceneRecord]]:
    """Each agent that begins, and that ends, in the middle of its way over the road."""
    road = get_ground_raster(load_map("amsterdam_120")).road
    for n, agent in enumerate(record.agents):
        xy = np.array(agent.trajectory)
        inside = np.flatnonzero(road.contains(xy) & (np.abs(xy).max(axis=1) < 40.0))
        inside = inside[(inside > 5) & (inside < len(xy) - 5)]  # else nothing is cut off
        for rule in sorted(ENDS) if len(inside) else ():
            k = int(inside[len(inside) // 2])
            cut_agent = cut(agent, k, begins=rule == "appears")
            agents = (*record.agents[:n], cut_agent, *record.agents[n + 1 :])
            yield rule, record.model_copy(update={"agents": agents})


def test_sixty_forged_beginnings_and_ends_are_sixty_caught() -> None:
    ground = load_map("amsterdam_120")
    texts = (
        "A car turning left yields to a pedestrian with six cars and four pedestrians around",
        "A car hits a cyclist on the west crosswalk with eight cars and two pedestrians around",
        "Six cars and six pedestrians, nothing happens",
        "Four cars and two pedestrians, nothing happens",
    )
    made = [synthesize(text, seed=5).record for text in texts]
    forged = [each for record in made for each in list_forged(record)][:60]
    assert len(forged) == 60
    for rule, record in forged:
        assert rule in list_rules(check(record, ground))
