"""What every exporter keeps: the tracks, the clock, the frame, and text as text."""

from __future__ import annotations

import io
import json
import math
import pickle
import sys
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import scenewright
from exported_scenes import CONTACT, make_record, make_scene
from scenewright.cli.main import main
from scenewright.cli.verify import list_scene_files
from scenewright.dataset.batch.manifest import list_scenes, write_manifest
from scenewright.errors import InputError
from scenewright.graph.scene_files import encode_scene
from scenewright.graph.verify import load_tracks, verify_tracks
from scenewright.scene.objects import EncounterRecord, ObjectRecord
from scenewright.scene.record import SceneRecord
from scenewright.tools.formats import FORMATS, ExportedScene, prepare_scene, write_scene
from scenewright.tools.formats.exported_scene import wrap_angles
from scenewright.tools.formats.opendrive import Road, make_roads, write_opendrive
from scenewright.tools.formats.osi import load_osi_classes
from scenewright.tools.formats.road_users import ROAD_USERS, find_kind
from scenewright.tools.formats.scenarionet import load_arrays
from scenewright.tools.formats.womd import (
    compute_masked_crc,
    load_example_class,
    load_scenario_class,
    read_example,
    read_records,
    write_records,
)
from scenewright.tools.formats.womd import (
    read as read_womd,
)
from scenewright.tools.formats.wosac import CURRENT, ROLLOUTS, STEPS, load_messages
from scenewright.tools.track_io.external_tracks import read_external_recordings


def test_headings_lie_within_pi_and_velocities_are_of_the_positions() -> None:
    car, walker, late = make_scene().agents
    assert car.heading == pytest.approx(math.pi / 2)
    assert late.heading == pytest.approx(-math.pi + 0.01)
    assert car.velocity == pytest.approx(np.tile([0.0, 10.0], (41, 1)))
    assert walker.speed == pytest.approx(1.0)
    assert (late.first, late.times[0], late.last) == (20, 2.0, 80)


def test_the_intended_route_goes_on_past_a_collision() -> None:
    car = make_scene().agents[0]
    assert car.route_ahead[0] == pytest.approx(car.xy[-1])
    assert car.route_ahead[-1] == pytest.approx([4.95, 49.0], abs=0.01)
    longer = car.continue_until(80)
    assert longer.last == 80
    assert longer.xy[41:] == pytest.approx(
        np.stack([np.full(40, 4.95), -9.0 + np.arange(1, 41)], axis=1), abs=1e-6
    )
    assert longer.heading == pytest.approx(math.pi / 2)


def test_lights_have_a_colour_at_every_step() -> None:
    colours = make_scene().list_colours()["south:stop"]
    assert colours[:60] == ["green"] * 60
    assert colours[60:] == ["red"] * 41


READ_BACK = {
    "csv": "*.csv", "fcd": "*.xml", "openscenario": "*.xosc", "scenarionet": "sd_*.pkl",
    "commonroad": "*.xml", "womd": "*.tfrecord", "argoverse2": "*/*.parquet",
    "osi": "*.mcap",
}  # fmt: skip
"""Formats at 10 Hz that the verifier reads, and which of their files it reads."""


@pytest.mark.parametrize("name", READ_BACK)
def test_what_is_written_shows_the_verifier_the_same(name: str, tmp_path: Path) -> None:
    for package in FORMATS[name].packages:
        pytest.importorskip(package)
    form = "whole" if "whole" in FORMATS[name].forms else None
    scenewright.export(make_record(), name, tmp_path, form=form)
    (file,) = tmp_path.glob(READ_BACK[name])
    tracks = load_tracks(file)
    (event,) = [each for each in verify_tracks(tracks) if each.type == "collision"]
    struck = {tracks.subtypes[event.from_], tracks.subtypes[event.to]}
    assert (struck, event.kind) == ({"car", "pedestrian"}, "pedestrian_strike")
    assert event.time == pytest.approx(CONTACT, abs=0.1)
    found = {(user.shape.type, round(user.track.start, 3)): user for user in tracks.users}
    for agent in make_scene().agents:
        user = found[agent.type, agent.times[0]]
        assert user.track.xy == pytest.approx(agent.xy, abs=1e-4)
        assert wrap_angles(user.track.heading - agent.heading) == pytest.approx(0.0, abs=1e-5)
        assert user.shape.length == pytest.approx(agent.length)


def test_trajnet_frames_are_steps_with_a_sample_every_fourth() -> None:
    (text,) = write_scene(make_scene(), "trajnet").values()
    rows = [json.loads(line) for line in text.splitlines()]
    tracks = [row["track"] for row in rows if "track" in row]
    late = [(row["f"], row["x"]) for row in tracks if row["p"] == 3]
    assert late[:2] == [(20, 49.0), (24, pytest.approx(49.0 - 3.2))]
    # Both whose tracks the collision ends after 11 samples are to be predicted.
    scenes = [(row["scene"]["p"], row["scene"]["s"], row["scene"]["e"]) for row in rows[:2]]
    assert scenes == [(1, 0, 40), (2, 0, 40)]


def test_fcd_has_fronts_and_angles_clockwise_from_north() -> None:
    (text,) = write_scene(make_scene(), "fcd").values()
    first = ElementTree.fromstring(text)[0]
    assert [each.tag for each in first] == ["vehicle", "person"]
    later = ElementTree.fromstring(text)[30]
    assert [each.tag for each in later] == ["vehicle", "vehicle", "person"]  # as SUMO's schema
    assert float(first[0].attrib["y"]) == pytest.approx(-49.0 + 2.3)
    assert float(first[0].attrib["angle"]) == pytest.approx(0.0)
    assert float(first[1].attrib["angle"]) == pytest.approx(270.0)


