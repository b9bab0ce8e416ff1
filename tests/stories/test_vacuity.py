"""Every relation file, played: its event is there for its own words, whichever way the scene is
turned, and gone once one of the two comes a minute later."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from scenewright import synthesize
from scenewright.graph.run import Scene
from scenewright.intersections import load_map
from scenewright.scene.record import AgentRecord, SceneRecord
from scenewright.scene.relations import Pattern, Role, get_pattern, load_patterns
from scenewright.scene.track import Track
from scenewright.tools.relation_checker import RoadUser, check, find_events, read_users

CHOSEN = frozenset(
    {
        "rider_right_hook_near_miss", "vehicle_yields_to_crosswalk_rider", "rider_close_overtaking",
        "pedestrians_collide_at_corner", "pedestrians_near_miss_on_crosswalk",
    }
)  # fmt: skip
"""Of the patterns with riders or two on foot one of each kind: these are enough for what they
share."""
NAMES = [
    pattern.id
    for pattern in load_patterns()
    # A push takes three: test_chains.py.
    if (pattern.is_of_paper and pattern.manoeuvre != "pushed") or pattern.id in CHOSEN
]
MAP = load_map("amsterdam_120")
MINUTE = 60.0

every_pattern = pytest.mark.parametrize("name", NAMES)


@cache
def played(name: str) -> Scene:
    """A scene of the pattern with nobody else in it, asked for in the file's first phrase."""
    return synthesize(f"{said(get_pattern(name))}. Nobody else is around.", seed=3)


def said(pattern: Pattern) -> str:
    """The first phrase, told of a car and of a truck or a pedestrian."""
    names = {"{from}": agent(pattern.from_, "car"), "{to}": agent(pattern.to, "truck")}
    text = pattern.phrases[0]
    for role, words in names.items():
        text = text.replace(role, words)
    return text[0].upper() + text[1:]


def agent(role: Role, vehicle: str) -> str:
    return {"pedestrian": "a pedestrian", "rider": "a cyclist"}.get(role.type, f"a {vehicle}")


Seen = tuple[str, str | None, tuple[int, ...], float]


def events(users: list[RoadUser]) -> list[Seen]:
    """Type, kind, agents (in order where that matters) and time of what happens but follows."""
    return [
        (each.type, each.kind, (each.from_, each.to), each.time)
        for each in find_events(users)
        if each.type != "follow"
    ]


def follows(users: list[RoadUser]) -> set[tuple[int, int]]:
    return {(each.from_, each.to) for each in find_events(users) if each.type == "follow"}


def changed(
    user: RoadUser, edit: Callable[[Track], Track] = lambda track: track, *, later: float = 0.0
) -> RoadUser:
    track = edit(user.track)
    delayed = Track(track.xy, track.heading, track.start + later, track.step)
    return RoadUser(user.id, delayed, user.shape)


def turned(track: Track) -> Track:
    c, s = np.cos(1.1), np.sin(1.1)
    xy = track.xy @ np.array(((c, s), (-s, c)))
    return Track(xy, track.heading + 1.1, track.start, track.step)


def shifted(track: Track) -> Track:
    return Track(track.xy + np.array((313.7, -1200.3)), track.heading, track.start, track.step)


def mirrored(track: Track) -> Track:
    return Track(track.xy * np.array((1.0, -1.0)), -track.heading, track.start, track.step)


def sampled(step: float) -> Callable[[Track], Track]:
    """The same motion, read at another time step.

    A collision lies at the end, so that is kept. Nobody gives way to who is not there yet, so the
    beginning is, too: less than a step is added before it, as fast as it begins.
    """

    def edit(track: Track) -> Track:
        times = np.arange(track.end, track.start + 1e-9 - step, -step)[::-1]
        xy = np.stack([np.interp(times, track.times, column) for column in track.xy.T], axis=1)
        early = np.minimum(times - track.start, 0.0)[:, None]
        xy += early * (track.xy[1] - track.xy[0]) / track.step
        heading = np.interp(times, track.times, np.unwrap(track.heading))
        return Track(xy, heading, float(times[0]), step)

    return edit


@every_pattern
def test_its_phrase_brings_about_the_event_of_its_file(name: str) -> None:
    pattern, scene = get_pattern(name), played(name)
    assert scene.provenance["patterns"] == [name]
    assert scene.provenance["taxonomy"] == [f"{pattern.theme} / {pattern.subtype} / {name}"]
    (seen,) = scene.proof.events
    assert seen.type == pattern.proof.event
    assert pattern.kind in (None, seen.kind)
    agents = {each.id: each for each in scene.record.agents}
    first, second = agents[seen.from_], agents[seen.to]
    given = plays(first, pattern.from_) and plays(second, pattern.to)
    swapped = plays(second, pattern.from_) and plays(first, pattern.to)
    assert given or (swapped and seen.type in ("collision", "near_miss"))


def plays(agent: AgentRecord, role: Role) -> bool:
    return role.admits(agent.type) and agent.movement in role.movements


@every_pattern
@pytest.mark.parametrize("late", [0, 1], ids=["from", "to"])
def test_nothing_is_left_of_it_once_one_of_the_two_comes_a_minute_later(
    name: str, late: int
) -> None:
    scene = played(name)
    (relation,) = scene.record.relations
    who = (relation.from_, relation.to)[late]
    users = [
        changed(user, later=MINUTE if user.id == who else 0.0) for user in read_users(scene.record)
    ]
    assert find_events(users, intersection_map=MAP, signals=scene.record.signals) == ()
    proof = check(with_delay(scene.record, who), MAP)
    assert not proof.verified
    assert proof.missing[0].rule == "relation_not_realised"


def with_delay(record: SceneRecord, who: int) -> SceneRecord:
    agents = tuple(
        each.model_copy(update={"spawn_time": each.spawn_time + MINUTE}) if each.id == who else each
        for each in record.agents
    )
    meta = record.meta.model_copy(update={"duration": record.meta.duration + MINUTE})
    return record.model_copy(update={"agents": agents, "meta": meta})


@every_pattern
@pytest.mark.parametrize(
    "edit",
    [turned, shifted, sampled(0.05), sampled(0.2)],
    ids=["turned", "shifted", "finer", "coarser"],
)
def test_it_is_seen_alike_from_everywhere(name: str, edit: Callable[[Track], Track]) -> None:
    users = list(read_users(played(name).record))
    others = [changed(user, edit) for user in users]
    assert follows(others) == follows(users)
    for before, after in zip(events(users), events(others), strict=True):
        assert after[:3] == before[:3]
        assert after[3] == pytest.approx(before[3], abs=0.11)


# a rider is overtaken on the side away from the kerb, which in a mirror is the other one
@pytest.mark.parametrize("name", [each for each in NAMES if each != "rider_close_overtaking"])
def test_in_a_mirror_only_the_name_of_a_turn_changes(name: str) -> None:
    users = list(read_users(played(name).record))
    others = [changed(user, mirrored) for user in users]
    assert follows(others) == follows(users)
    for before, after in zip(events(users), events(others), strict=True):
        assert (after[0], set(after[2])) == (before[0], set(before[2]))
        assert after[3] == pytest.approx(before[3], abs=0.01)
        assert after[1] == before[1] or {after[1], before[1]} <= {"left_turn", "angle", "head_on"}
