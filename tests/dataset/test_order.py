"""Orders: read, worded by many voices, filled with scenes, and gone on with after a kill."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import map_files
from inline_jobs import run_jobs_inline, spread_inline
from scenewright.backends import TASKS, Question
from scenewright.backends.recorded import record_answers
from scenewright.backends.text_backend import Completion, TextBackend
from scenewright.cli.batch import format_progress
from scenewright.cli.main import main
from scenewright.dataset.batch import carry_out as carrying
from scenewright.dataset.batch.audit import audit_dataset
from scenewright.dataset.batch.worker import Options, Outcome
from scenewright.dataset.orders import agent, writers
from scenewright.dataset.orders.agent import Order, build_slots
from scenewright.dataset.orders.order_spec import read_order
from scenewright.dataset.orders.run import build_paper_order, fill
from scenewright.dataset.orders.scenario_spec import Party, Story, draw_minute, list_parties
from scenewright.dataset.orders.templates import VOICES, list_voices, render_text
from scenewright.dataset.orders.wording import BOOK, Book, WordingTask, word_by_templates
from scenewright.dataset.orders.writers import BuiltinWriter, ModelWriter, StoryRequest, TextReader
from scenewright.dataset.tables.parquet import read_table
from scenewright.errors import BackendFault, InputError
from scenewright.intersections import load_map
from scenewright.scene.events import EVENT_OF_RELATION
from scenewright.scene.relations import load_patterns
from scripted import ScriptedModel, build_scripted_backend

ON = load_map("amsterdam_120")
OPTIONS = Options("amsterdam_120")
SMALL = "2 follows and 1 normal scene at 5 am in light traffic"


@pytest.fixture(autouse=True)
def inline(monkeypatch: pytest.MonkeyPatch) -> None:
    run_jobs_inline(monkeypatch)


@pytest.mark.parametrize(
    ("text", "quotas"),
    [
        ("40 collisions and 50 yields at rush hour, as varied as they come",
         {"collision": 40, "yielding": 50}),
        ("forty crashes, fifty near-misses and a hundred normal scenes in medium traffic",
         {"collision": 40, "near-miss": 50, "normal": 100}),
        ("a dozen rear-end collisions at 8 am", {"rear-end-collision": 12}),
        ("two hundred and fifty yields", {"yielding": 250}),
        ("8 T-bones around noon with five background cars", {"collision": 8}),
        ("5 jaywalker near misses in the evening and 3 head-on crashes",
         {"jaywalker-near-miss": 5, "head-on-collision": 3}),
    ],
)  # fmt: skip
def test_an_order_is_read(text: str, quotas: dict[str, int]) -> None:
    assert {quota.name: quota.count for quota in read_order(text).quotas} == quotas


def test_patterns_times_and_context_of_an_order() -> None:
    wish = read_order("3 left-turn strikes of pedestrians between 7 and 9 am in heavy traffic")
    assert wish.quotas[0].leaves == ("pedestrian_strike_left_turn",)
    assert (wish.windows, wish.context.density) == (((420, 540),), "high")
    rush = read_order("5 yields at rush hour")
    assert rush.windows == ((390, 600), (930, 1170))
    assert len(read_order("2 of each pattern").quotas) == len(load_patterns())
    leaves = read_order("5 near misses").quotas[0].leaves
    assert not {"uturn_near_miss", "paths_cross_near_miss", "merge_near_miss"} & set(leaves)
    turning = read_order("5 U-turn near misses").quotas[0].leaves
    assert turning == ("pedestrian_near_miss_uturn", "uturn_near_miss")


@pytest.mark.parametrize(
    "text",
    ["make me happy", "0 collisions", "-3 collisions", "5 unicorns", "", "7 am", "9" * 30],
)
def test_an_order_without_a_count_of_a_kind_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="known kind"):
        read_order(text)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("2 collisions at 8 am and 2 yields at 11 pm", "one time of day, this one 8 am and 11 pm"),
        ("4 collisions in the morning and 4 yields at noon", "one time of day"),
        ("10 collisions and 10 purple elephants", "no scene can have: 'elephants'"),
        ("7 collisions and 6 yields, classes and hours balanced", "cannot balance 'classes'"),
        ("10 collisions, 20 percent of them in fog", "no shares .'percent'"),
    ],
)
def test_nothing_of_an_order_is_dropped(text: str, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        read_order(text)


def test_an_order_beyond_reason_is_refused() -> None:
    with pytest.raises(InputError, match="at most"):
        read_order("999999999 collisions")


def test_an_order_that_names_riders_gets_them() -> None:
    (quota,) = read_order("3 e-scooter yields").quotas
    assert quota.rider == "scooter"
    chosen = [each for each in load_patterns() if each.id in quota.leaves]
    assert all("rider" in (each.from_.type, each.to.type) for each in chosen)
    parties = list_parties(
        chosen[0], intersection_map=ON, detail=2, rng=np.random.default_rng(0), rider=quota.rider
    )
    assert "scooter" in {party.type for party in parties}


def test_patterns_are_dealt_out_evenly() -> None:
    wish = read_order("29 yields")
    first = Counter(slot.leaves[0] for slot in build_slots(wish, seed=1, places=["amsterdam_120"]))
    assert set(first) == set(wish.quotas[0].leaves)
    assert max(first.values()) - min(first.values()) <= 1


def test_what_an_order_leaves_open_has_equal_shares() -> None:
    wish = read_order("300 safety critical events, places and times of day balanced")
    assert {quota.event: quota.count for quota in wish.quotas} == {
        "collision": 75, "near_miss": 75, "yielding": 75, "follow": 75,
    }  # fmt: skip
    places = ["a", "b", "c", "d"]
    for text in ("300 safety critical events", "1 of each pattern", "3 of each pattern"):
        slots = list(build_slots(read_order(text), seed=1, places=places))
        used = Counter(slot.intersection for slot in slots)
        assert max(used.values()) - min(used.values()) <= 1
        hours = Counter(int(4 * slot.share) for slot in slots)
        assert max(hours.values()) - min(hours.values()) <= max(2, 0.1 * len(slots))
    by_pattern = Counter((slot.leaves[0], slot.intersection) for slot in slots)
    assert set(by_pattern.values()) == {1}
    rush = read_order("8 yields at rush hour")
    minutes = [
        draw_minute(rush.windows, np.random.default_rng(0), slot.share)
        for slot in build_slots(rush, seed=1, places=places)
    ]
    assert sum(390 <= minute < 600 for minute in minutes) in (3, 4)  # of 210 and 240 minutes


def test_times_as_in_traffic_are_left_to_the_traffic() -> None:
    wish = read_order("3 near misses, times of day as in traffic")
    assert (wish.even, wish.windows) == (False, ())
    (slot, *_) = build_slots(wish, seed=0, places=["amsterdam_120"])
    entry = word_by_templates(WordingTask(replace(slot, attempts=1), wish, OPTIONS, ()))
    assert (entry.time, entry.context) == (None, {})


def test_a_text_without_a_time_has_its_share_of_the_day_all_the_same() -> None:
    wish = read_order("40 near misses")
    slots = [replace(each, attempts=1) for each in build_slots(wish, seed=0, places=[ON.name])]
    entries = [word_by_templates(WordingTask(each, wish, OPTIONS, ())) for each in slots[::4]]
    untold = [each for each in entries if each.context]
    assert 0 < len(untold) < len(entries)
    assert all(each.context == {"time_of_day": each.time} for each in untold)


def test_every_pattern_can_be_worded_in_many_voices() -> None:
    rng, writer, voices = np.random.default_rng(0), BuiltinWriter(ON), set()
    known = [each for each in load_patterns() if each.is_common or each.subtype == "U-turn"]
    ridden = [each for each in known if "rider" in (each.from_.type, each.to.type)]
    asked = [each for each in known if each not in ridden] + ridden[::4]
    for turn, pattern in enumerate(asked):
        event = EVENT_OF_RELATION[pattern.relation]
        # Not every way that a pattern allows is on this map; the agent thinks up another story.
        for again in range(12):
            parties = list_parties(pattern, intersection_map=ON, detail=2, rng=rng)
            story = Story(event, pattern.id, parties, draw_minute([], rng), "medium")
            given = writer.write_text(story, StoryRequest(turn + again), rng=rng)
            if given is not None:
                break
        assert given is not None, pattern.id
        voices.add(given.voice)
    assert len(voices) >= len(VOICES) - 2


def test_nothing_is_worded_that_the_map_has_no_room_for() -> None:
    pattern = next(each for each in load_patterns() if each.id == "left_turn_opposite_collision")
    rng, reader = np.random.default_rng(0), TextReader(ON)
    one, other = list_parties(pattern, intersection_map=ON, detail=2, rng=rng)
    story = Story("collision", pattern.id, (one, other), None, None)
    text = f"A car turning left from the {one.side} collides with a car from the {other.side}"
    assert reader.is_read_as(text, story)
    assert not reader.is_read_as(text.replace("collides with", "follows"), story)
    assert not reader.is_read_as(text + " in heavy traffic", story)


def test_a_text_that_another_pattern_could_play_is_not_used() -> None:
    """Else patterns would not come out even: both turn, so one may as well follow the other."""
    reader = TextReader(ON)
    turning = Party("vehicle", "right"), Party("vehicle", "left")
    story = Story("collision", "turning_collision", turning, None, None)
    assert not reader.is_read_as("A right-turning car hits a left-turning truck", story)
    walking = Party("vehicle", "left"), Party("pedestrian", "crossing")
    story = Story("collision", "pedestrian_strike_left_turn", walking, None, None)
    assert reader.is_read_as("A left-turning car hits a pedestrian", story)


def test_stories_are_worded_with_time_and_density_or_without() -> None:
    rng = np.random.default_rng(0)
    for minute, density in ((None, None), (485, None), (None, "high"), (750, "low")):
        story = Story("normal", None, (), minute, density)  # type: ignore[arg-type]
        for voice in list_voices(story):
            text = render_text(story, voice, rng)
            assert "{" not in text
            assert "  " not in text


def order(out: Path, text: str = SMALL, **more: Any) -> Order:
    return Order(text=text, wish=read_order(text), out=out, options=OPTIONS, **more)


def contents(out: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(out)): path.read_bytes()
        for path in sorted(out.rglob("*"))
        if path.is_file() and not path.name.startswith((".", "journal"))
    }


def test_an_order_is_filled_and_a_kill_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    report = fill(order(tmp_path / "whole"))
    assert report["filled"]
    assert [quota["filled"] for quota in report["quotas"]] == [2, 1]
    assert audit_dataset(tmp_path / "whole").faults == ()

    def dying(jobs: Iterable[Any], task: Any, *, workers: int, limit: Any) -> Iterator[Any]:
        yield from spread_inline(list(jobs)[1:2], task, workers=workers, limit=limit)
        raise KeyboardInterrupt

    monkeypatch.setattr(carrying, "spread", dying)
    with pytest.raises(KeyboardInterrupt):
        fill(order(tmp_path / "killed"))
    book = tmp_path / "killed" / "order.jsonl"
    book.write_bytes(book.read_bytes() + b'{"id": "half')
    monkeypatch.setattr(carrying, "spread", spread_inline)
    fill(order(tmp_path / "killed"))
    assert contents(tmp_path / "killed") == contents(tmp_path / "whole")


def test_scenes_of_an_order_have_the_time_limit_that_was_said(tmp_path: Path) -> None:
    wanted = Order(
        text=SMALL, wish=read_order(SMALL), out=tmp_path / "short", budget=3,
        options=replace(OPTIONS, time_limit=1e-6),
    )  # fmt: skip
    report = fill(wanted)
    assert report["scenes"] == 0
    reasons = {name for quota in report["quotas"] for name in quota["refused"]}
    assert {name.rpartition(": ")[2] for name in reasons} == {"time_limit"}


def test_an_order_at_several_places_gives_as_many_scenes_and_holds_half_of_the_places_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own").mkdir()
    monkeypatch.setenv("SCENEWRIGHT_INTERSECTIONS", str(tmp_path / "own"))
    file = map_files.lanelet2(tmp_path / "four.osm")
    assert main(["intersections", "import", str(file), "--name", "other", "-q"]) == 0
    out, refused = tmp_path / "out", []

    def refuse_first(jobs: Iterable[Any], task: Any, *, workers: int, limit: Any) -> Iterator[Any]:
        for job in jobs:
            if refused:
                yield job, task(job)
            else:  # a scene of a pattern that this one is not for
                refused.append(job.key)
                yield job, task(replace(job, wanted=()))

    monkeypatch.setattr(carrying, "spread", refuse_first)
    text = "2 follows at 5 am in light traffic"
    report = fill(order(out, text, places=("amsterdam_120", "other")))
    assert (report["scenes"], report["instructions"], report["held_out"]) == (2, 3, ["other"])
    scenes = list(read_table(out / "tables", "scenes", ["row", "intersection", "split"]))
    assert {each["intersection"]: each["split"] == "test" for each in scenes}["other"]
    assert Counter(each["intersection"] for each in scenes) == {"amsterdam_120": 1, "other": 1}
    (row,) = read_table(out / "tables", "refused", ["row", "code", "reason"])
    assert (row["row"], row["code"]) == (refused[0], "another_event")
    assert row["reason"].startswith("the scene shows follow: ")
    assert json.loads((out / "manifest.json").read_bytes())["complete"]
    card = (out / "README.md").read_text("utf-8")
    assert "| scenes at other | 1 |" in card
    assert "| refused: another\\_event | 1 |" in card
    assert "| follow | none seen | 2 | 100 % |" in card
    assert main(["agent", text, "--out", "x", "--intersections", "other", "--dry-run"]) == 2


def test_what_is_refused_is_worded_anew_then_replaced_then_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no(jobs: Iterable[Any], task: Any, *, workers: int, limit: Any) -> Iterator[Any]:
        for job in jobs:
            yield job, Outcome("refused", "no_surviving_combination", "no room")

    monkeypatch.setattr(carrying, "spread", no)
    report = fill(order(tmp_path / "out", "1 collision", budget=5))
    written = (tmp_path / "out" / "order.jsonl").read_text("utf-8").splitlines()
    entries = [json.loads(line) for line in written]
    leaves = [entry["leaf"] for entry in entries]
    assert len(entries) == report["instructions"] == 5
    assert len({entry["text"] for entry in entries}) == 5
    assert leaves[0] == leaves[1] != leaves[2] == leaves[3] != leaves[4]
    assert not report["filled"]
    assert report["quotas"][0]["open"] == ["collision-01"]


def story_of_a_yield() -> Story:
    who = Party("vehicle", "left", side="north"), Party("pedestrian", "crossing", crosswalk="east")
    return Story("yielding", "vehicle_yields_to_pedestrian_left_turn", who, 485, "low")


RIGHT = "At 08:05 in light traffic a car from the north turning left yields to a woman on the east \
crosswalk"


def words_of(*texts: Any) -> tuple[ModelWriter, ScriptedModel]:
    replies = [each if isinstance(each, Completion) else {"text": each} for each in texts]
    text_model = ScriptedModel({"plan": replies}, name="openai:writer")
    return ModelWriter(TextBackend(text_model), ON), text_model


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("A car hits a pedestrian at 08:05 in light traffic", "describes collision"),
        (RIGHT.replace("light", "heavy"), "density"),
        (RIGHT.replace("08:05", "17:00"), "time"),
        (RIGHT + ", three other cars", "does not have"),
        ("Lovely weather we are having today", "no traffic scene"),
        ("x", "characters"),
        ("A car " + 100 * "and again " , "characters"),
        (f"{RIGHT}.", "before"),
        (RIGHT.replace("left", "right"), "never gets to"),
        (RIGHT.replace("north turning left", "south turning right"), "their movements"),
        (Completion("I cannot do that."), "JSON"),
        ({"words": 1}, "no text"),
    ],
)  # fmt: skip
def test_a_models_text_of_another_story_is_sent_back(text: Any, wrong: str) -> None:
    if isinstance(text, dict):
        text = Completion(json.dumps(text))
    writer, text_model = words_of(text, f"  {RIGHT}\n")
    given = writer.write_text(
        story_of_a_yield(), StoryRequest(taken={f"{RIGHT}."}), rng=np.random.default_rng(0)
    )
    assert given is not None
    assert (given.text, given.misread) == (RIGHT, 1)
    assert 'time": "08:05' in text_model.asked[0][1].user
    assert wrong in text_model.asked[1][1].user


def test_a_text_that_only_a_model_understands_is_left_to_a_model() -> None:
    text = "somebody on foot gets waved through by a northerner hanging a left, five past eight"
    writer, _ = words_of(text)
    given = writer.write_text(
        story_of_a_yield(), StoryRequest(grammar=False), rng=np.random.default_rng(0)
    )
    assert given is not None
    assert given.text == text


def test_a_model_that_never_gets_it_right_gives_way_to_a_builtin_voice() -> None:
    writer, text_model = words_of(*["A car hits a pedestrian"] * 3)
    given = writer.write_text(story_of_a_yield(), StoryRequest(), rng=np.random.default_rng(0))
    assert given is not None
    assert given.voice in VOICES
    assert len(text_model.asked) == 3


def test_a_model_that_cannot_be_reached_ends_the_order() -> None:
    writer, _ = words_of()
    with pytest.raises(BackendFault, match="no answer left"):
        writer.write_text(story_of_a_yield(), StoryRequest(), rng=np.random.default_rng(0))


def driving(party: dict[str, Any], vehicle: str) -> str:
    noun = {"cyclist": "cyclist", "scooter": "e-scooter"}.get(party["type"], vehicle)
    way = {"straight": "going straight", "left": "turning left", "right": "turning right"}
    return f"{noun} {way[party['movement']]}" + (
        f" from the {party['side']}" if "side" in party else ""
    )


def test_an_order_worded_by_a_model_is_repeated_from_its_answers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """First texts tell another story; three are mended, one is worded by a builtin voice."""
    manners = iter(range(99))

    def reply(question: Question) -> dict[str, str]:
        if question.rejections:
            story = question.facts["story"]
            one, other = driving(story["who does it"], "car"), driving(story["to whom"], "bus")
            return {"text": f"A {one} follows a {other} at {story['time']}, light traffic"}
        return {"text": f"A car nearly hits a bus, number {next(manners)}"}

    model = build_scripted_backend({"plan": [reply]}, name="openai:writer", forever=True)
    answers = tmp_path / "answers.jsonl"
    kept = record_answers(dict.fromkeys(TASKS, model), answers)["plan"]
    monkeypatch.setattr(writers, "load_speaking_backend", lambda *_: kept)
    report = fill(order(tmp_path / "first", "4 follows at 5 am in light traffic", writer="x:y"))
    assert report["filled"]
    assert report["by the builtin writer"] == 1
    monkeypatch.undo()
    run_jobs_inline(monkeypatch)
    words = ["agent", "4 follows at 5 am in light traffic", "--writer", f"recorded:{answers}"]
    out = tmp_path / "again"
    assert main([*words, "--refiner", "none", "--out", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["scenes"] == 4
    texts = [json.loads(line)["text"] for line in (out / "order.jsonl").read_text().splitlines()]
    first = (tmp_path / "first" / "order.jsonl").read_text().splitlines()
    assert texts == [json.loads(line)["text"] for line in first]


def test_a_backend_that_is_down_costs_no_instructions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def down(jobs: Iterable[Any], task: Any, *, workers: int, limit: Any) -> Iterator[Any]:
        for job in jobs:
            normal = job.asked == "normal"
            yield job, task(job) if normal else Outcome("failed", "backend_failed", "no reply")

    words = ["agent", SMALL, "--refiner", "none", "--out", str(tmp_path / "out"), "-q"]
    monkeypatch.setattr(carrying, "spread", down)
    assert main(words) == 4
    assert "failed for 2 of 3 scenes" in capsys.readouterr().err
    assert len((tmp_path / "out" / "order.jsonl").read_text().splitlines()) == 3
    monkeypatch.setattr(carrying, "spread", spread_inline)
    assert main(words) == 0
    assert audit_dataset(tmp_path / "out").complete


def test_the_papers_composition_with_a_model_and_from_its_answers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two backends in one dataset, each with its row of Table 2; the second one recorded."""
    words = ["dataset", "paper", "--scale", "0.01", "--seed", "1", "--refiner", "none", "-q"]
    asked = ["--backend", "builtin", "--backend", "planner=builtin"]
    record = ["--record", str(tmp_path / "answers.jsonl")]
    first, again = tmp_path / "first", tmp_path / "again"
    assert main([*words, "--out", str(first), *asked, *record]) == 0
    answers = tmp_path / "answers-planner-builtin.jsonl"
    asked = ["--backend", "builtin", "--backend", f"recorded:{answers}"]
    assert main([*words, "--out", str(again), *asked]) == 0
    capsys.readouterr()
    for before, after in (
        ("planner-builtin", "recorded-answers-planner-builtin"),
        ("builtin", "builtin"),
    ):
        for kind in ("collision", "yielding"):
            [one] = first.glob(f"{before}-{kind}-01*/scene.json")
            [other] = again.glob(f"{after}-{kind}-01*/scene.json")
            assert one.read_bytes() == other.read_bytes()
    assert main(["evals", "tables", str(again), "--draws", "10", "--no-understanding", "-q"]) == 0
    page = capsys.readouterr().out
    for backend in ("builtin", f"recorded:{answers}"):
        for event, n in (("collision", 1), ("yielding", 1), ("overall", 2)):
            assert f"| {backend} | {event} | {n} / {n} | 100.00 % [" in page