@pytest.mark.parametrize("name", ["openscenario", "commonroad"])
def test_text_never_becomes_markup(name: str) -> None:
    for content in write_scene(make_scene(), name).values():
        root = ElementTree.fromstring(content)
        assert "b" not in {each.tag for each in root.iter()}
    texts = b"".join(write_scene(make_scene(), name).values())
    assert b"&lt;b&gt;car&lt;/b&gt; &amp; &quot;friends&quot;" in texts


def test_an_ego_left_to_the_user_is_not_replayed() -> None:
    scene = make_scene(ego="vehicle-2")
    replay, _ = map(ElementTree.fromstring, write_scene(scene, "openscenario").values())
    told = {each.get("entityRef") for each in replay.iterfind(".//ManeuverGroup/Actors/EntityRef")}
    assert told == {"vehicle-1", "pedestrian-1"}
    placed = {each.get("entityRef") for each in replay.iterfind(".//Init/Actions/Private")}
    assert placed == {"vehicle-1", "pedestrian-1", "vehicle-2"}
    (text,) = write_scene(scene, "commonroad").values()
    root = ElementTree.fromstring(text)
    assert [each.get("id") for each in root.iterfind("dynamicObstacle")] == ["1", "2"]
    # It enters at 2 s, which is time step 0 of its planning problem.
    assert root.findtext("planningProblem/initialState/position/point/x") == "49.0"
    assert root.findtext("dynamicObstacle/initialState/position/point/y") == "-29.0"


def _with_objects() -> ExportedScene:
    """The scene with a parked bus and a box, of which nothing moves."""
    places = {"height": "high", "x": 20.0, "y": -4.0, "heading": 0.0}
    bus = {"id": "object-1", "kind": "parked", "subtype": "bus", "length": 12.0, "width": 2.55}
    box = {"id": "object-2", "kind": "box", "length": 1.6, "width": 1.0}
    objects = tuple(ObjectRecord.model_validate(each | places) for each in (bus, box))
    record = make_record().model_copy(update={"objects": objects})
    return prepare_scene(record, make_scene().intersection_map)


def test_objects_stand_where_they_stand() -> None:
    scene = _with_objects()
    files = write_scene(scene, "openscenario")
    root = ElementTree.fromstring(files["hand_made_1.xosc"])
    assert root.find(".//MiscObject[@name='box']/BoundingBox/Dimensions").get("length") == "1.6"
    told = {each.get("entityRef") for each in root.iterfind(".//ManeuverGroup/Actors/EntityRef")}
    placed = {each.get("entityRef") for each in root.iterfind(".//Init/Actions/Private")}
    assert placed - told == {"object-1", "object-2"}
    (text,) = write_scene(scene, "commonroad").values()
    still = ElementTree.fromstring(text).findall("staticObstacle")
    assert [each.findtext("type") for each in still] == ["parkedVehicle", "unknown"]
    (record,) = read_records(*write_scene(scene, "womd").values(), name="it")
    tracks = load_scenario_class().FromString(record).tracks
    assert [track.object_type for track in tracks] == [1, 2, 1, 1, 4]
    assert {(s.center_x, s.velocity_x, s.valid) for s in tracks[4].states} == {(20.0, 0.0, True)}
    (content,) = write_scene(scene, "scenarionet").values()
    parked = load_arrays(content, name="it")["tracks"]
    assert [track["type"] for track in parked.values()][3:] == ["VEHICLE", "TRAFFIC_BARRIER"]


def test_openscenario_in_routes_waits_for_the_ego_where_it_must() -> None:
    record = make_record()
    late = record.agents[1].model_copy(
        update={
            "spawn_time": 1.0,
            "trajectory": record.agents[1].trajectory[10:],
            "heading": record.agents[1].heading[10:],
        }
    )
    agents = (record.agents[0], late, record.agents[2])
    scene = prepare_scene(
        record.model_copy(update={"agents": agents}), make_scene().intersection_map
    )
    files = write_scene(scene, "openscenario", form="reactive")
    root = ElementTree.fromstring(files["hand_made_1.xosc"])
    started = root.find(
        ".//Event[@name='drive pedestrian-1']//ReachPositionCondition//WorldPosition"
    )
    assert started is not None
    # It is within 2 m of that place 0.2 s before it gets there.
    condition = root.find(".//Event[@name='drive pedestrian-1']/StartTrigger//Condition")
    assert condition.get("delay") == "0.2"
    # The place is that of the ego's axle.
    assert started.get("x") == "4.95"
    assert float(started.get("y", 0)) == pytest.approx(-39.0 - 0.3 * 4.6)


def test_openscenario_in_routes_has_no_tracks_to_check(tmp_path: Path) -> None:
    (file, _) = sorted(
        scenewright.export(make_record(), "openscenario", tmp_path, form="reactive"), reverse=True
    )
    with pytest.raises(InputError, match="has no times"):
        load_tracks(file)


