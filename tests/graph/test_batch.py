"""Many scenes in one run: nothing lost, doubled or half-written, whoever does the work and dies."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from scenewright.apps.cli import main
from scenewright.errors import InputError
from scenewright.graph.batch import carrying
from scenewright.graph.batch.audit import audit
from scenewright.graph.batch.pool import Died, spread
from scenewright.graph.batch.run import Request, run_batch, shard_of
from scenewright.graph.batch.work import Options, Outcome, work

OPTIONS = Options("amsterdam_120")
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
    jobs: Iterable[Any], task: Callable[[Any], Any], *, workers: int
) -> Iterator[tuple[Any, Any]]:
    for job in jobs:
        yield job, task(job)


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


def test_the_tables_load_and_hold_every_row(whole: Path) -> None:
    import pandas as pd

    frames = {
        name: pd.read_parquet(whole / "tables" / f"{name}.parquet")
        for name in ("scenes", "agents", "tracks", "events")
    }
    scenes = frames["scenes"].set_index("row")
    assert list(scenes.index) == list(TEXTS)
    assert scenes.loc["pizza", "status"] == "refused"
    assert "traffic" in str(scenes.loc["pizza", "reason"])
    assert scenes.loc["../../etc", "folder"] != "../../etc"
    asked = frames["events"][frames["events"]["asked"]]
    assert set(zip(asked["row"], asked["type"], strict=True)) == {
        ("../../etc", "collision"),
        ("follow", "follow"),
    }
    scene = json.loads((whole / "follow" / "scene.json").read_bytes())
    track = frames["tracks"].query("row == 'follow' and agent == 1")
    agent = next(each for each in scene["agents"] if each["id"] == 1)
    assert track[["x", "y"]].to_numpy().tolist() == agent["trajectory"]
    assert math.isclose(track["time"].iloc[0], agent["spawn_time"])


def test_a_run_that_dies_between_rows_goes_on_to_the_same_bytes(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dying(jobs: Iterable[Any], task: Any, *, workers: int) -> Iterator[Any]:
        yield from list(one_by_one(list(jobs)[::-1][:2], task, workers=workers))
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
        request = Request(rows(tmp_path), tmp_path / "out", OPTIONS, shard=shard_of(text))
        assert run_batch(request).rows == 2
    assert contents(tmp_path / "out") == contents(whole)


def test_a_scene_that_was_lost_or_damaged_is_made_again(whole: Path, tmp_path: Path) -> None:
    request = Request(rows(tmp_path), tmp_path / "out", OPTIONS)
    run_batch(request)
    for path in (tmp_path / "out" / "calm").iterdir():
        path.unlink()
    (tmp_path / "out" / "follow" / "proof.json").write_bytes(b"{}")
    assert run_batch(request).now == 2
    assert contents(tmp_path / "out") == contents(whole)


def test_what_failed_is_kept_and_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def down(jobs: Iterable[Any], task: Any, *, workers: int) -> Iterator[Any]:
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
    path.write_text(json.dumps({"id": "a", "text": "A car follows a bus at 5 pm", "seed": 7,
                                "overrides": own}))  # fmt: skip
    run_batch(Request(path, tmp_path / "out", OPTIONS))
    meta = json.loads((tmp_path / "out" / "a" / "scene.json").read_bytes())["meta"]
    assert (meta["density"], meta["time_of_day"], meta["seed"]) == ("low", "05:00", 7)


def test_check_finds_what_was_changed(whole: Path, tmp_path: Path) -> None:
    import shutil

    assert audit(whole).faults == ()
    copy = tmp_path / "copy"
    shutil.copytree(whole, copy)
    scene = copy / "calm" / "scene.json"
    scene.write_bytes(scene.read_bytes().replace(b'"seed":', b'"seed": '))
    (copy / "stray.txt").write_text("?")
    found = {fault.where for fault in audit(copy).faults}
    assert found == {"calm/scene.json", "stray.txt"}
    shutil.rmtree(copy / "follow")
    assert "follow/scene.json" in {fault.where for fault in audit(copy).faults}


def test_the_card_names_licence_tables_and_counts(whole: Path) -> None:
    card = (whole / "README.md").read_text("utf-8")
    assert card.startswith("---\nlicense: apache-2.0\n")
    assert "path: tables/tracks.parquet" in card
    assert "| rows made | 3 |" in card
    manifest = json.loads((whole / "manifest.json").read_bytes())
    assert manifest["rows"] == {"given": 4, "made": 3, "refused": 1, "failed": 0, "left": 0}


@pytest.mark.parametrize("text", ["0/2", "3/2", "1", "a/b", "1/0", "-1/2"])
def test_a_shard_is_one_of_so_many(text: str) -> None:
    with pytest.raises(InputError, match="--shard"):
        shard_of(text)


def test_work_never_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    from scenewright.graph import run
    from scenewright.graph.batch.work import Job

    def broken(*_: Any, **__: Any) -> None:
        raise ZeroDivisionError("deep down")

    monkeypatch.delenv("SCENEWRIGHT_TRACEBACK", raising=False)
    monkeypatch.setattr(run, "synthesize", broken)
    done = work(Job(0, "a", "a", "A car", 0, "amsterdam_120", "builtin", "none", "draw"))
    assert (done.status, done.code) == ("failed", "internal_error")
    assert "deep down" in str(done.reason)


def test_jobs_of_a_worker_that_dies_are_given_to_another() -> None:
    """Processes of their own: one job kills its worker, however often, the others are done."""
    done = dict(spread([0, "1", "2", "3"], int, workers=2))
    assert done == {0: 0, "1": 1, "2": 2, "3": 3}
    done = dict(spread([7], os._exit, workers=2))
    assert done == {7: Died(7)}


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
           "--backend nobody", "--shard 9")  # fmt: skip
    for words in map(str.split, bad):
        assert main(["batch", str(rows(tmp_path)), "--out", str(tmp_path / "out"), *words]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1, words
        assert not (tmp_path / "out").exists()


def test_ctrl_c_says_that_what_is_done_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(jobs: Iterable[Any], task: Any, *, workers: int) -> Iterator[Any]:
        yield next(one_by_one(jobs, task, workers=workers))
        raise KeyboardInterrupt

    monkeypatch.setattr(carrying, "spread", interrupted)
    words = ["batch", str(rows(tmp_path)), "--out", str(tmp_path / "out"), "-q", "--json"]
    assert main(words) == 130
    out, err = capsys.readouterr()
    assert "the same command goes on" in err
    assert json.loads(out)["code"] == "interrupted"
    assert main(["make", "x", "--seed", "-1"]) == 2
