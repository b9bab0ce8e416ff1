"""Lines for people, objects for machines, and folders that appear whole or not at all."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scenewright.cli import console, interrupts
from scenewright.cli.console import (
    Result,
    count,
    format_columns,
    format_one_line,
    paint,
    shorten,
    show_progress,
    show_result,
    tell,
    write_json,
)
from scenewright.cli.output_folder import (
    SCENES,
    choose_folder_name,
    fill_folder,
    plan_folder,
    shorten_path,
    target_folder,
    write_report,
)
from scenewright.errors import InputError

Capture = pytest.CaptureFixture[str]


@pytest.mark.parametrize(
    ("number", "words"), [(0, "0 files"), (1, "1 file"), (2, "2 files"), (1000, "1000 files")]
)
def test_a_number_of_things_is_singular_for_one_alone(number: int, words: str) -> None:
    assert count(number, "file") == words


@pytest.mark.parametrize(
    ("number", "most", "shown"),
    [
        (0, 2, []),
        (2, 2, ["0", "1"]),
        (3, 2, ["0", "1", "and 1 more"]),
        (9, 2, ["0", "1", "and 7 more"]),
        (3, 0, ["and 3 more"]),
    ],
)
def test_lines_beyond_the_most_are_counted(number: int, most: int, shown: list[str]) -> None:
    assert shorten([str(each) for each in range(number)], most) == shown


@pytest.mark.parametrize(
    ("text", "limit", "line"),
    [
        ("", 5, ""),
        ("  a \t b\r\n c ", 9, "a b c"),
        ("abcde", 5, "abcde"),
        ("abcdef", 5, "abcd…"),
        ("a\x00b\x07c", 9, "a b c"),
        ("ä ö 車", 9, "ä ö 車"),
        ("a\u200bb", 9, "a b"),
    ],
)
def test_a_text_becomes_one_line_of_a_limited_length(text: str, limit: int, line: str) -> None:
    assert format_one_line(text, limit=limit) == line
    assert len(line) <= limit


def test_columns_are_as_wide_as_their_widest_cell() -> None:
    rows = [("car", "1", ""), ("pedestrian", "12", "x")]
    assert format_columns(("kind", "n", "mark"), rows, right={"n"}).splitlines() == [
        "",
        " kind          n   mark",
        " " + "─" * len("pedestrian   12   mark"),
        " car           1",
        " pedestrian   12   x",
        "",
    ]


def test_cells_of_a_column_begin_or_end_at_one_place() -> None:
    table = format_columns(("kind", "n"), [("car", "1"), ("bus", "100")], right={"n"})
    lines = table.splitlines()
    assert [lines[1], *lines[3:5]] == [" kind     n", " car      1", " bus    100"]
    table = format_columns(("kind", "n"), [("car", "1"), ("bus", "100")], right=set())
    lines = table.splitlines()
    assert [lines[1], *lines[3:5]] == [" kind   n", " car    1", " bus    100"]


def test_a_row_of_another_length_is_a_bug() -> None:
    with pytest.raises(ValueError, match="zip"):
        format_columns(("kind", "n"), [("car",)], right=set())


def test_colours_are_for_terminals_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    assert paint("line", "red") == "line"
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setattr(console, "is_terminal", lambda _stream: True)
    assert paint("line", "red") == "\x1b[31mline\x1b[0m"
    assert paint("line", "green") == "\x1b[32mline\x1b[0m"
    assert paint("line", "dim") == "\x1b[2mline\x1b[0m"
    assert paint("line", "") == "line"
    monkeypatch.setenv("NO_COLOR", "1")
    assert paint("line", "red") == "line"


def test_told_lines_keep_an_indent_and_no_control_character(capsys: Capture) -> None:
    tell(["first", "      second", "th\x1bird\nfourth"])
    assert capsys.readouterr().err == "first\n  second\nth ird fourth\n"


def test_a_result_is_shown_as_text_or_as_one_object(capsys: Capture) -> None:
    result = Result({"n": 1}, "text\n", summary=["summary"], notes=["note"])
    show_result(result, quiet=False, as_json=False)
    assert tuple(capsys.readouterr()) == ("text\n", "summary\nnote\n")
    show_result(result, quiet=True, as_json=False)
    assert tuple(capsys.readouterr()) == ("text\n", "note\n")
    show_result(result, quiet=True, as_json=True)
    assert tuple(capsys.readouterr()) == ('{"ok": true, "n": 1}\n', "note\n")


def test_a_text_that_is_computed_is_not_for_machines(capsys: Capture) -> None:
    asked: list[str] = []

    def build_text() -> str:
        asked.append("once")
        return "computed\n"

    show_result(Result({"ok": False}, build_text), quiet=True, as_json=True)
    assert (asked, capsys.readouterr().out) == ([], '{"ok": false}\n')
    show_result(Result({}, build_text), quiet=True, as_json=False)
    assert (asked, capsys.readouterr().out) == (["once"], "computed\n")


def test_an_object_for_machines_has_no_number_that_is_none(capsys: Capture) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json({"x": float("nan")})
    assert capsys.readouterr().out == ""


def test_progress_names_the_stage_and_holds_a_refusal_back(capsys: Capture) -> None:
    with show_progress(quiet=False) as log:
        log("scene_planner", "two agents")
        log("waypoint_filter", "refused: too near")
        assert capsys.readouterr().err == "planning: two agents\n"
        log("waypoint_filter", "3 left")
        assert capsys.readouterr().err == "solving: refused: too near\nsolving: 3 left\n"
        log("", "no stage")
        log("another", "of its own name")
        assert capsys.readouterr().err == "no stage\nanother: of its own name\n"
        log("scene_verifier", "refused: the last is the answer of the run")
    assert capsys.readouterr().err == ""


def test_progress_that_is_not_asked_for_is_silent_and_yet_stops(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    with show_progress(quiet=True) as log:
        log("scene_planner", "two agents")
        monkeypatch.setattr(interrupts, "_received", [2])
        with pytest.raises(KeyboardInterrupt):
            log("scene_planner", "two agents")
    assert tuple(capsys.readouterr()) == ("", "")


def test_a_folder_appears_once_it_is_full(tmp_path: Path) -> None:
    target = tmp_path / "a" / "b" / "scene"
    with fill_folder(target) as part:
        (part / "scene.json").write_text("new")
        assert not target.exists()
    assert [each.name for each in target.iterdir()] == ["scene.json"]
    assert [each.name for each in target.parent.iterdir()] == ["scene"]


def test_a_folder_that_failed_leaves_nothing_behind(tmp_path: Path) -> None:
    def fail(error: BaseException) -> None:
        with fill_folder(tmp_path / "a" / "b" / "scene") as part:
            (part / "scene.json").write_text("half")
            raise error

    with pytest.raises(InputError, match=r"cannot write .*scene: disk full"):
        fail(OSError(28, "disk full"))
    for kind in (KeyboardInterrupt, ZeroDivisionError):
        with pytest.raises(kind):
            fail(kind())
    assert list(tmp_path.iterdir()) == []


def test_an_earlier_scene_is_replaced_and_kept_if_the_new_one_fails(tmp_path: Path) -> None:
    target = tmp_path / "scene"
    target.mkdir()
    for name in ("scene.json", "scene.gif"):
        (target / name).write_text("old")

    def fail() -> None:
        with fill_folder(target) as part:
            (part / "scene.json").write_text("new")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert (target / "scene.json").read_text() == "old"
    with fill_folder(target) as part:
        (part / "scene.json").write_text("new")
    assert [each.name for each in target.iterdir()] == ["scene.json"]
    assert (target / "scene.json").read_text() == "new"
    assert [each.name for each in tmp_path.iterdir()] == ["scene"]


def test_files_beside_a_scene_stay_and_its_old_views_go(tmp_path: Path) -> None:
    target = tmp_path / "scene"
    target.mkdir()
    for name in ("scene.json", "scene.gif", "notes.txt"):
        (target / name).write_text("old")
    with fill_folder(target) as part:
        (part / "scene.json").write_text("new")
    assert sorted(each.name for each in target.iterdir()) == ["notes.txt", "scene.json"]
    assert (target / "notes.txt").read_text() == "old"
    assert (target / "scene.json").read_text() == "new"


def test_a_folder_of_other_files_is_written_by_force_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("")
    with pytest.raises(InputError, match="holds other files") as refused:
        target_folder(str(tmp_path), force=False)
    assert "--force" in str(refused.value)
    with pytest.raises(InputError, match=r"choose another --out$"):
        target_folder(str(tmp_path), force=None)
    assert target_folder(str(tmp_path), force=True) == tmp_path.resolve()
    (tmp_path / "scene.json").write_text("")
    with pytest.raises(InputError, match="holds other files"):
        target_folder(str(tmp_path), force=False)
    (tmp_path / "notes.txt").unlink()
    assert target_folder(str(tmp_path), force=False) == tmp_path.resolve()


def test_a_folder_is_named_by_its_scene_where_none_is_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    chosen = plan_folder(None, force=None)("A Scene: 1")
    assert chosen == tmp_path.resolve() / SCENES / "a-scene-1"
    assert plan_folder("there", force=None)("any") == tmp_path.resolve() / "there"
    (tmp_path / SCENES / "taken").mkdir(parents=True)
    (tmp_path / SCENES / "taken" / "notes").write_text("")
    with pytest.raises(InputError, match="holds other files"):
        plan_folder(None, force=None)("taken")


@pytest.mark.parametrize(
    ("scene_id", "name"),
    [
        ("", "scene"),
        ("---", "scene"),
        ("x" * 200, "x" * 80),
        ("x" * 79 + "-y", "x" * 79),
        ("A_b.C", "a_b-c"),
        (".hidden", "hidden"),
    ],
)
def test_a_name_of_a_folder_is_plain_and_short(scene_id: str, name: str) -> None:
    assert choose_folder_name(scene_id) == name


def test_a_report_is_a_page_and_its_values(tmp_path: Path) -> None:
    folder = write_report(tmp_path / "new", "tables", "# Ä\udcff\n", {"é": 1, "list": [1, 2]})
    assert sorted(each.name for each in folder.iterdir()) == ["tables.json", "tables.md"]
    assert (folder / "tables.md").read_bytes() == "# Ä\\udcff\n".encode()
    assert json.loads((folder / "tables.json").read_bytes()) == {"é": 1, "list": [1, 2]}
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_report(tmp_path / "other", "tables", "", {"x": float("inf")})
    assert not (tmp_path / "other").exists()


def test_paths_below_the_working_folder_are_shown_from_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert shorten_path(Path.cwd() / "a" / "b") == Path("a/b")
    assert shorten_path(Path.cwd().parent) == Path.cwd().parent
