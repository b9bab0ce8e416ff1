"""Jobs on processes of this machine: each has one job at a time and is replaced when it dies.

Workers are forked from a server that has loaded and used all that a scene needs, where the system
can fork and the environment is as it was when the server began; else each starts and loads anew.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import pickle
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import forkserver
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerContext, SpawnContext
from multiprocessing.process import BaseProcess
from typing import Any, Generic, TypeVar

from scenewright.graph.collector import HARDLY_EVER

JobT = TypeVar("JobT")
ResultT = TypeVar("ResultT")

RECYCLED_AFTER = 1000
"""Jobs after which a worker is replaced, so that what libraries keep does not add up."""
TRIES = 3
"""How many workers may die of one job before it is given up."""
WARM_UP = 60.0
"""More time for the first job of a worker, which has everything to load [s]."""
_PRELOADED = "scenewright.dataset.batch.preload"
_server_environment: dict[str, str] = {}
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Died:
    """A job of which every worker died, and with which exit code the last."""

    code: int | None


@dataclass(frozen=True)
class Overdue:
    """A job that took longer than it may: its worker was ended, and it is not tried again."""

    limit: float


@dataclass(frozen=True)
class _PoolTask(Generic[JobT]):
    """A job, and how many workers died of it."""

    job: JobT
    deaths: int = 0


class _Worker(Generic[JobT]):
    """A process, the pipe to it, and the job that it has."""

    def __init__(self, task: Callable[[Any], Any]) -> None:
        context = _choose_context()
        self.pipe, theirs = context.Pipe()
        self.process: BaseProcess = context.Process(target=_serve, args=(theirs, task), daemon=True)
        with _use_one_thread():
            self.process.start()
        theirs.close()
        self.task: _PoolTask[JobT] | None = None
        self.given = 0
        self._since = 0.0

    def give(self, task: _PoolTask[JobT]) -> None:
        """Hands over a job; a dead worker is noticed when its answer is awaited."""
        self.task, self.given, self._since = task, self.given + 1, time.monotonic()
        with suppress(OSError):
            self.pipe.send(task.job)

    def compute_left(self, limit: float) -> float:
        """How long its job may still take [s]."""
        allowed = limit + (WARM_UP if self.given == 1 else 0.0)
        return self._since + allowed - time.monotonic()

    def take_answer(self) -> Any:
        """What its job came to; `Died` where it is no more."""
        try:
            return pickle.loads(self.pipe.recv_bytes())
        except (EOFError, OSError):
            self.process.join()
            return Died(self.process.exitcode)

    def stop(self) -> None:
        """Ends the process, whatever it does."""
        self.pipe.close()
        self.process.kill()
        self.process.join()


def start_server() -> None:
    """Begin to load what workers need, while the rows are still being read."""
    if _choose_context().get_start_method() == "forkserver":
        with _use_one_thread():
            forkserver.ensure_running()


def _choose_context() -> ForkServerContext | SpawnContext:
    """Workers of the server see the environment with which it began."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    if not _server_environment:
        _server_environment.update(os.environ)
        multiprocessing.set_forkserver_preload([_PRELOADED])
    if _server_environment != dict(os.environ):
        return multiprocessing.get_context("spawn")
    return multiprocessing.get_context("forkserver")


@contextmanager
def _use_one_thread() -> Iterator[None]:
    """Workers share the cores among them by being many, not by threads of libraries."""
    missing = [name for name in _THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(missing, "1"))
    try:
        yield
    finally:
        for name in missing:
            del os.environ[name]


def _serve(pipe: Connection, task: Callable[[Any], Any]) -> None:
    """What a worker does until its pipe closes. Ctrl-C is the parent's business."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with suppress(EOFError, OSError):
        pipe.send_bytes(pickle.dumps(task(pipe.recv())))
        # What the first job loaded stays: the collector need not look through it again and again,
        # as it would after every scene.
        gc.freeze()
        gc.set_threshold(*HARDLY_EVER)
        while True:
            pipe.send_bytes(pickle.dumps(task(pipe.recv())))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def spread(
    jobs: Iterable[JobT],
    task: Callable[[JobT], ResultT],
    *,
    workers: int,
    limit: float | None = None,
) -> Iterator[tuple[JobT, ResultT | Died | Overdue]]:
    """(job, result) in the order in which jobs come to an end; `jobs` is drawn from as needed.

    A job whose worker dies (killed, out of memory) is given to another one, at most TRIES times.

    Args:
        limit: longest that one job may take [s].
    """
    again, fresh = deque[_PoolTask[JobT]](), map(_PoolTask, jobs)

    def take_next() -> _PoolTask[JobT] | None:
        """The next one to do: first those whose worker died."""
        return again.popleft() if again else next(fresh, None)

    crew: list[_Worker[JobT]] = []
    try:
        while len(crew) < workers and (first := take_next()) is not None:
            crew.append(_Worker(task))
            crew[-1].give(first)
        while busy := [(each, each.task) for each in crew if each.task is not None]:
            left = None if limit is None else min(each.compute_left(limit) for each, _ in busy)
            ready = wait([each.pipe for each, _ in busy], left if left is None else max(left, 0.0))
            for worker, done in busy:
                overdue = limit is not None and worker.compute_left(limit) <= 0.0
                if worker.pipe not in ready and not overdue:
                    continue
                answered = worker.pipe in ready
                result = worker.take_answer() if answered else Overdue(limit or 0.0)
                retried = isinstance(result, Died) and done.deaths + 1 < TRIES
                if retried:
                    again.append(_PoolTask(done.job, done.deaths + 1))
                # Before the result is looked at, the worker has something to do.
                following, worker.task = take_next(), None
                if isinstance(result, Died | Overdue) or worker.given >= RECYCLED_AFTER:
                    worker.stop()
                    crew.remove(worker)
                    if following is not None:
                        crew.append(_Worker(task))
                        crew[-1].give(following)
                elif following is not None:
                    worker.give(following)
                if not retried:
                    yield done.job, result
    finally:
        for worker in crew:
            worker.stop()
