"""Objects in agents' way in the checker: real encounters, copies of them, and forgeries."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from checker_tracks import EAST, along, distance, line, mirrored, moved, resampled, scene
from scenewright.scene.objects import Encounter, EncounterRecord, ObjectRecord
from scenewright.scene.track import get_rider_shape
from scenewright.tools.relation_checker import RoadUser, build_trajectory
from scenewright.tools.relation_checker.events import observe
from scenewright.tools.relation_checker.objects import check_encounters

VAN = ObjectRecord(
    id="object-1", kind="stalled", subtype="van", height="high",
    length=5.4, width=2.0, x=0.0, y=-1.75, heading=0.0,
)  # fmt: skip


def waiting(gap: float = 2.0, stays: float = 15.0) -> RoadUser:
    """Eastward at 8 m/s, 2 m/s^2 down to a stand `gap` behind the van."""
    stops = 0.0 - 2.7 - gap - 2.3
    return line(1, (stops - 16.0 - 40.0, -1.75), EAST, distance(8.0, (0, 5), (-2, 4), (0, stays)))


def striking(stops_after: float = 0.0) -> RoadUser:
    """Eastward at 8 m/s into the van at t = 4 s, when it ends."""
    return line(1, (-5.0 - 32.0, -1.75), EAST, distance(8.0, (0, 4 + stops_after)))


def stopping(braking: float = 6.0, gap: float = 0.6) -> RoadUser:
    """Eastward at 9 m/s, hard down to a stand just short of the van."""
    stops, takes = 0.0 - 2.7 - gap - 2.3, 9.0 / braking
    start = stops - 9.0 * 5 - 9.0 * takes / 2
    return line(1, (start, -1.75), EAST, distance(9.0, (0, 5), (-braking, takes), (0, 18)))


def pulling_out(waits: float = 4.0) -> RoadUser:
    """Eastward to a stand 8 m behind the van, then over to the left and past it."""
    x = np.arange(-60.0, 60.0, 0.05)
    out, back = (np.clip(each, 0.0, 1.0) for each in ((x + 12.5) / 9, (25 - x) / 18))
    y = -1.75 + 3.0 * (3 * out**2 - 2 * out**3) * (3 * back**2 - 2 * back**3)
    stand = distance(8.0, (0, 3.875), (-2, 4), (0, waits), (1, 6), (0, 10))
    return along(1, np.stack((x, y), axis=1), stand)


def passing(moves: float = 3.0) -> RoadUser:
    """Eastward at 8 m/s, over to the left before the van and back after it."""
    x = np.arange(-60.0, 60.0, 0.05)
    out, back = (np.clip(each, 0.0, 1.0) for each in ((x + 25) / 18, (25 - x) / 18))
    y = -1.75 + moves * (3 * out**2 - 2 * out**3) * (3 * back**2 - 2 * back**3)
    return along(1, np.stack((x, y), axis=1), distance(8.0, (0, 14)))


REAL: dict[Encounter, RoadUser] = {
    "goes_round": passing(), "waits_behind": waiting(), "hits": striking(),
    "stops_short": stopping(), "waits_then_passes": pulling_out(),
}  # fmt: skip


def faults(user: RoadUser, how: Encounter, van: ObjectRecord = VAN) -> list[str]:
    step = user.track.step
    made = scene([user], duration=24.0)
    asked = EncounterRecord(agent=1, object="object-1", how=how)
    made = made.model_copy(
        update={
            "objects": (van,), "encounters": (asked,),
            "meta": made.meta.model_copy(update={"step": step}),
        }
    )  # fmt: skip
    return [each.detail for each in check_encounters(made, observe([user]))[1]]


@pytest.mark.parametrize("how", REAL)
def test_each_encounter_is_seen_as_itself_alone(how: Encounter) -> None:
    # Who stops just short also waits there; who waits first also goes round it.
    also = {("stops_short", "waits_behind"), ("waits_then_passes", "goes_round")}
    for other, user in REAL.items():
        assert bool(faults(user, how)) == (other != how and (other, how) not in also), (other, how)


@pytest.mark.parametrize("how", REAL)
def test_mirrored_turned_and_resampled_copies_are_seen_alike(how: Encounter) -> None:
    user = REAL[how]
    assert not faults(mirrored(user), how, VAN.model_copy(update={"y": 1.75}))
    x, y = np.array((np.cos(1.1), np.sin(1.1))) * 0 + (-np.sin(1.1) * -1.75, np.cos(1.1) * -1.75)
    turned = VAN.model_copy(update={"x": float(x), "y": float(y), "heading": 1.1})
    assert not faults(moved(user, turn=1.1), how, turned)
    if how != "hits":  # who ends at a contact does so within a sample of it
        assert not faults(resampled(user, 0.05), how)


@pytest.mark.parametrize(
    ("user", "how", "words"),
    [
        (passing(0.0), "goes_round", "touches it"),
        (moved(passing(0.0), shift=(0.0, 3.0)), "goes_round", "never drives straight at it"),
        (waiting(gap=9.0), "waits_behind", "stands 9.0 m from it"),
        (waiting(stays=1.0), "waits_behind", "at least 2 s"),
        (moved(waiting(), shift=(0.0, 3.5)), "waits_behind", "not ahead of it"),
        (striking(stops_after=1.0), "hits", "goes on for"),
        (moved(striking(), shift=(-1.0, 0.0)), "hits", "never touches it"),
        (stopping(braking=3.0), "stops_short", "does not brake hard"),
        (stopping(gap=3.0), "stops_short", "just short"),
        (pulling_out(waits=0.2), "waits_then_passes", "at least 1 s"),
        (line(1, (-5.0, -1.75), EAST, distance(0.5, (0, 0.2))), "hits", "from the beginning"),
    ],
)
def test_what_only_looks_like_an_encounter_is_refused(
    user: RoadUser, how: Encounter, words: str
) -> None:
    assert words in faults(user, how)[0]


def test_an_object_elsewhere_proves_nothing() -> None:
    for how, user in REAL.items():
        for shift in ({"y": 6.0}, {"x": 300.0}):
            assert faults(user, how, VAN.model_copy(update=shift))


def test_clearance_beside_an_object_is_that_of_the_outlines() -> None:
    user = passing()
    made = scene([user]).model_copy(
        update={
            "objects": (VAN,),
            "encounters": (EncounterRecord(agent=1, object="object-1", how="goes_round"),),
        }
    )
    figures, _ = check_encounters(made, observe([user]))
    van = shapely.box(-2.7, -2.75, 2.7, -0.75)
    track = build_trajectory(user)
    car = shapely.box(-track.length / 2, -track.width / 2, track.length / 2, track.width / 2)
    slow = min(
        shapely.affinity.translate(
            shapely.affinity.rotate(car, heading, (0, 0), use_radians=True), *xy
        ).distance(van)
        for xy, heading in zip(track.xy, track.heading, strict=True)
    )
    assert figures[0]["clearance"] == pytest.approx(slow, abs=2e-3)


@pytest.mark.parametrize(
    ("how", "met", "missed"),
    [("hits", (7.5, 8.5), (6.0, 7.0)), ("waits_behind", (1.8, 2.2), (2.5, 3.1))],
)
def test_a_figure_asked_for_is_measured(
    how: Encounter, met: tuple[float, float], missed: tuple[float, float]
) -> None:
    made = scene([REAL[how]], duration=24.0)
    for figure, fits in ((met, True), (missed, False)):
        asked = EncounterRecord(agent=1, object="object-1", how=how, figure=figure)
        own = made.model_copy(update={"objects": (VAN,), "encounters": (asked,)})
        assert bool(check_encounters(own, observe([REAL[how]]))[1]) != fits


def test_who_queues_stands_behind_another_who_waits() -> None:
    first, second = waiting(), waiting(gap=2.0 + 4.6 + 1.5)
    second = RoadUser(**{**second.__dict__, "id": 2})
    asked = (
        EncounterRecord(agent=1, object="object-1", how="waits_behind"),
        EncounterRecord(agent=2, object="object-1", how="queues"),
    )
    made = scene([first, second], duration=24.0)
    made = made.model_copy(update={"objects": (VAN,), "encounters": asked})
    figures, findings = check_encounters(made, observe([first, second]))
    assert not findings
    assert figures[1]["gap"] == pytest.approx(1.5, abs=0.02)
    alone = made.model_copy(update={"encounters": asked[1:]})
    assert "no agent stands" in check_encounters(alone, observe([first, second]))[1][0].detail


PARKED = ObjectRecord(
    id="object-1", kind="parked", subtype="car", height="high",
    length=4.6, width=1.85, x=0.0, y=-2.0, heading=0.0,
)  # fmt: skip


@pytest.mark.parametrize(
    ("since", "y", "fault"),
    [
        (3.5, -0.6, None),
        (None, -0.6, "from the beginning"),
        (1.0, -0.6, "before"),
        (3.5, 1.0, "never touches"),
        (4.2, -0.6, "never touches"),
    ],
)
def test_a_door_opens_too_late_for_who_rides_into_it(
    since: float | None, y: float, fault: str | None
) -> None:
    """Eastward at 6 m/s: the front is at the door, 0.4 m ahead of the middle, after 4 s."""
    rider = line(
        1,
        (0.4 - 0.06 - 0.9 - 24.0, y),
        EAST,
        distance(6.0, (0, 4.1)),
        shape=get_rider_shape("cyclist"),
    )
    door = ObjectRecord(
        id="object-1-door", kind="door", height="low", length=0.95, width=0.12,
        x=0.4, y=-2.0 + 0.925 + 0.02 + 0.475, heading=np.pi / 2, since=since,
    )  # fmt: skip
    asked = EncounterRecord(agent=1, object="object-1", how="doored")
    made = scene([rider], duration=6.0).model_copy(
        update={"objects": (PARKED, door), "encounters": (asked,)}
    )
    measured, findings = check_encounters(made, observe([rider]))
    if fault is None:
        assert not findings
        assert measured[0]["speed"] == pytest.approx(6.0, abs=0.05)
        assert measured[0]["opened"] == pytest.approx(0.5, abs=0.05)
    else:
        assert fault in findings[0].detail
