"""What people meet at the command line: files, exit codes, one clear line when it cannot be."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from scenewright.backends import Question
from scenewright.cli import make as making
from scenewright.cli.main import main
from scenewright.errors import BackendFault, Unsatisfiable

QUICK = "Light traffic at dawn, no incidents."
CROSSING = "A car hits a pedestrian on the north crosswalk at 5 am"
PLAIN = ["--no-picture", "--no-recording"]
FILES = ["proof.json", "provenance.json", "scene.json"]

Run = Callable[..., "Outcome"]


class Outcome:
    """Exit code and what was printed."""

    def __init__(self, code: int, out: str, err: str) -> None:
        self.code, self.out, self.err = code, out, err

    @property
    def complaint(self) -> str:
        """The one line about what went wrong."""
        lines = [line for line in self.err.splitlines() if line.startswith("scenewright: ")]
        assert len(lines) == 1, self.err
        return lines[0]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """The command line in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def call(*words: str) -> Outcome:
        code = main(words)
        out, err = capsys.readouterr()
        assert "Traceback" not in out + err
        return Outcome(code, out, err)

    return call


@pytest.fixture(scope="module")
def crash(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a verified collision."""
    folder = tmp_path_factory.mktemp("crash") / "scene"
    assert main(["make", CROSSING, "--out", str(folder), "-q", *PLAIN]) == 0
    return folder


def everything_in(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def test_make_writes_a_whole_folder(run: Run, tmp_path: Path) -> None:
    done = run("make", QUICK, "--out", "scenes/one")
    assert done.code == 0
    assert done.out == "scenes/one\n"
    assert everything_in(tmp_path / "scenes" / "one") == [*FILES, "scene.png", "scene.rrd"]
    assert "verified" in done.err.splitlines()
    assert "nothing happens" in done.err


def test_words_that_are_not_shown_stand_beside_the_verdict_everywhere(
    run: Run, tmp_path: Path
) -> None:
    told = run("make", f"{QUICK}, a dog barks", "--lenient", "--out", "x", "--json", *PLAIN)
    made = json.loads(told.out)
    assert (made["verified"], made["verdict"]) == (True, "partly")
    assert made["caveat"] == "'dog', 'barks' not shown"
    amber = [each["words"] for each in made["account"] if each["state"] == "not_shown"]
    assert amber == ["dog", "barks"]
    proof = json.loads((tmp_path / "x" / "proof.json").read_bytes())
    assert proof["account"] == made["account"]
    (checked,) = json.loads(run("verify", "x", "--json").out)["scenes"]
    assert (checked["verdict"], checked["caveat"]) == ("partly", made["caveat"])
    shown = run("verify", "x")
    assert shown.code == 0
    assert "partly: " in shown.out
    assert "x: not shown: 'dog' (animals are not shown), 'barks'" in shown.out.splitlines()[-1]


def test_make_names_a_folder_itself(run: Run) -> None:
    done = run("make", QUICK, *PLAIN)
    folder = Path(done.out.strip())
    scene = json.loads((folder / "scene.json").read_bytes())
    assert folder == Path("scenes") / scene["meta"]["scene_id"]
    assert scene["meta"]["user_prompt"] == QUICK


def test_make_reports_to_machines_in_one_object(run: Run) -> None:
    done = run("make", CROSSING, "--out", "x", "--json", *PLAIN)
    given = json.loads(done.out)
    assert (given["ok"], given["verdict"], given["folder"]) == (True, "verified", "x")
    assert {each["state"] for each in given["account"]} == {"seen"}
    assert [event["type"] for event in given["events"]] == ["collision"]
    assert given["files"] == FILES
    assert given["warnings"] == []


def test_make_reports_to_people_who_does_what_where(run: Run) -> None:
    done = run("make", CROSSING, "--out", "x", *PLAIN)
    line = next(line for line in done.err.splitlines() if "collides with" in line)
    assert "pedestrian-1 (north crosswalk)" in line
    assert "(pedestrian strike), on the north crosswalk" in line


def test_quiet_is_quiet(run: Run) -> None:
    assert run("make", QUICK, "--out", "x", "-q", *PLAIN).err == ""


def test_instruction_from_stdin(run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    said = tmp_path / "said"
    said.write_text(QUICK)
    with said.open() as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        done = run("make", "-", "--out", "x", *PLAIN)
    assert done.code == 0


UNUSABLE = {
    "empty": [""],
    "blank": ["  \t "],
    "nonsense": ["asdf qwer zxcv"],
    "off topic": ["Write me a poem about cheese."],
    "100 kB": ["car " * 25_000],
    "control characters": ["A car\x1b[2J hits a bus"],
    "NUL": ["A car\0 hits a bus"],
    "not UTF-8": ["A car \udcff hits a bus"],
    "another language": ["Ein Auto lässt einen Fußgänger über die Straße gehen"],
    "unknown intersection": [QUICK, "--intersection", "nowhere"],
    "intersection as a path": [QUICK, "--intersection", "../../etc"],
    "intersection that cannot be printed": [QUICK, "--intersection", "\x1b]0;\udcff"],
    "unknown backend": [QUICK, "--backend", "oracle"],
    "unknown refiner": [QUICK, "--refiner", "sandpaper"],
    "unknown selection": [QUICK, "--selection", "best"],
    "seed in words": [QUICK, "--seed", "abc"],
    "seed with a fraction": [QUICK, "--seed", "1.5"],
    "negative seed": [QUICK, "--seed", "-1"],
    "seed too large": [QUICK, "--seed", str(2**63)],
    "seed without end": [QUICK, "--seed", "9" * 5000],
    "unknown option": [QUICK, "--colour", "red"],
    "no instruction": [],
    "two instructions": [QUICK, QUICK],
    "no folder": [QUICK, "--out", " "],
    "folder with NUL": [QUICK, "--out", "a\0b"],
    "folder name too long": [QUICK, "--out", "x" * 300],
    "folder below a device": [QUICK, "--out", f"{os.devnull}/scene"],
    "folder is a device": [QUICK, "--out", os.devnull],
}


@pytest.mark.parametrize("words", UNUSABLE.values(), ids=UNUSABLE)
def test_unusable_input_is_one_line_and_code_2(run: Run, tmp_path: Path, words: list[str]) -> None:
    done = run("make", *words)
    assert done.code == 2
    assert done.out == ""
    assert len(done.err.splitlines()) == 1
    assert done.complaint.isprintable()
    assert len(done.complaint) < 700
    assert everything_in(tmp_path) == []


@pytest.mark.parametrize("words", UNUSABLE.values(), ids=UNUSABLE)
def test_machines_learn_why(run: Run, words: list[str]) -> None:
    done = run("make", *words, "--json")
    given = json.loads(done.out)
    assert (done.code, given["ok"], given["code"], given["exit_code"]) == (
        2,
        False,
        "unusable_input",
        2,
    )
    assert given["reason"] in done.complaint


def test_a_request_that_cannot_be_met_is_code_3(run: Run, tmp_path: Path) -> None:
    done = run("make", "A car turns left from the north and leaves to the north.", "--json")
    given = json.loads(done.out)
    assert (done.code, given["code"]) == (3, "unsatisfiable")
    assert "north" in done.complaint
    assert given["advice"] is not None
    assert given["rejections"][-1]["stage"] == "scene_planner"
    assert everything_in(tmp_path) == []


def raiser(error: BaseException) -> Callable[..., Any]:
    def fail(*_: Any, **__: Any) -> Any:
        raise error

    return fail


FAULTS: dict[str, tuple[BaseException, int, str]] = {
    "backend": (BackendFault("the model answers 503"), 4, "backend_failed"),
    "unsatisfiable": (Unsatisfiable("no gap for vehicle-1"), 3, "unsatisfiable"),
    "memory": (MemoryError(), 2, "out_of_memory"),
    "system": (OSError(errno.EMFILE, "Too many open files"), 2, "unusable_input"),
    "interrupt": (KeyboardInterrupt(), 130, "interrupted"),
    "bug": (ZeroDivisionError("division by zero"), 70, "internal_error"),
}


@pytest.mark.parametrize(("error", "code", "name"), FAULTS.values(), ids=FAULTS)
def test_no_failure_is_a_traceback(
    run: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    error: BaseException,
    code: int,
    name: str,
) -> None:
    monkeypatch.setattr("scenewright.graph.run.synthesize", raiser(error))
    done = run("make", QUICK, "--json")
    assert (done.code, json.loads(done.out)["code"]) == (code, name)
    assert done.complaint
    assert everything_in(tmp_path) == []


def test_a_bug_shows_where_if_asked(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("scenewright.graph.run.synthesize", raiser(ZeroDivisionError()))
    monkeypatch.setenv("SCENEWRIGHT_TRACEBACK", "1")
    with pytest.raises(ZeroDivisionError):
        run("make", QUICK)


def test_a_folder_with_other_files_is_left_alone(run: Run, tmp_path: Path) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.tex").write_text("years of work")
    done = run("make", QUICK, "--out", "thesis", *PLAIN)
    assert (done.code, everything_in(tmp_path)) == (2, ["thesis", "thesis/chapter.tex"])
    assert "--force" in done.complaint


def test_force_adds_to_a_folder_and_keeps_the_rest(run: Run, tmp_path: Path) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.tex").write_text("years of work")
    (tmp_path / "thesis" / "scene.gif").write_text("of an earlier scene")
    assert run("make", QUICK, "--out", "thesis", "--force", *PLAIN).code == 0
    assert everything_in(tmp_path / "thesis") == ["chapter.tex", *FILES]


def test_an_earlier_scene_is_replaced(run: Run, tmp_path: Path) -> None:
    run("make", QUICK, "--out", "x", "--no-recording")
    assert run("make", CROSSING, "--out", "x", *PLAIN).code == 0
    assert everything_in(tmp_path) == ["x", *(f"x/{name}" for name in FILES)]
    assert "collision" in (tmp_path / "x" / "scene.json").read_text()


def test_a_file_in_the_way_is_kept(run: Run, tmp_path: Path) -> None:
    (tmp_path / "x").write_text("mine")
    assert run("make", QUICK, "--out", "x").code == 2
    assert run("make", QUICK, "--out", "x/y").code == 2
    assert (tmp_path / "x").read_text() == "mine"


def test_a_folder_without_permission(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused = PermissionError(errno.EACCES, "Permission denied")
    monkeypatch.setattr("scenewright.cli.output_folder.tempfile.TemporaryFile", raiser(refused))
    done = run("make", QUICK, "--out", "x")
    assert (done.code, everything_in(tmp_path)) == (2, [])
    assert "cannot write" in done.complaint


@pytest.fixture(params=[*FILES, "scene.png", "scene.rrd"])
def full_disk(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that is full when one of the files is written."""
    write = Path.write_bytes

    def until_full(path: Path, data: bytes) -> int:
        if request.param not in path.name:
            return write(path, data)
        write(path, data[:100])
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(Path, "write_bytes", until_full)


@pytest.mark.usefixtures("full_disk")
def test_a_full_disk_leaves_nothing(run: Run, tmp_path: Path) -> None:
    done = run("make", QUICK, "--out", "new/parents/x")
    assert (done.code, everything_in(tmp_path)) == (2, [])
    assert done.complaint.endswith("new/parents/x: No space left on device")


def test_a_full_disk_keeps_the_earlier_scene(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run("make", CROSSING, "--out", "x", *PLAIN)
    before = (tmp_path / "x" / "scene.json").read_bytes()
    full = raiser(OSError(errno.ENOSPC, "No space left on device"))
    monkeypatch.setattr(Path, "write_bytes", full)
    assert run("make", QUICK, "--out", "x", *PLAIN).code == 2
    assert (tmp_path / "x" / "scene.json").read_bytes() == before
    assert everything_in(tmp_path / "x") == FILES


def test_a_scene_outlives_its_picture(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(making, "write_view", raiser(RuntimeError("no fonts")))
    done = run("make", QUICK, "--out", "x", "--no-recording", "--json")
    given = json.loads(done.out)
    assert (done.code, given["files"]) == (0, FILES)
    assert given["warnings"] == ["no scene.png: RuntimeError: no fonts"]
    assert "warning: no scene.png" in done.err


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("swallowed", [False, True], ids=["", "swallowed by a library"])
def test_interrupted_while_drawing_leaves_nothing(
    run: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    *,
    number: signal.Signals,
    code: int,
    swallowed: bool,
) -> None:
    def draw(*_: object, **__: object) -> None:
        try:
            signal.raise_signal(number)
        except KeyboardInterrupt:
            if not swallowed:
                raise

    monkeypatch.setattr(making, "write_view", draw)
    # Whoever runs the tests in the background has interrupts ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert run("make", QUICK, "--out", "new/x", "--no-recording").code == code
    finally:
        signal.signal(signal.SIGINT, before)
    assert everything_in(tmp_path) == []


ROWS = [
    {"id": "b", "text": "A northbound car hits a bus."},
    {"id": "a", "text": ""},
    {"text": "A car hits a bus."},
    {"id": "p", "text": "Make it a truck.", "previous": "A northbound car hits a bus."},
    {"id": "q", "text": "A car hits a bus.", "previous": 7},
    "not a row",
    {"id": "c\ud800", "text": "Ordinary traffic in the evening, nothing happens."},
]


def test_plan_answers_every_row_in_order(run: Run, tmp_path: Path) -> None:
    lines = [json.dumps(row) for row in ROWS]
    (tmp_path / "in.jsonl").write_text("\ufeff" + "\n\n".join(lines))
    done = run("plan", "in.jsonl", "--out", "out.jsonl")
    assert (done.code, done.out) == (0, "out.jsonl\n")
    rows = [json.loads(line) for line in (tmp_path / "out.jsonl").read_text().splitlines()]
    assert [row["id"] for row in rows] == ["b", "a", None, "p", "q", None, "c\ud800"]
    assert [row["refused"] for row in rows] == [False, True, True, False, True, True, False]
    assert all(isinstance(row["reason"], str) == row["refused"] for row in rows)
    assert [relation["type"] for relation in rows[0]["relations"]] == ["collision"]
    assert rows[6]["relations"] == [{"type": "normal", "from": None, "to": None}]
    assert set(rows[0]) == {
        *("id", "agents", "relations", "context", "refused", "reason"),
        *("did_you_mean", "said", "unrealised"),
    }


def test_plan_from_stdin_to_stdout(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "in.jsonl").write_text(json.dumps(ROWS[0]))
    with (tmp_path / "in.jsonl").open() as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        done = run("plan", "-")
    assert json.loads(done.out)["id"] == "b"
    assert done.err == "1 rows, 0 refused\n"


class Oracle:
    """A backend that breaks on one text and cannot be reached for another."""

    name, deterministic = "oracle", False

    def answer(self, question: Question) -> dict[str, Any]:
        match question.facts["instruction"]:
            case "bug":
                raise KeyError("bug")
            case "gone":
                raise BackendFault("the model cannot be reached")
            case "mends" if not question.rejections:
                return {"agents": 3}
        return {"agents": [{"id": "vehicle-1", "type": "vehicle"}]}


def test_plan_survives_a_bug_in_one_row(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("scenewright.backends.load_backend", lambda *_, **__: Oracle())
    rows = [{"id": text, "text": text} for text in ("bug", "mends", "plain")]
    (tmp_path / "in.jsonl").write_text("\n".join(map(json.dumps, rows)))
    done = run("plan", "in.jsonl", "--backend", "oracle")
    assert [json.loads(line)["refused"] for line in done.out.splitlines()] == [True, False, False]
    assert done.err.startswith("warning: row 'bug': this is a fault in scenewright: KeyError")


def test_plan_stops_where_the_backend_fails(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("scenewright.backends.load_backend", lambda *_, **__: Oracle())
    (tmp_path / "in.jsonl").write_text('{"id": "a", "text": "gone"}')
    assert run("plan", "in.jsonl", "--out", "out.jsonl").code == 4
    assert everything_in(tmp_path) == ["in.jsonl"]


BAD_FILES = {
    "cut off": b'{"id": "a", "text": "A car hits a bus."}\n{"id": "b", "te',
    "not UTF-8": b'{"id": "a", "text": "\xff"}',
    "too deep": b"[" * 100_000,
    "binary": bytes(range(256)),
    "missing": None,
}


@pytest.mark.parametrize("data", BAD_FILES.values(), ids=BAD_FILES)
def test_plan_refuses_a_file_that_holds_no_rows(
    run: Run, tmp_path: Path, data: bytes | None
) -> None:
    if data is not None:
        (tmp_path / "in.jsonl").write_bytes(data)
    (tmp_path / "out.jsonl").write_text("earlier")
    done = run("plan", "in.jsonl", "--out", "out.jsonl")
    assert (done.code, len(done.err.splitlines())) == (2, 1)
    assert "in.jsonl" in done.complaint
    assert (tmp_path / "out.jsonl").read_text() == "earlier"


def test_plan_checks_where_to_write_first(run: Run, tmp_path: Path) -> None:
    (tmp_path / "in.jsonl").write_text(json.dumps(ROWS[0]))
    assert run("plan", "in.jsonl", "--out", "missing/out.jsonl").code == 2
    assert run("plan", "in.jsonl", "--json").code == 2
    assert run("plan", "in.jsonl", "--backend", "oracle").code == 2
    assert everything_in(tmp_path) == ["in.jsonl"]


def test_verify_confirms_what_make_wrote(run: Run, crash: Path) -> None:
    done = run("verify", str(crash))
    assert done.code == 0
    row = next(line for line in done.out.splitlines() if "collision" in line)
    assert "verified" in row
    assert "pedestrian-1 (north crosswalk)" in row
    assert done.err == ""


def test_verify_sees_through_a_scene_that_was_changed(
    run: Run, crash: Path, tmp_path: Path
) -> None:
    scene = json.loads((crash / "scene.json").read_bytes())
    for agent in scene["agents"]:
        if agent["type"] == "pedestrian":
            agent["trajectory"] = [[x, y + 8.0] for x, y in agent["trajectory"]]
    (tmp_path / "moved.json").write_text(json.dumps(scene))
    done = run("verify", "moved.json", str(crash))
    assert done.code == 1
    assert "not verified" in done.out
    assert "moved.json: " in done.out.splitlines()[-1]
    given = json.loads(run("verify", "moved.json", "--json").out)
    assert given["ok"] is False
    assert given["scenes"][0]["proof"]["missing"]


def test_verify_takes_a_folder_of_scenes(run: Run, crash: Path) -> None:
    given = json.loads(run("verify", str(crash.parent), str(crash / "scene.json"), "--json").out)
    assert [scene["path"] for scene in given["scenes"]] == [str(crash), str(crash / "scene.json")]


def test_verify_goes_on_after_a_bad_path(run: Run, crash: Path, tmp_path: Path) -> None:
    (tmp_path / "tracks.ndjson").write_text("{}")
    (tmp_path / "tracks.csv").write_text("")
    (tmp_path / "tracks.osi").write_text("")
    (tmp_path / "broken.json").write_text("{")
    (tmp_path / "empty").mkdir()
    bad = ["tracks.ndjson", "tracks.csv", "tracks.osi", "broken.json", "empty", "missing"]
    done = run("verify", *bad, str(crash))
    assert done.code == 2
    assert "collision" in done.out
    assert len(done.err.splitlines()) == len(bad)
    assert "cannot be checked yet" in done.err


@pytest.fixture
def tracks(tmp_path: Path) -> Path:
    """Two cars that meet at the origin after 1 s, less their lengths."""
    rows = ["t,id,class,x,y"]
    for k in range(21):
        rows += [f"{k / 10},red,car,{k - 10},0", f"{k / 10},blue,car,0,{k - 10}"]
    file = tmp_path / "tracks.csv"
    file.write_text("\n".join(rows))
    return file


def test_verify_lists_the_events_of_foreign_tracks(run: Run, tracks: Path) -> None:
    done = run("verify", "tracks.csv")
    assert (done.code, done.err) == (0, "")
    assert done.out.startswith("tracks.csv: 2 agents, 0.0 to 2.0 s every 0.1 s: 1 collision\n")
    row = next(line for line in done.out.splitlines() if "angle" in line)
    assert "1 (car)   2 (car)   0.7 s" in row
    assert done.out.endswith(
        "1 is red\n2 is blue\n"
        "1 and 2 at 0.7 s, to avoid it: 1 could not (no time), 2 could not (no time)\n"
    )


def test_collisions_that_foreign_tracks_deny_are_one_line(run: Run, tracks: Path) -> None:
    """Both drive on through one another."""
    rows = [f"{k / 10},{who},car,{x},{y}" for k in range(21, 41)
            for who, x, y in (("red", k - 10, 0), ("blue", 0, k - 10))]  # fmt: skip
    tracks.write_text(tracks.read_text() + "\n" + "\n".join(rows))
    done = run("verify", "tracks.csv")
    assert done.out.splitlines() == [
        "tracks.csv: 2 agents, 0.0 to 4.0 s every 0.1 s: 1 implausible collision",
        "1 is red", "2 is blue",
        "1 collision that the tracks deny: 1 and 2 at 0.7 s (both go on as if there had been none)",
    ]  # fmt: skip
    given = json.loads(run("verify", "tracks.csv", "--json").out)
    assert [event["type"] for event in given["events"]] == ["collision"]
    assert [finding["rule"] for finding in given["findings"]] == ["implausible_collision"]


def test_verify_reports_to_machines_about_foreign_tracks(run: Run, tracks: Path) -> None:
    done = run("verify", "tracks.csv", "--intersection", "amsterdam_120", "--json")
    given = json.loads(done.out)
    assert (done.code, given["ok"]) == (0, True)
    assert [event["type"] for event in given["events"]] == ["collision"]
    assert [agent["name"] for agent in given["agents"]] == ["red", "blue"]


def test_verify_names_who_leaves_the_map(run: Run, tmp_path: Path) -> None:
    (tmp_path / "far.csv").write_text("t,id,class,x,y\n0,1,car,900,900\n0.1,1,car,901,900\n")
    done = run("verify", "far.csv", "--intersection", "amsterdam_120")
    assert done.code == 0
    assert "no events" in done.out
    assert "0.0% of its positions on the road" in done.out


def test_verify_takes_scenes_and_tracks_together(run: Run, crash: Path, tracks: Path) -> None:
    assert "verified" in run("verify", str(crash), "tracks.csv").out
    given = json.loads(run("verify", str(crash), "tracks.csv", "--json").out)
    assert given["ok"] is True
    assert given["scenes"][0]["verified"] is True
    assert given["scenes"][1]["events"][0]["type"] == "collision"


def test_verify_says_what_it_assumed(run: Run, tmp_path: Path) -> None:
    (tmp_path / "still.csv").write_text("t,id,class,x,y\n0,1,car,0,0\n0.1,1,car,0,0\n")
    assert "note: still.csv: id 1 without heading" in run("verify", "still.csv").err


def test_verify_refuses_tracks_in_one_line(run: Run, tracks: Path) -> None:
    tracks.write_text(tracks.read_text() + "\n2.1,red,car,nan,0")
    done = run("verify", "tracks.csv")
    assert (done.code, done.out) == (2, "")
    assert "tracks.csv, line 44: x is nan" in done.complaint
    given = json.loads(run("verify", "tracks.csv", "--json").out)
    assert given["ok"] is False
    assert "line 44" in given["scenes"][0]["error"]


def test_verify_against_another_map(run: Run, crash: Path) -> None:
    done = run("verify", str(crash), "--intersection", "nowhere")
    assert (done.code, done.out) == (2, "")
    assert "nowhere" in done.complaint


def test_show_needs_a_recording(run: Run, crash: Path) -> None:
    done = run("show", str(crash))
    assert done.code == 2
    assert "scene.rrd" in done.complaint


def test_show_draws_one_scene_or_a_contact_sheet_of_several(run: Run, crash: Path) -> None:
    assert run("show", str(crash), "--png", "one.png").code == 0
    Path("aside").mkdir()  # as a dataset's folder of tables
    done = run("show", str(crash), "aside", str(crash), "--png", "sheet.png")
    assert (done.code, done.out) == (0, "sheet.png\n")
    with Image.open("one.png") as picture, Image.open("sheet.png") as several:
        one, sheet = picture.size, several.size
    assert sheet[0] / sheet[1] > 1.5 * one[0] / one[1]
    done = run("show", str(crash), str(crash), "--gif", "x.gif")
    assert done.code == 2
    assert "--png" in done.complaint
    assert run("show", "aside", "aside", "--png", "x.png").code == 2
    assert not Path("x.png").exists()


def test_show_opens_a_recording(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr("scenewright.viz.recording.open_recording", opened.append)
    assert run("show", "scenes/x").code == 0
    assert opened == ["scenes/x"]


def test_intersections_are_listed_and_shown(run: Run, tmp_path: Path) -> None:
    assert "amsterdam_120" in run("intersections", "list").out
    given = json.loads(run("intersections", "list", "--json").out)
    assert "amsterdam_120" in [row["name"] for row in given["intersections"]]
    shown = run("intersections", "show", "amsterdam_120", "--png", "map.png")
    assert "from north: " in shown.out
    assert (tmp_path / "map.png").read_bytes()[:4] == b"\x89PNG"
    facts = json.loads(run("intersections", "show", "amsterdam_120", "--json").out)
    assert [leg["name"] for leg in facts["legs"]] == ["north", "east", "south", "west"]


def test_an_unknown_intersection_lists_the_known(run: Run, tmp_path: Path) -> None:
    done = run("intersections", "show", "../nowhere")
    assert done.code == 2
    assert "amsterdam_120" in done.complaint
    assert everything_in(tmp_path) == []


@pytest.mark.parametrize(
    "words",
    [[], ["make"], ["plan"], ["verify"], ["show"], ["intersections"], ["intersections", "train"]],
    ids=" ".join,
)
def test_every_command_explains_itself(run: Run, words: list[str]) -> None:
    done = run(*words, "--help")
    assert done.code == 0
    assert done.out.startswith("Usage: scenewright")


def test_an_unknown_command_is_one_line(run: Run) -> None:
    assert run("frobnicate").code == 2


def command(*words: str, **how: Any) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "scenewright", *words], stderr=subprocess.PIPE, **how
    )


def test_a_reader_that_has_left_is_no_drama(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    process = command("intersections", "list", stdout=writer, cwd=tmp_path)
    os.close(writer)
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said) == (141, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_stdout_is_one_line(tmp_path: Path) -> None:
    with Path("/dev/full").open("wb") as full:
        process = command("intersections", "list", stdout=full, cwd=tmp_path)
        _, said = process.communicate(timeout=60)
    assert (process.returncode, said.decode()) == (2, "scenewright: No space left on device\n")


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_a_run_without_a_trace(tmp_path: Path, number: int, code: int) -> None:
    process = command(
        *("make", QUICK, "--out", "x"),
        stdout=subprocess.PIPE,
        cwd=tmp_path,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert process.stderr is not None
    assert process.stderr.readline().startswith(b"planning: ")
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    assert process.returncode == code, said
    assert b"Traceback" not in said
    assert everything_in(tmp_path) == []
