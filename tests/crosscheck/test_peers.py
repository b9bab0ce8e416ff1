"""Contact, closest approach, PET and following against packages that others wrote."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from itertools import combinations
from typing import Any

import numpy as np
import planar_reference as reference
import pytest
import shapely
import traffic
from ledger import note
from peer import ask

from scenewright.scene.track import Shape, Track
from scenewright.tools.relation_checker import (
    RoadUser,
    Trajectory,
    build_trajectory,
    compute_clearance,
    compute_drac,
    compute_path_ttc,
    compute_pet,
    compute_ttc_2d,
    find_common_times,
    find_first_contact,
)

Pair = tuple[RoadUser, RoadUser]
LAST_PET = 8.0
"""PET is compared up to this [s]."""


def _pairs(
    scenes: Iterable[traffic.Scene], wanted: Callable[[Pair], bool], most: int
) -> list[Pair]:
    """Pairs that are wanted, at most so many, evenly taken from all."""
    found = [pair for scene in scenes for pair in scene.pairs() if wanted(pair)]
    return found[:: max(len(found) // most, 1)][:most]


def _tracks(pair: Pair) -> tuple[Trajectory, Trajectory]:
    return build_trajectory(pair[0]), build_trajectory(pair[1])


def _pet(pair: Pair) -> float | None:
    return compute_pet(*_tracks(pair))


def _least_clearance(pair: Pair) -> float:
    one, two = _tracks(pair)
    return float(compute_clearance(one, two, times=find_common_times(one, two)).min(initial=np.inf))


def _boxed(pairs: list[Pair]) -> list[Pair]:
    return [(traffic.boxed(a), traffic.boxed(b)) for a, b in pairs]


def _together(pair: Pair) -> Pair:
    """Both tracks while both are there, from time 0: others expect all to be there throughout."""
    times = find_common_times(*_tracks(pair))
    cut = []
    for user in pair:
        first = round((times[0] - user.track.start) / 0.1)
        part = slice(first, first + len(times))
        track = Track(user.track.xy[part], user.track.heading[part], 0.0)
        cut.append(RoadUser(user.id, track, user.shape))
    return cut[0], cut[1]


def _told(pairs: list[Pair]) -> list[list[dict[str, Any]]]:
    return [[traffic.as_json(user) for user in pair] for pair in pairs]


def _meets_at_an_angle(pair: Pair) -> bool:
    """Whether the two have a PET, and are never behind one another where they meet."""
    pet = _pet(pair)
    if pet is None or pet > LAST_PET - 0.3:
        return False
    found = reference.crossings(*pair, step=0.05)
    return all(c.angle > np.deg2rad(30) for c in found)


@pytest.mark.parametrize("kind", ["analytic", "generated", "recorded"])
def test_pet_by_omega_prime(kind: str) -> None:
    """Its least time gap is over samples 0.1 s apart: up to two of them longer than ours."""
    scenes = {"analytic": traffic.analytic, "generated": traffic.generated,
              "recorded": traffic.recorded}[kind]()  # fmt: skip
    if not scenes:
        pytest.skip(f"no tracks: name their folder in {traffic.RECORDINGS}")
    pairs = _boxed(_pairs(scenes, _meets_at_an_angle, 60))
    answer = ask("omega-prime", {"buffer": LAST_PET, "pairs": _told(pairs)})["pairs"]
    ours = np.array([_pet(pair) for pair in pairs], dtype=np.float64)
    theirs = np.array([found["pet"] for found in answer], dtype=np.float64)
    note("PET [s]", "omega-prime", kind, ours - theirs)
    assert len(pairs) > 10
    assert np.all((ours - theirs > -0.21) & (ours - theirs < 0.04))


def test_following_by_omega_prime() -> None:
    """Its TTC of following is of the centres: ours and a car's length at the closing speed."""
    for fast, slow in ((10.0, 4.0), (14.0, 12.0), (9.0, 6.0)):
        pair = (traffic.straight(1, towards=0.0, speed=fast, at=8.0),
                traffic.straight(2, towards=0.0, speed=slow, at=5.5))  # fmt: skip
        answer = ask("omega-prime", {"buffer": LAST_PET, "pairs": _told([pair])})["pairs"][0]
        found = np.array(answer["ttc"])
        theirs = found[:, 1] - traffic.CAR.length / (fast - slow)
        ahead = theirs > 0.1
        ours = compute_path_ttc(*_tracks(pair), times=found[ahead, 0], horizon=60.0)
        note("TTC of following [s]", "omega-prime", "analytic", ours - theirs[ahead])
        assert ahead.sum() > 5
        assert np.abs(ours - theirs[ahead]).max() < 1e-3


