"""The benchmark for egos: its list, what fails, its files, and egos at a socket."""

from __future__ import annotations

import json
import re
import socket
import threading
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from exported_scenes import make_record
from scenewright.cli.main import main
from scenewright.dataset.tables.junit import build_junit
from scenewright.driving import benchmark
from scenewright.driving.benchmark import (
    BenchmarkScene,
    build_row,
    choose_scenes,
    drive_benchmark,
    find_failure,
    load_listed,
    read_list,
)
from scenewright.driving.benchmark_report import build_page, list_test_cases
from scenewright.driving.policies import BUILT_IN
from scenewright.driving.report import report_drive
from scenewright.driving.scenario import Scenario, build_scenario
from scenewright.driving.single_drive import drive_once
from scenewright.errors import InputError
from scenewright.intersections import load_map

CLIENT = Path(__file__).parents[2] / "docs" / "tutorials" / "ego-benchmark.md"


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The user's folder of this module: scenes are made in it once."""
    return tmp_path_factory.mktemp("data")


@pytest.fixture(autouse=True)
def _use_kept(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SCENEWRIGHT_DATA", str(kept))


@pytest.fixture(scope="module")
def strike() -> Scenario:
    """vehicle-1 comes at 10 m/s and strikes pedestrian-1 at 4 s."""
    return build_scenario(make_record(), load_map("amsterdam_120"))


def test_the_list_has_two_hundred_scenes_of_every_sort() -> None:
    version, scenes = read_list()
    assert version
    assert len(scenes) == len({scene.id for scene in scenes}) == 200
    assert len({(scene.text, scene.seed) for scene in scenes}) == 200
    assert len({scene.digest for scene in scenes}) == 200
    assert Counter(scene.split for scene in scenes) == {"dev": 100, "test": 100}
    for split in ("dev", "test"):
        mine = choose_scenes(split=split)  # type: ignore[arg-type]
        assert min(Counter(scene.temperament for scene in mine).values()) >= 25
        assert min(Counter(scene.kind for scene in mine).values()) >= 5
        assert len({scene.kind for scene in mine}) == 8
    assert len(choose_scenes(n=5, temperament="hasty")) == 5


def test_scenes_are_made_as_listed_and_kept(monkeypatch: pytest.MonkeyPatch, kept: Path) -> None:
    scenes = choose_scenes(n=3)
    assert drive_benchmark(scenes, [], workers=1, step_limit=5.0) == ([], {})

    def refuse(scene: BenchmarkScene) -> Any:
        raise InputError("made again")

    monkeypatch.setattr(benchmark, "make_scene", refuse)
    assert load_listed(scenes[0]).record is not None
    file = kept / "ego-benchmark" / f"{scenes[0].digest[7:]}.json"
    whole = file.read_bytes()
    file.write_bytes(whole.replace(b'"spawn_time":0', b'"spawn_time":1', 1))
    assert file.read_bytes() != whole
    with pytest.raises(InputError, match="made again"):
        load_listed(scenes[0])
    file.write_bytes(whole)


def test_a_scene_that_is_another_one_here_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = choose_scenes(n=2)
    wrong = replace(first, digest="sha256:" + 64 * "0")
    monkeypatch.setattr(benchmark, "read_list", lambda: ("9", (wrong, second)))
    words = ["drive", "--benchmark", "--workers", "1", "--policy", "constant", "--json"]
    assert main(words) == 2
    out, err = capsys.readouterr()
    said = json.loads(out)
    assert (said["ok"], said["version"]) == (False, "9")
    assert list(said["not_comparable"]) == [first.id]
    assert [row["scene"] for row in said["drives"]] == [second.id]
    assert f"scene {first.id} is another one here" in err
    assert "not be comparable" in err


def test_an_ego_that_yields_to_nobody_fails_where_a_careful_one_does_not() -> None:
    (scene,) = [each for each in read_list()[1] if each.id == "collision-01"]
    names = ["lane-follower", "cautious"]
    rows, lost = drive_benchmark([scene], names, workers=1, step_limit=5.0)
    assert not lost
    assert [row["failed"] for row in rows] == [True, False]
    assert "collision" in rows[0]["why"]
    assert rows[1]["why"] is None


def test_what_fails_an_ego(strike: Scenario) -> None:
    report = report_drive(drive_once(strike, BUILT_IN["constant"]()))
    assert "collision with pedestrian-1" in str(find_failure(report))
    assert report.impact is not None
    for kind in ("stopped_ego", "active_rear"):
        blameless = replace(report, impact=replace(report.impact, kind=kind))
        assert find_failure(blameless) is None
    calm = replace(report, impact=None)
    for changed, why in (
        ({"red_lights": 1}, "ran a red light"),
        ({"off_road": 0.4}, "0.4 m off the road"),
        ({"nuplan": {"score": 0.0, "ego_is_making_progress": 0.0}, "progress": 1.2}, "no progress"),
    ):
        assert why in str(find_failure(replace(calm, figures=calm.figures | changed)))


def make_rows(strike: Scenario) -> list[dict[str, Any]]:
    report = report_drive(drive_once(strike, BUILT_IN["constant"](), name="<b>me</b>"))
    row = build_row(report, scene="one & two", kind="strike")
    return [row | {"why": "hit <script>alert(1)</script>\x00\x1b"}, row | {"failed": False}]


def test_junit_has_a_case_for_each_scene(strike: Scenario) -> None:
    (suite,) = ElementTree.fromstring(build_junit(list_test_cases(make_rows(strike))))
    assert suite.attrib == {"name": "ego <b>me</b>", "tests": "2", "failures": "1"}
    cases = suite.findall("testcase")
    assert [case.get("name") for case in cases] == ["one & two"] * 2
    (failure,) = [case.find("failure") for case in cases if len(case)]
    assert failure is not None
    assert failure.text == "hit <script>alert(1)</script>  "


def test_the_page_needs_nothing_and_escapes_all(strike: Scenario) -> None:
    page = build_page(make_rows(strike)).decode()
    assert "&lt;script&gt;alert(1)" in page
    assert "&lt;b&gt;me" in page
    assert not re.search(r"<script|<b>|https?:|src=|@import|url\(", page)
    assert page.count("<svg") == 5


def test_the_command_writes_all_it_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["drive", "--benchmark", "--n", "2", "--policy", "constant", "--workers", "1"]
    files = ["--junit", "a.xml", "--html", "a.html", "--out", "driven"]
    assert main([*words, *files, "-q"]) == 0
    table = capsys.readouterr().out
    assert "constant" in table
    assert " %" in table
    assert main(["verify", f"driven/constant/{choose_scenes(n=1)[0].id}"]) in (0, 1)
    assert b"<testcase" in Path("a.xml").read_bytes()
    assert b"</html>" in Path("a.html").read_bytes()
    capsys.readouterr()
    assert main([*words, "--fail-on", "collision", "-q", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["ok"] is False


def test_what_does_not_go_together_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["drive"]) == main(["drive", "A car", "--benchmark"]) == 2
    assert capsys.readouterr().err.count("name a text") == 2
    words = ["drive", "--benchmark", "--n", "1", "--serve", "nowhere", "-q"]
    assert main(words) == main([*words, "--out", "driven"]) == 2
    err = capsys.readouterr().err
    assert "HOST:PORT" in err
    assert "without --out" in err
    assert main(["drive", "--benchmark", "--others", "resolve", "--time-limit", "9"]) == 2
    assert "fixed, without --others and --time-limit" in capsys.readouterr().err


# ---- at a socket --------------------------------------------------------------------------------


class Line:
    """A connection to a server, over a pair of sockets."""

    def __init__(self, server: Any) -> None:
        self.mine, theirs = socket.socketpair()
        server.process_request(theirs, "test")
        self.stream = self.mine.makefile("rwb")

    def close(self) -> None:
        self.stream.close()
        self.mine.close()

    def send(self, line: bytes) -> dict[str, Any]:
        self.stream.write(line)
        self.stream.flush()
        answer: dict[str, Any] = json.loads(self.stream.readline())
        return answer

    def call(self, **request: Any) -> dict[str, Any]:
        return self.send(json.dumps(request).encode() + b"\n")


@pytest.fixture
def server(strike: Scenario, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    pytest.importorskip("gymnasium")
    from scenewright.driving.socket_server import EgoServer, Session

    monkeypatch.setattr(Session, "disable_nagle_algorithm", False)  # a pair has no such option

    scene = BenchmarkScene(id="strike", seed=5, others="reactive", temperament="careless")
    with EgoServer(("127.0.0.1", 0), [scene], lambda _: strike, most=9, again=True) as served:
        yield served


def test_an_ego_at_a_socket_sees_what_the_environment_shows(server: Any, strike: Scenario) -> None:
    from scenewright.driving.env import DriveEnv

    env = DriveEnv(strike, others="reactive", temperament="careless", mode="route", seed=7)
    line = Line(server)
    answer = line.call(call="reset", seed=7, actions="route")
    seen, info = env.reset()
    assert answer["info"] == info | {"scene": "strike"}
    done = False
    while not done:
        for name, values in seen.items():
            assert answer["observation"][name] == values.tolist()
        action = [0.4 - 0.1 * info["time"]]
        answer = line.call(call="step", action=action)
        seen, reward, terminated, truncated, info = env.step(action)
        done = terminated or truncated
        assert (answer["reward"], answer["terminated"]) == (reward, terminated)
        assert answer["truncated"] is truncated
        assert answer["info"].items() >= info.items()
    assert answer["info"]["result"] == server.rows[0]
    assert server.rows[0]["seed"] == 7
    assert line.call(call="close") == {"closed": True}
    assert line.stream.readline() == b""
    line.close()


def test_malformed_calls_get_one_line_and_the_connection_lives(server: Any) -> None:
    line = Line(server)
    for sent, said in (
        (b"\n", "line"),
        (b"{\n", "line"),
        (b"\xff\xfe\n", "line"),
        (b"[]\n", "line"),
        (b"[" * 60_000 + b"\n", "line"),
        (b"x" * 200_000 + b"\n", "65536 bytes"),
        (b'{"call": "render"}\n', "call"),
        (b'{"call": "reset", "speed": 3}\n', "speed"),
        (b'{"call": "reset", "seed": -1}\n', "seed"),
        (b'{"call": "reset", "scene": "../x"}\n', "scene"),
        (b'{"call": "reset", "actions": "fly"}\n', "actions"),
        (b'{"call": "step", "action": [0]}\n', "reset before step"),
    ):
        answer = line.send(sent)
        assert list(answer) == ["error"]
        assert said in answer["error"]
        assert "\n" not in answer["error"]
    assert "observation" in line.call(call="reset", actions="route")
    for action in (None, [], [1, 2], ["a"], {"a": 1}, [[1.0]], [10**400], "1", ["1"], [True]):
        assert "error" in line.call(call="step", action=action)
    assert "finite" in line.send(b'{"call": "step", "action": [1e999]}\n')["error"]
    assert line.call(call="step", action=[0.0])["info"]["end"] is None
    line.close()


def test_the_documented_client_drives_the_benchmark(
    server: Any, strike: Scenario, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    (code,) = re.findall(r"```python\n(# client.*?)```", CLIENT.read_text("utf-8"), re.DOTALL)
    assert len(code.splitlines()) <= 50
    names: dict[str, Any] = {"__name__": "client"}
    exec(code, names)
    scenes = [replace(server._scenes[0], id=name) for name in ("a", "b")]
    server._scenes, server.most, server.again = scenes, 2, False
    threading.Thread(target=server.serve_forever, daemon=True).start()
    lines = [Line(server)]
    monkeypatch.setattr(socket, "create_connection", lambda _: lines[0].mine)
    env = names["RemoteEnv"]()
    names["drive_all"](env)
    said = capsys.readouterr().out.splitlines()
    assert [each.split()[0] for each in said] == ["a", "b"]
    assert [row["scene"] for row in server.rows] == ["a", "b"]
    with pytest.raises(ValueError, match="none of that name is left"):
        env.reset()
    with pytest.raises(ValueError, match="fixed"):
        env.reset(seed=3)
    env.stream.close()
    lines[0].close()