def test_openscenario_in_routes_names_lanes_that_lead_into_one_another() -> None:
    files = write_scene(make_scene(), "openscenario", form="reactive")
    root = ElementTree.fromstring(files["hand_made_1.xosc"])
    names = {
        road.get("id"): road.get("name")
        for road in ElementTree.fromstring(files["hand_made_1.xodr"]).iterfind("road")
    }
    routes = {
        action.get("name"): [names[each.get("roadId")] for each in action.iter("LanePosition")]
        for action in root.iter("Route")
    }
    assert routes == {"route vehicle-2": ["east:approach", "east>west", "west:exit"]}
    # Who takes part in an event keeps to its own line, or the two could miss one another.
    lines = {each.get("name"): each for each in root.iter("Trajectory")}
    assert list(lines) == ["way vehicle-1", "way pedestrian-1"]
    assert not [each for each in root.iter("Vertex") if each.get("time")]
    stops = root.find(".//Event[@name='stop vehicle-1']")
    assert stops.find(".//CollisionCondition/EntityRef").get("entityRef") == "pedestrian-1"
    assert stops.find(".//AbsoluteTargetSpeed").get("value") == "0.0"
    assert root.find(".//Event[@name='stop vehicle-2']") is None
    # Who has come to the end of its way is taken out, so that nobody piles up there.
    gone = [
        each.get("name")
        for each in root.iter("Event")
        if each.find(".//DeleteEntityAction") is not None
    ]
    assert sorted(gone) == ["leave pedestrian-1", "leave vehicle-1", "leave vehicle-2"]


@pytest.mark.parametrize("left_hand", [False, True])
def test_opendrive_lanes_end_where_the_next_begin(left_hand: bool) -> None:
    """Both edges do, although the lanelets' own are up to 10 cm apart where the width changes."""
    plan = make_scene().intersection_map
    if left_hand:
        mirrored = [
            each.model_copy(update={
                name: tuple((-x, y) for x, y in getattr(each, other))
                for name, other in (("left", "right"), ("right", "left"))
            })
            for each in plan.lanelets
        ]  # fmt: skip
        plan = plan.model_copy(update={"lanelets": tuple(mirrored), "left_hand_traffic": True})
    roads = make_roads(plan)
    joints = [(road, roads[name]) for road in roads.values() for name in road.lanelet.successors]
    assert len(joints) == 28
    for before, after in joints:
        assert _find_edges(before, -1) == pytest.approx(_find_edges(after, 0), abs=1e-9)
    root = ElementTree.fromstring(write_opendrive(plan))
    lights = [each.get("id") for each in root.iterfind("road/signals/signal")]
    assert sorted(lights, key=int) == [str(n) for n in range(1, 9)]


def _find_edges(road: Road, k: int) -> np.ndarray:
    """[2, 2] where the edges of the lane lie at a point of the road."""
    left = np.array([-road.tangents[k][1], road.tangents[k][0]])
    return np.stack([road.line[k], road.line[k] + road.lane * road.width[k] * left])


def test_opendrive_pieces_are_as_long_as_they_say_and_no_width_is_said_twice() -> None:
    root = ElementTree.fromstring(write_opendrive(make_scene().intersection_map))
    p = np.linspace(0.0, 1.0, 2001)
    for road in root.iterfind("road"):
        pieces = list(road.iterfind("planView/geometry"))
        length, (*_, last) = float(road.get("length", 0)), pieces
        assert float(last.get("s", 0)) + float(last.get("length", 0)) == pytest.approx(length)
        for piece in pieces:
            curve = piece.find("paramPoly3")
            if curve is not None:
                u, v = (
                    sum(float(curve.attrib[f"{n}{axis}"]) * p**k for k, n in enumerate("abcd"))
                    for axis in "UV"
                )
                drawn = np.hypot(np.diff(u), np.diff(v)).sum()
                assert float(piece.get("length", 0)) == pytest.approx(drawn, abs=1e-4)
        slopes = [float(each.get("b", 0)) for each in road.iter("width")]
        assert all(a != pytest.approx(b, abs=1e-7) for a, b in pairwise(slopes))


def test_scenarionet_begins_at_the_ego_which_goes_on_after_a_collision() -> None:
    (content,) = write_scene(make_scene(), "scenarionet").values()
    scenario = load_arrays(content, name="it")
    ego = scenario["tracks"]["1"]["state"]
    assert ego["valid"][:98].all()
    assert ego["position"][97, :2] == pytest.approx([4.95, 49.0], abs=2.0)
    assert scenario["metadata"]["sdc_continues_from"] == 41
    light = scenario["dynamic_map_states"]["south:approach:inner"]["state"]["object_state"]
    assert light[59:61] == ["TRAFFIC_LIGHT_GREEN", "TRAFFIC_LIGHT_RED"]
    (later,) = write_scene(make_scene(ego="vehicle-2"), "scenarionet").values()
    scenario = load_arrays(later, name="it")
    assert scenario["metadata"]["time_offset"] == 2.0
    assert scenario["tracks"]["3"]["state"]["position"][0, 0] == pytest.approx(49.0)


def test_a_tf_example_holds_the_window_in_tensors_of_the_datasets_shapes(tmp_path: Path) -> None:
    paths = [tmp_path / form for form in ("window", "example")]
    for path in paths:
        scenewright.export(make_record(), "womd", path, form=path.name)
    whole, flat = (load_tracks(next(path.glob("*.tfrecord"))).users for path in paths)
    for one, two in zip(whole, flat, strict=True):
        assert two.shape == one.shape
        assert two.track.times == pytest.approx(one.track.times)
        assert two.track.xy == pytest.approx(one.track.xy, abs=1e-4)
        assert wrap_angles(two.track.heading - one.track.heading) == pytest.approx(0.0, abs=1e-5)
    (file,) = paths[1].glob("*.tfexample.tfrecord")
    (record,) = read_records(file.read_bytes(), name="it")
    tensors = read_example(record)
    assert tensors is not None
    sizes = {"past": 10, "current": 1, "future": 80}
    for part, steps in sizes.items():
        assert len(tensors[f"state/{part}/x"]) == 128 * steps
        assert len(tensors[f"traffic_light_state/{part}/state"]) == 16 * steps
    assert tensors["state/is_sdc"].tolist() == [1] + [0] * 127
    points = tensors["roadgraph_samples/xyz"].reshape(30_000, 3)[:, :2]
    valid = tensors["roadgraph_samples/valid"] > 0
    assert set(tensors["roadgraph_samples/type"][valid]) == {2, 15, 18}
    same = np.diff(tensors["roadgraph_samples/id"][valid]) == 0
    assert np.hypot(*np.diff(points[valid], axis=0)[same].T).max() < 1.0
    with pytest.raises(InputError, match="state/past/x"):
        read_womd(write_records([example_without(record, "state/past/x")]), name="it")


