"""How clips are cut: what is in view, what is left out, and that the cut betrays nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scenewright.cli.main import main
from scenewright.evals.understanding.cases import PairRelation, SceneCase, observe
from scenewright.evals.understanding.clips import (
    LENGTH,
    ClipSource,
    ForeseenEvent,
    count_agents,
    cut_clip,
    cut_clips,
    list_event_starts,
    list_normal_starts,
    read_source,
)
from scenewright.evals.understanding.language_model import name_agents
from scenewright.evals.understanding.scoring import ScenePrediction, count_scene
from scenewright.scene.events import Event


def event(time: float, *, one: int = 1, two: int = 2) -> Event:
    """A collision of two."""
    return Event.model_validate(
        {"type": "collision", "from": one, "to": two, "time": time, "location": (0.0, 0.0)}
    )


@pytest.fixture(scope="module")
def source(scenes: Path) -> ClipSource:
    """A scene of 30 s in which agents 1 and 2 are always there."""
    found = read_source(scenes / "struck")
    here = {agent.id: (0.0, 30.0) for agent in found.case.record.agents}
    assert found.case.record.meta.duration == 30.0
    return replace(found, spans=here, events=(), named=None)


def test_a_clip_begins_2_to_6_s_before_the_conflict_can_be_told(source: ClipSource) -> None:
    known = ForeseenEvent(event(15.0), decided=12.0)
    starts = list_event_starts(replace(source, events=(known,), named=known))
    assert (min(starts), max(starts)) == (6.0, 10.0)
    late = ForeseenEvent(event(15.0), decided=14.5)
    starts = list_event_starts(replace(source, events=(late,), named=late))
    assert (min(starts), max(starts)) == (8.5, 10.0), "no event in the first 5 s of a clip"


def test_both_parties_are_in_view_within_the_first_second(source: ClipSource) -> None:
    known = ForeseenEvent(event(15.0), decided=12.0)
    spans = {**source.spans, 2: (8.0, 30.0)}
    starts = list_event_starts(replace(source, events=(known,), named=known, spans=spans))
    assert min(starts) == 7.0


def test_another_event_fits_the_clip_or_lies_outside_of_it(source: ClipSource) -> None:
    known, other = ForeseenEvent(event(15.0), 12.0), ForeseenEvent(event(17.0, one=3), 13.0)
    both = replace(source, events=(known, other), named=known)
    assert 8.0 in list_event_starts(both)
    unseen = replace(both, spans={**source.spans, 3: (12.0, 30.0)})
    assert list_event_starts(unseen) == []
    early = ForeseenEvent(event(9.0, one=3), 8.0)
    cut = list_event_starts(replace(source, events=(known, early), named=known))
    assert not cut, "an event that is over 2 s before 10 s needs a later beginning"


def test_in_a_normal_clip_two_come_near_and_nothing_happens(source: ClipSource) -> None:
    meeting = ((1, 2, np.arange(10.0, 12.0, 0.5)),)
    calm = replace(source, near=meeting)
    starts = list_normal_starts(calm)
    assert starts
    assert all(start + 5.0 <= 11.5 and start + LENGTH >= 10.0 for start in starts)
    assert not list_normal_starts(replace(calm, events=(ForeseenEvent(event(12.0), 9.0),)))
    assert not list_normal_starts(replace(calm, near=()))


def test_what_a_clip_shows_is_what_the_scene_shows_then(source: ClipSource) -> None:
    case, start = cut_clip(source, 7.3), 7.3
    whole = {agent.id: agent for agent in source.case.record.agents}
    assert case.record.meta.duration == LENGTH
    assert case.record.agents
    for agent in case.record.agents:
        first = round((start + agent.spawn_time - whole[agent.id].spawn_time) / 0.1)
        assert agent.trajectory[0] == whole[agent.id].trajectory[first]
        assert 0.0 <= agent.spawn_time <= agent.spawn_time + 0.1 * len(agent.trajectory) <= 10.2
    assert all(0.0 <= light.start < light.end <= LENGTH for light in case.record.signals)


def test_clips_with_and_without_an_event_show_as_many_agents(source: ClipSource) -> None:
    """Of two scenes without an event the one with as many agents gives the clip."""
    always = replace(source, case=keep_all(source.case, "always"), near=())
    known = ForeseenEvent(event(15.0), decided=12.0)
    eventful = replace(always, events=(known,), named=known)
    meeting = ((1, 2, np.arange(0.0, 30.0, 0.5)),)
    alike = replace(always, case=keep_all(source.case, "alike"), near=meeting)
    fewer = replace(
        alike, case=keep_all(source.case, "fewer"), spans={1: (0.0, 30.0), 2: (0.0, 30.0)}
    )
    cases = cut_clips([fewer, eventful, alike])
    assert {case.scene: case.named for case in cases} == {"always": "collision", "alike": None}
    assert {case.record.meta.duration for case in cases} == {LENGTH}
    (seen,) = (case for case in cases if case.named)
    (relation,) = seen.labels.relations
    assert relation.time is not None
    assert 5.0 <= relation.time <= LENGTH
    assert count_agents(alike, 3.0).tolist() == count_agents(eventful, 9.0).tolist()
    assert cut_clips([eventful, fewer]) == []


def keep_all(case: SceneCase, name: str) -> SceneCase:
    """The scene under another name, with all its agents standing there all the time."""
    agents = tuple(
        each.model_copy(update={
            "spawn_time": 0.0, "trajectory": (each.trajectory[0],) * 301,
            "heading": (each.heading[0],) * 301,
        })
        for each in case.record.agents
    )  # fmt: skip
    record = case.record.model_copy(update={"agents": agents})
    return replace(case, scene=name, id=name, record=record)


def test_riders_are_named_and_their_exits_count(source: ClipSource) -> None:
    agents = source.case.record.agents
    record = source.case.record.model_copy(
        update={"agents": (agents[0].model_copy(update={"type": "cyclist"}), *agents[1:])}
    )
    seen = observe(record, scene="x", window=30.0)
    assert "cyclist-1" in name_agents(seen).values()
    labels = replace(
        source.case.labels, types={"a": "cyclist"}, starts={"a": 0.0}, exits={"a": "north"},
        relations=(),
    )  # fmt: skip
    counts = count_scene(labels, ScenePrediction({"a": "north"}, ()), window=4.0)
    assert counts.exits is not None
    assert counts.exits[2].tolist() == [1, 0, 0], "right, wrong, and again wrong"


def test_strictly_an_event_of_an_agent_unseen_is_missed(source: ClipSource) -> None:
    labels = replace(
        source.case.labels, starts={"a": 0.0, "b": 5.0},
        relations=(PairRelation("collision", "a", "b", 7.0),),
    )  # fmt: skip
    counts = count_scene(labels, ScenePrediction(None, ()), window=4.0)
    assert counts.items is not None
    assert counts.strict is not None
    assert counts.items[1].tolist() == [0, 0, 0]
    assert counts.strict[1].tolist() == [0, 0, 2]


def test_predictions_are_entered_into_the_leaderboard(
    scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    board = tmp_path / "board.json"
    board.write_text('{"schema_version": 1, "entries": {}, "predictions": {}}')
    words = ["evals", "understanding", str(scenes), "--split", "all", "--windows", "4", "--quiet"]
    words.append("--whole")
    given = ["--method", "oracle_seen", "--board", str(board), "--name", "knows all"]
    assert main([*words, *given]) == 0
    page = board.with_suffix(".md").read_text()
    assert "| knows all |" in page
    assert "100.0 % [100.0, 100.0]" in page
    assert main([*words, "--method", "gmm", "--board", str(board), "--name", "x"]) == 2
    assert "relations after 4 s" in capsys.readouterr().err


def test_a_folder_without_clips_is_one_line(
    scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "one").symlink_to(scenes / "plain")
    words = ["evals", "understanding", str(tmp_path), "--split", "all", "--method", "gmm"]
    assert main([*words, "--quiet"]) == 2
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1
    assert "--whole" in error
    assert main([*words, "--windows", "2", "--whole", "--quiet"]) == 0
