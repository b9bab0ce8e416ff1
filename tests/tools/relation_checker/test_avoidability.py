"""What would have avoided an event: on paper, and against a re-simulation with shapely."""

import numpy as np
import pytest
import shapely

from checker_tracks import EAST, NORTH, SOUTH, along, bend, distance, line, moved, scene, walk
from scenewright.cli.scene_summary import describe_avoidability
from scenewright.scene.objects import ObjectRecord
from scenewright.scene.track import Track
from scenewright.tools.relation_checker import RoadUser, check, find_events
from scenewright.tools.relation_checker.reactions import Sights, find_avoidability
from scenewright.tools.relation_checker.trajectory import build_trajectories

STRAIGHT = distance(10.0, (0.0, 5.5))


def rows(*users: RoadUser, objects: tuple[ObjectRecord, ...] = ()):
    tracks = build_trajectories(list(users))
    return find_avoidability(find_events(users), Sights(objects, tracks))


def wall(x: float, y: float) -> ObjectRecord:
    """A container of 1 x 6 m."""
    return ObjectRecord(
        id="object-1", kind="container", height="high", length=6.0, width=1.0, x=x, y=y,
        heading=np.pi / 2,
    )  # fmt: skip


def test_who_is_to_pass_behind_brakes_as_worked_out_on_paper() -> None:
    # At 1.7 s both are 33 m off. The other's rear has left after 36.225 m, in 3.6225 s, up to when
    # 29.775 m are free: 2 (36.225 - 29.775) / 3.6225^2. After a second: 2.6225 s, 19.775 m.
    one, two = rows(line(1, (-50.0, 0.0), EAST, STRAIGHT), line(2, (0.0, -50.0), NORTH, STRAIGHT))

    assert (one["visible_from"], one["avoidable"]) == (pytest.approx(1.7, abs=0.051), True)
    assert one["needed_braking"] == pytest.approx(0.983, abs=0.01)
    assert one["after_reaction"] == pytest.approx(2 * (26.225 - 19.775) / 2.6225**2, abs=0.02)
    assert two == one | {"agent": 2, "other": 1}


def test_who_is_to_stop_behind_a_standing_car_brakes_with_v_squared_over_2_d() -> None:
    approach = line(1, (-50.0, 0.0), EAST, distance(10.0, (0.0, 5.0)))
    (front, behind) = rows(approach, line(2, (0.0, 0.0), EAST, np.zeros(90)))

    room = 50.0 - 4.6 - 10.0 * front["visible_from"]
    assert front["needed_braking"] == pytest.approx(100 / (2 * room), abs=0.01)
    assert front["after_reaction"] == pytest.approx(100 / (2 * (room - 10.0)), abs=0.01)
    assert not behind["avoidable"]
    assert behind["why_not"] == "comes from behind"


def test_who_sees_it_too_late_could_not_avoid_it() -> None:
    # The wall hides the walker from the driver until it is 1.1 m from the car's side.
    car = line(1, (-40.0, 0.0), EAST, distance(10.0, (0.0, 4.5)))
    walker = walk(2, (0.0, -7.0), NORTH, distance(1.4, (0.0, 4.5)))
    driver, on_foot = rows(car, walker, objects=(wall(-2.2, -4.6),))

    assert driver["visible_from"] > 2.5
    # 9.8 m are left at 2.9 s: at once that would take 5 m/s^2, but a second is 10 m.
    for row in (driver, on_foot):
        assert row["after_reaction"] is None
        assert (row["avoidable"], row["why_not"]) == (False, "no time")
    assert driver["needed_braking"] > 8.0
    assert on_foot["needed_braking"] < 3.0