@pytest.mark.parametrize("kind", ["analytic", "random", "generated", "recorded"])
def test_contact_by_scenario_gym(kind: str) -> None:
    """It looks every 0.02 s, and calls a contact what we call one at 1 mm."""
    scenes = {"analytic": traffic.analytic, "random": traffic.random_pairs,
              "generated": traffic.generated, "recorded": traffic.recorded}[kind]()  # fmt: skip
    if not scenes:
        pytest.skip(f"no tracks: name their folder in {traffic.RECORDINGS}")
    found = _pairs(scenes, lambda pair: _least_clearance(pair) < 1.0, 50)
    pairs = _boxed([_together(pair) for pair in found])
    step = 0.02
    answer = ask("scenario-gym", {"timestep": step, "pairs": _told(pairs)})["pairs"]
    contacts = 0
    for pair, theirs in zip(pairs, answer, strict=True):
        ours = find_first_contact(*_tracks(pair))
        if theirs is None:
            # a contact of some millimetres, or one that is over before it looks again
            assert ours is None or _slight(pair, ours.time, step), ours
            continue
        assert ours is not None
        note("first contact [s]", "scenario-gym", kind, [ours.time - theirs])
        assert -step - 0.005 < ours.time - theirs < 1e-6 or _slight(pair, ours.time, step)
        contacts += 1
    assert contacts or kind == "recorded"


def _slight(pair: Pair, time: float, step: float) -> bool:
    """Whether the contact is thin, or the footprints are apart or the tracks over within a step."""
    if pair[0].track.end < time + step:
        return True
    times = time + np.linspace(0.0, step, 21)
    areas = [reference.areas(reference.core(u, *reference.pose_at(u, times))) for u in pair]
    apart = reference.clearances(*pair, times) > reference.TOUCH
    thin = shapely.area(shapely.intersection(*areas)) < 2e-3
    return bool(apart.any() or thin.all())


@pytest.mark.parametrize("kind", ["analytic", "generated", "recorded"])
def test_closest_encounter_by_crime(kind: str) -> None:
    """DCE and TTCE, over all samples but the last, which it leaves out."""
    scenes = {"analytic": traffic.analytic, "generated": traffic.generated,
              "recorded": traffic.recorded}[kind]()  # fmt: skip
    if not scenes:
        pytest.skip(f"no tracks: name their folder in {traffic.RECORDINGS}")
    pairs = [_together(p) for p in _pairs(scenes, lambda p: _least_clearance(p) < 8.0, 40)]
    question = [{"agents": told} for told in _told(pairs)]
    answer = ask("commonroad-crime", {"pairs": question})["pairs"]
    assert len(pairs) > 10
    for pair, found in zip(pairs, answer, strict=True):
        one, two = _tracks(pair)
        ours = compute_clearance(one, two, times=find_common_times(one, two)[:-1])
        k = int(np.argmin(ours))
        note("closest approach [m]", "commonroad-crime", kind, [ours[k] - found["dce"]])
        # rounded to 1 cm; its discs are polygons, up to 2 mm narrower
        assert abs(ours[k] - found["dce"]) < 0.008
        at = int(np.rint(found["ttce"] * 10))
        assert ours[at] < ours[k] + 0.003


