"""Many scenes in one run: nothing lost, doubled or half-written, whoever does the work and dies."""

from __future__ import annotations

import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from scenewright.backends import Question
from scenewright.cli.main import main
from scenewright.dataset.batch import audit as audit_module
from scenewright.dataset.batch import carry_out as carrying
from scenewright.dataset.batch import worker as work_module
from scenewright.dataset.batch.answering import Asking, _make_take_turns
from scenewright.dataset.batch.audit import audit_dataset
from scenewright.dataset.batch.manifest import write_manifest
from scenewright.dataset.batch.pool import Died, Overdue, spread
from scenewright.dataset.batch.run import Request, parse_shard, run_batch
from scenewright.dataset.batch.worker import FILES, Options, Outcome, work
from scenewright.dataset.tables.parquet import (
    SCHEMAS,
    TABLES,
    SceneFiles,
    build_rows,
    import_parquet,
)
from scenewright.dataset.tables.parquet import read_table as read_rows
from scenewright.dataset.tables.splits import SPLITS, choose_split
from scenewright.errors import InputError
from scenewright.intersections import load_map

OPTIONS = Options("amsterdam_120", max_agents=12)
"""What the command has here: `tests/conftest.py` names 12 agents for all tests."""
TEXTS = {
    "follow": "A car follows a bus at 5 am",
    "calm": "Light traffic at dawn, no incidents.",
    "../../etc": "A car hits a pedestrian on the north crosswalk at 5 am",
    "pizza": "Order me a pizza",
}


@pytest.fixture(scope="module", autouse=True)
def inline() -> Iterator[None]:
    """The engine `process` without processes; what they add is tested by itself below."""
    patch = pytest.MonkeyPatch()
    patch.setattr(carrying, "spread", one_by_one)
    yield
    patch.undo()


def one_by_one(
    jobs: Iterable[Any], task: Callable[[Any], Any], *, workers: int, limit: Any = None
) -> Iterator[tuple[Any, Any]]:
    for job in jobs:
        yield job, task(job)


def test_the_limit_of_the_environment_stands_in_the_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SCENEWRIGHT_MAX_AGENTS", "9")
    source = tmp_path / "rows.jsonl"
    source.write_text('{"id": "one", "text": "A car follows a bus at 5 am"}\n')
    run_batch(Request(source, tmp_path / "out", Options("amsterdam_120"), workers=1))
    header = json.loads((tmp_path / "out" / "journal.jsonl").read_text().splitlines()[0])
    (file,) = (tmp_path / "out").rglob("provenance.json")
    assert header["max_agents"] == 9 == json.loads(file.read_text())["max_agents"]