def example_without(record: bytes, name: str) -> bytes:
    example = load_example_class().FromString(record)
    kept = [each for each in example.features.feature if each.key != name]
    return bytes(load_example_class()(features={"feature": kept}).SerializeToString())


@pytest.mark.parametrize(("ego", "late"), [(None, 0), ("vehicle-2", 0), (None, 80), (None, 300)])
def test_the_usual_womd_record_has_91_steps_and_an_ego_to_predict(
    ego: str | None, late: int
) -> None:
    (content,) = write_scene(_delay(late, ego), "womd").values()
    (record,) = read_records(content, name="it")
    scenario = load_scenario_class().FromString(record)
    now = scenario.current_time_index
    assert (len(scenario.timestamps_seconds), now) == (91, 10)
    assert {len(track.states) for track in scenario.tracks} == {91}
    driven = scenario.tracks[scenario.sdc_track_index]
    assert driven.id == (3 if ego else 1)
    assert driven.states[now].valid
    predicted = [scenario.tracks[each.track_index] for each in scenario.tracks_to_predict]
    assert driven.id in {track.id for track in predicted}
    assert all(track.states[now].valid for track in predicted)
    car = next(track for track in scenario.tracks if track.id == 1)
    last = max(k for k, state in enumerate(car.states) if state.valid)
    assert last > now  # what happens is in the future


def test_a_whole_womd_record_is_now_when_its_ego_is_there() -> None:
    (content,) = write_scene(_delay(80), "womd", form="whole").values()
    scenario = load_scenario_class().FromString(*read_records(content, name="it"))
    assert scenario.current_time_index == 80
    assert scenario.tracks[0].states[80].valid
    assert [each.track_index for each in scenario.tracks_to_predict] == [0, 1]


@pytest.mark.parametrize(("ego", "late"), [(None, 0), ("vehicle-2", 0), (None, 80), (None, 300)])
def test_the_usual_argoverse_scenario_has_110_steps_an_av_and_a_focal_track(
    ego: str | None, late: int
) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    content = next(iter(write_scene(_delay(late, ego), "argoverse2").values()))
    rows = parquet.read_table(io.BytesIO(content)).to_pylist()
    assert {row["num_timestamps"] for row in rows} == {110}
    assert max(row["timestep"] for row in rows) < 110
    (focal,) = {row["focal_track_id"] for row in rows}
    assert focal == ("AV" if ego else "2")  # whom the ego hits; vehicle-2 meets nobody
    assert {row["track_id"] for row in rows if row["object_category"] == 3} == {focal}
    last = {row["track_id"]: row["position_y"] for row in rows if row["timestep"] == 49}
    assert {"AV", focal} <= last.keys()
    assert [row["observed"] for row in rows] == [row["timestep"] < 50 for row in rows]


def _delay(steps: int, ego: str | None = None) -> ExportedScene:
    """The scene with everything so much later."""
    record = make_record()
    by = steps / 10
    agents = [a.model_copy(update={"spawn_time": a.spawn_time + by}) for a in record.agents]
    events = [e.model_copy(update={"time": (e.time or 0.0) + by}) for e in record.events]
    meta = record.meta.model_copy(update={"duration": record.meta.duration + by})
    later = record.model_copy(
        update={"meta": meta, "agents": tuple(agents), "events": tuple(events), "signals": ()}
    )
    return prepare_scene(later, make_scene().intersection_map, ego=ego)


def test_an_ego_that_nobody_named_and_that_is_not_there_gives_way_to_one_that_is() -> None:
    record = make_record()
    early = record.agents[2].model_copy(update={"id": 0, "role": "foreground", "spawn_time": 0.0})
    agents = (early, *record.agents[:2])
    scene = prepare_scene(
        record.model_copy(update={"agents": agents}), make_scene().intersection_map
    )
    assert scene.ego.id == 0
    assert scene.cut_window(91, now=10, event=60).ego.id == 0  # it is there at 4 s
    gone = replace(scene.agents[0], xy=scene.agents[0].xy[:20])
    left = replace(scene, agents=(gone, *scene.agents[1:]), ego=gone)
    assert left.cut_window(91, now=10, event=60).ego.id == 1
    named = replace(left, ego_named=True).cut_window(91, now=10, event=60)
    assert named.ego.id == 0
    assert named.ego.first <= 10 <= named.ego.last


