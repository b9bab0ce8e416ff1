"""Commands refuse what they cannot use in one line, with the exit code, and write nothing."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import scenewright
from scenewright.backends import load_backend
from scenewright.cli.batch import RunOptions
from scenewright.cli.catalogue import format_entry, read_catalogue
from scenewright.cli.main import main
from scenewright.cli.page import batches as page_batches
from scenewright.cli.page.batches import Batches
from scenewright.cli.page.own_maps import OwnMaps
from scenewright.cli.plan import plan_all, read_rows
from scenewright.errors import InputError

Call = Callable[..., tuple[int, str, str]]


@pytest.fixture
def call(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Call:
    """Exit code, stdout and stderr of the command line in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SCENEWRIGHT_DATA", str(tmp_path))

    def run(*words: str) -> tuple[int, str, str]:
        code = main(words)
        out, err = capsys.readouterr()
        assert "Traceback" not in out + err
        return code, out, err

    return run


REFUSED: list[tuple[str, str]] = [
    ("make", "Missing argument"),
    ("make words --seed x", "--seed"),
    ("make words --unknown", "unknown"),
    ("make words --selection some", "--selection"),
    ("make words --intersection nowhere", "nowhere"),
    ("make words --backend nobody", "nobody"),
    ("make words --time-limit soon", "--time-limit"),
    ("make words --max-agents many", "--max-agents"),
    ("plan missing.jsonl", "missing.jsonl"),
    ("verify", "Missing argument"),
    ("verify missing", "missing"),
    ("export missing --to csv --out x", "missing"),
    ("export missing --out x", "--to"),
    ("show a b", "one recording is opened at a time"),
    ("show missing --png x.png", "missing"),
    ("find words missing.csv", "describes no traffic scene"),
    ("find words missing.csv --limit 0", "--limit"),
    ("coverage missing", "there is no verified scene in missing"),
    ("coverage missing --goal goals.yaml", "goals.yaml"),
    ("catalogue show nothing", "there is no nothing"),
    ("catalogue make", "name one plan, or write --all"),
    ("catalogue make nothing --all", "name one plan, or write --all"),
    ("catalogue make nothing", "there is no nothing"),
    ("dataset check missing", "missing"),
    ("dataset check missing --workers 0", "--workers"),
    ("dataset join missing other", "missing"),
    ("dataset export missing --to csv --out x", "missing"),
    ("intersections show nowhere", "nowhere"),
    ("evals tables missing --corpus none.npz", "there is no none.npz"),
    ("evals tables missing --draws 9", "--draws"),
    ("batch missing.jsonl --out x", "missing.jsonl"),
    ("sweep missing.yaml --out x", "missing.yaml"),
]


@pytest.mark.parametrize(("words", "said"), REFUSED, ids=[each for each, _ in REFUSED])
def test_a_command_refuses_and_writes_nothing(
    words: str, said: str, call: Call, tmp_path: Path
) -> None:
    code, out, err = call(*words.split())
    assert (code, out) == (2, "")
    lines = [line for line in err.splitlines() if line.startswith("scenewright: ")]
    assert any(said in line for line in lines), err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "words", ["verify missing", "catalogue list --no-such", "coverage missing", "plan"]
)
def test_a_refusal_is_an_object_for_machines(words: str, call: Call) -> None:
    code, out, _ = call(*words.split(), "--json")
    told = json.loads(out)
    assert (code, told["ok"]) == (2, False)


def test_a_search_names_the_file_that_cannot_be_read(call: Call, tmp_path: Path) -> None:
    code, out, err = call("find", "A car yields to a pedestrian", "missing.csv")
    assert (code, out) == (2, "0 hits\n")
    assert "missing.csv" in err
    assert list(tmp_path.iterdir()) == []


def test_the_version_is_one_line(call: Call) -> None:
    assert call("--version") == (0, f"scenewright {scenewright.__version__}\n", "")


def test_without_a_command_the_help_is_shown(call: Call) -> None:
    code, out, _ = call()
    assert (code, out.split()[:2]) == (0, ["Usage:", "scenewright"])


def test_the_catalogue_is_listed_as_text_and_as_an_object(call: Call) -> None:
    code, out, _ = call("catalogue", "list", "--json")
    told, (_, sources) = json.loads(out), read_catalogue()
    assert (code, list(told["plans"])) == (0, list(sources["plans"]))
    _, text, _ = call("catalogue", "list")
    assert all(name in text for name in told["plans"])
    assert all(why in text for why in told["absent"].values())


@pytest.mark.parametrize("name", read_catalogue()[1]["plans"])
def test_an_entry_is_its_plan_below_its_source(name: str) -> None:
    folder, sources = read_catalogue()
    plan = (folder / f"{name}.yaml").read_text("utf-8")
    text = format_entry(name)
    assert text.endswith(plan)
    head = text.removesuffix(plan).splitlines()
    assert head == [f"# {key}: {value}" for key, value in sources["plans"][name].items()]


def test_an_empty_memory_is_listed_and_wiped(call: Call, tmp_path: Path) -> None:
    code, out, _ = call("memory", "list", "--json")
    file = str(tmp_path / "memory.jsonl")
    assert (code, json.loads(out)) == (0, {"ok": True, "file": file, "episodes": []})
    code, out, err = call("memory", "wipe")
    assert (code, out, err) == (0, "", "0 episodes forgotten\n")


