"""Tracks in formats without a simulator of their own, each read by a package that others wrote.

What is read are boxes at times; two collide where their footprints overlap.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator
from importlib.metadata import version
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from shapely import Point, box
from shapely.affinity import rotate, translate

Sample = tuple[str, float, float, float, float, float, float]
"""Id in the file, time [s], x, y [m], heading [rad], length, width [m]; NaN where it has none."""
NOT_STATED = math.nan


def read_csv(file: Path) -> Iterator[Sample]:
    """A table, by pandas and movingpandas."""
    import geopandas
    import movingpandas
    import pandas

    table = pandas.read_csv(file)
    places = geopandas.points_from_xy(table["x"], table["y"])
    times = pandas.to_datetime(table["t"], unit="s")
    frame = geopandas.GeoDataFrame(table.assign(time=times), geometry=places).set_index("time")
    for track in movingpandas.TrajectoryCollection(frame, "id"):
        for row in track.df.itertuples():
            place = row.geometry.x, row.geometry.y
            yield str(row.id), row.t, *place, row.heading, row.length, row.width


def read_fcd(file: Path) -> Iterator[Sample]:
    """SUMO's tables by sumolib, valid by SUMO's schema but for the two attributes of our own."""
    import sumo
    import sumolib
    import xmlschema

    schema = xmlschema.XMLSchema(Path(sumo.__file__).parent / "data" / "xsd" / "fcd_file.xsd")
    faults = [each.reason for each in schema.iter_errors(str(file))]
    own = [each for each in faults if "'length'" in each or "'width'" in each]
    assert faults == own, faults[0]
    for step in sumolib.xml.parse(str(file), "timestep"):
        for kind in ("vehicle", "person"):
            for each in getattr(step, kind) or ():
                heading = math.radians(90.0 - float(each.angle))
                length, width = float(each.length), float(each.width)
                back = length / 2 if kind == "vehicle" else 0.0
                x = float(each.x) - back * math.cos(heading)
                y = float(each.y) - back * math.sin(heading)
                yield each.id, float(step.time), x, y, heading, length, width


def read_trajnet(file: Path) -> Iterator[Sample]:
    """By trajnetplusplustools, which must find every scene's path whole."""
    from trajnetplusplustools import Reader

    reader = Reader(str(file), scene_type="paths")
    for _, paths in reader.scenes():
        assert len({row.frame for row in paths[0]}) == len(paths[0]) >= 10
    for frame, rows in reader.tracks_by_frame.items():
        for row in rows:
            yield str(row.pedestrian), frame / 10, row.x, row.y, *[NOT_STATED] * 3


def read_womd(file: Path) -> Iterator[Sample]:
    """A Scenario, by the classes of the dataset's own package."""
    from waymo_open_dataset.protos.scenario_pb2 import Scenario

    for record in list_records(file):
        scenario = Scenario.FromString(record)
        assert scenario.IsInitialized()
        assert scenario.tracks[scenario.sdc_track_index].states[scenario.current_time_index].valid
        for track in scenario.tracks:
            for time, s in zip(scenario.timestamps_seconds, track.states, strict=True):
                if s.valid:
                    where = s.center_x, s.center_y, s.heading, s.length, s.width
                    yield str(track.id), time, *where


def read_example(file: Path) -> Iterator[Sample]:
    """A tf.Example, by the package tfrecord; times are those of its micro seconds."""
    from tfrecord.example_pb2 import Example

    for record in list_records(file):
        held = Example.FromString(record).features.feature
        value = {
            key: np.array(each.float_list.value or each.int64_list.value)
            for key, each in held.items()
        }
        for part, steps in (("past", 10), ("current", 1), ("future", 80)):
            names = ("valid", "timestamp_micros", "x", "y", "bbox_yaw", "length", "width")
            table = np.stack([value[f"state/{part}/{n}"].reshape(128, steps) for n in names], -1)
            for n, k in np.argwhere(table[..., 0] == 1).tolist():
                _, micros, *where = table[n, k].tolist()
                yield f"{value['state/id'][n]:.0f}", micros * 1e-6, *where


def list_records(file: Path) -> Iterator[bytes]:
    """The records of a TFRecord, by tfrecord; their checksums, which it skips, by google-crc32c."""
    import google_crc32c
    from tfrecord.reader import tfrecord_iterator

    data, at = file.read_bytes(), 0
    for record in tfrecord_iterator(str(file)):
        content, at = bytes(record), at + 12 + len(record) + 4
        crc = google_crc32c.value(content)
        masked = ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF
        assert int.from_bytes(data[at - 4 : at], "little") == masked
        yield content


def read_wosac(file: Path) -> Iterator[Sample]:
    """Rollouts by the classes of the challenge's own package, from step 11 on."""
    from waymo_open_dataset.protos.sim_agents_submission_pb2 import JointScene

    scene = JointScene.FromString(file.read_bytes())
    assert scene.IsInitialized()
    for each in scene.simulated_trajectories:
        rows = zip(each.center_x, each.center_y, each.heading, strict=True)
        for k, (x, y, heading) in enumerate(rows, start=11):
            yield str(each.object_id), k / 10, x, y, heading, NOT_STATED, NOT_STATED


