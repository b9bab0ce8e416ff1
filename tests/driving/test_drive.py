"""Drives: motion, contacts, who is at fault, what a policy may do wrong, what is written."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from exported_scenes import make_agent, make_line, make_record
from scenewright.cli.main import main
from scenewright.driving.ego_motion import EgoState, move_ego
from scenewright.driving.observation import SHAPES, Observer
from scenewright.driving.policies import (
    BUILT_IN,
    ConstantSpeedPolicy,
    ReplayPolicy,
    RuleBasedPolicy,
)
from scenewright.driving.report import report_drive
from scenewright.driving.run_drive import run_drive
from scenewright.driving.save import save_drive
from scenewright.driving.scenario import Scenario, build_scenario
from scenewright.driving.scores import ScoreInputs, measure_comfort, score_epdms, score_nuplan
from scenewright.driving.world import Replay, find_overlaps, start_world
from scenewright.errors import InputError
from scenewright.graph.scene_files import load_scene
from scenewright.graph.verify import verify
from scenewright.intersections import load_map
from scenewright.scene.record import SceneRecord


@pytest.fixture(scope="module")
def strike() -> Scenario:
    """vehicle-1 comes at 10 m/s and strikes pedestrian-1 at 4 s."""
    return build_scenario(make_record(), load_map("amsterdam_120"))


class Braking:
    mode = "route"

    def reset(self, scenario: Scenario, seed: int) -> None:
        pass

    def act(self, observation: dict[str, Any]) -> np.ndarray:  # noqa: ARG002
        return np.array([-5.0])


class Slamming(Braking):
    def act(self, observation: dict[str, Any]) -> np.ndarray:  # noqa: ARG002
        return np.array([-10.0])


class Unfit(Braking):
    def act(self, observation: dict[str, Any]) -> np.ndarray:  # noqa: ARG002
        return np.array([math.nan])


def test_the_recorded_drive_is_driven_again(strike: Scenario) -> None:
    drive = run_drive(strike, ReplayPolicy())
    states = [(each.x, each.y) for each in drive.world.history]
    assert drive.world.end == "collision"
    assert drive.scenario.names[drive.world.hit] == "pedestrian-1"
    recorded = strike.xy[strike.ego, : len(states)]
    assert np.abs(np.array(states) - recorded).max() < 0.01


def test_braking_misses_the_pedestrian(strike: Scenario) -> None:
    drive = run_drive(strike, Braking())
    # 10 m/s at 5 m/s^2: 10 m, less half a step of speed lost at once.
    assert drive.world.end == "over"
    assert drive.world.ego.progress == pytest.approx(10.0 - 0.5, abs=0.02)


def test_who_would_have_been_struck_goes_on_along_its_route() -> None:
    plain = make_record().to_json()
    plain["agents"][1]["waypoints"] = [[9.0 - 1.5 * k, -6.5] for k in range(10)]
    record = type(make_record()).model_validate(plain)
    scenario = build_scenario(record, load_map("amsterdam_120"))
    walker = scenario.names.index("pedestrian-1")
    assert scenario.present[walker, 80]
    assert scenario.xy[walker, 80] == pytest.approx((0.2, -6.5), abs=0.1)


def test_who_comes_late_is_not_seen_before(strike: Scenario) -> None:
    world = start_world(strike, Replay(), "route", rng=np.random.default_rng(0))
    seen = Observer(strike).observe(world)
    assert {name: value.shape for name, value in seen.items()} == SHAPES
    assert seen["agents"][:, 10].sum() == 1
    for _ in range(20):
        world.advance(np.zeros(1))
    assert Observer(strike).observe(world)["agents"][:, 10].sum() == 2


def test_observations_are_in_the_frame_of_the_ego(strike: Scenario) -> None:
    world = start_world(strike, Replay(), "route", rng=np.random.default_rng(0))
    seen = Observer(strike).observe(world)
    # The ego heads north from (4.95, -49); the pedestrian stands at (9, -6.5) and walks west.
    assert seen["agents"][0, :6] == pytest.approx((42.5, -4.05, 0, 1, 0, 1), abs=1e-3)
    assert seen["route"][1] == pytest.approx((3, 0, 1, 0, 1), abs=1e-3)


def test_the_bicycle_turns_in_its_circle() -> None:
    state = EgoState(0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 0.0)
    route = build_scenario(make_record(), load_map("amsterdam_120")).paths[0]
    steering = 0.3
    for _ in range(400):
        state = move_ego(state, np.array([0.0, steering]), "bicycle", route, length=4.6, step=0.01)
    slip = math.atan(math.tan(steering) / 2)
    radius = 0.6 * 4.6 / 2 / math.sin(slip)
    assert state.heading == pytest.approx(20.0 / radius, rel=1e-6)
    centre = np.array([-radius * math.sin(slip), radius * math.cos(slip)])
    assert math.dist((state.x, state.y), centre) == pytest.approx(radius, rel=1e-3)


def test_footprints_touch_at_their_corners() -> None:
    size, other = np.array([4.0, 2.0]), np.array([[2.0, 2.0]])
    turned = np.array([math.pi / 4])
    for x, touches in ((2.0 + math.sqrt(2) - 0.01, True), (2.0 + math.sqrt(2) + 0.01, False)):
        hit = find_overlaps(
            np.zeros(2), np.zeros(1), size, np.array([[x, 0.0]]), turned, other, np.array([False])
        )
        assert hit.tolist() == [touches]
    disc = np.array([[0.6, 0.6]])
    # The corner is at (2, 1): a disc of 0.3 m beside it touches along the axes, not diagonally.
    for place, touches in (((2.2, 1.2), True), ((2.25, 1.25), False), ((2.29, 0.0), True)):
        hit = find_overlaps(
            np.zeros(2), np.zeros(1), size, np.array([place]), np.zeros(1), disc, np.array([True])
        )
        assert hit.tolist() == [touches]


def test_the_same_seed_and_policy_give_the_same(strike: Scenario) -> None:
    for name, make in BUILT_IN.items():
        first, again = (run_drive(strike, make(), name=name).digest for _ in range(2))
        assert first == again


class Faulty(Braking):
    def __init__(self, answer: Any) -> None:
        self.answer, self.asked = answer, 0

    def act(self, observation: dict[str, Any]) -> Any:  # noqa: ARG002
        self.asked += 1
        if self.asked < 4:
            return [0.0]
        if isinstance(self.answer, BaseException):
            raise self.answer
        while self.answer == "hangs":
            pass
        return self.answer


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (ValueError("two\nlines"), "act raised ValueError: two lines"),
        ("hangs", "act took more than 0.2 s"),
        ([math.nan], "an action has finite numbers, no NaN or infinity"),
        ([0.0, 1.0], r"an action of route has shape \(1,\), not \(2,\)"),
        ("faster", r"an action is an array of shape \(1,\), no str"),
        (SystemExit(3), "act raised SystemExit: 3"),
    ],
)
def test_a_faulty_policy_ends_its_drive_in_one_line(
    strike: Scenario, answer: Any, said: str
) -> None:
    drive = run_drive(strike, Faulty(answer), step_limit=0.2)
    assert drive.fault is not None
    assert pytest.approx(0.3) == drive.world.step * strike.step
    assert re.fullmatch(f"at 0.3 s {said}", drive.fault)
    told = report_drive(drive).to_json()
    assert told["end"] == "policy_failed"
    assert told["nuplan"]["score"] == told["epdms"]["score"] == 0.0


def test_an_ego_that_strikes_with_its_front_is_at_fault(strike: Scenario) -> None:
    report = report_drive(run_drive(strike, ConstantSpeedPolicy(), name="constant"))
    impact = report.impact
    assert impact is not None
    assert (impact.other, impact.kind, impact.at_fault) == ("pedestrian-1", "active_front", "ego")
    assert impact.time == pytest.approx(4.0, abs=0.1)
    assert impact.speed == pytest.approx(10.0, abs=0.1)
    assert impact.reduction == pytest.approx(0.0, abs=0.1)
    assert report.to_json()["nuplan"]["score"] == 0.0


def make_rear_end() -> SceneRecord:
    """vehicle-2 runs into vehicle-1 from behind."""
    slow = make_agent(1, "vehicle-1", 0.0, make_line((4.95, -30.0), (0.0, 2.0), 9.0), math.pi / 2)
    fast = make_agent(2, "vehicle-2", 0.0, make_line((4.95, -49.0), (0.0, 9.0), 9.0), math.pi / 2)
    return SceneRecord.model_validate(
        make_record().to_json() | {"agents": [slow, fast], "events": [], "relations": []}
    )


def test_an_ego_hit_from_behind_is_not() -> None:
    report = report_drive(run_drive(
        build_scenario(make_rear_end(), load_map("amsterdam_120"), ego="vehicle-1"),
        ConstantSpeedPolicy(),
    ))  # fmt: skip
    assert report.impact is not None
    assert (report.impact.kind, report.impact.at_fault) == ("active_rear", "other")


def test_a_lawful_driver_is_not_measured_by_one_who_ran_red() -> None:
    plain = make_record().to_json()
    line = make_line((4.95, -49.0), (0.0, 9.0), 9.0)
    plain |= {"agents": [make_agent(1, "vehicle-1", 0.0, line, math.pi / 2)], "events": []}
    red = plain["signals"][0] | {"end": 5.5, "colour": "red"}
    green = red | {"start": 5.5, "end": 10.0, "colour": "green"}
    scores = {}
    for name, rows in (("all red", [red | {"end": 10.0}]), ("red, then green", [red, green])):
        scenario = build_scenario(
            SceneRecord.model_validate(plain | {"signals": rows}), load_map("amsterdam_120")
        )
        reports = [
            report_drive(run_drive(scenario, p)) for p in (RuleBasedPolicy(), ReplayPolicy())
        ]
        scores[name] = [r.figures["nuplan"]["ego_progress_along_expert_route"] for r in reports]
        assert [report.figures["red_lights"] for report in reports] == [0, 1]
        assert reports[0].figures["nuplan"]["score"] > 0.5
    assert scores["all red"] == [pytest.approx(0.93, abs=0.07), 1.0]
    assert scores["red, then green"] == [pytest.approx(0.85, abs=0.15), 1.0]


def test_a_drive_says_for_what_it_is_not_verified() -> None:
    line = make_line((4.95, -49.0), (0.0, 9.0), 9.0)
    plain = make_record().to_json() | {"events": [], "relations": [], "signals": []}
    plain["agents"] = [make_agent(1, "vehicle-1", 0.0, line, math.pi / 2)]
    scenario = build_scenario(SceneRecord.model_validate(plain), load_map("amsterdam_120"))
    gentle, hard = (
        report_drive(run_drive(scenario, policy)).to_json()["not_verified_for"]
        for policy in (ConstantSpeedPolicy(), Slamming())
    )
    assert gentle == ["red lights"]  # the scene made by hand has no plan of its signals
    assert hard == ["hardness of motion", "red lights"]


def test_a_pedestrian_cannot_be_the_ego() -> None:
    with pytest.raises(InputError, match="pedestrian"):
        build_scenario(make_record(), load_map("amsterdam_120"), ego="pedestrian-1")


def _inputs(**changed: Any) -> ScoreInputs:
    given = {
        "at_fault": 0, "at_fault_objects": 0, "off_road": 0.0, "against_flow": 0.0,
        "red_lights": 0, "ttc": 2.0, "progress": 50.0, "reference": 50.0, "overspeed": 0.0,
        "duration": 10.0, "off_lane": 0.0, "comfortable": True,
    }  # fmt: skip
    return ScoreInputs(**(given | changed))


@pytest.mark.parametrize(
    ("changed", "nuplan", "epdms"),
    [
        ({}, 1.0, 1.0),
        ({"at_fault": 1}, 0.0, 0.0),
        ({"at_fault_objects": 1}, 0.5, 0.5),
        ({"off_road": 0.31}, 0.0, 0.0),
        ({"ttc": 0.9}, 11 / 16, 9 / 14),
        ({"comfortable": False}, 14 / 16, 12 / 14),
        ({"progress": 25.0}, 13.5 / 16, 11.5 / 14),
        ({"progress": 5.0}, 0.0, 9.5 / 14),
        ({"progress": 0.0, "reference": 1.9}, 1.0, 1.0),
        ({"against_flow": 1.99}, 1.0, 1.0),
        ({"against_flow": 2.0}, 0.5, 0.5),
        ({"against_flow": 5.99}, 0.5, 0.5),
        ({"against_flow": 6.0}, 0.0, 0.0),
        ({"overspeed": 11.15}, 14 / 16, 1.0),
        ({"red_lights": 1}, 1.0, 0.0),
        ({"off_lane": 2.1}, 1.0, 12 / 14),
    ],
)
def test_scores_follow_their_definitions(
    changed: dict[str, Any], nuplan: float, epdms: float
) -> None:
    assert score_nuplan(_inputs(**changed))["score"] == pytest.approx(nuplan, abs=1e-4)
    assert score_epdms(_inputs(**changed))["score"] == pytest.approx(epdms, abs=1e-4)


def test_comfort_of_even_braking() -> None:
    t = np.arange(0.0, 2.0, 0.1)
    points = np.column_stack([10 * t - 1.5 * t**2, 0 * t, 0 * t, 10 - 3 * t])
    comfort = measure_comfort(points, 0.1)
    assert comfort.braking == pytest.approx(3.0)
    assert comfort.jerk == pytest.approx(0.0, abs=1e-6)
    assert comfort.is_comfortable


def test_comfort_of_a_motion_that_is_known() -> None:
    t = np.arange(0.0, 4.0, 0.1)
    straight = np.column_stack([0 * t, 0 * t, 0 * t, 5 + 0.5 * t + 0.4 * t**2])
    comfort = measure_comfort(straight, 0.1)
    # d/dt (0.5 + 0.8 t), and at the ends half a step that nuPlan's eight samples shift
    assert comfort.jerk_along == comfort.jerk == pytest.approx(0.8, abs=0.11)
    turning = np.column_stack([0 * t, 0 * t, 0.1 * t + 0.05 * t**2, 0 * t + 8.0])
    comfort = measure_comfort(turning, 0.1)
    assert comfort.yaw_rate == pytest.approx(0.1 + 0.1 * 3.9)
    assert comfort.yaw_acceleration == pytest.approx(0.1)
    assert comfort.lateral == pytest.approx(8.0 * 0.49)
    assert comfort.jerk == pytest.approx(0.8, abs=0.11)
    # One sample that is 0.2 m/s too fast has a jerk of 20 m/s^3; nuPlan's 1.5 s smooth it away.
    turning[:, 2], turning[20, 3] = 0.0, 8.2
    assert measure_comfort(turning, 0.1).is_comfortable


def _drive_beside(
    ego: np.ndarray, *others: tuple[np.ndarray, float], heading: float = math.pi / 2
) -> dict[str, Any]:
    """The report of a scene in which all drive as they are recorded."""
    plain = make_record().to_json()
    plain["agents"] = [make_agent(1, "vehicle-1", 0.0, ego, heading)] + [
        make_agent(k, f"vehicle-{k}", 0.0, xy, turned, role="background")
        for k, (xy, turned) in enumerate(others, start=2)
    ]
    plain["events"] = []
    record = SceneRecord.model_validate(plain)
    scenario = build_scenario(record, load_map("amsterdam_120"), ego="vehicle-1")
    return report_drive(run_drive(scenario, ReplayPolicy())).to_json()


@pytest.mark.parametrize(("speed", "score"), [(1.9, 1.0), (2.1, 0.5), (5.9, 0.5), (6.1, 0.0)])
def test_a_way_against_the_traffic_counts_by_its_length_within_a_second(
    speed: float, score: float
) -> None:
    told = _drive_beside(make_line((4.95, -20.0), (0.0, -speed), 4.0), heading=-math.pi / 2)
    assert told["nuplan"]["driving_direction_compliance"] == score
    assert told["epdms"]["DDC"] == score


@pytest.mark.parametrize(("contact", "within"), [(-35.0, 1.0), (0.0, 0.0)])
def test_who_comes_from_the_side_counts_for_the_ttc_in_a_junction(
    contact: float, within: float
) -> None:
    ego = make_line((4.95, contact - 10.0), (0.0, 10.0), 1.5)
    other = make_line((4.95 + 17.0, contact), (-17.0, 0.0), 1.5)  # 60 degrees off the way ahead
    told = _drive_beside(ego, (other, math.pi))
    assert told["end"] == "collision"
    assert told["nuplan"]["time_to_collision_within_bound"] == within


def test_a_drive_is_saved_as_a_scene_that_can_be_verified(strike: Scenario, tmp_path: Path) -> None:
    report = report_drive(run_drive(strike, ReplayPolicy(), name="replay"))
    save_drive(report, tmp_path / "driven", picture=False, recording=False)
    record = load_scene(tmp_path / "driven")
    assert [event.type for event in record.events] == ["collision"]
    assert record.meta.duration == pytest.approx(report.drive.world.step * 0.1)
    proof = verify(tmp_path / "driven")
    assert proof == report.scene.proof
    assert json.loads((tmp_path / "driven" / "drive.json").read_text())["end"] == "collision"


def drive_by_command(
    folder: Path, capsys: pytest.CaptureFixture[str], *words: str
) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of the command on the scene made by hand."""
    (folder / "scene.json").write_text(json.dumps(make_record().to_json()))
    code = main(["drive", str(folder), *words])
    said = capsys.readouterr()
    return code, said.out, said.err