def test_the_papers_composition() -> None:
    wish = build_paper_order(["builtin", "openai:some-model"])
    counts = {(quota.backend, quota.event): quota.count for quota in wish.quotas}
    assert counts == {
        (None, "normal"): 100,
        ("builtin", "collision"): 40,
        ("builtin", "yielding"): 50,
        ("openai:some-model", "collision"): 40,
        ("openai:some-model", "yielding"): 50,
    }
    assert wish.context.density == "medium"
    names = {slot.name for slot in build_slots(wish, seed=0, places=["amsterdam_120"])}
    assert {"normal-001", "builtin-collision-01", "some-model-yielding-50"} <= names
    assert len(names) == wish.count


def test_the_command_line_says_what_it_understood(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["agent", "3 yields at noon", "--out", "nowhere", "--dry-run"]) == 0
    assert "3 x yielding (28 patterns)" in capsys.readouterr().out
    assert not Path("nowhere").exists()
    assert main(["agent", "3 dragons", "--out", "nowhere"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_texts_worded_on_workers_are_those_of_one_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The book has the texts in the order of the slots, whichever worker is ready first."""
    wish = read_order("4 yields")
    first = build_slots(wish, seed=0, places=["amsterdam_120"])
    slots = [replace(slot, attempts=1) for slot in first]
    books: list[bytes] = []
    progress_lines: list[str] = []

    def answer_backwards(tasks: Any, task: Any, *, workers: int) -> Iterator[tuple[Any, Any]]:
        yield from [(each, task(each)) for each in tasks][::-1]

    monkeypatch.setattr(agent, "spread", answer_backwards)
    for few in (10, 1):
        monkeypatch.setattr(agent, "FEW", few)
        folder = tmp_path / str(few)
        folder.mkdir()
        wanted = Order(text="4 yields", wish=wish, out=folder, options=OPTIONS, workers=2)
        context: Any = SimpleNamespace(
            order=wanted, book=Book(folder), writers={"amsterdam_120": BuiltinWriter(ON)},
            log=lambda progress: progress_lines.append(format_progress(progress)),
        )  # fmt: skip
        agent.write_instructions(slots, context)
        books.append((folder / BOOK).read_bytes())

    assert books[0] == books[1] != b""
    assert progress_lines[3].startswith("4 of 4 texts")