def read_foxglove(file: Path) -> Iterator[Sample]:
    """Boxes on /agents by mcap; every message valid by the schema that its file has for it."""
    import jsonschema
    from mcap.reader import make_reader

    held: dict[int, Any] = {}
    with file.open("rb") as stream:
        for schema, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
            if schema.id not in held:
                definition = json.loads(schema.data)
                held[schema.id] = jsonschema.validators.validator_for(definition)(definition)
            body = json.loads(message.data)
            held[schema.id].validate(body)
            for entity in body["entities"] if channel.topic == "/agents" else ():
                (cube,) = entity["cubes"]
                place, turn = cube["pose"]["position"], cube["pose"]["orientation"]
                heading = 2 * math.atan2(turn["z"], turn["w"])
                size = cube["size"]["x"], cube["size"]["y"]
                time = message.log_time * 1e-9
                yield entity["id"], time, place["x"], place["y"], heading, *size


def read_constraints(file: Path) -> Iterator[Sample]:
    """Constraints, by py-osc2's parser; there are no tracks in them."""
    from osc2parser.osc2parser import parse_file

    _, errors, _ = parse_file(str(file))
    assert not errors, f"{errors} errors"
    yield from ()


READERS: dict[str, tuple[str, Callable[[Path], Iterator[Sample]]]] = {
    ".csv": ("movingpandas", read_csv),
    ".fcd.xml": ("sumolib", read_fcd),
    ".ndjson": ("trajnetplusplustools", read_trajnet),
    ".tfexample.tfrecord": ("tfrecord", read_example),
    ".tfrecord": ("waymo-open-dataset-tf-2-12-0", read_womd),
    ".joint_scene.binproto": ("waymo-open-dataset-tf-2-12-0", read_wosac),
    ".foxglove.mcap": ("mcap", read_foxglove),
    ".osc": ("py-osc2", read_constraints),
}
"""By how a file ends: the package that reads it, and how."""


def play(question: dict[str, Any], read: Callable[[Path], Iterator[Sample]]) -> dict[str, Any]:
    """Pairs and times of first overlap, and how far the positions are from the scene's [m]."""
    names = {str(agent["id"]): name for name, agent in question["agents"].items()}
    names |= {str(number): name for name, number in question["objects"].items()}
    steps: dict[int, dict[str, tuple[float, ...]]] = {}
    for who, t, *where in read(Path(question["file"])):
        held = steps.setdefault(round(t / question["step"]), {})
        assert abs(t / question["step"] - round(t / question["step"])) < 1e-3
        assert names.get(who, who) not in held, f"{who} is there twice"
        held[names.get(who, who)] = tuple(where)
    shift = question.get("shift", 0)
    worst, seen = 0.0, 0
    for name, agent in question["agents"].items():
        for t, xy in zip(agent["t"], agent["xy"], strict=True):
            there = steps.get(round(t / question["step"]) - shift, {}).get(name)
            if there is not None:
                seen += 1
                worst = max(worst, *(abs(a - b) for a, b in zip(there, xy, strict=False)))
    return {
        "agents": len({name for held in steps.values() for name in held}),
        "collisions": collide(steps, question),
        "position_error": worst,
        "samples": seen,
    }


def collide(steps: dict[int, Any], question: dict[str, Any]) -> list[list[Any]]:
    """Pairs whose footprints overlap and when first; two that stand do not collide."""
    found: dict[tuple[str, str], float] = {}
    discs, stands = set(question["discs"]), set(question["objects"])
    for k, held in sorted(steps.items()):
        shapes = {}
        for name, (x, y, heading, length, width) in held.items():
            if math.isnan(length):
                return []
            flat = box(-length / 2, -width / 2, length / 2, width / 2)
            turned = rotate(flat, heading, origin=(0, 0), use_radians=True)
            disc = Point(x, y).buffer(length / 2, quad_segs=32)
            shapes[name] = disc if name in discs else translate(turned, x, y)
        for a, b in combinations(sorted(shapes), 2):
            if {a, b} <= stands or (a, b) in found:
                continue
            (xa, ya, *_), (xb, yb, *_) = held[a], held[b]
            if math.hypot(xa - xb, ya - yb) < 30.0 and shapes[a].intersects(shapes[b]):
                found[a, b] = round(k * question["step"], 3)
    return [[*pair, t] for pair, t in found.items()]


def main() -> None:
    scenes = json.load(sys.stdin)["scenes"]
    package, read = next(found for end, found in READERS.items() if scenes[0]["file"].endswith(end))
    answers = [play(each, read) for each in scenes]
    json.dump({"version": f"with {package} {version(package)}", "scenes": answers}, sys.stdout)


if __name__ == "__main__":
    main()
