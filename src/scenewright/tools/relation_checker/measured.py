"""Figures that a request asks for, measured on the final tracks (SEMANTICS 8, numbers)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.events import Event, Finding
from scenewright.scene.map import IntersectionMap
from scenewright.scene.measures import UNITS
from scenewright.scene.record import MeasureRecord
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.events import SceneObservation
from scenewright.tools.relation_checker.footprints import compute_offsets
from scenewright.tools.relation_checker.ground_raster import get_ground_raster
from scenewright.tools.relation_checker.liveness import find_standstills
from scenewright.tools.relation_checker.planar import geos
from scenewright.tools.relation_checker.trajectory import Trajectory

KEPT = 1.0
"""How long a speed is to be kept for the agent to drive or walk at it [s]."""
ROUNDING = {"m/s": 0.02, "m/s2": 0.05, "s": 0.02, "m": 0.02, "%": 0.5}
"""How far beside its bounds a figure may be measured, as positions are kept to 1 mm."""
MOVING = 1.0
"""Slower than this [m/s] a headway says nothing."""
FRONT = 0.3
"""Depth of the front [m]."""
SIGHT = 30.0
"""How far ahead of a standing agent a line or crosswalk is looked for [m]."""
WEIGHT = {"collision": 0, "yielding": 1, "near_miss": 2, "follow": 3}
"""Which of several events of two agents is meant: the first."""


class MeasuredFigures:
    """What the tracks show of figures that were asked for."""

    def __init__(
        self,
        events: Sequence[Event],
        observed: SceneObservation,
        intersection_map: IntersectionMap | None,
    ) -> None:
        self._observed, self._map = observed, intersection_map
        self._events = sorted(events, key=lambda each: WEIGHT[each.type])
        self._tracks = observed.by_id

    def find_shortfalls(
        self, measures: Sequence[MeasureRecord]
    ) -> tuple[tuple[Finding, ...], list[dict[str, Any]]]:
        """A finding for every measure that the tracks do not show, and what each measured."""
        findings, found = [], []
        for measure in measures:
            values = self.measure(measure)
            own = {"kind": measure.kind, "agent": measure.agent, "other": measure.other}
            found.append(own | {"values": [round(value, 3) for value in values]})
            if (detail := _find_shortfall(measure, values)) is not None:
                agents = (
                    (measure.agent,) if measure.other is None else (measure.agent, measure.other)
                )
                findings.append(Finding(rule="measure_not_met", agents=agents, detail=detail))
        return tuple(findings), found

    def measure(self, measure: MeasureRecord) -> tuple[float, ...]:
        """The values that must lie in the range; none where nothing of the kind is seen."""
        track = self._tracks[measure.agent]
        match measure.kind:
            case "speed":
                # The highest that is kept for a second.
                window = round(KEPT / STEP)
                if len(track.speed) <= window:
                    return ()
                views = np.lib.stride_tricks.sliding_window_view(track.speed, window)
                return (float(views.min(axis=1).max()),)
            case "line_speed":
                # Where it passes its light: the red one that it runs, else the first.
                lights = self._observed.lights
                met = (*lights.find_red_crossings(track), *lights.find_crossings(track))
                return tuple(float(np.interp(c.time, track.times, track.speed)) for c in met[:1])
            case "braking":
                return (float(-track.acceleration.min(initial=0.0)),)
            case "acceleration":
                return (float(track.acceleration.max(initial=0.0)),)
            case "wait":
                return tuple(end - start for start, end in self._find_wait(track))
            case "line_distance":
                return self._measure_line_distance(track)
        return self._measure_pair(measure, track)

    def _measure_pair(self, measure: MeasureRecord, track: Trajectory) -> tuple[float, ...]:
        pair = {measure.agent, measure.other}
        event = next((e for e in self._events if {e.from_, e.to} == pair), None)
        if event is None or measure.other is None:
            return ()
        evidence = event.evidence
        match measure.kind:
            case "contact_speed":
                key = "speed_from" if event.from_ == measure.agent else "speed_to"
                return _list_values(evidence.get(key))
            case "pet":
                return _list_values(self._observed.pet((measure.agent, measure.other)))
            case "ttc":
                return _list_values(evidence.get("path_ttc"))
            case "time":
                return (event.time,)
            case "headway" | "gap":
                return self._measure_following(measure)
            case _ if event.type == "collision":
                return measure_impact_share(measure.kind, track, self._tracks[measure.other], event)
        return ()

    def _find_wait(self, track: Trajectory) -> list[tuple[float, float]]:
        """The standstill in which it gives way; else its longest."""
        stands = find_standstills(track)
        yields = [e.time for e in self._events if e.type == "yielding" and e.from_ == track.id]
        if yields:
            return sorted(stands, key=lambda each: abs(each[0] - yields[0]))[:1]
        return sorted(stands, key=lambda each: each[0] - each[1])[:1]

    def _measure_following(self, measure: MeasureRecord) -> tuple[float, ...]:
        """The least and the median figure over the longest stretch of following."""
        stretches = [
            (e.time, float(e.evidence["until"]))
            for e in self._events
            if e.type == "follow" and (e.from_, e.to) == (measure.agent, measure.other)
        ]
        if not stretches:
            return ()
        start, end = max(stretches, key=lambda each: each[1] - each[0])
        ids = self._observed.ids
        found = [
            (lane.gap if measure.kind == "gap" else lane.headway)[
                (lane.leader == ids.index(measure.other or 0)) & (lane.times >= start - STEP / 2)
                & (lane.times <= end + STEP / 2) & (lane.speed > MOVING)
            ]
            for lane in self._observed.lanes
            if ids[lane.follower] == measure.agent
        ]  # fmt: skip
        values: FloatArray = np.concatenate([*found, np.empty(0)])
        return (float(values.min()), float(np.median(values))) if len(values) else ()

    def _measure_line_distance(self, track: Trajectory) -> tuple[float, ...]:
        """From the front of the standing agent straight ahead to a stop line or crosswalk."""
        if self._map is None:
            return ()
        marks = [geos.LineString(line.line) for line in self._map.stop_lines]
        marks += [crosswalk.area for crosswalk in get_ground_raster(self._map).crosswalks]
        found: list[float] = []
        for start, end in self._find_wait(track):
            xy, heading = track.at(np.array([(start + end) / 2]))
            ahead = np.array([np.cos(heading[0]), np.sin(heading[0])])
            front = xy[0] + track.nose * ahead
            ray = geos.LineString([front, front + SIGHT * ahead])
            met = [geos.intersection(ray, mark) for mark in marks]
            apart = [each.distance(geos.Point(front)) for each in met if not each.is_empty]
            found += [min(apart)] if apart else []
        return tuple(found)


def _find_shortfall(measure: MeasureRecord, values: Sequence[float]) -> str | None:
    """Why a measure is not met by its values; None if it is."""
    unit = UNITS[measure.kind].unit
    slack = ROUNDING[unit]
    low, high = measure.low - slack, measure.high + slack
    if values and all(low <= value <= high for value in values):
        return None
    name = {"pet": "PET", "ttc": "TTC"}.get(measure.kind, measure.kind.replace("_", " "))
    of = f"{measure.agent}" if measure.other is None else f"{measure.agent} and {measure.other}"
    seen = " to ".join(f"{value:.2f}" for value in sorted(set(values)))
    seen = f"{seen} {unit}" if seen else "none"
    asked = f"{measure.low:.4g} to {measure.high:.4g} {unit} asked for"
    return f"{name} of {of}: {seen} observed, {asked}"


def measure_impact_share(
    kind: str, track: Trajectory, other: Trajectory, event: Event
) -> tuple[float, ...]:
    """Where a contact lies on a vehicle [%]: across its front, or from its front along its side.

    Args:
        kind: `front_point` counts from the side that the other one comes from.
    """
    if not track.is_vehicle:
        return ()
    xy, heading = track.at(np.array([event.time]))
    along, across = map(float, compute_offsets(np.array(event.location), xy[0], heading[0]))
    at_front = along >= track.half_length - FRONT
    if kind == "side_point":
        share = (track.half_length - along) / track.length
        return () if at_front else (100.0 * float(np.clip(share, 0.0, 1.0)),)
    from_left = float(np.clip((track.half_width - across) / track.width, 0.0, 1.0))
    if kind == "front_point":
        before, after = other.at(np.array([event.time - 0.3, event.time]))[0]
        to_right = compute_offsets(after, before, heading[0])[1] < 0.0
        kind = "front_point_left" if to_right else "front_point_right"
    share = from_left if kind == "front_point_left" else 1.0 - from_left
    return (100.0 * share,) if at_front else ()


def _list_values(value: object) -> tuple[float, ...]:
    return (float(value),) if isinstance(value, int | float) else ()