def test_following_by_crime() -> None:
    """In a lane to the east, where its TTC is right, rounded to 0.01 s."""
    pairs = [
        (traffic.straight(1, towards=0.0, speed=fast, at=8.0),
         traffic.straight(2, towards=0.0, speed=slow, at=5.0 if slow else 6.0))
        for fast, slow in ((10.0, 4.0), (14.0, 13.0), (6.0, 0.0), (9.0, 6.5))
    ]  # fmt: skip
    moments = list(range(1, 40, 3))
    question = [{"agents": told, "in_lane": moments} for told in _told(pairs)]
    answer = ask("commonroad-crime", {"pairs": question})["pairs"]
    for pair, found in zip(pairs, answer, strict=True):
        theirs = np.array([value for _, value in found["ttc"]], dtype=np.float64)
        times = np.array([0.1 * k for k, _ in found["ttc"]])
        for name, measure in (
            ("TTC of following [s]", compute_path_ttc),
            ("TTC in the plane [s]", compute_ttc_2d),
        ):
            ours = measure(*_tracks(pair), times=times, horizon=80.0)
            note(name, "commonroad-crime", "analytic", ours - theirs)
            assert np.abs(ours - theirs).max() < 0.006


def test_pet_by_crime() -> None:
    """Its zone is entered a sample early and left a sample late: up to 0.3 s shorter than ours."""
    pairs = [
        (traffic.straight(1, towards=0.0, speed=10.0, at=6.0),
         traffic.straight(2, towards=np.pi / 2, speed=7.0, at=6.0 + lag))
        for lag in (-4.0, -3.0, -2.0, -1.3, 1.3, 2.0, 3.0, 4.0)
    ]  # fmt: skip
    question = [{"agents": told, "crossing": traffic.CAR.width} for told in _told(pairs)]
    answer = ask("commonroad-crime", {"pairs": question})["pairs"]
    ours = np.array([_pet(pair) for pair in pairs], dtype=np.float64)
    theirs = np.array([found["pet"] for found in answer], dtype=np.float64)
    note("PET [s]", "commonroad-crime", "analytic", ours - theirs)
    assert np.all((ours - theirs > 0.0) & (ours - theirs < 0.31))


FOLLOWS, COLLIDES = 2, 111
"""SUMO's numbers of encounters: the ego follows, the two collide."""


class Simulated:
    """Ten minutes at SUMO's crossroads, as our movers and as SUMO's findings."""

    def __init__(self, answer: dict[str, Any]) -> None:
        self.conflicts: list[dict[str, Any]] = answer["conflicts"]
        self.agents = {agent["name"]: agent for agent in answer["agents"]}
        self.tracks = {
            name: build_trajectory(RoadUser(n, _track(agent), Shape("vehicle", agent["length"],
                                                            agent["width"])))
            for n, (name, agent) in enumerate(self.agents.items())
        }  # fmt: skip

    def pair(self, conflict: dict[str, Any]) -> tuple[Trajectory, Trajectory]:
        return self.tracks[conflict["ego"]], self.tracks[conflict["foe"]]


def _track(agent: dict[str, Any]) -> Track:
    xy = np.column_stack((agent["x"], agent["y"]))
    return Track(xy, np.unwrap(agent["heading"]), agent["start"], agent["step"])


@cache
def simulated() -> Simulated:
    return Simulated(ask("eclipse-sumo", {"seconds": 600, "seed": 3, "rude": 0.5}))


def test_pet_by_sumo() -> None:
    """Lanes as wide as cars that cross at a right angle: its zone is the footprints'."""
    traffic_ = simulated()
    found = [c for c in traffic_.conflicts if c["pet"] and c["pet"] < LAST_PET]
    ours = np.array([compute_pet(*traffic_.pair(c)) for c in found], dtype=np.float64)
    difference = ours - np.array([c["pet"] for c in found])
    note("PET [s]", "eclipse-sumo", "simulated", difference)
    assert len(found) > 50
    assert np.all((difference > -0.02) & (difference < 0.05))


