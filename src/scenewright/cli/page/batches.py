"""The page's batches: rows that were dropped on it, made by `scenewright batch` in a process."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field
from starlette.responses import HTMLResponse

from scenewright.cli.batch import RunOptions
from scenewright.cli.page.routes import Upload
from scenewright.dataset.batch.carry_out import JOURNAL
from scenewright.dataset.batch.journal import JournalEntry, read_entries
from scenewright.dataset.batch.rows import DatasetRow, read_source
from scenewright.errors import InputError
from scenewright.files import write_atomically
from scenewright.graph.scene_files import load_scene, read_proof
from scenewright.intersections import load_map
from scenewright.scene.events import Event

MOST_ROWS_BYTES = 20_000_000
MOST_AT_ONCE = 2000
"""Rows in one answer; the page asks on from there."""
_ROWS, _OUT, _SETTING, _ERRORS = "rows.jsonl", "out", "setting.json", "errors.txt"


class Batches:
    """The batches of one folder; one process each while it is being made."""

    def __init__(self, folder: Path, run: RunOptions) -> None:
        """Runs differ from the given one in place and backend alone."""
        self._folder, self._run = folder, run
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._lock = threading.Lock()

    def list_answers(self) -> dict[str, Callable[..., Any]]:
        """Every address of batches."""
        return {
            "GET /api/batches": self.list_names,
            "POST /api/batches/new": self.start,
            "GET /api/batches/{batch}": self.describe,
            "POST /api/batches/{batch}/go": self.go_on,
            "POST /api/batches/{batch}/stop": self.stop,
            "GET /api/batches/{batch}/{row:int}/page.html": self.show_scene,
        }

    def stop(self, batch: str) -> dict[str, Any]:
        """Stops a batch; what is made stays."""
        self._find(batch)
        with self._lock:
            _end(self._running.get(batch))
        return {"ok": True}

    def show_scene(self, batch: str, row: int) -> HTMLResponse:
        """The self-contained page of a scene, by its place in the journal."""
        from scenewright.graph.verify import verify
        from scenewright.viz.html_player import build_player

        folder = self._find(batch)
        entries = read_entries(folder / _OUT / JOURNAL)
        if row >= len(entries) or entries[row].status != "made":
            raise InputError("there is no scene of this row")
        record = load_scene(folder / _OUT / entries[row].folder)
        place = load_map(record.meta.intersection)
        page = HTMLResponse(build_player(scene=record, proof=verify(record), intersection=place))
        page.headers["Content-Security-Policy"] = "frame-ancestors 'self'"
        return page

    def list_names(self) -> dict[str, Any]:
        """The names of all batches, the newest first."""
        found = [each.parent.name for each in self._folder.glob(f"batch-*/{_SETTING}")]
        return {"batches": sorted(found, key=lambda name: -int(name.partition("-")[2]))}

    def start(
        self,
        rows: Annotated[bytes, Upload(MOST_ROWS_BYTES, "application/x-ndjson")],
        intersection: str = "amsterdam_120",
        backend: list[str] = [],  # noqa: B006 -- never changed
    ) -> dict[str, Any]:
        """A new batch of the rows that are the request's body.

        Raises:
            InputError: a row, the intersection or the folder cannot be used.
        """
        load_map(intersection)
        with self._lock:
            folder = self._create_folder()
            write_atomically(folder / _ROWS, rows)
            try:
                count = read_source(folder / _ROWS).rows
            except InputError as error:
                (folder / _ROWS).unlink()
                folder.rmdir()
                raise InputError(str(error).replace(str(folder / _ROWS), "the rows")) from None
            setting = {"intersection": intersection, "backend": backend, "rows": count}
            write_atomically(folder / _SETTING, json.dumps(setting).encode())
        return self.go_on(folder.name)

    def go_on(self, batch: str) -> dict[str, Any]:
        """Makes what is not made yet; nothing if that is being done."""
        folder = self._find(batch)
        with self._lock:
            process = self._running.get(batch)
            if process is None or process.poll() is not None:
                setting = json.loads((folder / _SETTING).read_bytes())
                own = {"intersection": setting["intersection"], "backend": setting["backend"]}
                self._running[batch] = _launch(folder, replace(self._run, **own))
        return {"batch": batch}

    def close(self) -> None:
        """Ends all processes; the batches can be gone on with."""
        for process in self._running.values():
            _end(process)

    def describe(
        self, batch: str, after: Annotated[int, Field(ge=0, lt=10**9)] = 0
    ) -> dict[str, Any]:
        """How far a batch is, and its rows that came to an end, from the number `after` on."""
        folder = self._find(batch)
        process = self._running.get(batch)
        running = process is not None and process.poll() is None
        entries = read_entries(folder / _OUT / JOURNAL)
        setting = json.loads((folder / _SETTING).read_bytes())
        source = read_source(folder / _ROWS) if after < len(entries) else ()
        rows = {each.number: each.row for each in source}
        shown = list(enumerate(entries))[after : after + MOST_AT_ONCE]
        done = len({entry.number for entry in entries})
        return {
            "batch": batch, "rows": setting["rows"], "done": done, "running": running,
            "error": "" if running else _read_error(folder),
            "scenes": [_describe_row(folder, each, n, rows) for n, each in shown],
        }  # fmt: skip

    def _find(self, name: str) -> Path:
        if not re.fullmatch(r"batch-\d{1,9}", name) or not (self._folder / name).is_dir():
            raise InputError(f"there is no batch {name[:40]!r}")
        return self._folder / name

    def _create_folder(self) -> Path:
        self._folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        taken = [int(each.name.partition("-")[2]) for each in self._folder.glob("batch-*")]
        folder = self._folder / f"batch-{max(taken, default=0) + 1}"
        folder.mkdir()
        return folder


def _launch(folder: Path, run: RunOptions) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "scenewright", "batch", str(folder / _ROWS)]
    command += ["--out", str(folder / _OUT), "--quiet", *run.list_words()]
    with (folder / _ERRORS).open("wb") as errors:
        return subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=errors
        )


def _end(process: subprocess.Popen[bytes] | None) -> None:
    if process is not None and process.poll() is None:
        process.terminate()
        try:
            process.wait(10.0)
        except subprocess.TimeoutExpired:
            process.kill()


def _read_error(folder: Path) -> str:
    """The last line that the process said; empty if it said nothing."""
    path = folder / _ERRORS
    lines = path.read_text(errors="replace").split("\n") if path.exists() else []
    said = [line for line in lines if line.startswith("scenewright:")]
    return said[-1].removeprefix("scenewright:").strip()[:300] if said else ""


def _describe_row(
    folder: Path, entry: JournalEntry, place: int, rows: dict[int, DatasetRow]
) -> dict[str, Any]:
    """A row as the page lists it; its events with their figures where it has a scene."""
    row = {
        "place": place, "number": entry.number, "id": rows[entry.number].id,
        "text": rows[entry.number].text,
        "status": entry.status, "reason": entry.reason, "events": [],
    }  # fmt: skip
    path = folder / _OUT / entry.folder / "proof.json"
    if entry.status != "made" or not path.exists():
        return row
    proof = read_proof(path)
    verdict = {"verdict": proof.describe_verdict(), "caveat": proof.caveat}
    return {**row, **verdict, "events": [_describe_event(event) for event in proof.events]}


def _describe_event(event: Event) -> dict[str, Any]:
    figures = {k: v for k, v in event.evidence.items() if isinstance(v, int | float)}
    return {"type": event.type, "kind": event.kind, "time": event.time, "figures": figures}
