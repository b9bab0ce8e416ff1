"""How a scene looks in every kind of view: colours, outlines over time, printable text."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from scenewright.scene.base import RIDERS, Colour, FloatArray
from scenewright.scene.events import Proof
from scenewright.scene.kinds import has_trait
from scenewright.scene.map import IntersectionMap
from scenewright.scene.objects import ObjectRecord
from scenewright.scene.phrasing import call_agents
from scenewright.scene.record import AgentRecord, EventRecord, SceneRecord, SegmentStatus

FOREGROUND = (
    "#D55E00",
    "#0072B2",
    "#009E73",
    "#AA3377",
    "#E69F00",
    "#56B4E9",
    "#5B3A9E",
    "#8C564B",
)
"""Colours that colour-blind readers can distinguish, in this order (after Okabe and Ito)."""
BACKGROUND_VEHICLE = "#8A94A3"
BACKGROUND_PEDESTRIAN = "#A39382"
BACKGROUND_RIDER = "#93927F"
STANDING = "#3F4650"
"""Of objects that stand all the time."""
LIGHTS: dict[Colour, str] = {"green": "#19A974", "yellow": "#F2B705", "red": "#DB2B39"}
STATES: dict[SegmentStatus, str] = {
    "keep": "#6C8EBF",
    "stop": "#C1272D",
    "proceed": "#3A9D6B",
    "terminate": "#4A4A4A",
}
View = tuple[float, float, float, float]
"""West, east, south, north [m]."""
STANDSTILL_SPEED = 0.3
"""Speed [m/s] at or below which an agent is stationary (SEMANTICS section 4)."""

_BICYCLE = ((-1.0, 0.1), (-0.45, 0.14), (-0.35, 0.7), (0.05, 0.75), (0.3, 0.95), (0.42, 0.95),
            (0.44, 0.16), (1.0, 0.1))  # fmt: skip
_SCOOTER = ((-1.0, 0.12), (-0.8, 0.3), (-0.4, 0.3), (-0.38, 0.8), (0.2, 0.8), (0.5, 0.95),
            (0.68, 0.95), (0.7, 0.25), (1.0, 0.12))  # fmt: skip
"""Left half of a rider from above, rear wheel first: wheels, shoulders, handlebar."""

_DISC = np.stack([np.cos(a := np.linspace(0, 2 * np.pi, 24, endpoint=False)), np.sin(a)], axis=1)


@dataclass(frozen=True, eq=False)
class DrawnMotion:
    """An agent of a scene as arrays.

    Attributes:
        times: [T] since scene start [s].
        xy: [T, 2] centre positions [m].
        heading: [T] [rad].
        speed: [T] [m/s].
        colour: `#RRGGBB`.
        stays: its last footprint remains as an obstacle after a collision.
        called: what people call it, "the taxi".
    """

    agent: AgentRecord
    times: FloatArray
    xy: FloatArray
    heading: FloatArray
    speed: FloatArray
    colour: str
    stays: bool
    called: str

    @property
    def is_foreground(self) -> bool:
        """Whether the instruction is about this agent."""
        return self.agent.role == "foreground"

    def find_sample(self, time: float) -> int | None:
        """The sample shown at `time`; None before it appears and after it has left."""
        if time < self.times[0] - 1e-6 or (time > self.times[-1] + 1e-6 and not self.stays):
            return None
        return int(np.clip(np.searchsorted(self.times, time + 1e-6) - 1, 0, len(self.times) - 1))

    def compute_outline(self, index: int, least: float = 0.0) -> FloatArray:
        """[N, 2] corners of the footprint at a sample [m]; a pedestrian's at least so wide [m]."""
        size = np.array([self.agent.length, self.agent.width]) / 2
        if self.agent.type == "pedestrian":
            size = np.maximum(size, least / 2)
        unit = _shape_agent(self.agent)
        angle = self.heading[index]
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        return np.asarray((unit * size) @ turn + self.xy[index])

    def compute_front(self, index: int) -> FloatArray:
        """[2] middle of the front edge at a sample [m]."""
        angle = self.heading[index]
        ahead = np.array([np.cos(angle), np.sin(angle)]) * self.agent.length / 2
        return np.asarray(self.xy[index] + ahead)

    def find_standstill(self, start: float, end: float) -> tuple[int, int] | None:
        """First and last sample of the standstill within an interval [s]; None if it has none."""
        inside = (self.times >= start - 1e-6) & (self.times <= end + 1e-6)
        still = np.flatnonzero(inside & (self.speed <= STANDSTILL_SPEED))
        return (int(still[0]), int(still[-1])) if len(still) else None


def _shape_agent(agent: AgentRecord) -> FloatArray:
    """[N, 2] corners of the footprint in half lengths and half widths, front to the right."""
    if agent.type in RIDERS:
        left = np.array(_BICYCLE if agent.type == "cyclist" else _SCOOTER)
        return np.concatenate([left, left[::-1] * (1.0, -1.0)])
    return _DISC if agent.type == "pedestrian" else _shape_vehicle(agent.length)


def _shape_vehicle(length: float) -> FloatArray:
    """[N, 2] unit rectangle; its front corners are cut by about 0.4 m to show the heading."""
    nose = 1 - min(0.8 / length, 0.5)
    return np.array([(-1, -1), (nose, -1), (1, -0.55), (1, 0.55), (nose, 1), (-1, 1)], dtype=float)


def outline_object(record: ObjectRecord) -> FloatArray:
    """[N, 2] corners of a standing object [m]; a vehicle's are cut at its front."""
    drives = record.subtype is not None
    unit = _shape_vehicle(record.length) if drives else _shape_vehicle(np.inf)
    cos, sin = np.cos(record.heading), np.sin(record.heading)
    turn = np.array([[cos, sin], [-sin, cos]])
    half = np.array([record.length, record.width]) / 2
    return np.asarray((unit * half) @ turn + (record.x, record.y))


