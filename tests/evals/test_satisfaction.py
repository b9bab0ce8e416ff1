"""Satisfaction judged from tracks: who is who, what happens, nothing else, whatever made it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenewright import export, synthesize
from scenewright.cli.main import main
from scenewright.errors import InputError
from scenewright.evals.leaderboard import enter_leaderboard
from scenewright.evals.satisfaction import judge as judging
from scenewright.evals.satisfaction.judge import (
    SeenAgent,
    Submission,
    Verdict,
    count_verdicts,
    judge,
    read_submission,
    see_agents,
    to_markdown,
)
from scenewright.graph.run import Scene
from scenewright.intersections import load_map
from scenewright.scene.account import AccountEntry
from scenewright.scene.events import Event
from scenewright.scene.track import Shape, Track
from scenewright.tools.relation_checker import RoadUser

TEXT = "A car turning left from the north yields to a pedestrian on the east crosswalk at 5 am"


def row(*, refused: bool = False, **changes: Any) -> dict[str, Any]:
    car = {"id": "vehicle-1", "type": "vehicle", "entry": "north", "exit": "east",
           "movement": "left", "crosswalk": None}  # fmt: skip
    walker = {"id": "pedestrian-1", "type": "pedestrian", "entry": None, "exit": None,
              "movement": "crossing", "crosswalk": "east"}  # fmt: skip
    relation = {"type": "yielding", "from": "vehicle-1", "to": "pedestrian-1"}
    context = {"density": None, "time_of_day": None, "background": None}
    label = {"agents": [car, walker], "relations": [relation], "context": context}
    return {"id": "one", "text": TEXT, "expected": {**label, "refused": refused, **changes}}


CAR = SeenAgent(1, "vehicle", "north", "east", "left", frozenset())
WALKER = SeenAgent(2, "pedestrian", None, None, "crossing", frozenset({"east"}))
OTHER = SeenAgent(3, "vehicle", "south", "north", "straight", frozenset())


def event(kind: str, a: int, b: int, **evidence: float) -> Event:
    return Event.model_validate(
        {"type": kind, "from": a, "to": b, "time": 5.0, "location": (0.0, 0.0), "kind": None,
         "cause": None, "evidence": evidence}
    )  # fmt: skip


YIELD = event("yielding", 1, 2, pet=2.0)


def test_what_was_said_and_nothing_else_satisfies() -> None:
    queue = event("follow", 3, 1)
    assert judge(row(), Submission((CAR, WALKER, OTHER), (YIELD, queue))).outcome == "satisfied"


@pytest.mark.parametrize(
    ("submission", "reason"),
    [
        (Submission((CAR, WALKER), ()), "does not happen"),
        (Submission((CAR, WALKER), (event("yielding", 2, 1),)), "does not happen"),
        (Submission((replace(CAR, movement="right", exit="west"), WALKER), (YIELD,)), "does not"),
        (Submission((CAR, replace(WALKER, crosswalks=frozenset({"west"}))), (YIELD,)), "does not"),
        (Submission((CAR, WALKER, OTHER), (YIELD, event("collision", 3, 1))), "unasked collision"),
        (Submission((CAR, WALKER, OTHER), (YIELD, event("near_miss", 3, 2, pet=1.4))), "near_miss"),
        (Submission((CAR, WALKER), (YIELD,), fault="partly: 'rain' not shown"), "not shown"),
    ],
)
def test_anything_missing_turned_or_added_is_wrong(submission: Submission, reason: str) -> None:
    found = judge(row(), submission)
    assert found.outcome == "wrong"
    assert reason in str(found.reason)


def test_time_agents_without_events_and_impossible_texts_count() -> None:
    context = {"density": None, "time_of_day": "07:00-09:00", "background": None}
    late = Submission((CAR, WALKER), (YIELD,), time_of_day="10:00")
    assert judge(row(context=context), late).outcome == "wrong"
    assert judge(row(context=context), replace(late, time_of_day="08:00")).outcome == "satisfied"
    bystander = {"id": "vehicle-2", "type": "vehicle", "entry": "south", "exit": None,
                 "movement": "straight", "crosswalk": None}  # fmt: skip
    agents = [*row()["expected"]["agents"], bystander]
    assert judge(row(agents=agents), Submission((CAR, WALKER), (YIELD,))).outcome == "wrong"
    assert judge(row(agents=agents), Submission((CAR, WALKER, OTHER), (YIELD,))).outcome == (
        "satisfied"
    )
    assert judge(row(refused=True), None).outcome == "rightly_refused"
    assert judge(row(refused=True), Submission((CAR, WALKER), (YIELD,))).outcome == "wrong"
    assert judge(row(), None).outcome == "refused"


def test_a_track_cut_short_contradicts_nothing() -> None:
    cut = replace(CAR, exit=None, movement=None)
    assert judge(row(), Submission((cut, WALKER), (YIELD,))).outcome == "satisfied"


def test_legs_turns_and_crosswalks_are_read_off_tracks() -> None:
    place = load_map("amsterdam_120")
    route = next(each for each in place.movements if each.turn == "left")
    crosswalk = place.crosswalks[0]
    ways = (np.array(route.centreline), np.linspace(*map(np.array, crosswalk.centreline), 50))
    users = [
        RoadUser(
            n, Track(xy, np.arctan2(*np.gradient(xy, axis=0).T[::-1]), 0.0), Shape(kind, 4.0, 1.8)
        )  # type: ignore[arg-type]
        for n, (xy, kind) in enumerate(zip(ways, ("vehicle", "pedestrian"), strict=True))
    ]
    way = np.linspace((-15.0, 40.0), (15.0, 40.0), 60)
    users.append(RoadUser(2, Track(way, np.zeros(60), 0.0), Shape("pedestrian", 0.5, 0.5)))
    car, walker, jaywalker = see_agents(users, place)
    assert jaywalker.movement == "jaywalking"
    assert (car.entry, car.exit, car.movement) == (route.entry, route.exit, "left")
    assert walker.crosswalks == {crosswalk.leg}


@pytest.fixture(scope="module")
def scene() -> Scene:
    return synthesize(TEXT, seed=3, refiner="none", time_limit=None)


def test_our_scene_and_its_tracks_in_another_format_are_judged_alike(
    scene: Scene, tmp_path: Path
) -> None:
    scene.save(tmp_path / "ours" / "one")
    (file,) = export(scene, "csv", tmp_path / "csv")
    file.rename(tmp_path / "csv" / "one.csv")
    for folder in ("ours", "csv"):
        found = read_submission(tmp_path / folder, "one", intersection="amsterdam_120")
        assert judge(row(), found) == Verdict("one", "satisfied")
    assert read_submission(tmp_path / "csv", "two", intersection="amsterdam_120") is None
    (tmp_path / "csv" / "one.csv").write_text("nonsense")
    broken = judge(row(), read_submission(tmp_path / "csv", "one", intersection="amsterdam_120"))
    assert "cannot be read" in str(broken.reason)
    (tmp_path / "csv" / "one.xosc").write_text("")
    with pytest.raises(InputError, match="keep one"):
        read_submission(tmp_path / "csv", "one", intersection="amsterdam_120")


def test_a_scene_that_does_not_show_all_words_does_not_satisfy(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene.save(tmp_path / "one")
    dog = AccountEntry(start=0, end=3, words="dog", state="not_shown")
    partly = scene.proof.model_copy(update={"account": (*scene.proof.account, dog)})
    monkeypatch.setattr(judging, "verify", lambda _: partly)
    found = read_submission(tmp_path, "one", intersection="amsterdam_120")
    assert found is not None
    assert found.fault == "partly: 'dog' not shown"


def test_figures_have_their_own_denominators_and_the_board_is_ordered(tmp_path: Path) -> None:
    rows = [row(), row(), row(refused=True), row(refused=True)]
    outcomes = ("satisfied", "wrong", "rightly_refused", "wrong")
    verdicts = [Verdict("one", each, "unasked collision of 1 and 2") for each in outcomes]
    shares = count_verdicts(verdicts, rows)
    counts = {name: (share.count, share.n) for name, share in shares.items()}
    assert counts == {
        "satisfied": (1, 2), "false": (2, 3), "refused": (0, 2), "rightly refused": (1, 2),
    }  # fmt: skip
    assert "| unasked collision | 2 |" in to_markdown(shares, verdicts)
    board = tmp_path / "board.json"
    better = count_verdicts([Verdict("one", "satisfied")] * 2, rows[:2])
    worse, best = ({k: v.to_share(whole=1.0) for k, v in each.items()} for each in (shares, better))
    enter_leaderboard(board, "worse|<b>", worse)
    page = enter_leaderboard(board, "better", best).read_text()
    assert page.index("better") < page.index("worse")
    assert "<b>" not in page.replace("\\<b\\>", "")
    board.write_text("{}")
    with pytest.raises(InputError, match="no leaderboard"):
        enter_leaderboard(board, "x", best)


def test_the_command_writes_rows_and_refuses_an_empty_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["evals", "satisfaction", "--rows", str(tmp_path / "rows.jsonl")]) == 0
    lines = (tmp_path / "rows.jsonl").read_text("utf-8").splitlines()
    assert len(lines) == 490
    assert set(json.loads(lines[0])) == {"id", "text"}
    assert main(["evals", "satisfaction", str(tmp_path)]) == 2
    assert "holds no scene" in capsys.readouterr().err
