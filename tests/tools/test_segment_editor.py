"""Keep, Stop, Proceed and Terminate (paper Eq. 6), and the summary that they are reasoned from."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from scenewright.geometry.driving_profile import (
    StopCommand,
    compute_arrival,
    compute_motion,
    sample_track,
)
from scenewright.geometry.map_areas import MapAreas
from scenewright.intersections import load_map
from scenewright.scene.behavior import Segment
from scenewright.scene.selection import PlannedEvent, Push, SelectedAgent, Selection, Slowing, Stop
from scenewright.scene.track import STEP
from scenewright.tools.event_summary import summarise
from scenewright.tools.segment_editor import compute_edited_motion, end_motion, push_motion
from solver_agents import (
    EAST,
    SOUTH,
    WALK_NORTH,
    WESTBOUND,
    bend,
    candidate,
    law,
    straight,
    walker,
)

ROAD = candidate(straight((0.0, 0.0), EAST, 200.0))
BEND = candidate(bend(80.0, 15.0, 60.0), time_law=law(9.0))
GROUND = MapAreas(load_map("amsterdam_120"))
DURATION = 30.0
SMOOTHED = 0.4

TENTHS = st.integers(-150, 80).map(lambda n: round(n * STEP, 1))


def selected(of, *, enters=0.0, name="vehicle-1", **more) -> SelectedAgent:
    return SelectedAgent(name, "foreground", of, 0, enters, **more)


def segment(start, end, anchor, status) -> Segment:
    return Segment(start=max(start, 0.0), end=max(end, 0.0), anchor=anchor, status=status)


def edit(agent, segments, anchors, *, duration):
    """The track of an agent edited by its segments; None if nothing of it falls into the scene."""
    motion = compute_edited_motion(agent, segments, anchors, duration=duration)
    return sample_track(motion, enters=agent.enters, until=duration)


def edited(agent, *segments, **anchors):
    return edit(
        agent, segments, {"goal": agent.candidate.path.length, **anchors}, duration=DURATION
    )


def along(track, of):
    """Arc length of every sample, and how far off the path it is."""
    gaps = np.hypot(*(track.xy[:, None] - of.path.xy[None]).transpose(2, 0, 1))
    return of.path.s[gaps.argmin(axis=1)], gaps.min(axis=1)


@given(st.sampled_from([ROAD, BEND]), TENTHS)
def test_keep_is_the_prior(of, enters):
    track = edited(selected(of, enters=enters), segment(enters, DURATION, "goal", "keep"))
    prior = sample_track(compute_motion(of), enters=enters, until=DURATION)
    assert (track.xy == prior.xy).all()
    assert (track.heading == prior.heading).all()
    assert (track.start, track.step) == (prior.start, STEP)


@st.composite
def stops(draw):
    """A stop on either path: where, since when at the earliest, for how long."""
    of = draw(st.sampled_from([ROAD, BEND]))
    enters = draw(TENTHS)
    s = draw(st.floats(30.0, 120.0))
    start = enters + compute_arrival(of, StopCommand(s, 0.0))
    until = start + draw(st.floats(1.5, 10.0))
    assume(0.0 < until < DURATION - STEP)
    return of, enters, s, start, until


def stopped(case):
    of, enters, s, start, until = case
    planned = Stop("yield_point", s, start, until, "gives_way")
    agent = selected(of, enters=enters, stops=(planned,))
    return edited(
        agent,
        segment(enters, start, "here", "keep"),
        segment(start, until, "here", "stop"),
        segment(until, DURATION, "goal", "proceed"),
        here=s,
    )


@given(stops())
def test_stop_never_moves_while_it_stands(case):
    of, _, s, start, until = case
    track = stopped(case)
    standing = (track.times > start + SMOOTHED + STEP) & (track.times < until - SMOOTHED - STEP)
    spot = [np.interp(s, of.path.s, of.path.xy[:, axis]) for axis in (0, 1)]
    assert track.xy[standing] == pytest.approx(np.tile(spot, (standing.sum(), 1)), abs=6e-4)
    assert np.ptp(track.heading[standing]) < 1e-9 if standing.any() else True


@given(stops())
def test_proceed_resumes_the_deferred_remainder(case):
    """Back at the prior's speed, it goes where the prior went, later by one constant delay."""
    of, enters, s, start, until = case
    prior = compute_motion(of)
    agent = selected(of, enters=enters, stops=(Stop("p", s, start, until, "gives_way"),))
    hold = StopCommand(s, until - enters)
    motion = compute_motion(of, holds=(hold,))
    resumed = of.path.length - 40.0
    delays = [
        motion.find_time_at(x) - prior.find_time_at(x)
        for x in np.linspace(resumed, resumed + 35, 9)
    ]
    if s + 30.0 < resumed:
        assert np.ptp(delays) < 0.02
        assert delays[0] > until - start
    track = stopped(case)
    expected = sample_track(motion, enters=agent.enters, until=DURATION)
    assert (track.xy == expected.xy).all()