def test_a_door_is_there_from_when_it_opens(tmp_path: Path) -> None:
    door = {"id": "object-1-door", "kind": "door", "length": 0.95, "width": 0.12, "since": 2.45,
            "height": "high", "x": 20.0, "y": -4.0, "heading": 0.0}  # fmt: skip
    objects = (ObjectRecord.model_validate(door),)
    record = make_record().model_copy(update={"objects": objects})
    scene = prepare_scene(record, make_scene().intersection_map)
    (door,) = scene.objects
    assert (door.first, door.last) == (25, 100)
    root = ElementTree.fromstring(write_scene(scene, "openscenario")["hand_made_1.xosc"])
    placed = {each.get("entityRef") for each in root.iterfind(".//Init/Actions/Private")}
    assert "object-1-door" not in placed
    enters = root.find(".//Event[@name='enter object-1-door']")
    assert enters.find(".//AddEntityAction/Position") is not None
    assert enters.find(".//SimulationTimeCondition").get("value") == "2.5"
    (text,) = write_scene(scene, "commonroad").values()
    obstacle = ElementTree.fromstring(text).find("dynamicObstacle[@id='4']")
    assert obstacle.findtext("initialState/time/exact") == "25"
    assert len(obstacle.findall("trajectory/state")) == 75
    (content,) = write_scene(scene, "womd", form="whole").values()
    scenario = load_scenario_class().FromString(*read_records(content, name="it"))
    assert [s.valid for s in scenario.tracks[3].states] == [k >= 25 for k in range(101)]
    (content,) = write_scene(scene, "scenarionet").values()
    valid = load_arrays(content, name="it")["tracks"]["4"]["state"]["valid"]
    assert valid.tolist() == [k >= 25 for k in range(101)]
    truths = _read_truths(scene)
    assert [len(each.stationary_object) for each in truths] == [0] * 25 + [1] * 76


def _read_mcap(scene: ExportedScene, name: str) -> list[tuple[str, int, bytes]]:
    """Topic, time [ns] and content of every message of the scene in a format."""
    reader = pytest.importorskip("mcap.reader")
    (content,) = write_scene(scene, name).values()
    found = reader.make_reader(io.BytesIO(content), validate_crcs=True).iter_messages()
    return [(channel.topic, message.log_time, message.data) for _, channel, message in found]


def _read_truths(scene: ExportedScene) -> list[Any]:
    truth = load_osi_classes()["GroundTruth"]
    found = _read_mcap(scene, "osi")
    return [truth.FromString(content) for topic, _, content in found if topic == "ground_truth"]


def test_osi_names_roles_and_a_parked_truck_as_what_they_are() -> None:
    record = make_record()
    kinds = ("fire_engine", None, "bus")
    agents = tuple(
        a.model_copy(update={"subtype": kind}) for a, kind in zip(record.agents, kinds, strict=True)
    )
    places = {"height": "high", "x": 20.0, "y": -4.0, "heading": 0.0}
    parked = {"id": "object-1", "kind": "parked", "subtype": "truck", "length": 8.5, "width": 2.5}
    objects = (ObjectRecord.model_validate(parked | places),)
    changed = record.model_copy(update={"agents": agents, "objects": objects})
    moving = _read_truths(prepare_scene(changed, make_scene().intersection_map))[30].moving_object
    about = {m.id.value: (m.vehicle_classification.type, m.vehicle_classification.role)
             for m in moving if m.HasField("vehicle_classification")}  # fmt: skip
    # HEAVY_TRUCK in ROLE_FIRE, BUS in ROLE_PUBLIC_TRANSPORT, HEAVY_TRUCK in ROLE_CIVIL.
    assert about == {1: (7, 4), 3: (12, 6), 4: (7, 2)}
    assert {m.base.velocity.x for m in moving if m.id.value == 4} == {0.0}
    car = _read_truths(make_scene())[0].moving_object[0].vehicle_classification
    assert (car.type, car.role) == (4, 2)


def test_tfrecords_have_the_checksum_of_the_standard() -> None:
    """0xE3069283 is the check value of CRC-32C; a record that was changed is refused."""
    crc = 0xE3069283
    masked = ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF
    assert compute_masked_crc(b"123456789") == masked
    data = write_records([b"123456789", b""])
    assert list(read_records(data, name="it")) == [b"123456789", b""]
    with pytest.raises(InputError, match="record 0: its checksum"):
        list(read_records(data.replace(b"5", b"6"), name="it"))
    with pytest.raises(InputError, match="record 1: the file is cut off"):
        list(read_records(data[:-1], name="it"))


def test_a_missing_package_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mcap", None)
    with pytest.raises(InputError, match=r"^osi needs mcap: pip install .*exports"):
        write_scene(make_scene(), "osi")


def test_foxglove_boxes_are_as_large_as_the_agents() -> None:
    found = _read_mcap(make_scene(), "foxglove")
    topics = Counter(topic for topic, _, _ in found)
    assert topics == {"/map": 1, "/agents": 101, "/events": 1, "/lights": 2}
    lights = [
        (time, *json.loads(content)["entities"]) for topic, time, content in found
        if topic == "/lights"
    ]  # fmt: skip
    assert [(time, each["id"]) for time, each in lights] == [
        (0, "south:stop"), (6 * 10**9 , "south:stop"),
    ]  # fmt: skip
    green, red = (each["spheres"][0]["color"] for _, each in lights)
    assert green["g"] > green["r"]
    assert red["r"] > red["g"]
    boxes = {
        time: json.loads(content)["entities"] for topic, time, content in found
        if topic == "/agents"
    }  # fmt: skip
    (walker,) = [each for each in boxes[10**9] if each["id"] == "pedestrian-1"]
    assert walker["cubes"][0]["pose"]["position"]["x"] == pytest.approx(8.0)
    assert [each["id"] for each in boxes[8 * 10**9]] == ["vehicle-2"]


