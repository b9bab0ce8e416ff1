"""Filter implausible pieces out of recorded tracks, and count everything that was removed.

Trackers report false detections, lose agents, give two agents one name, need a while until their
filter has settled, and jitter. Pieces are discarded rather than repaired: a jump cuts a track, and
an implausible piece is dropped. The rest is smoothed lightly, because a derivative of jitter is no
acceleration.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from scenewright.geometry.kinematics import compute_kinematics, smooth
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.track import STEP, Track

FASTEST: Mapping[str, float] = {"vehicle": 20.0, "pedestrian": 3.0}
"""Highest speeds [m/s] (SEMANTICS section 5); a faster pedestrian rides something."""
JUMP_TOLERANCE = 2.0
"""Noise allowed in one step beyond the distance at a vehicle's highest speed [m]."""
MIN_DURATION = 2.0
"""Least duration of a piece that is kept [s]."""
MIN_EXTENT: Mapping[str, float] = {"vehicle": 3.0, "pedestrian": 1.0}
"""Least extent of a track along either axis [m]; others are false detections, or parked."""
SPEED_CHECK_SMOOTHING = 0.4
"""Smoothing under which speeds are judged, not the smoothing of what is kept [s]."""
COURSE_MIN_SPEED = 0.3
"""Speed below which the direction of motion is noise, so that the last one is held [m/s]."""


@dataclass(eq=False)
class CleaningReport:
    """What cleaning took away.

    Attributes:
        tracks: tracks seen; kept: pieces left of them.
        seconds: seen; seconds_kept: left.
        pieces: pieces taken away, by reason; cut: seconds cut off pieces that stayed, by reason.
    """

    tracks: int = 0
    kept: int = 0
    seconds: float = 0.0
    seconds_kept: float = 0.0
    pieces: Counter[str] = field(default_factory=Counter)
    cut: dict[str, float] = field(default_factory=dict)

    def add_cut(self, reason: str, seconds: float) -> None:
        """Counts seconds cut off."""
        self.cut[reason] = self.cut.get(reason, 0.0) + seconds

    def __add__(self, other: CleaningReport) -> CleaningReport:
        return CleaningReport(
            self.tracks + other.tracks,
            self.kept + other.kept,
            self.seconds + other.seconds,
            self.seconds_kept + other.seconds_kept,
            self.pieces + other.pieces,
            {r: self.cut.get(r, 0.0) + other.cut.get(r, 0.0) for r in {**self.cut, **other.cut}},
        )

    def format_lines(self) -> list[str]:
        """The report, one fact a line."""
        return [
            f"{self.tracks} tracks, {self.seconds:.0f} s; kept {self.kept} pieces, "
            f"{self.seconds_kept:.0f} s",
            *(f"removed {n} pieces: {reason}" for reason, n in self.pieces.most_common()),
            *(f"cut {s:.1f} s: {reason}" for reason, s in self.cut.items() if s > 0),
        ]


@dataclass(frozen=True, eq=False)
class RawTrack:
    """One track as a tracker wrote it.

    Attributes:
        type: agent class; time: [T] [s], multiples of 0.1; xy: [T, 2] positions [m].
        settling: how long the tracker's filter needs at the beginning [s].
    """

    type: AgentClass
    time: FloatArray
    xy: FloatArray
    settling: float = 0.0


def clean_track(seen: RawTrack, *, smoothing: float, removed: CleaningReport) -> Iterator[Track]:
    """The believable pieces of a track, smoothed, and what was removed added to `removed`.

    Args:
        smoothing: standard deviation of the Gaussian over time [s]; 0 for none.
    """
    removed.tracks += 1
    removed.seconds += len(seen.time) * STEP
    gap = np.abs(np.diff(seen.time) - STEP) > STEP / 4
    way = np.linalg.norm(np.diff(seen.xy, axis=0), axis=1)
    jump = ~gap & (way > FASTEST["vehicle"] * STEP + JUMP_TOLERANCE)
    removed.add_cut("jumps", float(jump.sum()) * STEP)
    cuts = [0, *(np.flatnonzero(gap | jump) + 1).tolist(), len(seen.time)]
    for a, b in pairwise(cuts):
        part = slice(a, b)
        skipped = round(seen.settling / STEP) if a == 0 else 0
        start, xy = float(seen.time[part][0]) + skipped * STEP, seen.xy[part][skipped:]
        reason = find_fault(seen.type, xy)
        if reason is not None:
            removed.pieces[reason] += 1
            continue
        removed.add_cut("the tracker's filter settles", skipped * STEP)
        removed.kept += 1
        removed.seconds_kept += len(xy) * STEP
        smoothed = smooth(xy, smoothing)
        yield Track(smoothed, compute_course(smoothed), round(round(start / STEP) * STEP, 1))


def find_fault(kind: AgentClass, xy: FloatArray) -> str | None:
    """Why a piece of a track cannot be used; None if it can."""
    if len(xy) * STEP < MIN_DURATION:
        return f"shorter than {MIN_DURATION:g} s"
    speed = compute_kinematics(smooth(xy, SPEED_CHECK_SMOOTHING)).speed
    if float(np.ptp(xy, axis=0).max()) < MIN_EXTENT[kind]:
        return "hardly moves: a false detection, parked, or waiting all the time"
    speed_p90 = float(np.quantile(speed, 0.9))
    if speed_p90 > FASTEST[kind]:
        return f"{kind} faster than {FASTEST[kind]:g} m/s"
    if float(speed.max()) > 1.3 * FASTEST[kind]:
        return "speed jumps: the track changes from one agent to another"
    return None


def compute_course(xy: FloatArray) -> FloatArray:
    """Compute the direction of motion [T] [rad]; held while standing, east without motion."""
    step = np.gradient(xy, STEP, axis=0) if len(xy) > 1 else np.zeros_like(xy)
    known = np.hypot(step[:, 0], step[:, 1]) >= COURSE_MIN_SPEED
    if not known.any():
        return np.zeros(len(xy))
    course = np.arctan2(step[:, 1], step[:, 0])
    last = np.maximum.accumulate(np.where(known, np.arange(len(xy)), -1))
    return np.asarray(np.unwrap(course[np.where(last < 0, int(np.argmax(known)), last)]))
