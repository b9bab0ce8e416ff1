"""`scenewright evals understanding` as somebody from outside uses it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from scenewright.cli.main import main

WORDS = ["evals", "understanding", "--whole"]


def run(*words: str | Path) -> int:
    return main([*WORDS, *map(str, words), "--quiet"])


def lines(file: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in file.read_text("utf-8").splitlines()]


def test_predictions_from_a_file_are_scored(
    scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    seen, said = tmp_path / "seen.jsonl", tmp_path / "said.jsonl"
    assert run(scenes, "--split", "all", "--windows", "2,4", "--write-observations", seen) == 0
    rows = lines(seen)
    assert {row["window"] for row in rows} == {2.0, 4.0}
    text = seen.read_text("utf-8")
    assert not [word for word in ("struck", "foreground", "exit", "goal", "seed") if word in text]
    guesses = [
        {"scene": row["scene"], "window": row["window"], "relations": [],
         "exits": {agent["id"]: "north" for agent in row["agents"]}}
        for row in rows
    ]  # fmt: skip
    said.write_text("".join(json.dumps(each) + "\n" for each in guesses))
    capsys.readouterr()
    words = (scenes, "--split", "all", "--windows", "2,4", "--method", said, "--json")
    assert run(*words) == 0
    result = json.loads(capsys.readouterr().out)
    (method,) = result["methods"]
    assert [row["window"] for row in method["windows"]] == [2.0, 4.0]
    assert 0 < method["windows"][0]["intent"]["overall"]["value"] < 100
    assert "Agent-level F1" in result["definition"]


def test_a_methods_own_predictions_score_the_same_from_their_file(
    scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = (scenes, "--split", "all", "--windows", "4", "--json")
    assert run(*words, "--method", "reasoner", "--method", "gmm", "--out", tmp_path) == 0
    first = json.loads(capsys.readouterr().out)["methods"]
    assert run(*words, "--method", tmp_path / "predictions_reasoner.jsonl") == 0
    (again,) = json.loads(capsys.readouterr().out)["methods"]
    for part in ("intent", "relations", "strict", "found_by_lead"):
        assert again["windows"][0][part] == first[0]["windows"][0][part]
    report = (tmp_path / "report.md").read_text("utf-8")
    assert "Exits: accuracy" in report
    assert json.loads((tmp_path / "report.json").read_text("utf-8"))["methods"] == first


GOOD = {"scene": "S", "window": 2.0, "exits": {}, "relations": []}


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"scene": "nowhere"}, "there is no scene 'nowhere'"),
        ({"window": 3.0}, "there is no window 3"),
        ({"exits": {"ghost": "north"}}, "no agent 'ghost' was seen"),
        ({"relations": [{"type": "collision", "from": "x", "to": "y"}]}, "no agent 'x'"),
        ({"relations": [{"type": "hug", "from": "x", "to": "y"}]}, "relations.0.type"),
        ({"exit": {}}, "exit: Extra inputs"),
        ({"window": "soon"}, "window: Input should be a valid number"),
    ],
)
def test_faults_of_a_file_are_one_line(
    scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], change: dict[str, Any],
    word: str,
) -> None:  # fmt: skip
    from scenewright.evals.understanding.cases import hash_scene

    file = tmp_path / "said.jsonl"
    file.write_text(json.dumps(GOOD | {"scene": hash_scene("plain")} | change))
    assert run(scenes, "--split", "all", "--windows", "2", "--method", file) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert word in line
    assert "line 1" in line


def test_a_file_must_be_whole(
    scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from scenewright.evals.understanding.cases import hash_scene

    one = GOOD | {"scene": hash_scene("plain")}
    file = tmp_path / "said.jsonl"
    words = (scenes, "--split", "all", "--windows", "2", "--method", file)
    for text, word in (
        (json.dumps(one), "rows are missing"),
        (json.dumps(one) + "\n" + json.dumps(one), "a second row"),
        ("", "holds no predictions"),
        ("{", "Invalid JSON"),
        ("[" * 100_000, "Invalid JSON"),
    ):
        file.write_text(text)
        assert run(*words) == 2
        (line,) = capsys.readouterr().err.strip().splitlines()
        assert word in line


@pytest.mark.parametrize(
    ("words", "word"),
    [
        ((), "nothing to do"),
        (("--method", "gpt"), "there is no method 'gpt'"),
        (("--method", "agent"), "needs --backend"),
        (("--method", "gmm", "--windows", "two"), "--windows takes seconds"),
        (("--method", "nowhere.jsonl"), "cannot read nowhere.jsonl"),
        (("--write-observations", "no/such/folder.jsonl"), "in a folder that exists"),
    ],
)
def test_impossible_requests_are_one_line(
    scenes: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], word: str
) -> None:
    assert run(scenes, "--split", "all", *words) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert word in line


def test_a_folder_without_scenes_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(tmp_path, "--method", "gmm") == 2
    assert "one sub-folder per scene" in capsys.readouterr().err
    assert run(tmp_path / "none", "--method", "gmm") == 2
    assert "is no folder of scenes" in capsys.readouterr().err