def test_contact_by_sumo() -> None:
    """The pairs that its SSM device says collide, and no others; in the step it says.

    Where the contact falls between two samples, the device gives a PET of 0 and no time.
    """
    traffic_ = simulated()
    theirs = [c for c in traffic_.conflicts if c["pet_kind"] == COLLIDES]
    found = {
        frozenset(names): find_first_contact(*(traffic_.tracks[name] for name in names))
        for names in combinations(traffic_.tracks, 2)
    }
    ours = {names: contact.time for names, contact in found.items() if contact is not None}
    assert {_names(c) for c in theirs} == ours.keys()
    timed = [c for c in theirs if COLLIDES in c["kinds"]]
    difference = [ours[_names(c)] - c["times"][c["kinds"].index(COLLIDES)] for c in timed]
    note("first contact [s]", "eclipse-sumo", "simulated", difference)
    assert len(difference) >= 3
    assert all(-0.1 <= d <= 1e-6 for d in difference)


def _names(conflict: dict[str, Any]) -> frozenset[str]:
    return frozenset((conflict["ego"], conflict["foe"]))


def test_following_by_sumo() -> None:
    """TTC and DRAC of who follows, away from the junction.

    SUMO takes the speed over the last step, we over the last and the next. What that can change is
    known from the speeds, and is allowed for.
    """
    traffic_, rows = simulated(), []
    for conflict in traffic_.conflicts:
        rows += _following_rows(traffic_, conflict)
    ours, theirs, low, high, our_drac, their_drac, drac_slack = np.array(rows).T
    note("TTC of following [s]", "eclipse-sumo", "simulated", ours - theirs)
    note("TTC of following beyond what acceleration explains [s]", "eclipse-sumo", "simulated",
         np.maximum(np.maximum(low - ours, ours - high), 0.0))  # fmt: skip
    note("DRAC of following [m/s^2]", "eclipse-sumo", "simulated", our_drac - their_drac)
    assert len(rows) > 100
    assert np.all((ours > low - 0.03) & (ours < high + 0.03))
    assert np.all(np.abs(our_drac - their_drac) < drac_slack + 0.02)


def _following_rows(traffic_: Simulated, conflict: dict[str, Any]) -> list[tuple[float, ...]]:
    """Our TTC, SUMO's, the least and the most that ours may be; DRAC likewise."""
    rows: list[tuple[float, ...]] = []
    one, two = traffic_.pair(conflict)
    speeds = [np.array(traffic_.agents[conflict[who]]["speed"]) for who in ("ego", "foe")]
    columns = zip(*(conflict[key] for key in ("times", "kinds", "ttc", "drac")), strict=True)
    for time, kind, ttc, rate in columns:
        if kind != FOLLOWS or ttc is None or ttc > 4.5 or not _on_the_road(one, two, time):
            continue
        k, j = one.index(time), two.index(time)
        closing = speeds[0][k] - speeds[1][j]
        change = abs(np.diff(speeds[0])[k]) / 2 + abs(np.diff(speeds[1])[j]) / 2
        if closing < 2 * change + 0.1:
            continue
        at = np.array([time])
        rate_slack = rate * ((closing + change) ** 2 / closing**2 - 1)
        rows.append((
            float(compute_path_ttc(one, two, times=at)[0]), ttc,
            ttc * closing / (closing + change), ttc * closing / (closing - change),
            float(compute_drac(one, two, times=at)[0]), rate, rate_slack,
        ))  # fmt: skip
    return rows


def _on_the_road(one: Trajectory, two: Trajectory, time: float) -> bool:
    """Away from the ends, and from the junction: lanes there are not as long as they look."""
    middle = np.array([200.0, 200.0])
    for track in (one, two):
        k = track.index(time)
        if not 1 < k < len(track) - 2 or np.hypot(*(track.xy[k] - middle)) < 15.0:
            return False
    return True