class Seeded(Braking):
    """Brakes as hard as its seed says."""

    def reset(self, scenario: Scenario, seed: int) -> None:  # noqa: ARG002
        self.seed = seed

    def act(self, observation: dict[str, Any]) -> np.ndarray:  # noqa: ARG002
        return np.array([-4.0 - self.seed])


def test_drives_that_cannot_differ_are_counted_as_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("--policy", "constant", "--n", "3", "--json")
    code, out, err = drive_by_command(tmp_path, capsys, *words)
    said = json.loads(out)
    assert code == 0
    assert (said["runs"], said["n"], len(said["drives"])) == (3, 1, 1)
    assert said["summary"]["collisions"] == {"count": 1, "of": 1, "rate": 1.0}
    assert "all 3 drives are the same" in err


def test_drives_that_differ_are_counted_each(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("--policy", f"{__name__}:Seeded", "--n", "3")
    _, out, err = drive_by_command(tmp_path, capsys, *words, "--json")
    said = json.loads(out)
    assert [each["seed"] for each in said["drives"]] == [0, 1, 2]
    assert said["runs"] == said["summary"]["collisions"]["of"] == 3
    assert "same" not in err
    _, out, _ = drive_by_command(tmp_path, capsys, *words)
    assert "{" not in out
    assert "collisions: 0 of 3 (95 % interval 0 to 56 %)\n" in out
    assert "ends: 3 over\n" in out


@pytest.mark.parametrize(
    ("policy", "fail_on", "code"),
    [
        ("constant", "collision", 1),
        ("constant", "at-fault", 1),
        (f"{__name__}:Braking", "collision", 0),
        (f"{__name__}:Unfit", "collision", 2),
    ],
)
def test_a_collision_can_fail_the_command(
    policy: str, fail_on: str, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("--policy", policy, "--fail-on", fail_on, "--json")
    ended, out, _ = drive_by_command(tmp_path, capsys, *words)
    assert ended == code
    assert json.loads(out)["ok"] is (code == 0)


def test_a_collision_that_is_not_its_fault_fails_only_where_any_does(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = make_rear_end()
    (tmp_path / "behind").mkdir()
    (tmp_path / "behind" / "scene.json").write_text(json.dumps(record.to_json()))
    words = ["drive", str(tmp_path / "behind"), "-q", "--policy", "constant", "--ego", "vehicle-1"]
    codes = [main([*words, "--fail-on", each]) for each in ("collision", "at-fault")]
    capsys.readouterr()
    assert codes == [1, 0]


@pytest.mark.parametrize(
    "words",
    [
        ["--policy", "nobody"],
        ["--policy", "json:dumps"],
        ["--policy", "nowhere_at_all:Policy"],
        ["--ego", "vehicle-9"],
    ],
)
def test_unusable_drives_are_refused_in_one_line(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "scene.json").write_text(json.dumps(make_record().to_json()))
    assert main(["drive", str(tmp_path), "-q", *words]) == 2
    assert capsys.readouterr().err.count("\n") == 1