def test_no_conversation_is_listed_where_there_is_none(call: Call) -> None:
    assert call("chat", "--list", "--threads", "t.sqlite")[:2] == (0, "")
    code, out, _ = call("chat", "--list", "--threads", "t.sqlite", "--json")
    assert (code, json.loads(out)) == (0, {"ok": True, "threads": []})


@pytest.mark.parametrize(
    ("data", "rows"),
    [
        (b"", []),
        (b"\n \n", []),
        (b'\xef\xbb\xbf{"id": "a"}\r\n\n[1]', [{"id": "a"}, [1]]),
        ('"\u2028"\n'.encode(), ["\u2028"]),
    ],
)
def test_rows_are_the_lines_that_are_not_blank(
    data: bytes, rows: list[Any], tmp_path: Path
) -> None:
    (tmp_path / "rows.jsonl").write_bytes(data)
    assert read_rows(str(tmp_path / "rows.jsonl")) == rows


@pytest.mark.parametrize(
    ("data", "said"),
    [(b'{}\n\n{"a"', "line 3: not JSON"), (b"\xff", "cannot read"), (b"[" * 10**5, "line 1")],
    ids=["torn", "not UTF-8", "deep"],
)
def test_damaged_rows_name_their_line(data: bytes, said: str, tmp_path: Path) -> None:
    (tmp_path / "rows.jsonl").write_bytes(data)
    with pytest.raises(InputError, match=said):
        read_rows(str(tmp_path / "rows.jsonl"))


@pytest.mark.parametrize(
    ("row", "name", "reason"),
    [
        ([1], None, "A row is an object with 'id' and 'text'."),
        ({}, None, "The row needs 'id' as a string."),
        ({"id": 3, "text": "x"}, 3, "The row needs 'id' as a string."),
        ({"id": "a"}, "a", "The row needs 'text' as a string."),
        ({"id": "a", "text": None}, "a", "The row needs 'text' as a string."),
        (
            {"id": "a", "text": "x", "previous": 1},
            "a",
            "'previous' must be a string, the text of the earlier turn.",
        ),
    ],
)
def test_a_row_that_is_none_is_refused_under_its_id(row: Any, name: Any, reason: str) -> None:
    (planned,), paid = plan_all([row], load_backend("builtin"))
    assert (planned["id"], planned["refused"], planned["reason"]) == (name, True, reason)
    assert (planned["agents"], planned["relations"], paid) == ([], [], {})


@pytest.fixture
def batches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Batches:
    """Batches whose process is not started."""

    class Ended:
        def poll(self) -> int:
            return 0

    monkeypatch.setattr(page_batches, "_launch", lambda _folder, _run: Ended())
    return Batches(tmp_path / "batches", RunOptions())


ROWS = b'{"id": "a", "text": "A car"}\n{"id": "b", "text": "A bus"}\n'


def test_batches_are_numbered_and_listed_newest_first(batches: Batches) -> None:
    assert batches.list_names() == {"batches": []}
    started = [batches.start(ROWS)["batch"] for _ in range(11)]
    assert started == [f"batch-{n}" for n in range(1, 12)]
    assert batches.list_names()["batches"] == started[::-1]


def test_rows_that_cannot_be_used_leave_no_batch(batches: Batches, tmp_path: Path) -> None:
    for rows in (b"{", b'{"text": "no id"}\n'):
        with pytest.raises(InputError, match="the rows") as refused:
            batches.start(rows)
        assert str(tmp_path) not in str(refused.value)
    with pytest.raises(InputError, match="nowhere"):
        batches.start(ROWS, intersection="nowhere")
    assert batches.list_names() == {"batches": []}
    assert not list((tmp_path / "batches").iterdir())


@pytest.mark.parametrize("name", ["", "batch-1", "batch-x", "../batch-1", "batch-1/..", "batch-"])
def test_a_batch_that_there_is_not_is_refused(name: str, batches: Batches) -> None:
    for ask in (batches.describe, batches.stop, batches.go_on):
        with pytest.raises(InputError, match="there is no batch"):
            ask(name)


def test_a_batch_without_scenes_is_described_with_its_last_error(
    batches: Batches, tmp_path: Path
) -> None:
    name = batches.start(ROWS)["batch"]
    (tmp_path / "batches" / name / "out").mkdir()
    (tmp_path / "batches" / name / "errors.txt").write_text(
        "scenewright: first\nscenewright:  last \nnote: other\n"
    )
    assert batches.describe(name) == {
        "batch": name, "rows": 2, "done": 0, "running": False, "error": "last", "scenes": [],
    }  # fmt: skip
    with pytest.raises(InputError, match="there is no scene of this row"):
        batches.show_scene(name, 0)


@pytest.mark.parametrize("name", ["", "map.pdf", "map.osm.gz", "osm"])
def test_a_file_that_is_no_map_is_not_kept(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="a map is OpenStreetMap"):
        OwnMaps(tmp_path / "maps").keep(b"data", name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("data", [b"", b"<osm", b"\xff\x00"], ids=repr)
def test_a_damaged_map_is_refused_by_its_name_and_removed(data: bytes, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        OwnMaps(tmp_path / "maps").keep(data, "town.osm")
    assert str(tmp_path) not in str(refused.value)
    assert list((tmp_path / "maps").iterdir()) == []


@pytest.mark.parametrize("name", ["", "town.osm", "../x.osm", "0123456789abcdef.osm"])
def test_a_map_that_is_gone_is_to_be_dropped_again(name: str, tmp_path: Path) -> None:
    from scenewright.cli.options import ImportOptions

    with pytest.raises(InputError, match="drop it again"):
        OwnMaps(tmp_path).import_junction(name, ImportOptions(name="x"))