BAD = {
    "bomb.xosc": (b"<!DOCTYPE x [<!ENTITY a 'b'>]><OpenSCENARIO/>", "document type"),
    "cut.xosc": (b"<OpenSCENARIO>", "line 1: not well-formed"),
    "routes.xosc": (b"<OpenSCENARIO/>", "no trajectories"),
    "sets.xml": (
        b"<commonRoad timeStepSize='0.1'><dynamicObstacle id='1'><type>car</type>"
        b"<occupancySet/></dynamicObstacle></commonRoad>",
        "obstacle 1: it is predicted by sets",
    ),
    "bomb.xml": (b"<!DOCTYPE x [<!ENTITY a 'b'>]><fcd-export/>", "document type"),
    "short.pkl": (b"\x80\x04", "no pickle of plain arrays"),
    "short.tfrecord": (b"123", "record 0: no TFRecord"),
    "example.tfrecord": (write_records([b"\x0a\x00"]), "no tf.Example of one"),
    "short.parquet": (b"PAR1", "no Parquet file"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_file_that_cannot_be_read_is_refused_in_one_line(name: str) -> None:
    content, words = BAD[name]
    with pytest.raises(InputError, match=words) as refused:
        read_external_recordings(content, name=name)
    assert "\n" not in str(refused.value)


class _Evil:
    def __reduce__(self) -> Any:
        return eval, ("1 + 1",)


def test_a_pickle_that_asks_for_code_is_refused() -> None:
    with pytest.raises(InputError, match=r"no pickle of plain arrays.*builtins\.eval"):
        load_arrays(pickle.dumps({"tracks": _Evil()}), name="evil.pkl")
    with pytest.raises(InputError, match="no ScenarioNet scenario"):
        read_external_recordings(pickle.dumps({"tracks": {"1": {}}}), name="odd.pkl")


@pytest.mark.parametrize("name", FORMATS)
def test_the_same_scene_gives_the_same_bytes(name: str) -> None:
    for package in FORMATS[name].packages:
        pytest.importorskip(package)
    assert write_scene(make_scene(), name) == write_scene(make_scene(), name)


def test_every_kind_of_road_user_has_words() -> None:
    assert find_kind("vehicle", None) == "vehicle"
    assert {"car", "truck", "bus", "motorcycle", "pedestrian", "cyclist", "scooter"} <= set(
        ROAD_USERS
    )
    with pytest.raises(InputError, match="hovercraft"):
        find_kind("vehicle", "hovercraft")


@pytest.mark.parametrize(
    ("to", "ego", "words"),
    [("dvd", None, "there are: csv"), ("csv", "vehicle-9", "no agent 'vehicle-9'")],
)
def test_what_cannot_be_exported_leaves_nothing(
    to: str, ego: str | None, words: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=words):
        scenewright.export([make_record()], to, tmp_path / "out", ego=ego)
    assert list(tmp_path.iterdir()) == []


def test_the_command_says_what_it_wrote(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scene.json").write_bytes(encode_scene(make_record()))
    out = tmp_path / "out"
    words = ["export", str(tmp_path), "--to", "openscenario", "--out", str(out), "--json"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["files"] == [str(out / f"hand_made_1{end}") for end in (".xosc", ".xodr")]
    assert sorted(map(str, out.iterdir())) == sorted(told["files"])
    assert main([*words, "--form", "opera"]) == 2
    assert "openscenario has no form 'opera'" in capsys.readouterr().err


def test_a_dataset_lists_its_scenes_and_no_others(tmp_path: Path) -> None:
    about: dict[str, Any] = {"rows": {}, "tables": {}}
    files = ("a/scene.json", "a/proof.json", "README.md")
    write_manifest(tmp_path, about, [(name, "0") for name in files])
    assert list_scenes(tmp_path) == [tmp_path / "a"]
    write_manifest(tmp_path, about, [("../b/scene.json", "0")])
    with pytest.raises(InputError, match="outside"):
        list_scenes(tmp_path)


def test_scenes_of_one_id_get_files_of_their_own(tmp_path: Path) -> None:
    files = scenewright.export([make_record(), make_record()], "csv", tmp_path)
    assert [file.name for file in files] == ["hand_made_1.csv", "hand_made_1-2.csv"]


def test_a_scene_without_agents_is_refused() -> None:
    empty = make_record().model_copy(update={"agents": ()})
    with pytest.raises(InputError, match="no agents"):
        prepare_scene(empty, make_scene().intersection_map)


def test_lanes_know_which_lanes_are_beside_them() -> None:
    (text,) = write_scene(make_scene(), "commonroad").values()
    root = ElementTree.fromstring(text)
    names = [each.id for each in make_scene().intersection_map.lanelets]
    lanelets = dict(zip(names, root.iterfind("lanelet"), strict=False))
    numbers = {each.get("id"): name for name, each in lanelets.items()}
    beside = {
        name: [
            (each.tag, numbers[each.get("ref", "")], each.get("drivingDir"))
            for each in lanelet
            if each.tag.startswith("adjacent")
        ]
        for name, lanelet in lanelets.items()
    }
    assert beside["south:approach:inner"] == [
        ("adjacentLeft", "south:exit:inner", "opposite"),
        ("adjacentRight", "south:approach:outer", "same"),
    ]
    assert beside["south>north:outer"] == [("adjacentLeft", "south>north:inner", "same")]
    assert beside["south>east:outer"] == []
    # The schema takes no offset of 0 in the cycle of a light.
    assert root.find("trafficLight/cycle") is not None
    assert root.find("trafficLight/cycle/timeOffset") is None
    pytest.importorskip("pyarrow")
    files = write_scene(make_scene(), "argoverse2")
    chart = json.loads(next(v for k, v in files.items() if k.endswith(".json")))
    lanes = chart["lane_segments"]
    pairs = {(each["id"], each["right_neighbor_id"]) for each in lanes.values()} - {
        (each["id"], None) for each in lanes.values()
    }
    assert len(pairs) == 6  # two lanes each on two approaches, two exits, two ways straight on
    assert {(lanes[str(b)]["left_neighbor_id"], b) for _, b in pairs} == pairs


def test_foxglove_says_what_is_in_its_messages() -> None:
    reader = pytest.importorskip("mcap.reader")
    (content,) = write_scene(make_scene(), "foxglove").values()
    found = list(reader.make_reader(io.BytesIO(content)).iter_messages())
    assert {schema.name for schema, _, _ in found} == {"foxglove.SceneUpdate", "foxglove.Log"}
    for schema, _, message in found:
        _check_shape(json.loads(message.data), json.loads(schema.data))


def _check_shape(value: Any, schema: dict[str, Any]) -> None:
    """That a value has all and only the fields of a JSON schema, and their types."""
    types = {"number": (int, float), "integer": int, "string": str, "boolean": bool,
             "array": list, "object": dict}  # fmt: skip
    assert isinstance(value, types[schema["type"]])
    if schema["type"] == "object":
        assert value.keys() == schema["properties"].keys()
        for name, part in schema["properties"].items():
            _check_shape(value[name], part)
    for each in value if schema["type"] == "array" else ():
        _check_shape(each, schema["items"])


@pytest.mark.parametrize("name", READ_BACK)
def test_verify_finds_the_tracks_in_an_exported_folder(name: str, tmp_path: Path) -> None:
    for package in FORMATS[name].packages:
        pytest.importorskip(package)
    scenewright.export(make_record(), name, tmp_path)
    assert list_scene_files(str(tmp_path)) == list(tmp_path.glob(READ_BACK[name]))


def _start_later(record: SceneRecord, skipped: dict[int, int]) -> ExportedScene:
    """The scene with agents at time 0 where they were some samples later."""
    agents = tuple(
        each.model_copy(update={
            "spawn_time": 0.0, "trajectory": each.trajectory[skipped[each.id]:],
            "heading": each.heading[skipped[each.id]:],
        }) if each.id in skipped else each
        for each in record.agents
    )  # fmt: skip
    return prepare_scene(
        record.model_copy(update={"agents": agents}), make_scene().intersection_map
    )


def test_openscenario_in_routes_puts_an_agent_on_its_lane_where_lanes_overlap() -> None:
    scene = _start_later(make_record(), {3: 50})
    files = write_scene(scene, "openscenario", form="reactive")
    root = ElementTree.fromstring(files["hand_made_1.xosc"])
    names = {
        each.get("id"): each.get("name")
        for each in ElementTree.fromstring(files["hand_made_1.xodr"]).iterfind("road")
    }
    truck = root.find(".//Private[@entityRef='vehicle-2']//TeleportAction/Position/LanePosition")
    assert truck is not None
    assert (names[truck.get("roadId")], truck.get("laneId")) == ("east>west", "-1")
    # Its middle is at x = 9, its axle 0.3 of 8.5 m behind that, the junction begins at 15.
    assert float(truck.get("s", 0)) == pytest.approx(15.0 - 9.0 - 2.55, abs=0.01)
    assert float(truck.get("offset", 9)) == pytest.approx(0.0, abs=0.05)
    assert float(truck.find("Orientation").get("h", 0)) == pytest.approx(0.01, abs=1e-3)
    # The axle of who enters at the edge of the map is not on its lane yet.
    car = root.find(".//Private[@entityRef='vehicle-1']//TeleportAction/Position/WorldPosition")
    assert float(car.get("y", 0)) == pytest.approx(-49.0 - 0.3 * 4.6)
    replay = ElementTree.fromstring(write_scene(scene, "openscenario")["hand_made_1.xosc"])
    assert not list(replay.iter("LanePosition"))


def test_rollouts_that_begin_alike_are_a_submission_of_the_challenge(tmp_path: Path) -> None:
    record = make_record()
    car = record.agents[0]
    rollouts = []
    for n in range(ROLLOUTS):  # the car goes 1 cm further each time after the eleventh step
        line = [(x, y + 0.01 * n * (k > CURRENT)) for k, (x, y) in enumerate(car.trajectory)]
        agent = car.model_copy(update={"trajectory": tuple(line)})
        rollouts.append(record.model_copy(update={"agents": (agent, *record.agents[1:])}))
    *_, file = scenewright.export(rollouts, "wosac", tmp_path)
    assert file.name == "submission.binproto"
    messages = load_messages()
    submission = messages["SimAgentsChallengeSubmission"].FromString(file.read_bytes())
    (scenario,) = submission.scenario_rollouts
    assert (scenario.scenario_id, submission.submission_type) == ("hand_made_1", 1)
    # What the challenge's own check asks for: 32 times 80 steps of who is there at the eleventh.
    there = [a.id for a in make_scene().agents if a.first <= CURRENT <= a.last]
    assert [len(joint.simulated_trajectories) for joint in scenario.joint_scenes] == [2] * 32
    for n, joint in enumerate(scenario.joint_scenes):
        assert [each.object_id for each in joint.simulated_trajectories] == there
        for each in joint.simulated_trajectories:
            for name in ("center_x", "center_y", "center_z", "heading"):
                assert len(getattr(each, name)) == STEPS
        (x, y), first = car.trajectory[CURRENT + 1], joint.simulated_trajectories[0]
        assert (first.center_x[0], first.center_y[0]) == pytest.approx((x, y + 0.01 * n), abs=1e-4)
        assert first.center_y[-1] > first.center_y[40]  # beyond the collision, along its route
    one = tmp_path / "hand_made_1.joint_scene.binproto"
    assert messages["JointScene"].FromString(one.read_bytes()) == scenario.joint_scenes[0]
    with pytest.raises(InputError, match="has 31 rollouts"):
        scenewright.export(rollouts[1:], "wosac", tmp_path / "fewer")
    assert len(scenewright.export(rollouts[0], "wosac", tmp_path / "one")) == 1


RANGES = {
    "range": ("5 .. 15 m/s", "UniformDistribution/Range", {"lowerLimit": 0.5, "upperLimit": 1.5}),
    "normal": ("normal(36, 7.2) km/h", "NormalDistribution",
               {"expectedValue": 1.0, "variance": 0.04}),
    "lognormal": ("lognormal(10, 0.2) m/s", "Histogram/Bin[10]/Range", {"upperLimit": 1.0}),
    "list": ([5, 12], "ProbabilityDistributionSet/Element[2]", {"value": 1.2, "weight": 1.0}),
}  # fmt: skip


@pytest.mark.parametrize("kind", RANGES)
def test_ranges_of_a_plan_are_factors_of_speeds_that_are_declared(
    tmp_path: Path, kind: str
) -> None:
    value, path, wanted = RANGES[kind]
    speeds = [{"kind": "speed", "agent": name, "value": value} for name in ("vehicle-1",)]
    plan = {"agents": [{"id": "vehicle-1", "subtype": ["car", "van"]}], "measures": speeds}
    files = scenewright.export(make_record(), "openscenario", tmp_path, form="reactive", plan=plan)
    scenario, ranges = (ElementTree.parse(f).getroot() for f in files if f.suffix == ".xosc")
    assert ranges.find(".//ScenarioFile").get("filepath") == "hand_made_1.xosc"
    declared = {each.get("name") for each in scenario.iter("ParameterDeclaration")}
    (drawn,) = ranges.iter("StochasticDistribution")
    assert drawn.get("parameterName") == "speed_vehicle_1"
    assert drawn.get("parameterName") in declared
    found = drawn.find(path)
    assert {name: float(found.get(name)) for name in wanted} == pytest.approx(wanted)


@pytest.mark.parametrize(
    ("form", "plan", "told"),
    [("replay", {"agents": []}, "reactive"), ("reactive", {"agents": []}, "leaves no speed open"),
     ("reactive", {"agents": 3}, "plan, agents")],
)  # fmt: skip
def test_ranges_that_no_parameter_holds_are_refused(
    tmp_path: Path, form: str, plan: dict[str, object], told: str
) -> None:
    with pytest.raises(InputError, match=told):
        scenewright.export(make_record(), "openscenario", tmp_path, form=form, plan=plan)
    assert list(tmp_path.iterdir()) == []


def test_openscenario_in_routes_declares_what_can_vary() -> None:
    record = make_record()
    late = record.agents[2].model_copy(update={"role": "foreground"})
    changed = record.model_copy(update={"agents": (*record.agents[:2], late)})
    scene = prepare_scene(changed, make_scene().intersection_map)
    files = write_scene(scene, "openscenario", form="reactive")
    root = ElementTree.fromstring(files["hand_made_1.xosc"])
    declared = {
        each.get("name"): each.get("value")
        for each in root.iterfind("ParameterDeclarations/ParameterDeclaration")
    }
    assert declared == {
        "speed_vehicle_1": "1.0", "speed_pedestrian_1": "1.0", "speed_vehicle_2": "1.0",
        "start_vehicle_2": "2.0",
    }  # fmt: skip
    entries = list(root.find(".//Event[@name='speed vehicle-1']").iter("SpeedProfileEntry"))
    assert {each.get("speed") for each in entries} == {"${10.0 * $speed_vehicle_1}"}
    assert sum(float(each.get("time", 0)) for each in entries) == pytest.approx(4.0)
    enters = root.find(".//Event[@name='enter vehicle-2']//SimulationTimeCondition")
    assert enters.get("value") == "$start_vehicle_2"
    replay = ElementTree.fromstring(write_scene(scene, "openscenario")["hand_made_1.xosc"])
    assert list(replay.find("ParameterDeclarations")) == []


def test_who_drives_into_a_door_has_collided_with_it() -> None:
    places = {"height": "high", "x": 20.0, "y": -4.0, "heading": 0.0}
    car = {"id": "object-1", "kind": "parked", "length": 4.6, "width": 1.85}
    door = {"id": "object-1-door", "kind": "door", "since": 6.0, "length": 0.9, "width": 0.1}
    objects = tuple(ObjectRecord.model_validate(each | places) for each in (car, door))
    hit = EncounterRecord(agent=3, object="object-1", how="doored")
    record = make_record().model_copy(update={"objects": objects, "encounters": (hit,)})
    scene = prepare_scene(record, make_scene().intersection_map)
    _, event = scene.events
    assert (event.type, event.from_, event.to, event.time) == ("collision", 3, 5, 8.0)
    root = ElementTree.fromstring(write_scene(scene, "openscenario")["hand_made_1.xosc"])
    # It stays where it is, and the door comes late, with a track as those have who come late.
    assert root.find(".//Event[@name='leave vehicle-2']") is None
    opens = root.find(".//Event[@name='follow object-1-door']//Vertex")
    assert float(opens.get("time", 0)) == 6.0
    assert scene.list_event_agents()[-2:] == [3, 5]