@given(stops())
def test_before_the_braking_nothing_changes(case):
    of, enters, s, _, _ = case
    track = stopped(case)
    prior = sample_track(compute_motion(of), enters=enters, until=DURATION)
    braking = s - of.time_law.speed**2 / (2 * of.time_law.braking)
    early = along(prior, of)[0] < braking - 0.5 * of.time_law.speed - 1.0
    assert (track.xy[: early.sum()] == prior.xy[early]).all()


@given(stops())
def test_an_edited_track_is_continuous_and_has_one_time_step(case):
    of = case[0]
    track = stopped(case)
    assert track.step == STEP
    assert track.start >= 0.0
    assert track.end <= DURATION + 1e-9
    assert np.round(track.start / STEP) == pytest.approx(track.start / STEP)
    steps = np.hypot(*np.diff(track.xy, axis=0).T)
    assert steps.max() <= of.time_law.speed * STEP + 0.01
    assert along(track, of)[1].max() <= 0.26
    assert (np.diff(along(track, of)[0]) >= 0).all()


@given(st.sampled_from([ROAD, BEND]), TENTHS, st.floats(1.0, 14.0))
def test_terminate_ends_within_a_tenth_of_a_second(of, enters, after):
    contact = max(enters, 0.0) + after
    agent = selected(of, enters=enters, contact=contact)
    track = edited(
        agent,
        segment(enters, contact, "contact", "keep"),
        segment(contact, contact, "contact", "terminate"),
    )
    prior = sample_track(compute_motion(of), enters=enters, until=DURATION)
    if contact > prior.end:
        return
    assert contact - 1e-6 <= track.end <= contact + STEP
    assert (track.xy == prior.xy[: len(track.xy)]).all()


def test_who_stands_when_the_scene_ends_has_not_begun_to_start():
    agent = selected(ROAD)
    track = edited(
        agent,
        segment(0.0, 12.0, "here", "keep"),
        segment(12.0, DURATION, "here", "stop"),
        here=100.0,
    )
    assert track.xy[track.times > 12.5] == pytest.approx(np.tile([100.0, 0.0], (175, 1)))


def test_who_leaves_before_the_scene_begins_has_no_track():
    assert edited(selected(ROAD, enters=-40.0), segment(0.0, 1.0, "goal", "keep")) is None


def test_slowings_of_the_selection_are_kept():
    agent = selected(ROAD, slowings=(Slowing(100.0, 4.0, 3.0),))
    track = edited(agent, segment(0.0, DURATION, "goal", "keep"))
    assert np.hypot(*np.diff(track.xy, axis=0).T).min() / STEP == pytest.approx(4.4, abs=0.1)


def test_terminated_is_cut_at_the_first_sample_not_before():
    motion = compute_motion(ROAD)
    assert len(end_motion(motion, 3.0).s) == 31
    assert len(end_motion(motion, 3.01).s) == 32


SOUTHWARDS = candidate(straight((-4.95, 49.5), SOUTH, 99.0))
ACROSS = walker(straight((-14.0, 8.6), EAST, 28.0), route=WALK_NORTH)


def summary_of(*agents, duration=20.0, events=()):
    selection = Selection(
        agents={each.name: each for each in agents},
        events=events,
        duration=duration,
        signal_offset=None,
        nll=0.0,
        cost=0.0,
        optimal=True,
    )
    return summarise(selection, map_areas=GROUND)


def test_anchors_lie_in_order_and_are_timed_by_the_prior():
    [summary] = summary_of(selected(SOUTHWARDS, enters=1.0)).agents
    assert [anchor.id for anchor in summary.anchors] == [
        "north:stop",
        "north:crosswalk:entry",
        "north:crosswalk:exit",
        "south:crosswalk:entry",
        "south:crosswalk:exit",
        "goal",
    ]
    arc = [anchor.s for anchor in summary.anchors]
    assert arc == sorted(arc)
    assert arc[0] == pytest.approx(49.5 - 11.8 - 2.3, abs=1e-3)
    for anchor in summary.anchors:
        assert anchor.time == pytest.approx(1.0 + anchor.s / 10.0, abs=0.01)
    assert (summary.enters, summary.leaves, summary.contact) == (1.0, 10.9, None)


