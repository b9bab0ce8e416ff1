"""Exits and relations from motion: what must come out, and what must not matter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenewright.evals.understanding.calibration import load_calibration
from scenewright.evals.understanding.cases import (
    ObservedAgent,
    ObservedScene,
    PairRelation,
    SceneCase,
    observe,
)
from scenewright.evals.understanding.forecast import DT, TICKS, AgentForecast, forecast_scene
from scenewright.evals.understanding.intent import find_nearest_mean, infer_routes
from scenewright.evals.understanding.pair_features import (
    IN_ZONE,
    NAMES,
    NONE,
    OF_ZONE,
    compute_time_gaps,
    compute_zone_features,
    mirror_features,
)
from scenewright.evals.understanding.pipeline import (
    check_predicted_tracks,
    find_method,
    predict_constant_velocity,
    predict_with_events,
    predict_with_refiner,
    reason,
    to_relations,
)
from scenewright.evals.understanding.route_components import list_sides, load_components
from scenewright.intersections import load_map
from scenewright.scene.record import SignalRecord

PLACE = "amsterdam_120"


def driven(
    route: str, *, way: float, speed: float = 9.0, id_: str = "0a", back: float = 0.0
) -> ObservedAgent:
    """A vehicle that has driven some way [m] of a route's first mean curve, from `back` [m] on."""
    ways = load_components(PLACE, "vehicle")
    c = [each.id for each in ways.routes].index(route)
    s = back + np.arange(0.0, way, 0.1 * speed)
    xy = np.stack([np.interp(s, ways.s[c], ways.curve[c, :, d]) for d in (0, 1)], axis=-1)
    return ObservedAgent(
        id_, "vehicle", 0.0, xy, np.interp(s, ways.s[c], ways.heading[c]),
        np.full(len(s), speed), s - back, 4.6, 1.85, False,
    )  # fmt: skip


def seen(*agents: ObservedAgent, now: float = 4.0) -> ObservedScene:
    return ObservedScene("00ff00ff00ff00ff", PLACE, now, 12, agents, ())


def sum_exits(agent: ObservedAgent, sides: tuple[str, ...]) -> np.ndarray:
    """The posterior of each exit."""
    found = infer_routes(seen(agent))[agent.id]
    return found.weights @ found.components.match_exits(sides)[found.kept]


@pytest.mark.parametrize(
    ("route", "exit_"),
    [("vehicle:north>east:left", "east"), ("vehicle:south>east:right", "east"),
     ("vehicle:west>east:straight", "east"), ("vehicle:east>south:left", "south")],
)  # fmt: skip
def test_the_exit_is_certain_well_into_a_turn(route: str, exit_: str) -> None:
    sides = list_sides(load_map(PLACE))
    agent = driven(route, way=60.0)
    chances = sum_exits(agent, sides)
    assert chances.sum() == pytest.approx(1.0)
    assert chances[sides.index(exit_)] > 0.95
    assert find_nearest_mean(agent, intersection=PLACE) == exit_


def test_before_a_turn_the_lane_and_frequencies_decide() -> None:
    sides = list_sides(load_map(PLACE))
    agent = driven("vehicle:north>south:straight", way=12.0)
    chances = sum_exits(agent, sides)
    assert chances[sides.index("north")] == pytest.approx(0.0)
    assert 0.3 < chances[sides.index("south")] < 0.99