def rows(folder: Path) -> Path:
    path = folder / "rows.jsonl"
    lines = [json.dumps({"id": key, "text": text}) for key, text in TEXTS.items()]
    path.write_text("\n".join(lines))
    return path


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset that was made in one go."""
    folder = tmp_path_factory.mktemp("whole")
    out = folder / "out"
    summary = run_batch(Request(rows(folder), out, OPTIONS))
    assert summary.counts == {"made": 3, "refused": 1}
    assert summary.complete
    return out


def contents(out: Path) -> dict[str, bytes]:
    """Every file but the journal and locks."""
    return {
        str(path.relative_to(out)): path.read_bytes()
        for path in sorted(out.rglob("*"))
        if path.is_file() and not path.name.startswith((".", "journal"))
    }


def test_a_row_has_a_folder_of_its_own_and_none_lies_outside(whole: Path) -> None:
    scenes = sorted(path.parent.name for path in whole.glob("*/scene.json"))
    assert [scenes[0], scenes[2]] == ["calm", "follow"]
    assert scenes[1].startswith("etc-")
    assert sorted(path.name for path in whole.parent.iterdir()) == ["out", "rows.jsonl"]


def read_table(folder: Path, name: str) -> list[dict[str, Any]]:
    return list(read_rows(folder / "tables", name, [*SCHEMAS[name]]))


def test_the_tables_load_and_hold_every_row(whole: Path) -> None:
    scenes = {row["row"]: row for row in read_table(whole, "scenes")}
    assert set(scenes) == {*TEXTS} - {"pizza"}
    (pizza,) = read_table(whole, "refused")
    assert (pizza["row"], pizza["status"]) == ("pizza", "refused")
    assert "traffic" in pizza["reason"]
    assert scenes["../../etc"]["folder"] != "../../etc"
    asked = {(row["row"], row["type"]) for row in read_table(whole, "events") if row["asked"]}
    assert asked == {("../../etc", "collision"), ("follow", "follow")}
    scene = json.loads((whole / "follow" / "scene.json").read_bytes())
    track = list_samples(whole)
    agent = next(each for each in scene["agents"] if each["id"] == 1)
    assert [[each["x"], each["y"]] for each in track] == agent["trajectory"]
    assert math.isclose(track[0]["time"], agent["spawn_time"])


def list_samples(folder: Path) -> list[dict[str, Any]]:
    """The samples of agent 1 of one row, in order."""
    rows = read_table(folder, "tracks")
    return [row for row in rows if row["row"] == "follow" and row["agent"] == 1]


def test_tracks_have_velocities_and_the_map_and_the_lights_are_tables(whole: Path) -> None:
    track = list_samples(whole)
    moved = (track[11]["x"] - track[9]["x"]) / 0.2
    assert math.isclose(track[10]["vx"], moved, abs_tol=2e-3)
    slowed = (track[11]["vx"] - track[9]["vx"]) / 0.2
    assert math.isclose(track[10]["ax"], slowed, abs_tol=2e-2)
    scene = json.loads((whole / "calm" / "scene.json").read_bytes())
    lights = [row for row in read_table(whole, "lights") if row["row"] == "calm"]
    assert len(lights) == len(scene["signals"])
    shapes, place = read_table(whole, "map"), load_map("amsterdam_120")
    walks = {row["feature"] for row in shapes if row["kind"] == "crosswalk"}
    assert walks == {each.id for each in place.crosswalks}
    splits = {row["split"] for row in read_table(whole, "scenes")}
    assert len({row["feature"] for row in shapes}) * len(splits) == len(shapes)
    queues = [row for row in read_table(whole, "events") if row["queue"]]
    assert {row["type"] for row in queues} == {"follow"}
    assert not any(row["asked"] for row in queues)


def test_the_card_names_the_splits_and_no_group_is_in_two(whole: Path) -> None:
    card = yaml.safe_load((whole / "README.md").read_text("utf-8").split("---\n")[1])
    named = {each["config_name"]: each["data_files"] for each in card["configs"]}
    assert list(named) == list(TABLES)
    for name, files in named.items():
        there = {path.stem: path for path in (whole / "tables" / name).iterdir()}
        assert {each["split"]: whole / each["path"] for each in files} == there
    for split in (each["split"] for each in named["scenes"]):
        table = import_parquet().read_table(whole / "tables" / "scenes" / f"{split}.parquet")
        for row in table.to_pylist():
            assert row["split"] == split == choose_split(row["intersection"], row["text"])


def test_a_split_follows_from_place_and_wording_alone() -> None:
    def split(text: str, voice: str | None = None) -> str:
        return choose_split("amsterdam_120", text, voice)

    assert split("A car hits a bus at 8:00") == split("a car  hits a bus at 9:30")
    assert split("A car hits a bus", "telegraph") == split("Anything else", "telegraph")
    found = [split(f"text {chr(97 + k % 26)}{chr(97 + k // 26)}") for k in range(600)]
    assert 0.75 < found.count("train") / 600 < 0.85
    assert {*found} == {*SPLITS}


def test_croissant_names_every_column_and_the_files_of_its_tables(whole: Path) -> None:
    about = json.loads((whole / "croissant.json").read_bytes())
    for each in about["distribution"]:
        assert [*whole.glob(each["includes"])]
    columns = {
        each["name"]: [field["name"] for field in each["field"]] for each in about["recordSet"]
    }
    assert list(columns) == list(TABLES)
    for name, found in columns.items():
        for path in (whole / "tables" / name).iterdir():
            assert found == import_parquet().ParquetFile(path).schema_arrow.names


def test_the_account_of_words_is_a_table_with_the_checkers_evidence(whole: Path) -> None:
    rows = read_table(whole, "account")
    proof = json.loads((whole / "follow" / "proof.json").read_bytes())
    assert [each for each in rows if each["row"] == "follow"] == [
        {"row": "follow", **entry} for entry in proof["account"]
    ]
    (follows,) = (e for e in rows if e["row"] == "follow" and e["words"] == "follows")
    assert TEXTS["follow"][follows["start"] : follows["end"]] == follows["words"] == "follows"
    assert (follows["agents"], follows["turn"], follows["state"]) == ([1, 2], 0, "seen")
    assert follows["claim"] == "event follow"
    assert follows["evidence"].startswith("follow of 1 and 2 at ")
    assert "pizza" not in {each["row"] for each in rows}


def test_a_scene_of_an_earlier_version_has_no_rows_of_account(whole: Path) -> None:
    scene, proof = (
        json.loads((whole / "follow" / name).read_bytes()) for name in ("scene.json", "proof.json")
    )
    del scene["said"], proof["account"]
    about = {
        "row": "follow",
        "text": TEXTS["follow"],
        "intersection": "amsterdam_120",
        "voice": None,
        "split": "train",
    }
    rows = build_rows(SceneFiles(about, scene, proof, {}))
    assert rows["account"] == []
    assert rows["events"]


def test_check_compares_the_tables_of_a_dataset_that_has_no_account(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(audit_module, "check_again", lambda _: None)

    def forget(about: dict[str, Any]) -> None:
        for path in accounts:
            del about["files"][path]
        del about["tables"]["account"]

    copy = tmp_path / "copy"
    shutil.copytree(whole, copy)
    accounts = {
        path.relative_to(copy).as_posix() for path in (copy / "tables" / "account").iterdir()
    }
    shutil.rmtree(copy / "tables" / "account")
    assert {each.where for each in audit_dataset(copy).faults} == accounts
    rewritten(copy, forget)
    assert audit_dataset(copy).faults == ()

    def miscount(about: dict[str, Any]) -> None:
        about["tables"]["events"] = 99

    rewritten(copy, miscount)
    assert {each.where for each in audit_dataset(copy).faults} == {"tables/events"}


def test_a_run_that_dies_between_rows_goes_on_to_the_same_bytes(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dying(jobs: Iterable[Any], task: Any, *, workers: int, limit: Any) -> Iterator[Any]:
        yield from list(one_by_one(list(jobs)[::-1][:2], task, workers=workers, limit=limit))
        raise KeyboardInterrupt

    monkeypatch.setattr(carrying, "spread", dying)
    request = Request(rows(tmp_path), tmp_path / "out", OPTIONS)
    with pytest.raises(KeyboardInterrupt):
        run_batch(request)
    assert not (tmp_path / "out" / "manifest.json").exists()
    monkeypatch.setattr(carrying, "spread", one_by_one)
    assert run_batch(request).now == 2
    assert contents(tmp_path / "out") == contents(whole)


def test_shards_in_one_folder_come_to_the_same_bytes(whole: Path, tmp_path: Path) -> None:
    for text in ("2/2", "1/2"):
        request = Request(rows(tmp_path), tmp_path / "out", OPTIONS, shard=parse_shard(text))
        assert run_batch(request).rows == 2
    assert contents(tmp_path / "out") == contents(whole)


def test_a_scene_that_was_lost_or_damaged_is_made_again(whole: Path, tmp_path: Path) -> None:
    request = Request(rows(tmp_path), tmp_path / "out", OPTIONS)
    shutil.copytree(whole, tmp_path / "out")
    for path in (tmp_path / "out" / "calm").iterdir():
        path.unlink()
    (tmp_path / "out" / "follow" / "proof.json").write_bytes(b"{}")
    assert run_batch(request).now == 2
    assert contents(tmp_path / "out") == contents(whole)


def test_what_failed_is_kept_and_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def down(jobs: Iterable[Any], task: Any, *, workers: int, limit: Any) -> Iterator[Any]:
        for job in jobs:
            dead = job.key == "follow"
            yield job, Died(-9) if dead else Outcome("failed", "backend_failed", "no reply")

    monkeypatch.setattr(carrying, "spread", down)
    request = Request(rows(tmp_path), tmp_path / "out", OPTIONS)
    summary = run_batch(request)
    assert summary.counts == {"failed": 4}
    assert summary.codes == {"backend_failed": 3, "worker_died": 1}
    assert not summary.complete
    monkeypatch.setattr(carrying, "spread", one_by_one)
    assert run_batch(request).counts == {"made": 3, "refused": 1}


def test_a_changed_input_is_refused_and_nothing_is_touched(whole: Path, tmp_path: Path) -> None:
    before = contents(whole)
    other = tmp_path / "other.jsonl"
    other.write_text('{"id": "a", "text": "A car follows a bus"}')
    with pytest.raises(InputError, match="the input has changed"):
        run_batch(Request(other, whole, OPTIONS))
    assert contents(whole) == before


def test_a_folder_with_other_things_is_left_alone(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="holds other files"):
        run_batch(Request(rows(tmp_path), out, OPTIONS))
    assert [path.name for path in out.iterdir() if not path.name.startswith(".")] == ["mine.txt"]


def test_a_rows_overrides_win(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    own = {"density": "low", "time_of_day": "05:00", "background": {"vehicles": 1}}
    path.write_text(json.dumps({"id": "a", "text": "A car follows a bus", "seed": 7,
                                "overrides": own}))  # fmt: skip
    run_batch(Request(path, tmp_path / "out", OPTIONS))
    meta = json.loads((tmp_path / "out" / "a" / "scene.json").read_bytes())["meta"]
    assert (meta["density"], meta["time_of_day"], meta["seed"]) == ("low", "05:00", 7)


def test_lenient_makes_the_row_and_lists_the_words_that_it_leaves_out(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    path.write_text('{"id": "wet", "text": "In the rain, a car follows a bus"}')
    strict = run_batch(Request(path, tmp_path / "strict", OPTIONS))
    assert strict.counts == {"refused": 1}
    lenient = run_batch(Request(path, tmp_path / "out", replace(OPTIONS, lenient=True)))
    assert lenient.counts == {"made": 1}
    scenes, account = (read_table(tmp_path / "out", name) for name in ("scenes", "account"))
    assert [each["words"] for each in account if each["state"] == "not_shown"] == ["rain"]
    assert [(each["verdict"], each["not_shown"]) for each in scenes] == [("partly", ["rain"])]
    card = (tmp_path / "out" / "README.md").read_text()
    assert "| scenes verified | 0 |" in card
    assert "| scenes verified in part, without all words | 1 |" in card
    assert "| words not shown, those of most scenes | 'rain' |" in card
    assert audit_dataset(tmp_path / "out").faults == ()


def test_check_finds_what_was_changed(whole: Path, tmp_path: Path) -> None:
    assert audit_dataset(whole).faults == ()
    copy = tmp_path / "copy"
    shutil.copytree(whole, copy)
    scene = copy / "calm" / "scene.json"
    scene.write_bytes(scene.read_bytes().replace(b'"seed":', b'"seed": '))
    (copy / "stray.txt").write_text("?")
    found = {fault.where for fault in audit_dataset(copy).faults}
    assert found == {"calm/scene.json", "stray.txt"}
    shutil.rmtree(copy / "follow")
    assert "follow/scene.json" in {fault.where for fault in audit_dataset(copy).faults}


KINDS = (
    "calm/scene.json", "calm/proof.json", "calm/provenance.json", "manifest.json", "README.md",
    "figures/overview.png", "croissant.json",
    *(f"tables/{name}" for name in TABLES),
)  # fmt: skip


@pytest.mark.parametrize("name", KINDS)
def test_check_finds_a_single_changed_byte_anywhere(
    name: str, whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the byte, the hashes tell; that the checker runs too is tested above."""
    monkeypatch.setattr(audit_module, "check_again", lambda _: None)
    copy = tmp_path / "copy"
    shutil.copytree(whole, copy)
    if (copy / name).is_dir():  # of a table, the file of its first split
        name = sorted((copy / name).iterdir())[0].relative_to(copy).as_posix()
    data = (copy / name).read_bytes()
    for at in (0, len(data) // 3, len(data) // 2, len(data) - 1):
        changed = bytearray(data)
        changed[at] ^= 1
        (copy / name).write_bytes(changed)
        assert name in found_in(copy), at


def found_in(folder: Path) -> str:
    """Everything that `dataset check` would say."""
    try:
        return " ".join(fault.where for fault in audit_dataset(folder).faults)
    except InputError as error:  # a manifest that is no JSON any more
        return str(error)


def rewritten(folder: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """The manifest written anew, with hashes that fit."""
    about = json.loads((folder / "manifest.json").read_bytes())
    change(about)
    files = about.pop("files")
    about.pop("manifest", None)
    write_manifest(folder, about, files.items())


def test_check_finds_scenes_that_changed_places_and_files_from_elsewhere(
    whole: Path, tmp_path: Path
) -> None:
    def swap(about: dict[str, Any]) -> None:
        files = about["files"]
        for name in FILES:
            one, other = f"calm/{name}", f"follow/{name}"
            files[one], files[other] = files[other], files[one]

    copy = tmp_path / "copy"
    shutil.copytree(whole, copy)
    for old, new in (("calm", "x"), ("follow", "calm"), ("x", "follow")):
        (copy / old).rename(copy / new)
    assert len(audit_dataset(copy).faults) > 6
    rewritten(copy, swap)
    found = {(fault.where, fault.what.split(":")[0]) for fault in audit_dataset(copy).faults}
    assert {(each, "is the scene of another row") for each in ("calm", "follow")} <= found

    shutil.rmtree(copy)
    shutil.copytree(whole, copy)
    (copy / "more").symlink_to(whole / "calm")
    (copy / "journal-of-mine").mkdir()
    (copy / "journal-of-mine" / "x").write_text("x")
    os.mkfifo(copy / "pipe")
    shutil.copytree(whole / "calm", tmp_path / "calm")

    def stretch(about: dict[str, Any]) -> None:
        about["files"] |= {"../calm/scene.json": "0", "/etc/passwd": "0", "a\0b": "0", "pipe": "0"}
        about["rows"]["made"] = 4

    rewritten(copy, stretch)
    found = {fault.where: fault.what for fault in audit_dataset(copy).faults}
    assert found["../calm/scene.json"] == found["/etc/passwd"] == "lies outside the dataset"
    assert {"a\0b", "pipe", "more", "journal-of-mine/x", "manifest.json"} <= set(found)
    assert "calm/scene.json" not in found


def test_the_card_names_licence_tables_and_counts(whole: Path) -> None:
    card = (whole / "README.md").read_text("utf-8")
    assert yaml.safe_load(card.split("---\n")[1])["license"] == "apache-2.0"
    assert "path: tables/tracks/train.parquet" in card
    assert "| scenes made | 3 |" in card
    assert "| instructions refused | 1 |" in card
    assert "| `agents` | list of int16 | those in the evidence |" in card
    manifest = json.loads((whole / "manifest.json").read_bytes())
    assert manifest["rows"] == {"given": 4, "made": 3, "refused": 1, "failed": 0, "left": 0}


@pytest.mark.parametrize("text", ["0/2", "3/2", "1", "a/b", "1/0", "-1/2"])
def test_a_shard_is_one_of_so_many(text: str) -> None:
    with pytest.raises(InputError, match="--shard"):
        parse_shard(text)


def test_work_never_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    from scenewright.dataset.batch.worker import Job, Options
    from scenewright.graph import run

    def broken(*_: Any, **__: Any) -> None:
        raise ZeroDivisionError("deep down")

    monkeypatch.delenv("SCENEWRIGHT_TRACEBACK", raising=False)
    monkeypatch.setattr(run, "synthesize", broken)
    done = work(Job(0, "a", "a", "A car", 0, Options("amsterdam_120")))
    assert (done.status, done.code) == ("failed", "internal_error")
    assert "deep down" in str(done.reason)


def test_jobs_of_a_worker_that_dies_are_given_to_another() -> None:
    """Processes of their own: one job kills its worker, however often, the others are done."""
    done = dict(spread([0, "1", "2", "3"], int, workers=2))
    assert done == {0: 0, "1": 1, "2": 2, "3": 3}
    done = dict(spread([7], os._exit, workers=2))
    assert done == {7: Died(7)}


def test_a_job_that_takes_for_ever_is_given_up_and_the_others_are_done() -> None:
    """The first job of a worker has time to load everything, so the long one comes third."""
    done = dict(spread([0, 0.01, 600, 0.02], time.sleep, workers=2, limit=2.0))
    assert done == {0: None, 0.01: None, 600: Overdue(2.0), 0.02: None}


def test_a_row_that_takes_too_long_is_kept_with_its_reason_and_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def slow(jobs: Iterable[Any], task: Any, *, workers: int, limit: Any) -> Iterator[Any]:
        for job in jobs:
            yield job, Overdue(limit) if job.key == "follow" else task(job)

    monkeypatch.setattr(carrying, "spread", slow)
    request = Request(rows(tmp_path), tmp_path / "out", OPTIONS, row_timeout=7)
    assert run_batch(request).codes == {"overdue": 1, "unusable_input": 1}
    entry = json.loads((tmp_path / "out" / "journal.jsonl").read_text().splitlines()[1])
    assert "longer than the 7 s" in entry["reason"]
    monkeypatch.setattr(carrying, "spread", one_by_one)
    assert run_batch(replace(request, row_timeout=60)).counts == {"made": 3, "refused": 1}


def test_answers_are_kept_and_a_batch_is_repeated_from_them(whole: Path, tmp_path: Path) -> None:
    """Grammar as it is, its answers kept, and the answers alone: the same scenes."""
    source, answers = str(rows(tmp_path)), tmp_path / "answers.jsonl"
    words = ["batch", source, "--refiner", "none", "-q", "--workers", "1"]
    assert main([*words, "--out", str(tmp_path / "kept"), "--record", str(answers)]) == 0
    given = [f"planner=recorded:{answers}", f"filter=recorded:{answers}", "reasoner=builtin"]
    backends = [word for each in given for word in ("--backend", each)]
    assert main([*words, "--out", str(tmp_path / "again"), *backends, "--at-once", "1"]) == 0
    for name in ("kept", "again"):
        for scene in ("calm", "follow"):
            made = (tmp_path / name / scene / "scene.json").read_bytes()
            assert made == (whole / scene / "scene.json").read_bytes()
    about = json.loads((tmp_path / "again" / "calm" / "provenance.json").read_bytes())
    assert about["models"]["plan"]["model"] == "builtin"
    assert not {"requests", "input_tokens"} & set(about["models"]["plan"])
    assert audit_dataset(tmp_path / "again").faults == ()
    size = answers.stat().st_size
    assert main([*words, "--out", str(tmp_path / "third"), "--record", str(answers)]) == 0
    assert answers.stat().st_size == size


def test_rows_without_a_recorded_answer_fail_and_are_made_once_there_is_one(
    tmp_path: Path,
) -> None:
    source, answers = rows(tmp_path), tmp_path / "answers.jsonl"
    asking, none = Asking(answers), replace(OPTIONS, backend=(f"recorded:{answers}",))
    run_batch(Request(source, tmp_path / "first", OPTIONS, limit=1, asking=asking))
    request = Request(source, tmp_path / "out", none)
    summary = run_batch(request)
    assert summary.counts == {"made": 1, "failed": 3}
    assert not summary.complete
    run_batch(Request(source, tmp_path / "second", OPTIONS, asking=asking))
    work_module._load_backend.cache_clear()
    assert run_batch(request).counts == {"made": 3, "refused": 1}


def test_no_more_is_asked_at_a_time_than_was_allowed(tmp_path: Path) -> None:
    class Slow:
        name, deterministic, now, most = "slow", False, 0, 0

        def answer(self, question: Any) -> dict[str, Any]:
            del question
            self.now += 1
            self.most = max(self.most, self.now)
            time.sleep(0.02)
            self.now -= 1
            return {}

    slow = Slow()
    # Each has turns of its own, as workers have: the folder is all that they share.
    turns = [tmp_path / f"{k}.lock" for k in range(2)]
    asking = [_make_take_turns(slow, turns) for _ in range(6)]
    with ThreadPoolExecutor(6) as threads:
        list(threads.map(lambda each: each.answer(Question("plan", {})), asking))
    assert slow.most == 2


def test_a_killed_command_leaves_nothing_behind_and_goes_on(whole: Path, tmp_path: Path) -> None:
    words = ["batch", str(rows(tmp_path)), "--out", str(tmp_path / "out"), "--workers", "1", "-q"]
    begun = subprocess.Popen(
        [sys.executable, "-m", "scenewright", *words], stdout=subprocess.DEVNULL
    )
    journal = tmp_path / "out" / "journal.jsonl"
    while begun.poll() is None and not (journal.exists() and journal.read_bytes().count(b"\n") > 1):
        time.sleep(0.02)
    begun.send_signal(signal.SIGKILL)
    begun.wait()
    assert main(words) == 0
    assert contents(tmp_path / "out") == contents(whole)


def test_a_dry_run_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["batch", str(rows(tmp_path)), "--out", str(out), "--dry-run"]) == 0
    assert capsys.readouterr().out.startswith("4 rows, 0 done, 4 to do\n")
    assert not out.exists()


def test_bad_options_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = ("--workers 0", "--limit 0", "--refiner magic", "--seed -1", "--intersection nowhere",
           "--backend nobody", "--shard 9", "--row-timeout 0", "--at-once 0", "--record .",
           "--backend builtin --backend builtin", "--backend cook=builtin", "--base-url http://x",
           "--backend recorded:nothing.jsonl", "--record a.jsonl --engine ray")  # fmt: skip
    for words in map(str.split, bad):
        assert main(["batch", str(rows(tmp_path)), "--out", str(tmp_path / "out"), *words]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1, words
        assert not (tmp_path / "out").exists()


def test_ctrl_c_says_that_what_is_done_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(jobs: Iterable[Any], task: Any, *, workers: int, limit: Any) -> Iterator[Any]:
        yield next(one_by_one(jobs, task, workers=workers, limit=limit))
        raise KeyboardInterrupt

    monkeypatch.setattr(carrying, "spread", interrupted)
    words = ["batch", str(rows(tmp_path)), "--out", str(tmp_path / "out"), "-q", "--json"]
    assert main(words) == 130
    out, err = capsys.readouterr()
    assert "the same command goes on" in err
    assert json.loads(out)["code"] == "interrupted"
    assert main(["make", "x", "--seed", "-1"]) == 2
