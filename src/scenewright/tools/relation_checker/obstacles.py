"""What agents do about objects in their way, on the final tracks: go round, wait behind, hit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.events import Finding
from scenewright.scene.kinds import get_kind, has_trait, load_function
from scenewright.scene.objects import EncounterRecord, ObjectRecord, name_door
from scenewright.scene.record import SceneRecord
from scenewright.scene.social import get_figure
from scenewright.tools.relation_checker.certificate import WRECK_ENDS_WITHIN, check_wreck_clearance
from scenewright.tools.relation_checker.events import SceneObservation
from scenewright.tools.relation_checker.footprints import BoolArray
from scenewright.tools.relation_checker.objects import find_contact, measure_gaps
from scenewright.tools.relation_checker.trajectory import Trajectory
from scenewright.tools.relation_checker.yielding import STANDING

IN_LINE = 0.1
"""Largest angle of a heading straight at an object [rad]; with more the agent is swerving."""
HEADS_FOR = 5
"""Samples for which it does at least, one after the other (0.5 s)."""
AHEAD = 40.0
"""How far ahead an object is in the way of a vehicle heading straight at it [m]."""
MOVES = 2.0
"""Least speed of a vehicle heading for an object [m/s]."""
WAITS = 2.0
"""Least standstill of a vehicle waiting behind an object [s]."""
WAITING_GAP = (0.3, 6.0)
"""How far behind it [m]."""
STRIKES = 1.0
"""Least speed of a collision with an object [m/s]."""
MOVED_OVER = 0.3
"""Least lateral distance when passing an object [m]."""

SHORT = (0.0, 2.0)
"""How far from an object who stops short of it stands [m]."""
BRAKES_HARD, NEAR_TTC = 3.4, 1.5
"""Braking [m/s^2] and time to contact [s] of a near miss with what stands (SEMANTICS 4)."""
PULLS_OUT_GAP = (0.3, 12.0)
"""How far behind an object who waits and then goes round it stands [m]."""
OPENS = (0.2, 1.5)
"""How long before the contact the door of a dooring opens [s]."""

Measured = dict[str, Any]


def check_encounters(
    scene: SceneRecord, observed: SceneObservation
) -> tuple[list[Measured], tuple[Finding, ...]]:
    """What was measured of every encounter asked for, and what is not as asked."""
    tracks = observed.by_id
    objects = {each.id: each for each in scene.objects}
    figures: list[Measured] = []
    findings: list[Finding] = []
    for each in scene.encounters:
        track, until = tracks[each.agent], scene.meta.duration
        kind = get_kind("encounter", each.how)
        things = [objects[each.object]]
        if has_trait("encounter", each.how, "door"):
            things = [o for o in scene.objects if o.id == name_door(each.object)]
        if has_trait("encounter", each.how, "behind_agent"):
            others = [o for o in scene.encounters if o.object == each.object and o != each]
            standing = [tracks[o.agent] for o in others if has_trait("encounter", o.how, "stands")]
            # Where their tracks end, as something that stands.
            things = [
                ObjectRecord(
                    id=f"agent {other.id}", kind="stalled", height="high", length=other.length,
                    width=other.width, x=float(other.xy[-1, 0]), y=float(other.xy[-1, 1]),
                    heading=float(other.heading[-1]),
                )
                for other in standing
            ]  # fmt: skip
        # The first that was measured, else the last fault.
        found: Measured | str = "no agent stands, or no door opens, that it could meet"
        for thing in things:
            found = load_function(str(kind.observe), __package__)(track, thing, until)
            if not isinstance(found, str):
                found = _find_figure_fault(each, found) or found
                break
        if isinstance(found, str):
            detail = f"agent {each.agent} {kind.shown} {each.object}: {found}"
            rule = "encounter_not_realised"
            findings.append(Finding(rule=rule, agents=(each.agent,), detail=detail))
            continue
        figures.append({"agent": each.agent, "object": each.object, "how": each.how, **found})
        if has_trait("encounter", each.how, "ends"):
            findings += check_wreck_clearance(track, observed.grid, {track.id}, scene.meta.duration)
    return figures, tuple(findings)


def _find_figure_fault(each: EncounterRecord, found: Measured) -> str | None:
    """Why the figure asked for is not met, in words; None if it is, or none is asked for."""
    if each.figure is None:
        return None
    own, (low, high) = get_figure(each.how), each.figure
    if low - 1e-6 <= found[own.name] <= high + 1e-6:
        return None
    measured = f"{own.name} {found[own.name]:.2f} {own.unit}"
    return f"{measured}; asked for {low:g} to {high:g} {own.unit}"


def list_asked_hits(scene: SceneRecord) -> frozenset[tuple[int, str]]:
    """Agents and the objects that they are to hit."""
    return frozenset(
        (e.agent, name_door(e.object) if has_trait("encounter", e.how, "door") else e.object)
        for e in scene.encounters
        if has_trait("encounter", e.how, "ends")
    )


def measure_passing(
    track: Trajectory, thing: ObjectRecord, _: float, *, least: float = MOVES
) -> Measured | str:
    """It drives straight at the object, then moves over and passes beside it untouched.

    Args:
        least: least speed at which it drives at it [m/s].
    """
    along, aside = _locate(track, thing)
    half = (track.length + thing.length) / 2
    beside = np.flatnonzero((np.abs(along) < half) & (np.abs(aside) < 6.0))
    if not len(beside) or along[0] > -half or along[-1] < half:
        return "it does not come from behind it and drive on ahead of it"
    heading = _heads_for(track, thing, moving=least > 0.0)[: beside[0]]
    lasting = np.convolve(heading, np.ones(HEADS_FOR))[HEADS_FOR - 1 :] > HEADS_FOR - 0.5
    if not lasting.any():
        return "it never drives straight at it, so it is not in its way"
    heads = int(np.flatnonzero(lasting)[-1]) + HEADS_FOR - 1
    gaps = measure_gaps(track.xy, track.heading, track.box, thing)
    k = int(gaps.argmin())
    moved = float(np.abs(aside[beside] - aside[heads]).max())
    if gaps[k] <= 0.0:
        return f"it touches it at {track.times[k]:.1f} s"
    if moved < MOVED_OVER:
        return f"it moves over by {moved:.2f} m only; at least {MOVED_OVER:g} m"
    return {
        "time": round(float(track.times[k]), 3), "clearance": round(float(gaps[k]), 3),
        "moved_over": round(moved, 3),
    }  # fmt: skip


def measure_late_passing(track: Trajectory, thing: ObjectRecord, _: float) -> Measured | str:
    """It stands behind the object, heading for it, and then passes beside it untouched."""
    passing = measure_passing(track, thing, 0.0, least=0.0)
    if isinstance(passing, str):
        return passing
    gaps = measure_gaps(track.xy, track.heading, track.box, thing)
    ahead = _heads_for(track, thing, moving=False)
    low, high = PULLS_OUT_GAP
    stands = (track.speed <= STANDING) & ahead & (gaps >= low) & (gaps <= high)
    stands &= track.times < passing["time"]
    waits = 0.1 * int(stands.sum())
    if waits < 1.0:
        return f"it stands behind it for {waits:.1f} s; at least 1 s"
    if float(track.speed[: int(stands.argmax()) + 1].max()) < MOVES:
        return "it has not been driving"
    return {**passing, "waits": round(waits, 3)}


def measure_short_stop(track: Trajectory, thing: ObjectRecord, until: float) -> Measured | str:
    """It comes at the object, brakes hard when a contact is near, and stands just short of it."""
    waiting = measure_waiting(track, thing, until)
    if isinstance(waiting, str):
        return waiting
    if not SHORT[0] < waiting["gap"] <= SHORT[1]:
        return f"it stands {waiting['gap']:.1f} m from it; less than {SHORT[1]:g} m is just short"
    hard = (track.acceleration <= -BRAKES_HARD) & _heads_for(track, thing)
    close = measure_gaps(track.xy, track.heading, track.box, thing)[hard] / track.speed[hard]
    if not len(close) or close.min() > NEAR_TTC:
        return "it does not brake hard for it at the last moment"
    return {**waiting, "path_ttc": round(float(close.min()), 3),
            "braking": round(float(-track.acceleration.min()), 3)}  # fmt: skip


def measure_waiting(track: Trajectory, thing: ObjectRecord, until: float) -> Measured | str:
    """It drives up to the object and stands behind it, heading for it, until the scene ends."""
    standing = track.speed <= STANDING
    moving = np.flatnonzero(~standing)
    if not len(moving) or not standing[-1]:
        return "it does not come to stand behind it and stay there"
    first = int(moving[-1]) + 1
    lasts = float(track.times[-1] - track.times[first])
    gap = float(measure_gaps(track.xy, track.heading, track.box, thing)[first])
    if lasts < WAITS or track.end < until - 0.2:
        return f"it stands for {lasts:.1f} s at the end; at least {WAITS:g} s"
    if not _heads_for(track, thing, moving=False)[first]:
        return "what it stands behind is not that, as it is not ahead of it"
    if not WAITING_GAP[0] <= gap <= WAITING_GAP[1]:
        return f"it stands {gap:.1f} m from it"
    if float(track.speed[: first + 1].max()) < MOVES:
        return "it has not been driving"
    return {"time": round(float(track.times[first]), 3), "gap": round(gap, 3)}


def measure_hit(track: Trajectory, thing: ObjectRecord, _: float) -> Measured | str:
    """It drives into the object, and ends there."""
    time = find_contact(thing, track)
    if time is None:
        return "it never touches it"
    if time <= track.start + 1e-6:
        return "it touches it from the beginning"
    before = int(np.searchsorted(track.times, time - 1e-6, side="right")) - 1
    speed = float(track.speed[max(before - 1, 0) : before + 1].max())
    if speed < STRIKES:
        return f"it touches it at {speed:.1f} m/s; at least {STRIKES:g} m/s"
    if track.end > time + WRECK_ENDS_WITHIN + 1e-6:
        return f"it goes on for {track.end - time:.1f} s; at most {WRECK_ENDS_WITHIN} s"
    return {"time": round(time, 3), "speed": round(speed, 3)}


def measure_dooring(track: Trajectory, thing: ObjectRecord, until: float) -> Measured | str:
    """A door opens beside its way, clear of it, and it rides into that at once."""
    hit = measure_hit(track, thing, until)
    if isinstance(hit, str):
        return hit
    if thing.since is None:
        return "the door stands open from the beginning"
    opened = hit["time"] - thing.since
    if not OPENS[0] <= opened <= OPENS[1]:
        return f"the door opens {opened:.1f} s before; {OPENS[0]:g} to {OPENS[1]:g} s are too late"
    return {**hit, "opened": round(opened, 3)}


def _locate(track: Trajectory, thing: ObjectRecord) -> tuple[FloatArray, FloatArray]:
    """[N] how far ahead of the middle of the object, and to its left, the track is [m]."""
    cos, sin = math.cos(thing.heading), math.sin(thing.heading)
    x, y = (track.xy - (thing.x, thing.y)).T
    return np.asarray(cos * x + sin * y), np.asarray(cos * y - sin * x)


def _heads_for(track: Trajectory, thing: ObjectRecord, *, moving: bool = True) -> BoolArray:
    """[N] whether the way straight ahead, as wide as the agent, meets the object."""
    cos, sin = np.cos(track.heading), np.sin(track.heading)
    away = (thing.x, thing.y) - track.xy
    ahead = cos * away[:, 0] + sin * away[:, 1]
    aside = cos * away[:, 1] - sin * away[:, 0]
    turn = thing.heading - track.heading
    # Half of the width of the object as seen along the way.
    half = (thing.length * np.abs(np.sin(turn)) + thing.width * np.abs(np.cos(turn))) / 2
    meets = (ahead > 0.0) & (ahead <= AHEAD) & (np.abs(aside) < half + track.width / 2)
    meets &= np.abs(np.sin(turn)) <= IN_LINE
    return np.asarray(meets & (track.speed >= MOVES) if moving else meets)
