"""Errors, replies of turns, comparisons and coverage in words and as objects."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from scenewright.authoring.session import Session
from scenewright.backends import load_backend
from scenewright.cli import interrupts
from scenewright.cli.coverage import read_encounters
from scenewright.cli.errors import CliError, to_cli_error
from scenewright.cli.options import (
    BoardOptions,
    DrawOptions,
    ModelOptions,
    PlaceOptions,
    SessionOptions,
)
from scenewright.cli.refiners import _split_recordings, compare_errors
from scenewright.cli.scene_summary import describe_avoidability, list_choices
from scenewright.cli.sessions import (
    add_facts,
    choose_free_name,
    find_memory_file,
    get_version,
    list_threads,
    list_versions,
    open_session,
)
from scenewright.cli.turn_report import format_reply
from scenewright.cli.views import add_views, render
from scenewright.errors import (
    BackendFault,
    BusyError,
    InputError,
    OutOfTime,
    ScenewrightError,
    Unsatisfiable,
)
from scenewright.extras import MissingPackageError
from scenewright.scene.account import SaidRecord
from scenewright.scene.events import Event
from scenewright.scene.rejection import Rejection, RejectionCode
from scenewright.scene.track import Track
from scenewright.tools.track_io.cleaning import CleaningReport
from scenewright.tools.track_io.track_files import FileTracks


def reject(code: RejectionCode) -> Rejection:
    return Rejection(stage="waypoint_filter", code=code, detail="why")


@pytest.mark.parametrize(
    ("error", "code", "exit_code", "reason"),
    [
        (InputError("a", "b\x1bc"), "unusable_input", 2, "a\nb c"),
        (BusyError("busy"), "unusable_input", 2, "busy"),
        (BackendFault("no key"), "backend_failed", 4, "no key"),
        (Unsatisfiable("none"), "unsatisfiable", 3, "none"),
        (MemoryError(), "out_of_memory", 2, "there is not enough memory for this"),
        (OSError(2, "No such file", "a.json"), "unusable_input", 2, "No such file: a.json"),
        (OSError(28, "disk full"), "unusable_input", 2, "disk full"),
        (OSError(), "unusable_input", 2, "OSError"),
        (KeyboardInterrupt(), "interrupted", 130, "interrupted; nothing was written"),
        (
            ValueError("x"),
            "internal_error",
            70,
            "this is a fault in scenewright: ValueError: x (SCENEWRIGHT_TRACEBACK=1 shows where)",
        ),
    ],
)
def test_an_error_has_its_code_and_one_reason(
    error: BaseException, code: str, exit_code: int, reason: str
) -> None:
    fault = to_cli_error(error)
    assert (fault.code, fault.exit_code, fault.reason) == (code, exit_code, reason)
    told = fault.to_json()
    assert (told["ok"], told["code"], told["exit_code"]) == (False, code, exit_code)
    assert told["reason"] == reason


@pytest.mark.parametrize(("number", "exit_code"), [(2, 130), (15, 143)])
def test_an_error_after_a_signal_is_the_interruption(
    number: int, exit_code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(interrupts, "_received", [number])
    fault = to_cli_error(ValueError("a library lost the interruption"))
    assert (fault.code, fault.exit_code) == ("interrupted", exit_code)


def test_ctrl_c_is_forgotten_where_it_ends_a_turn_alone_and_an_end_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(interrupts, "_received", [2, 15, 2])
    interrupts.forget_interrupt()
    assert interrupts.has_terminate_signal()
    with pytest.raises(KeyboardInterrupt):
        interrupts.stop_if_asked()
    monkeypatch.setattr(interrupts, "_received", [2])
    interrupts.forget_interrupt()
    assert not interrupts.has_stop_signal()
    interrupts.stop_if_asked()


def test_the_last_note_counts_until_the_next_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interrupts, "_kept", [])
    assert interrupts.get_note() is None
    interrupts.keep("3 scenes are kept")
    interrupts.keep("4 scenes are kept")
    assert interrupts.get_note() == "4 scenes are kept"
    with interrupts.watch_signals():
        assert interrupts.get_note() is None


@pytest.mark.parametrize(
    ("codes", "message", "line"),
    [
        (("contradictory",), "no", "no. Change or drop one of the two."),
        (("contradictory",), "no!", "no! Change or drop one of the two."),
        (
            ("contradictory", "unlawful"),
            "no.",
            "no. Say that the light is run, or drop --lawful (orders: --no-lawful).",
        ),
        (("malformed_reply",), "no", "no"),
        ((), "no", "no"),
    ],
)
def test_the_last_rejection_gives_the_advice(
    codes: tuple[RejectionCode, ...], message: str, line: str
) -> None:
    fault = to_cli_error(Unsatisfiable(message, tuple(map(reject, codes))))
    assert fault.reason == line
    assert [each["code"] for each in fault.to_json()["rejections"]] == list(codes)
    assert (fault.details["advice"] is None) == (line == message)


def test_a_limit_of_time_has_its_own_advice() -> None:
    fault = to_cli_error(OutOfTime("late", (reject("contradictory"),)))
    assert fault.reason.startswith("late. A longer --time-limit")


def test_what_models_were_asked_is_told_with_the_error() -> None:
    for error in (InputError("x"), BackendFault("x"), Unsatisfiable("x")):
        assert "models" not in to_cli_error(error).to_json()
        error.models = {"plan": {"requests": 2}}
        assert to_cli_error(error).to_json()["models"] == {"plan": {"requests": 2}}


def test_details_stand_beside_the_reason() -> None:
    told = CliError("c", 3, "r", {"advice": "a"}).to_json()
    assert told == {"ok": False, "code": "c", "exit_code": 3, "reason": "r", "advice": "a"}


REPLIES: list[tuple[dict[str, Any], list[tuple[str, str]]]] = [
    ({"kind": "asked", "question": "Which car?"}, [("yellow", "Which car?")]),
    ({"kind": "refused", "reason": "no tram"}, [("red", "refused: no tram")]),
    ({"kind": "answer", "lines": ["a", "b"]}, [("", "a"), ("", "b")]),
    ({"kind": "why", "lines": []}, []),
    ({"kind": "nothing", "reason": "no more"}, [("dim", "no more")]),
    ({"kind": "made", "version": 3}, [("", "version 3")]),
    ({"kind": "help", "text": "a\nb\n"}, [("", "a"), ("", "b")]),
    (
        {"kind": "saved", "warnings": ["no png"], "folder": "x", "files": ["a", "b"]},
        [("yellow", "warning: no png"), ("green", "x: a, b")],
    ),
    ({"kind": "history", "versions": [], "current": None}, [("dim", "there is no version yet")]),
    (
        {
            "kind": "history",
            "current": 2,
            "versions": [
                {"version": 1, "from": None, "words": "a car"},
                {"version": 2, "from": 1, "words": "a bus"},
            ],
        },
        [("", "  1: a car"), ("green", "* 2 (from 1): a bus")],
    ),
    ({"kind": "branches", "branch": "main", "branches": {}}, [("dim", "there is no version yet")]),
    (
        {"kind": "branches", "branch": "b", "branches": {"main": 1, "b": 2}},
        [("", "  main: version 1"), ("", "* b: version 2")],
    ),
    (
        {
            "kind": "compared",
            "first": 1,
            "second": 2,
            "differences": [("duration", "10 s", "12 s")],
            "same": ["vehicle-1"],
            "changed": [],
            "only_first": [],
            "only_second": [f"v{n}" for n in range(10)],
        },
        [
            ("green", "versions 1 and 2"),
            ("", "  duration: 10 s | 12 s"),
            ("dim", "  the same to the last bit: vehicle-1"),
            ("dim", "  only in 2: v0, v1, v2, v3, v4, v5, v6, v7 and 2 more"),
        ],
    ),
]


@pytest.mark.parametrize(("reply", "lines"), REPLIES, ids=lambda each: str(each)[:30])
def test_a_reply_is_lines_with_a_style(reply: dict[str, Any], lines: list[tuple[str, str]]) -> None:
    assert format_reply(reply, None) == lines


def test_agents_of_a_shown_version_are_told_apart_from_the_background() -> None:
    agent = {"id": 1, "name": "vehicle-1", "type": "vehicle", "subtype": "taxi",
             "entry": "north", "exit": "south", "role": "foreground"}  # fmt: skip
    other = agent | {"id": 12, "subtype": None, "role": "background"}
    assert format_reply({"kind": "shown", "version": 1, "agents": [agent, other]}, None) == [
        ("", "version 1"),
        ("", "    1 vehicle-1: taxi, north to south"),
        ("dim", "   12 vehicle-1: vehicle, north to south, background"),
    ]


@pytest.mark.parametrize(
    ("taken", "name"),
    [((), "chat-1"), (("chat-1", "chat-3"), "chat-2"), (("other-1",), "chat-1")],
)
def test_the_first_free_name_is_taken(taken: tuple[str, ...], name: str) -> None:
    assert choose_free_name("chat", taken) == name


@pytest.mark.parametrize("name", ["", "-a", ".a", "a b", "a/b", "../a", "x" * 65, "ä", "a\n"])
def test_a_name_of_a_thread_is_plain(name: str, tmp_path: Path) -> None:
    options = SessionOptions(threads=str(tmp_path / "t.sqlite"))
    with pytest.raises(InputError, match="is no name for a thread"):
        open_session(options, name, load_backend("builtin"))
    assert list(tmp_path.iterdir()) == []


def test_a_new_conversation_has_no_version(tmp_path: Path) -> None:
    file = str(tmp_path / "t.sqlite")
    assert list_threads(file) == []
    options = SessionOptions(threads=file)
    threads, session = open_session(options, "a.b-C_1", load_backend("builtin"), refiner="none")
    try:
        assert list_versions(session) == {"versions": [], "current": None}
        with pytest.raises(InputError, match="there is no scene yet"):
            get_version(session)
    finally:
        threads.close()


def test_a_reply_that_shows_nothing_has_no_facts() -> None:
    reply = {"kind": "refused", "reason": "no"}
    assert add_facts(cast("Session", None), reply) == (reply, None)


def test_the_memory_is_in_the_folder_of_data(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SCENEWRIGHT_DATA", str(tmp_path))
    assert find_memory_file() == tmp_path / "memory.jsonl"


def errors(vehicle: float, pedestrian: float, *, walked: int = 100) -> dict[str, float]:
    return {
        "vehicle_n": 100,
        "vehicle_ade_waypoints": vehicle,
        "pedestrian_n": walked,
        "pedestrian_ade_waypoints": pedestrian,
    }


@pytest.mark.parametrize(
    ("before", "after", "better"),
    [
        (errors(0.4, 0.4), errors(0.3, 0.3), True),
        (errors(0.4, 0.4), errors(0.4, 0.4), True),
        (errors(0.4, 0.4), errors(0.1, 0.5), False),
        (errors(0.4, 0.4), errors(0.1, 0.5, walked=19), True),
        (errors(0.4, 0.4), errors(0.1, 0.5, walked=20), False),
    ],
)
def test_no_class_that_decides_may_be_worse(
    before: dict[str, float], after: dict[str, float], better: bool
) -> None:
    said, is_better = compare_errors(before, after)
    assert is_better == better
    assert ("pedestrians held out" in said) == (after["pedestrian_n"] >= 20)


def test_errors_are_said_with_their_number_of_samples() -> None:
    said, _ = compare_errors(errors(0.4, 0.4), errors(0.1234, 0.5, walked=0))
    assert said == (
        "vehicles held out are off by 0.123 m, by the shipped weights 0.400 m (n = 100)"
    )
    nothing = {"vehicle_n": 0, "pedestrian_n": 0}
    assert compare_errors(nothing, nothing) == ("fewer than 20 moments of held-out agents", False)


def test_agents_of_the_first_60_percent_of_the_time_are_learned_from() -> None:
    def track(start: float) -> Track:
        xy = np.stack([np.arange(11.0), np.zeros(11)], axis=1)
        return Track(xy, np.zeros(11), start)

    tracks = [("car", track(start)) for start in (9.0, 0.0, 5.9, 6.1)]
    bicycle = ("bicycle", track(0.0))
    file = FileTracks("a.csv", (*tracks, bicycle), CleaningReport(), None, None, 60.0)
    fit, test = _split_recordings("here", file)
    assert [agent.track.start for agent in fit.agents] == [0.0, 5.9]
    assert [agent.track.start for agent in test.agents] == [6.1, 9.0]
    assert (fit.split, test.split) == ("fit", "test")
    alone = FileTracks("a.csv", (bicycle,), CleaningReport(), None, None, 60.0)
    assert list(_split_recordings("here", alone)) == []


EVENT = Event.model_validate({
    "type": "collision", "from": 1, "to": 2, "time": 4.0, "location": (0.0, 0.0), "evidence": {},
})  # fmt: skip
PARTY = {"event": "collision", "time": 4.0, "agent": 1, "other": 2, "avoidable": True,
         "after_reaction": 3.456, "needed_braking": 2.04, "visible_from": 1.0}  # fmt: skip


@pytest.mark.parametrize(
    ("rows", "lines"),
    [
        ([], []),
        ([PARTY | {"time": 5.0}], []),
        ([PARTY | {"other": 3}], []),
        (
            [PARTY],
            ["to avoid it: red braking at 2.0 m/s² from 1.0 s on (3.5 after 1 s)"],
        ),
        ([PARTY | {"after_reaction": 0.0}], ["to avoid it: red at the speed it had at 1.0 s"]),
        (
            [PARTY | {"agent": 2, "other": 1, "avoidable": False, "why_not": "no time"}],
            ["to avoid it: agent 2 could not (no time)"],
        ),
    ],
)
def test_what_would_have_avoided_an_event_is_said_of_its_parties(
    rows: list[dict[str, Any]], lines: list[str]
) -> None:
    assert describe_avoidability(EVENT, rows, {1: "red"}) == lines


def test_a_leg_that_was_chosen_is_said_where_there_is_a_note() -> None:
    entry = SaidRecord(start=0, end=3, words="car", became="entry", value="north", note="any leg")
    assert list_choices([entry]) == ["chosen: the north leg (any leg)"]
    assert list_choices([entry.model_copy(update={"note": ""})]) == []


def write(path: Path) -> None:
    path.write_bytes(b"view")


def fail_with(error: Exception) -> Callable[[Path], None]:
    def fail(_path: Path) -> None:
        raise error

    return fail


def test_a_view_that_cannot_be_drawn_is_a_warning(tmp_path: Path) -> None:
    names: list[str] = []
    views = {
        "a": write,
        "b": fail_with(MissingPackageError("install it")),
        "c": fail_with(ValueError("x" * 500)),
    }
    missing, strange = add_views(tmp_path, views, names.append)
    assert missing == "no b: install it"
    assert strange == "no c: ValueError: " + "x" * 281 + "…"
    assert (names, (tmp_path / "a").read_bytes()) == (["a", "b", "c"], b"view")


@pytest.mark.parametrize("error", [InputError("disk full"), MemoryError(), Unsatisfiable("no")])
def test_a_fault_that_concerns_the_scene_is_raised(error: Exception, tmp_path: Path) -> None:
    with pytest.raises((ScenewrightError, MemoryError)) as raised:
        add_views(tmp_path, {"a": fail_with(error)})
    assert raised.value is error


def test_a_file_is_rendered_to_its_bytes() -> None:
    assert render(write) == b"view"


def test_a_board_and_a_name_go_together() -> None:
    assert BoardOptions().enter({}) == []
    for half in ({"board": "b.json"}, {"name": "mine"}):
        with pytest.raises(InputError, match="--board and --name go together"):
            BoardOptions(**half)


def test_options_that_are_not_the_default_become_words() -> None:
    assert PlaceOptions().list_words() == []
    assert PlaceOptions(time_limit=3.5).list_words() == ["--time-limit", "3.5"]
    assert DrawOptions(selection="map", lenient=True, max_agents=4).list_words() == [
        "--selection", "map", "--lenient", "--max-agents", "4",
    ]  # fmt: skip


def test_a_request_passes_on_what_a_function_takes() -> None:
    def take(lenient: bool, other: int) -> None:
        del lenient, other

    assert DrawOptions(lenient=True).pass_on(take) == {"lenient": True}


def test_a_model_that_there_is_not_names_the_option() -> None:
    with pytest.raises(InputError, match="nobody"):
        ModelOptions(backend=["nobody"]).load()


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"verified": true}', "\xff"], ids=repr)
def test_a_damaged_proof_names_its_folder(text: str, tmp_path: Path) -> None:
    (tmp_path / "scene").mkdir()
    (tmp_path / "scene" / "proof.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match="scene holds no scene with its proof"):
        read_encounters([str(tmp_path)])


def test_scenes_that_are_not_verified_do_not_count(tmp_path: Path) -> None:
    (tmp_path / "proof.json").write_text(json.dumps({"verified": False}))
    with pytest.raises(InputError, match="there is no verified scene in"):
        read_encounters([str(tmp_path)])
    with pytest.raises(InputError, match="there is no verified scene in a, b"):
        read_encounters(["a", "b"])