def test_who_is_never_seen_leaves_no_braking() -> None:
    car = line(1, (-50.0, 0.0), EAST, distance(12.0, (0.0, 4.2)))
    other = line(2, (0.0, -50.0), NORTH, distance(12.0, (0.0, 4.2)))
    hidden = ObjectRecord(
        id="object-1", kind="container", height="high", length=60.0, width=0.2, x=-23.0, y=-23.0,
        heading=np.pi / 4,
    )  # fmt: skip

    for row in rows(car, other, objects=(hidden,)):
        assert row["visible_from"] is None
        assert row["needed_braking"] is None
        assert (row["avoidable"], row["why_not"]) == (False, "no line of sight")


def test_a_near_miss_is_avoided_by_a_pet_of_a_second_and_a_half() -> None:
    # Courses never conflict, so that the second one could see it in the 3 s before the event.
    users = [line(1, (-50.0, 0.0), EAST, distance(10.0, (0.0, 10.0))),
             line(2, (0.0, -60.0), NORTH, distance(10.0, (0.0, 10.0)))]  # fmt: skip
    (event,) = find_events(users)
    _, second = rows(*users)

    begin = second["visible_from"]
    assert begin == pytest.approx(event.time - 3.0, abs=0.1)
    # The first one's rear has left at 5.3225 s; 1.5 s later the second one's front may arrive.
    time, room = 5.3225 + 1.5 - begin, 60.0 - 10.0 * begin - 3.225
    assert second["needed_braking"] == pytest.approx(2 * (10 * time - room) / time**2, abs=0.02)


def test_proofs_have_it_and_the_summary_a_line_of_it() -> None:
    users = [line(1, (-50.0, 0.0), EAST, STRAIGHT), line(2, (0.0, -50.0), NORTH, STRAIGHT)]
    made = scene(users, ("collision", 1, 2))
    with_rules = made.model_copy(update={"meta": made.meta.model_copy(update={"rules": 2})})

    assert "avoidability" not in check(made).figures
    proof = check(with_rules)
    assert [row["agent"] for row in proof.figures["avoidability"]] == [1, 2]
    (event,) = proof.events
    assert describe_avoidability(event, proof.figures["avoidability"], {1: "a", 2: "b"}) == [
        "to avoid it: a braking at 1.0 m/s² from 1.7 s on (1.9 after 1 s), "
        "b braking at 1.0 m/s² from 1.7 s on (1.9 after 1 s)"
    ]


# Re-simulation


def outline(user: RoadUser, x: float, y: float, heading: float):
    if user.shape.type == "pedestrian":
        return shapely.Point(x, y).buffer(user.shape.width / 2, quad_segs=32)
    box = shapely.box(-user.shape.length / 2, -user.shape.width / 2,
                      user.shape.length / 2, user.shape.width / 2)  # fmt: skip
    turned = shapely.affinity.rotate(box, heading, origin=(0, 0), use_radians=True)
    return shapely.affinity.translate(turned, x, y)


def simulate(track: Track, until: float, go_on: float, times):
    """Outline poses of a track at times: as it was up to a moment, then straight on at a speed."""
    t = track.times
    poses = []
    for time in times:
        known = min(time, until, t[-1])
        x, y = (np.interp(known, t, track.xy[:, k]) for k in (0, 1))
        heading = np.interp(known, t, track.heading)
        beyond = max(time - known, 0.0) * go_on
        poses.append((x + beyond * np.cos(heading), y + beyond * np.sin(heading), heading))
    return poses


