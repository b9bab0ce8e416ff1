"""Egos in another process or language: `gymnasium`'s calls as JSON lines over a TCP socket."""

from __future__ import annotations

import json
import socketserver
import threading
from collections.abc import Callable, Sequence
from typing import Any, Literal

from pydantic import Field, ValidationError

from scenewright.driving.benchmark import BenchmarkScene, Row, build_row
from scenewright.driving.ego_motion import ActionMode
from scenewright.driving.env import DriveEnv
from scenewright.driving.report import report_drive
from scenewright.driving.scenario import Scenario
from scenewright.driving.single_drive import Drive
from scenewright.errors import InputError, ScenewrightError, describe_misfit
from scenewright.scene.base import Model

LONGEST_LINE = 65_536
LONGEST_SILENCE = 600.0
"""After which a connection is closed [s]."""


class Request(Model):
    """One line of a client."""

    call: Literal["reset", "step", "close"]
    scene: str | None = None
    seed: int | None = Field(default=None, ge=0, lt=2**63)
    actions: ActionMode = "bicycle"
    action: list[float] | list[list[float]] | None = None


class EgoServer(socketserver.ThreadingTCPServer):
    """Serves scenes to egos, one drive at a time on each connection, until `most` are over.

    Args:
        scenes: what may be driven, in order; load: makes one ready.
        most: drives; None: it ends at an interrupt.
        again: whether a scene may be driven again, with other seeds.

    Attributes:
        rows: of drives that are over, where they are counted.
    """

    allow_reuse_address = daemon_threads = True

    def __init__(
        self, address: tuple[str, int], scenes: Sequence[BenchmarkScene],
        load: Callable[[BenchmarkScene], Scenario], *, most: int | None, again: bool,
    ) -> None:  # fmt: skip
        super().__init__(address, Session)
        self.load, self.most, self.again = load, most, again
        self.rows, self._scenes, self._lock = list[Row](), scenes, threading.Lock()

    def choose(self, request: Request) -> BenchmarkScene:
        """The scene that a client asks for, or the next that is not done."""
        if request.seed is not None and not self.again:
            raise InputError("seed: those of the benchmark are fixed")
        done = set() if self.again else {row["scene"] for row in self.rows}
        for scene in self._scenes:
            if scene.id not in done and request.scene in (None, scene.id):
                return scene
        raise InputError("scene: none of that name is left")

    def enter(self, row: Row) -> int | None:
        """Keep the row of a drive; how many are left."""
        with self._lock:
            if self.most is None:
                return None
            if self.again or row["scene"] not in {each["scene"] for each in self.rows}:
                self.rows.append(row)
            return max(self.most - len(self.rows), 0)


class Session(socketserver.StreamRequestHandler):
    """One connection and its drive."""

    server: EgoServer
    timeout = LONGEST_SILENCE
    disable_nagle_algorithm = True
    _env: DriveEnv | None = None

    def handle(self) -> None:
        """Answer line by line until the client closes or falls silent, or nothing is left."""
        try:
            while line := self.rfile.readline(LONGEST_LINE + 1):
                answer = self._answer_line(line)
                self.wfile.write(json.dumps(answer, allow_nan=False).encode() + b"\n")
                if answer.get("info", {}).get("left") == 0:
                    self.server.shutdown()
                if "closed" in answer:
                    return
        except OSError:
            return

    def _answer_line(self, line: bytes) -> dict[str, Any]:
        try:
            if len(line) > LONGEST_LINE:
                while line and not line.endswith(b"\n"):
                    line = self.rfile.readline(LONGEST_LINE)
                raise InputError(f"a line has {LONGEST_LINE} bytes at most")
            return self._answer(Request.model_validate_json(line, strict=True))
        except ValidationError as error:
            return {"error": describe_misfit(error, "line")[:300]}
        except ScenewrightError as error:
            return {"error": " ".join(str(error).split())[:300]}

    def _answer(self, request: Request) -> dict[str, Any]:
        if request.call == "close":
            return {"closed": True}
        if request.call == "reset":
            self._scene = one = self.server.choose(request)
            self._seed = one.seed if request.seed is None else request.seed
            self._env = DriveEnv(
                self.server.load(one), others=one.others, temperament=one.temperament,
                mode=request.actions, seed=self._seed,
            )  # fmt: skip
            seen, info = self._env.reset()
            return _write(seen) | {"info": info | {"scene": one.id}}
        if self._env is None:
            raise InputError("call reset before step: no drive is in progress")
        seen, reward, terminated, truncated, info = self._env.step(request.action)  # type: ignore[arg-type]  # which step reads
        if terminated or truncated:
            one = self._scene
            world: Any = self._env.world  # there is one after a step
            drive = Drive(world, "socket", one.others, self._seed, temperament=one.temperament)
            row = build_row(report_drive(drive), scene=one.id, kind=one.kind, split=one.split)
            info |= {"result": row, "left": self.server.enter(row)}
        ends = {"terminated": terminated, "truncated": truncated}
        return _write(seen) | {"reward": reward, **ends, "info": info}


def _write(observation: Any) -> dict[str, Any]:
    return {"observation": {name: values.tolist() for name, values in observation.items()}}