def test_slowing_without_a_red_light_makes_a_turn_likelier() -> None:
    sides = list_sides(load_map(PLACE))
    ways = load_components(PLACE, "vehicle")
    c = [each.id for each in ways.routes].index("vehicle:south>east:right")
    free = driven("vehicle:south>east:right", way=37.0)
    usual = ways.bend[c, ways.bend.shape[1] // 2]
    v = np.minimum(9.0, np.interp(free.moved, ways.s[c], usual))
    assert v[-1] < 8.0
    slowed = replace(free, speed=v)
    here = sides.index("north")
    straight = [sum_exits(a, sides)[here] for a in (free, slowed)]
    assert straight[1] < straight[0]


def test_a_light_holds_who_has_its_line_ahead_and_no_green() -> None:
    ways = load_components(PLACE, "vehicle")
    c = [each.id for each in ways.routes].index("vehicle:north>south:straight")
    held = []
    for colour, left in (("red", 25.0), ("green", 25.0), ("red", -8.0)):
        light = SignalRecord(stop_line="north:stop", start=0.0, end=4.0, colour=colour)
        agent = driven("vehicle:north>south:straight", way=float(ways.line[c]) - 2.3 - left)
        scene = replace(seen(agent), lights=(light,))
        (found,) = forecast_scene(scene, infer_routes(scene))
        held.append(found.weight[found.held].sum())
        if left > 0.0:
            assert np.median(found.line) == pytest.approx(left, abs=1.5)
    assert held == pytest.approx([1.0, 0.0, 0.0], abs=0.05)


def future(agent: ObservedAgent, xy: np.ndarray, heading: float) -> AgentForecast:
    size = 3
    return AgentForecast(
        agent, load_components(PLACE, "vehicle"),
        np.repeat(xy[None], size, axis=0), np.full((size, TICKS), heading),
        np.ones((size, TICKS), dtype=np.bool_), np.full(size, 5.0),
        np.zeros(size, dtype=np.bool_), np.full(size, np.inf),
        np.zeros(size, dtype=np.intp), np.full(size, 1 / size),
    )  # fmt: skip


@pytest.mark.parametrize(("late", "gap"), [(0.0, 0.0), (1.5, 1.0), (-2.5, -2.0)])
def test_the_gap_of_crossing_cars_is_what_either_would_have_to_wait(
    late: float, gap: float
) -> None:
    """Two cars cross at right angles at 5 m/s, the second `late` seconds later at the crossing.

    Footprints are 4.6 m long, so that up to a second later they still touch, a tick more or less.
    """
    t = DT * np.arange(TICKS)
    a, b = (driven("vehicle:west>east:straight", way=5.0, id_=name) for name in "ab")
    east = future(a, np.stack([-20.0 + 5.0 * t, 0 * t], axis=-1), 0.0)
    north = future(b, np.stack([0 * t, -20.0 + 5.0 * (t - late)], axis=-1), np.pi / 2)
    found = compute_time_gaps(east, north)
    assert found is not None
    least = max(abs(late) - (4.6 + 1.85) / 2 / 5.0, 0.0)
    assert np.abs(found.gap).max() == pytest.approx(least, abs=2 * DT)
    assert (np.sign(found.gap) == -np.sign(gap)).all()
    assert found.angle[found.gap < 90] == pytest.approx(np.pi / 2)


def test_paths_that_stay_apart_have_no_time_gap() -> None:
    t = DT * np.arange(TICKS)
    a, b = (driven("vehicle:west>east:straight", way=5.0, id_=name) for name in "ab")
    one = future(a, np.stack([5.0 * t, 0 * t], axis=-1), 0.0)
    two = future(b, np.stack([5.0 * t, 0 * t + 20.0], axis=-1), 0.0)
    assert compute_time_gaps(one, two) is None


@pytest.mark.parametrize("late", [0.0, 0.6, 4.0])
def test_the_zone_of_crossing_cars_is_where_and_when_they_cross(late: float) -> None:
    """Two cars cross at right angles at 5 m/s; each is in the zone for 1.29 s."""
    t = DT * np.arange(TICKS)
    a, b = (driven("vehicle:west>east:straight", way=5.0, id_=name, speed=5.0) for name in "ab")
    east = future(a, np.stack([-20.0 + 5.0 * t, 0 * t], axis=-1), 0.0)
    north = future(b, np.stack([0 * t, -20.0 + 5.0 * (t - late)], axis=-1), np.pi / 2)
    both, one, two = compute_zone_features(east, north, np.ones(3, dtype=np.bool_))
    of_both, of_a, of_b = (
        dict(zip(names, values, strict=True))
        for names, values in ((OF_ZONE, both), (IN_ZONE, one), (IN_ZONE, two))
    )
    reach, stay = 20.0 - (1.85 + 4.6) / 2, (1.85 + 4.6) / 5.0
    assert of_a["zone"] == pytest.approx(reach, abs=0.8)
    assert of_b["zone_in"] == pytest.approx(reach / 5.0 + late, abs=0.2)
    assert of_a["zone_for"] == pytest.approx(stay, abs=0.3)
    assert (of_a["lead"], of_b["lead"]) == pytest.approx((late, -late), abs=0.15)
    assert of_both["offset"] == pytest.approx(late / stay, abs=0.15)
    assert of_a["zone_needs"] == pytest.approx(25.0 / (2 * (reach - 0.8)), abs=0.1)


def test_paths_that_stay_apart_share_no_zone() -> None:
    t = DT * np.arange(TICKS)
    a, b = (driven("vehicle:west>east:straight", way=5.0, id_=name) for name in "ab")
    one = future(a, np.stack([5.0 * t, 0 * t], axis=-1), 0.0)
    two = future(b, np.stack([5.0 * t, 0 * t + 20.0], axis=-1), 0.0)
    for mine in (np.ones(3, dtype=np.bool_), np.zeros(3, dtype=np.bool_)):
        both, own, _ = compute_zone_features(one, two, mine)
        assert (tuple(both), tuple(own)) == NONE


def test_probabilities_sum_to_one_and_ignore_the_order_of_a_pair() -> None:
    values = np.random.default_rng(0).uniform(0, 1, (50, len(NAMES)))
    trees = load_calibration()
    there, back = trees.predict_pairs(values), trees.predict_pairs(mirror_features(values))
    assert there.sum(axis=1) == pytest.approx(1.0)
    assert back[:, [0, 1, 2, 4, 3]] == pytest.approx(there)
    assert trees.predict_pairs(values[:0]).shape == (0, 5)


def test_constant_velocity_and_the_checker_see_a_crash_coming() -> None:
    one = driven("vehicle:west>east:straight", way=36.0, id_="a", speed=9.0)
    two = driven("vehicle:south>north:straight", way=36.0, id_="b", speed=9.0)
    observation = seen(one, two)
    found = to_relations(
        check_predicted_tracks(observation, predict_constant_velocity), observation
    )
    assert {each.key[0] for each in found} <= {"collision", "near_miss"}
    assert len(found) == 1
    apart = seen(one, driven("vehicle:east>west:straight", way=36.0, id_="b"))
    assert check_predicted_tracks(apart, predict_constant_velocity) == ()


def renamed(row: ObservedScene, names: dict[str, str]) -> ObservedScene:
    agents = [replace(a, id=names[a.id]) for a in row.agents]
    return replace(row, agents=tuple(sorted(agents, key=lambda a: a.id)))


@pytest.mark.parametrize("method", ["reasoner", "constant_velocity"])
def test_nothing_but_motion_decides(cases: dict[str, SceneCase], method: str) -> None:
    """Other ids, and so another order, give the same exits and relations."""
    predict = find_method(method, intersection=PLACE).predict
    for name, case in cases.items():
        for window in (4.0, 6.0):
            row = observe(case.record, scene=name, window=window)
            names = {a.id: f"{n:08x}" for n, a in enumerate(reversed(row.agents))}
            before, after = predict(row, case), predict(renamed(row, names), case)
            assert before.relations is not None
            assert after.relations is not None
            moved = {
                PairRelation(r.type, names[r.from_], names[r.to]).key for r in before.relations
            }
            assert moved == {r.key for r in after.relations}
            if before.exits is not None:
                assert after.exits == {names[a]: side for a, side in before.exits.items()}


def test_the_reasoner_repeats_itself_and_predicts_observed_agents_only(
    cases: dict[str, SceneCase],
) -> None:
    for name, case in cases.items():
        row = observe(case.record, scene=name, window=4.0)
        first, second = reason(row), reason(row)
        assert (first.exits, first.relations) == (second.exits, second.relations)
        ids = {agent.id for agent in row.agents}
        assert set(first.exits or ()) == ids
        assert {r.from_ for r in first.relations or ()} | {
            r.to for r in first.relations or ()
        } <= ids


def test_oracle_seen_is_right_about_observed_agents(cases: dict[str, SceneCase]) -> None:
    case = cases["struck"]
    row = observe(case.record, scene="struck", window=20.0)
    said = predict_with_events(row, case)
    assert said.relations is not None
    assert {r.key for r in said.relations} == {r.key for r in case.labels.relations}
    assert [r.type for r in said.relations].count("collision") == 1


def test_an_empty_street_is_understood(cases: dict[str, SceneCase]) -> None:
    row = observe(cases["plain"].record, scene="plain", window=1.0)
    said = reason(replace(row, agents=(), lights=()))
    assert (said.exits, said.relations) == ({}, ())


def test_the_refiner_predicts_all_agents_observed_for_a_step_or_more(
    cases: dict[str, SceneCase],
) -> None:
    """An untrained network changes no velocity much; who has just come goes on as it came."""
    from refiner_networks import build_zero_network, convert_network
    from scenewright.tools.trajnet_refiner.config import RefinerConfig

    config = RefinerConfig(hidden=8, embedding=4, pooled=4)
    net = convert_network(build_zero_network(config))
    for window in (0.5, 4.0):
        observation = observe(cases["plain"].record, scene="plain", window=window)
        drawn = predict_with_refiner(net, observation)
        assert len(drawn) == len(observation.agents)
        for agent, xy in zip(observation.agents, drawn, strict=True):
            assert xy.shape == (80, 2)
            assert np.isfinite(xy).all()
            assert np.hypot(*(xy[0] - agent.xy[-1])) < 3.0


def test_the_refiner_predicts_nothing_for_an_empty_observation(cases: dict[str, SceneCase]) -> None:
    from refiner_networks import build_zero_network, convert_network
    from scenewright.tools.trajnet_refiner.config import RefinerConfig

    config = RefinerConfig(hidden=8, embedding=4, pooled=4)
    net = convert_network(build_zero_network(config))
    observation = observe(cases["plain"].record, scene="plain", window=0.5)
    assert predict_with_refiner(net, replace(observation, agents=())) == []
