"""The scenes that all implementations are shown: analytic, random, our generator's, recorded."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from scenewright.errors import Unsatisfiable
from scenewright.graph.run import synthesize
from scenewright.scene.track import PEDESTRIAN, STEP, Shape, Track, get_vehicle_shape
from scenewright.tools.relation_checker import RoadUser, read_users
from scenewright.tools.track_io.external_tracks import read_tracks

CAR, TRUCK = get_vehicle_shape("car"), get_vehicle_shape("truck")
INSTRUCTIONS = Path(__file__).parents[2] / "examples" / "instructions.txt"
RECORDINGS = "SCENEWRIGHT_DATA"
"""Environment variable: a folder that holds `vehicle_tracks_*.csv` of the TAF-BW data set."""


@dataclass(frozen=True)
class Scene:
    """Some road users.

    Attributes:
        name: for messages; users: who takes part; foreground: ids that the scene is about.
    """

    name: str
    users: tuple[RoadUser, ...]
    foreground: frozenset[int]

    def pairs(self) -> Iterator[tuple[RoadUser, RoadUser]]:
        """Pairs of which one is in the foreground and that come near one another."""
        for a, b in combinations(self.users, 2):
            if {a.id, b.id} & self.foreground and _near(a, b):
                yield a, b


def boxed(user: RoadUser) -> RoadUser:
    """A square for a disc: some implementations know rectangles only."""
    return RoadUser(user.id, user.track, Shape("vehicle", user.shape.length, user.shape.width))


def as_json(user: RoadUser) -> dict[str, Any]:
    """What a peer is told of somebody."""
    track, shape = user.track, user.shape
    return {
        "id": user.id, "class": shape.type, "length": shape.length, "width": shape.width,
        "start": track.start, "step": track.step, "heading": np.unwrap(track.heading).tolist(),
        "x": track.xy[:, 0].tolist(), "y": track.xy[:, 1].tolist(),
    }  # fmt: skip


def _near(a: RoadUser, b: RoadUser) -> bool:
    """Whether the rectangles round both tracks, 10 m wider, meet."""
    span = [(u.track.xy.min(axis=0) - 10, u.track.xy.max(axis=0) + 10) for u in (a, b)]
    return bool((span[0][0] <= span[1][1]).all() and (span[1][0] <= span[0][1]).all())


def straight(
    number: int,
    *,
    towards: float,
    speed: float,
    at: float,
    offset: float = 0.0,
    shape: Shape = CAR,
    lasts: float = 12.0,
) -> RoadUser:
    """Somebody on a straight line at constant speed.

    Args:
        towards: heading [rad]; at: time at which the line's foot nearest the origin is passed [s];
            offset: of the line to the left of the origin [m].
    """
    t = np.arange(round(lasts / STEP) + 1) * STEP
    along = speed * (t - at)
    c, s = np.cos(towards), np.sin(towards)
    xy = np.stack((c * along - s * offset, s * along + c * offset), axis=1)
    return RoadUser(number, Track(xy, np.full(len(t), towards), 0.0), shape)


def bend(number: int, *, turn: float, speed: float, at: float, spin: float = 0.0) -> RoadUser:
    """A car on an arc through the origin: radius 1/|turn| [m], to the left if turn > 0."""
    t = np.arange(121) * STEP
    angle = speed * (t - at) * turn
    xy = np.stack((np.sin(angle), 1 - np.cos(angle)), axis=1) / turn
    c, s = np.cos(spin), np.sin(spin)
    return RoadUser(number, Track(xy @ np.array([[c, s], [-s, c]]), angle + spin, 0.0), CAR)


def _scene(name: str, *users: RoadUser) -> Scene:
    return Scene(name, users, frozenset(u.id for u in users))


@cache
def analytic() -> tuple[Scene, ...]:
    """Straight lines and arcs at constant speed: what they do can be worked out on paper."""
    lags = (-5.0, -2.0, -1.0, -0.5, 0.0, 0.4, 0.8, 1.5, 3.0, 4.5)
    return (*(scene for lag in lags for scene in _crossing(lag)), *_following(), *_head_on())


def _crossing(lag: float) -> Iterator[Scene]:
    """Somebody crosses before a car, or as much later [s]."""
    at, car = 6.0 + lag, straight(1, towards=0.0, speed=10.0, at=6.0)
    for degrees in (90, 60, 135, 45, 110):
        other = straight(2, towards=np.deg2rad(degrees), speed=7.0, at=at)
        yield _scene(f"crossing at {degrees} degrees, {lag:+} s", car, other)
    walker = straight(2, towards=np.pi / 2, speed=1.4, at=at, shape=PEDESTRIAN)
    yield _scene(f"walker crosses, {lag:+} s", car, walker)
    oncoming = straight(2, towards=np.pi, speed=11.0, at=at, offset=-2.0)
    turning = bend(1, turn=0.08, speed=6.0, at=6.0)
    yield _scene(f"left turn across oncoming, {lag:+} s", turning, oncoming)


def _following() -> Iterator[Scene]:
    for fast, slow in ((10.0, 4.0), (14.0, 13.0), (6.0, 0.0), (8.0, 7.5)):
        behind = straight(1, towards=0.3, speed=fast, at=8.0)
        ahead = straight(2, towards=0.3, speed=slow, at=4.0 if slow else 6.0)
        yield _scene(f"{fast} m/s behind {slow} m/s", behind, ahead)


def _head_on() -> Iterator[Scene]:
    for offset in (0.0, 1.0, 1.8, 1.9, 3.5):
        one = straight(1, towards=0.0, speed=12.0, at=5.0)
        two = straight(2, towards=np.pi, speed=9.0, at=5.5, offset=offset)
        yield _scene(f"head on, {offset} m aside", one, two)


@cache
def random_pairs(count: int = 200) -> tuple[Scene, ...]:
    """Lines and arcs of all sizes, speeds and directions that pass near the origin together."""
    rng = np.random.default_rng(20261121)
    return tuple(
        _scene(f"random {n}", _random_user(1, rng), _random_user(2, rng)) for n in range(count)
    )


def _random_user(number: int, rng: np.random.Generator) -> RoadUser:
    at, towards = rng.uniform(3, 9), rng.uniform(0, 2 * np.pi)
    if rng.random() < 0.25:
        return straight(number, towards=towards, speed=rng.uniform(0.5, 3.0), at=at,
                        offset=rng.normal(0, 2), shape=PEDESTRIAN)  # fmt: skip
    if rng.random() < 0.35:
        turn = rng.uniform(0.02, 0.12) * rng.choice((-1, 1))
        return bend(number, turn=turn, speed=rng.uniform(3, 9), at=at, spin=towards)
    return straight(number, towards=towards, speed=rng.uniform(1, 18), at=at,
                    offset=rng.normal(0, 2), shape=(CAR, TRUCK)[rng.integers(2)])  # fmt: skip


@cache
def generated(seeds: tuple[int, ...] = (1, 2)) -> tuple[Scene, ...]:
    """Scenes of our own generator, over all kinds of relation."""
    scenes = []
    for text in INSTRUCTIONS.read_text("utf-8").splitlines():
        for seed in seeds:
            try:
                made = synthesize(text, seed=seed)
            except Unsatisfiable:
                continue
            bound = frozenset(a.id for a in made.record.agents if a.role == "foreground")
            scenes.append(Scene(f"{text} ({seed})", read_users(made.record), bound))
    return tuple(scenes)


@cache
def recorded(most: int = 12) -> tuple[Scene, ...]:
    """Real tracks of the TAF-BW data set; none if the folder is not named."""
    folder = os.environ.get(RECORDINGS)
    files = sorted(Path(folder).rglob("vehicle_tracks_*.csv")) if folder else []
    scenes = []
    for file in files[:most]:
        users = read_tracks(_as_csv(file).encode(), name=f"{file.name}.csv").users[:40]
        scenes.append(Scene(file.name, users, frozenset(u.id for u in users)))
    return tuple(scenes)


def _as_csv(file: Path) -> str:
    """The columns that scenewright reads; the data set measures time in milliseconds."""
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow(("t", "id", "class", "x", "y", "heading", "length", "width"))
    with file.open(newline="") as rows:
        for row in csv.DictReader(rows):
            writer.writerow((
                f"{float(row['timestamp_ms']) / 1000:.3f}", row["track_id"], row["agent_type"],
                row["x"], row["y"], row["psi_rad"], row["length"], row["width"],
            ))  # fmt: skip
    return out.getvalue()
