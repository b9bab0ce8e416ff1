"""Contact, clearance, PET and TTC against shapely by brute force, and TTC against FCL."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import planar_reference as reference
import pytest
import shapely
import traffic
from ledger import note
from peer import ask

from scenewright.scene.base import FloatArray
from scenewright.scene.track import Shape
from scenewright.tools.relation_checker import (
    RoadUser,
    build_trajectory,
    compute_clearance,
    compute_drac,
    compute_path_ttc,
    compute_pet,
    compute_ttc_2d,
    find_common_times,
    find_encounters,
    find_first_contact,
)

HORIZON = 5.0
FINEST = 0.005
"""TTC is found to this [s]; a contact that is over sooner can be missed."""
NEAR = 40.0
"""TTC is compared while centres are nearer than this [m]."""

Pair = tuple[RoadUser, RoadUser]
KINDS: dict[str, Callable[[], tuple[traffic.Scene, ...]]] = {
    "analytic": traffic.analytic,
    "random": traffic.random_pairs,
    "generated": traffic.generated,
    "recorded": traffic.recorded,
}


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    name = str(request.param)
    if not KINDS[name]():
        pytest.skip(f"no tracks: name their folder in {traffic.RECORDINGS}")
    return name


def pairs(kind: str) -> Iterator[tuple[str, Pair]]:
    for scene in KINDS[kind]():
        for pair in scene.pairs():
            yield f"{scene.name}, {pair[0].id} and {pair[1].id}", pair


def test_clearance_is_the_distance_of_the_polygons(kind: str) -> None:
    for name, (a, b) in pairs(kind):
        one, two = build_trajectory(a), build_trajectory(b)
        times = find_common_times(one, two)
        difference = compute_clearance(one, two, times=times) - reference.clearances(a, b, times)
        note("clearance [m]", "shapely", kind, difference)
        assert np.abs(difference).max(initial=0.0) < 1e-9, name


def test_first_contact_is_when_the_polygons_first_meet(kind: str) -> None:
    compared = 0
    for name, (a, b) in pairs(kind):
        times = reference.common(a, b)
        if len(times) == 0 or reference.clearances(a, b, times).min() > 3.0:
            continue
        ours, theirs = (
            find_first_contact(build_trajectory(a), build_trajectory(b)),
            reference.first_touch(a, b),
        )
        assert (ours is None) == (theirs is None), name
        if ours is not None and theirs is not None:
            note("first contact [s]", "shapely", kind, [ours.time - theirs])
            # both stop at 1 mm; the reference looks every 1 ms
            assert abs(ours.time - theirs) < 0.002, name
            compared += 1
    assert compared or kind == "recorded"


def test_pet_is_the_least_lag_of_the_polygons(kind: str) -> None:
    step = 0.05 if kind in ("generated", "recorded") else 0.02
    compared = 0
    for name, (a, b) in pairs(kind):
        ours = compute_pet(build_trajectory(a), build_trajectory(b))
        found = reference.crossings(a, b, step=step)
        theirs = min((c.lag for c in found), default=None)
        if a.shape.type == b.shape.type and any(c.angle <= np.deg2rad(30) for c in found):
            # behind one another in one lane: headway. Leaving contacts out can only raise a lag.
            assert ours is None or (theirs is not None and ours > theirs - 2 * step), name
            continue
        assert (ours is None) == (theirs is None), name
        if ours is not None and theirs is not None:
            note("PET [s]", "shapely", kind, [ours - theirs])
            # the reference is late by up to two of its steps; ours by 0.01 s, where two brush past
            # one another in one direction by 0.03 s
            assert -2 * step - 0.01 < ours - theirs < 0.04, name
            compared += 1
    assert compared


def test_pet_ends_with_the_track() -> None:
    """A car is last seen on the crossing at 3 s; 2.6775 s later the other's front is there."""
    seen = traffic.straight(1, towards=0.0, speed=10.0, at=3.0, lasts=3.0)
    later = traffic.straight(2, towards=np.pi / 2, speed=10.0, at=6.0)
    (meeting,) = find_encounters((build_trajectory(seen), build_trajectory(later)))
    assert meeting.first_time == pytest.approx(3.0)
    assert meeting.pet == pytest.approx(2.6775, abs=0.01)