def touches(agent, other, *, event, begin, braking, delay, lag) -> bool:
    """Whether the braking agent ever touches the other, moved in time by up to the lag."""
    until = event.time if event.type == "collision" else np.inf
    t, step = agent.track.times, 0.05
    way = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(agent.track.xy, axis=0).T))))
    end = min(until, t[-1])
    k = round((begin - agent.track.start) / 0.1)
    speed = (way[k + 1] - way[k - 1]) / 0.2
    last_speed = np.hypot(*np.diff(other.track.xy, axis=0)[
        min(round((min(until, other.track.end) - other.track.start) / 0.1) - 1,
            len(other.track.xy) - 2)
    ]) / 0.1  # fmt: skip
    clock = np.arange(0.0, event.time + 6.0 - begin, step)
    shapes = [
        outline(other, *pose)
        for pose in simulate(other.track, until, last_speed, begin + np.arange(
            -lag, clock[-1] + lag + step, step))
    ]  # fmt: skip
    tree_lag = round(lag / step)
    for n, tau in enumerate(clock):
        braked = max(tau - delay, 0.0)
        braked = min(braked, speed / braking) if braking > 0 else braked
        s = way[k] + speed * (min(tau, delay) + braked) - braking * braked**2 / 2
        known = min(s, np.interp(end, t, way))
        time = np.interp(known, way + 1e-9 * np.arange(len(way)), t)
        x, y = (np.interp(time, t, agent.track.xy[:, i]) for i in (0, 1))
        heading = np.interp(time, t, agent.track.heading)
        own = outline(agent, x + (s - known) * np.cos(heading), y + (s - known) * np.sin(heading),
                      heading)  # fmt: skip
        near = shapes[n : n + 2 * tree_lag + 1]
        if any(own.intersects(each) for each in near):
            return True
    return False


def encounters(rng: np.random.Generator):
    """A crossing at any angle, one that turns, a walker, a leader that brakes."""
    turn, v, w = rng.uniform(0.6, 2.5), rng.uniform(6.0, 12.0), rng.uniform(5.0, 11.0)
    lag = rng.uniform(-1.2, 1.2)
    s, s2 = distance(v, (0.0, 9.0)), distance(w, (0.0, 9.0))
    car = line(1, (-4.0 * v, 0.0), EAST, s)
    start = -(4.0 + lag) * w * np.array((np.cos(turn), np.sin(turn)))
    yield car, line(2, tuple(start), turn, s2)
    left = bend((-25.0, 0.0), EAST, 20.0, 8.0, np.pi / 2, 40.0)
    slow = distance(6.0, (0.0, 9.0))
    yield along(1, left, slow), line(2, (7.0, 8.0 * (4.6 + lag)), SOUTH, distance(8.0, (0.0, 9.0)))
    yield car, walk(2, (0.0, -1.4 * (4.0 + lag)), NORTH, distance(1.4, (0.0, 9.0)))
    behind = line(2, (-4.0 * v - rng.uniform(9.0, 14.0), 0.0), EAST, s)
    brakes = distance(v, (0.0, 2.0), (-5.0, v / 5.0), (0.0, 5.0))
    yield line(1, (-4.0 * v, 0.0), EAST, brakes[:90]), behind


@pytest.mark.parametrize("seed", range(6))
def test_a_little_less_braking_ends_in_contact_and_more_never_does(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tried = 0
    for pair in encounters(rng):
        angle = rng.uniform(0.0, 6.0)
        users = [moved(user, turn=angle) for user in pair]
        for event in find_events(users):
            if event.type not in ("collision", "near_miss"):
                continue
            found = find_avoidability([event], Sights((), build_trajectories(users)))
            for row in found:
                agent, other = (next(u for u in users if u.id == row[key])
                                for key in ("agent", "other"))  # fmt: skip
                lag = 1.5 if event.evidence.get("pet", 9.0) <= 1.5 else 0.0
                common = {"event": event, "begin": row["visible_from"], "lag": lag}
                for key, delay in (("needed_braking", 0.0), ("after_reaction", 1.0)):
                    needed = row[key]
                    if row["visible_from"] is None:
                        continue
                    if needed is None:
                        assert touches(agent, other, braking=50.0, delay=delay, **common)
                        continue
                    tried += 1
                    # The oracle looks every 0.05 s, in which the other goes on by half a metre.
                    margin = 0.05 + 0.06 * needed
                    for more in (margin, 1.0, 4.0):
                        braking = needed + more
                        assert not touches(agent, other, braking=braking, delay=delay, **common)
                    # A harder stop is over between two looks of the oracle.
                    if margin < needed < 20.0:
                        braking = needed - margin
                        assert touches(agent, other, braking=braking, delay=delay, **common)
    assert tried >= 2