@given(TENTHS, st.floats(5.0, 60.0), st.floats(1.0, 8.0), st.sampled_from([SOUTHWARDS, ACROSS]))
def test_anchors_are_always_in_order_and_name_every_stay(enters, s, stays, of):
    s = min(s, of.path.length - 5.0)
    start = enters + compute_arrival(of, StopCommand(s, 0.0))
    stop = Stop("yield_point", s, start, start + stays, "gives_way")
    [summary] = summary_of(selected(of, enters=enters, stops=(stop,))).agents
    arc = [anchor.s for anchor in summary.anchors]
    names = [anchor.id for anchor in summary.anchors]
    assert arc == sorted(arc)
    assert len(set(names)) == len(names)
    [stay] = summary.stays
    assert dict(zip(names, arc, strict=True))[stay.anchor] == pytest.approx(s, abs=1e-3)
    assert (stay.start, stay.until) == pytest.approx((start, start + stays), abs=1e-3)
    assert all(anchor.time is None or 0 <= anchor.time <= 20.0 for anchor in summary.anchors)


def test_stop_lines_and_kerbs_carry_the_maps_names():
    stop = Stop("stop_line", 34.8, 6.0, 9.0, "red_light")
    kerb = Stop("kerb", 4.3, 3.0, 9.0, "gives_way")
    summary = summary_of(
        selected(SOUTHWARDS, stops=(stop,)),
        selected(ACROSS, name="pedestrian-1", stops=(kerb,)),
    )
    car, person = summary.agents
    assert car.stays[0].anchor == "north:stop"
    assert [anchor.id for anchor in car.anchors].count("north:stop") == 1
    assert person.stays[0].anchor == "north:kerb:west"


def test_a_contact_ends_the_way_and_events_are_evidence():
    event = PlannedEvent(
        "contact(vehicle-1, vehicle-2)", ("vehicle-1", "vehicle-2"), 5.0, (1.0, 2.0)
    )
    summary = summary_of(
        selected(SOUTHWARDS, contact=5.0),
        selected(candidate(straight((49.5, 1.75), np.pi, 99.0), route=WESTBOUND), name="vehicle-2"),
        events=(event,),
    )
    assert summary.agents[0].leaves == 5.0
    assert summary.agents[1].leaves == pytest.approx(9.9)
    assert summary.evidence[0]["clause"] == event.clause


def test_who_started_before_the_scene_comes_from_its_stop_and_shows_none():
    stop = Stop("stop_line", 60.0, -8.0, -1.0, "red_light")
    agent = selected(ROAD, enters=-15.0, stops=(stop,))
    selection = Selection({agent.name: agent}, (), DURATION, None, 0.0, 0.0, optimal=False)
    [summary] = summarise(selection, map_areas=GROUND).agents
    segments = summary.suggest_segments(DURATION)
    assert [each.status for each in segments] == ["keep"]
    places = {anchor.id: anchor.s for anchor in summary.anchors}
    track = edit(agent, segments, places, duration=DURATION)
    # A second after its start it has come 1 m or so, not the 150 m of who never stood.
    assert 60.0 < along(track, ROAD)[0][0] < 63.0


def test_who_rolls_keeps_and_proceeds_without_a_stop():
    stop = Stop("yield_point", 80.0, 9.0, 9.0, "gives_way", None, 5.0, 2.0)
    agent = selected(ROAD, stops=(stop,))
    selection = Selection({agent.name: agent}, (), DURATION, None, 0.0, 0.0, optimal=False)
    [summary] = summarise(selection, map_areas=GROUND).agents
    segments = summary.suggest_segments(DURATION)
    assert [each.status for each in segments] == ["keep", "proceed"]
    places = {anchor.id: anchor.s for anchor in summary.anchors}
    asked_to_stop = (*segments[:1], segment(9.0, 12.0, "yield_point@80.0", "stop"), *segments[1:])
    for told in (segments, asked_to_stop):
        speed = np.gradient(along(edit(agent, told, places, duration=DURATION), ROAD)[0], STEP)
        assert 1.0 < speed[20:150].min() < 3.5


def test_a_push_moves_who_stands_until_it_stands_again():
    stop = StopCommand(20.0, 30.0)
    motion = push_motion(compute_motion(ROAD, holds=(stop,)), Push(15.04, 6.0, 5.0))
    times = np.array([15.0, 15.1, 15.5, 17.0])
    moved = [0.0, 6.0 * 0.06 - 2.5 * 0.06**2, 6.0 * 0.46 - 2.5 * 0.46**2, 3.6]
    assert motion.compute_positions(times) == pytest.approx(20.0 + np.array(moved), abs=1e-6)