def test_a_corner_that_is_hit_for_a_moment_has_a_ttc() -> None:
    """Two cars that cross touch at their corners from 6.3475 to 6.3725 s, between two samples."""
    one = build_trajectory(traffic.straight(1, towards=0.0, speed=10.0, at=6.05))
    two = build_trajectory(traffic.straight(2, towards=np.pi / 2, speed=10.0, at=6.67))
    times = np.array([4.0, 5.0, 6.0])
    for measure in (compute_ttc_2d, compute_path_ttc):
        assert measure(one, two, times=times) == pytest.approx(6.3475 - times, abs=0.006)
    contact = find_first_contact(one, two)
    assert contact is not None
    assert contact.time == pytest.approx(6.3475, abs=0.001)


@pytest.mark.parametrize("degrees", [90, 75, 60, 45])
@pytest.mark.parametrize("lag", [-3.0, -1.5, 1.5, 3.0])
def test_pet_of_a_zone_is_never_longer(degrees: float, lag: float) -> None:
    """Where the definitions part: a zone is left and entered by whole areas, ours by footprints.

    At a right angle both are the same. The more acute the angle, the longer the zone, and the
    earlier somebody enters it at a corner where the other never was.
    """
    a = traffic.straight(1, towards=0.0, speed=10.0, at=6.0)
    b = traffic.straight(2, towards=np.deg2rad(degrees), speed=7.0, at=6.0 + lag)
    ours, zone = compute_pet(build_trajectory(a), build_trajectory(b)), reference.zone_lag(a, b)
    assert ours is not None
    assert zone is not None
    note(f"PET less that of the zone, {degrees} degrees [s]", "shapely", "analytic", [ours - zone])
    if degrees == 90:
        assert ours == pytest.approx(zone, abs=0.03)
    else:
        assert ours > zone - 0.03
    if degrees == 45:
        assert ours > zone + 0.2


def test_ttc_at_constant_velocity(kind: str) -> None:
    compared = 0
    for name, pair in pairs(kind):
        times = _near_times(pair)[::3]
        if len(times) == 0:
            continue
        tracks = build_trajectory(pair[0]), build_trajectory(pair[1])
        ours = compute_ttc_2d(*tracks, times=times, horizon=HORIZON)
        theirs = reference.straight_ttc(*pair, times, horizon=HORIZON + 0.1)
        compared += _compare(_Shown(name, kind, "shapely", pair, times), ours, theirs)
    assert compared


def test_ttc_by_fcl() -> None:
    """FCL finds the contact by continuous collision: once more with an algorithm of its own."""
    scenes = [*traffic.analytic(), *traffic.random_pairs()]
    shown = [(scene.name, (a, b)) for scene in scenes for a, b in scene.pairs()]
    moments = [_near_times(pair)[::5] for _, pair in shown]
    question = [
        {"agents": [traffic.as_json(u) for u in pair],
         "states": np.stack([_states(u, times) for u in pair], axis=1).tolist()}
        for (_, pair), times in zip(shown, moments, strict=True)
    ]  # fmt: skip
    answer = ask("python-fcl", {"horizon": HORIZON + 0.1, "pairs": question})["pairs"]
    compared = 0
    for (name, pair), times, found in zip(shown, moments, answer, strict=True):
        ours = compute_ttc_2d(*(build_trajectory(u) for u in pair), times=times, horizon=HORIZON)
        theirs = np.array([np.inf if t is None else t for t in found], dtype=np.float64)
        # FCL itself overlooks contacts of a few millimetres
        known = np.isinf(ours) | np.isfinite(theirs)
        compared += _compare(_Shown(name, "analytic, random", "python-fcl", pair, times[known]),
                             ours[known], theirs[known])  # fmt: skip
        assert (~known).sum() <= 2, name
    assert compared > 500


def test_ttc_along_the_paths(kind: str) -> None:
    compared = 0
    for name, pair in pairs(kind):
        times = np.array([
            t for t in _near_times(pair)[::10]
            if all(reference.line_left(u, t, seconds=HORIZON) for u in pair)
        ])  # fmt: skip
        if len(times) == 0:
            continue
        ours = compute_path_ttc(*(build_trajectory(u) for u in pair), times=times, horizon=HORIZON)
        theirs = np.array([reference.path_ttc_at(*pair, t, horizon=HORIZON) for t in times])
        both = np.isfinite(ours) & np.isfinite(theirs)
        difference = ours[both] - theirs[both]
        note("TTC along paths [s]", "shapely", kind, difference)
        # paths are kept every 0.5 m: some centimetres at the corners of who turns
        assert np.abs(difference).max(initial=0.0) < 0.1, name
        for k in np.flatnonzero(np.isfinite(ours) != np.isfinite(theirs)):
            assert _slight(pair, float(times[k])), (name, times[k], ours[k], theirs[k])
        compared += int(both.sum())
    assert compared