def describe_object(record: ObjectRecord) -> str:
    """What an object is, in words: a parked truck, a bus at its stop."""
    if record.kind == "bus_stop":
        return "bus at its stop"
    if record.kind == "door":
        return f"door, opens at {record.since or 0.0:.1f} s"
    return f"{record.kind.replace('_', '-')} {record.subtype or ''}".strip()


def list_motions(scene: SceneRecord) -> list[DrawnMotion]:
    """All agents as arrays, background first, so that the foreground is drawn on top."""
    shades, called = choose_colours(scene), call_agents(scene)
    ordered = sorted(scene.agents, key=lambda agent: (agent.role == "foreground", agent.id))
    motions = []
    for agent in ordered:
        if not agent.trajectory:
            continue
        xy = np.array(agent.trajectory, dtype=float).reshape(-1, 2)
        times = agent.spawn_time + scene.meta.step * np.arange(len(xy), dtype=np.float64)
        steps = np.gradient(xy, scene.meta.step, axis=0) if len(xy) > 1 else np.zeros_like(xy)
        motions.append(
            DrawnMotion(
                agent=agent,
                times=times,
                xy=xy,
                heading=np.array(agent.heading, dtype=float),
                speed=np.linalg.norm(steps, axis=1),
                colour=shades[agent.id],
                stays=_is_obstacle(agent.id, float(times[-1]), scene.events),
                called=called[agent.id],
            )
        )
    return motions


def _is_obstacle(number: int, end: float, events: Iterable[EventRecord]) -> bool:
    return any(
        event.type == "collision"
        and number in (event.from_, event.to)
        and event.time is not None
        and abs(event.time - end) <= 0.5
        for event in events
    )


def choose_colours(scene: SceneRecord) -> dict[int, str]:
    """`#RRGGBB` by agent id: strong for the foreground, muted for the background."""
    muted = {"vehicle": BACKGROUND_VEHICLE, "pedestrian": BACKGROUND_PEDESTRIAN}
    muted |= dict.fromkeys(RIDERS, BACKGROUND_RIDER)
    foreground = sorted(agent.id for agent in scene.agents if agent.role == "foreground")
    shades = {agent.id: muted[agent.type] for agent in scene.agents}
    return shades | {n: FOREGROUND[i % len(FOREGROUND)] for i, n in enumerate(foreground)}


def parse_colour(colour: str) -> tuple[int, int, int]:
    """`#RRGGBB` as three bytes."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def is_night(scene: SceneRecord) -> bool:
    """Whether it is dark at the scene's time of day."""
    return not 6 <= int(scene.meta.time_of_day[:2]) < 20


def make_printable(text: str, *, limit: int = 400) -> str:
    """One line of visible characters, at most `limit` long; an ellipsis replaces the rest."""
    head = text[: 8 * limit]
    kept = "".join(c if unicodedata.category(c)[0] not in "CZ" else " " for c in head)
    line = " ".join(kept.split())
    whole = len(line) <= limit and len(head) == len(text)
    return line if whole else line[: limit - 1].rstrip() + "…"


def colour_verdict(proof: Proof) -> str:
    """Green, amber where something stands beside the tick, or red."""
    return "#B3202A" if not proof.verified else "#A15C00" if proof.caveat else "#15803D"


def find_light_colours(scene: SceneRecord, time: float) -> dict[str, Colour]:
    """Colour by stop line or crosswalk id at a time [s since scene start]."""
    return {
        row.stop_line or row.crosswalk or "": row.colour
        for row in scene.signals
        if row.start <= time < row.end
    }


def find_main_time(scene: SceneRecord) -> float:
    """The time to show when there is only one picture [s]: the first event, else the first agent
    that drives into an object, else the fullest."""
    times = [event.time for event in scene.events if event.time is not None]
    ended = {
        encounter.agent
        for encounter in scene.encounters
        if has_trait("encounter", encounter.how, "ends")
    }
    times += [
        agent.spawn_time + scene.meta.step * (len(agent.trajectory) - 1)
        for agent in scene.agents
        if agent.id in ended
    ]
    if times:
        return min(times)
    grid = np.arange(0.0, scene.meta.duration + 1e-6, 0.5)
    step = scene.meta.step
    present = np.zeros(len(grid))
    for agent in scene.agents:
        end = agent.spawn_time + step * (len(agent.trajectory) - 1)
        present += (grid >= agent.spawn_time) & (grid <= end)
    return float(grid[int(np.argmax(present - 1e-3 * np.abs(grid - scene.meta.duration * 0.4)))])


def choose_view(
    scene: SceneRecord, moving: list[DrawnMotion], intersection: IntersectionMap
) -> View:
    """The square that shows the crosswalks and the foreground around its event [m]."""
    time = find_main_time(scene)
    shown_points = [np.array(walk.polygon) for walk in intersection.crosswalks]
    for motion in moving:
        if motion.is_foreground:
            near = np.abs(motion.times - time) <= 4.0
            shown_points.append(motion.xy[near])
    shown_points += [np.array([e.location]) for e in scene.events if e.location is not None]
    points = np.vstack(shown_points) if shown_points else np.zeros((1, 2))
    half = float(np.clip(np.ptp(points, axis=0).max() / 2 + 5.0, 18.0, intersection.extent))
    low, high = -intersection.extent + half, intersection.extent - half
    x, y = np.clip((points.min(axis=0) + points.max(axis=0)) / 2, low, high)
    return float(x - half), float(x + half), float(y - half), float(y + half)