def test_drac_of_who_closes_in_from_behind() -> None:
    """Closing speed squared over twice the gap, with the gap by shapely."""
    for fast, slow in ((10.0, 4.0), (14.0, 8.0), (6.0, 0.0), (9.0, 5.5)):
        a = traffic.straight(1, towards=0.3, speed=fast, at=8.0)
        b = traffic.straight(2, towards=0.3, speed=slow, at=5.0 if slow else 6.0)
        times = reference.common(a, b)
        gaps = reference.clearances(a, b, times)
        known = (gaps > 0.1) & (gaps / (fast - slow) < HORIZON - 0.1)
        known &= ~np.maximum.accumulate(gaps <= 0.1)  # afterwards the one has driven through
        ours = compute_drac(build_trajectory(a), build_trajectory(b), times=times[known])
        difference = ours - (fast - slow) ** 2 / (2 * gaps[known])
        note("DRAC [m/s^2]", "shapely", "analytic", difference)
        assert len(difference) > 10
        assert np.abs(difference).max() < 1e-6


def _near_times(pair: Pair) -> FloatArray:
    times = find_common_times(build_trajectory(pair[0]), build_trajectory(pair[1]))
    if len(times) == 0:
        return times
    centres = [reference.pose_at(u, times)[0] for u in pair]
    return times[np.hypot(*(centres[0] - centres[1]).T) < NEAR]


def _states(user: RoadUser, times: FloatArray) -> Any:
    """[n, 5] x, y, heading and velocity."""
    xy, heading = reference.pose_at(user, times)
    k = np.rint((times - user.track.start) / user.track.step).astype(int)
    return np.column_stack((xy, heading, reference.velocity_of(user)[k]))


@dataclass(frozen=True)
class _Shown:
    """What TTC is compared on: a pair, at times [s], by a package."""

    name: str
    kind: str
    package: str
    pair: Pair
    times: FloatArray


def _compare(shown: _Shown, ours: FloatArray, theirs: FloatArray) -> int:
    """Ours is the other's, or later by what it is exact to; what only the other finds is brief."""
    both = np.isfinite(ours) & np.isfinite(theirs)
    difference = ours[both] - theirs[both]
    note("TTC in the plane [s]", shown.package, shown.kind, difference)
    assert np.all((difference > -1e-3) & (difference < FINEST + 1e-3)), (shown.name, difference)
    assert not np.any(np.isfinite(ours) & np.isinf(theirs)), shown.name
    missed = np.flatnonzero(np.isinf(ours) & (theirs < HORIZON - FINEST))
    note("TTC in the plane of brief contacts we miss [s]", shown.package, shown.kind,
         theirs[missed])  # fmt: skip
    assert not any(_lasting(shown.pair, float(shown.times[k])) for k in missed), shown.name
    return int(both.sum())


def _lasting(pair: Pair, time: float) -> bool:
    """Whether the predicted contact holds at any of the moments that are so little apart."""
    ahead = np.arange(0.0, HORIZON + FINEST / 2, FINEST)
    moved = []
    for user in pair:
        x, y, heading, vx, vy = _states(user, np.array([time]))[0]
        xy = np.array([x, y]) + ahead[:, None] * np.array([vx, vy])
        moved.append(reference.areas(reference.core(user, xy, np.full(len(ahead), heading))))
    near = sum(reference.radius(u) for u in pair)
    return bool((shapely.distance(*moved) <= near - 1e-9).any())


def _slight(pair: Pair, time: float) -> bool:
    """Whether a predicted contact hangs on 10 cm.

    Looked at every 0.1 s, there is none with footprints 10 cm smaller all round, and one with
    footprints as much larger.
    """
    smaller, larger = (
        reference.path_ttc_at(_grown(pair[0], by), _grown(pair[1], by), time,
                              horizon=HORIZON, step=0.1)
        for by in (-0.2, 0.2)
    )  # fmt: skip
    return bool(np.isinf(smaller) and np.isfinite(larger))


def _grown(user: RoadUser, by: float) -> RoadUser:
    shape = Shape(user.shape.type, user.shape.length + by, user.shape.width + by)
    return RoadUser(user.id, user.track, shape)
