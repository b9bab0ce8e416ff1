"""The same jobs on a Ray cluster: the way past one machine (extra `ray`).

Tasks compute and hand the files back; only the driver writes, so the machines need no common disk.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from itertools import islice
from typing import Any, TypeVar

from scenewright.dataset.batch.pool import TRIES, WARM_UP, Died, Overdue
from scenewright.extras import require_extra
from scenewright.time_limit import raise_after

JobT = TypeVar("JobT")
ResultT = TypeVar("ResultT")

SHARD = 8
"""Jobs of one Ray task: few enough to lose with a worker, enough to pay for the task."""
AHEAD = 2
"""Tasks in flight for each worker, so that none waits for the driver."""
_WARM: list[bool] = []
"""Not empty where this process has done a job."""


def spread_on_ray(
    jobs: Iterable[JobT],
    task: Callable[[JobT], ResultT],
    *,
    workers: int,
    limit: float | None = None,
) -> Iterator[tuple[JobT, ResultT | Died | Overdue]]:
    """(job, result) as tasks of a Ray cluster come to an end.

    Joins the cluster that RAY_ADDRESS names, else starts one on this machine with `workers` CPUs.
    A task whose worker dies is run again by Ray, at most TRIES times in all; then each of its jobs
    gets a task of its own, so that a job that kills its worker costs no other.

    Args:
        limit: longest that one job may take [s].

    Raises:
        InputError: Ray is not installed.
    """
    require_extra("ray", "--engine ray", "ray")
    ray = import_module("ray")
    started = not ray.is_initialized()
    if started:
        address = os.environ.get("RAY_ADDRESS")
        local = {} if address else {"num_cpus": workers, "include_dashboard": False}
        ray.init(address=address, log_to_driver=False, logging_level="ERROR", **local)
    remote = ray.remote(num_cpus=1, max_retries=TRIES - 1)(_run_shard)
    fresh, alone = iter(jobs), deque[JobT]()
    flying: dict[Any, list[JobT]] = {}
    try:
        while True:
            while len(flying) < AHEAD * workers:
                shard = [alone.popleft()] if alone else list(islice(fresh, SHARD))
                if not shard:
                    break
                flying[remote.remote(task, shard, limit)] = shard
            if not flying:
                return
            done, _ = ray.wait(list(flying), num_returns=1, timeout=1.0)
            for each in done:
                shard = flying.pop(each)
                try:
                    results = ray.get(each)
                except ray.exceptions.RayTaskError:
                    raise
                except ray.exceptions.RayError:  # every worker that had it died
                    if len(shard) > 1:
                        alone.extend(shard)
                        continue
                    results = [Died(None)]
                yield from zip(shard, results, strict=True)
    finally:
        if started:
            ray.shutdown()


def _run_shard(task: Callable[[Any], Any], jobs: list[Any], limit: float | None) -> list[Any]:
    return [run_within(limit, task, job) for job in jobs]


class _TimeIsUp(BaseException):
    """Raised in the midst of a job; a base exception, so that no job takes it for its own."""


def run_within(limit: float | None, task: Callable[[Any], Any], job: Any) -> Any:
    """A job's result, or `Overdue` when the time is up."""
    if limit is None:
        return task(job)
    try:
        with raise_after(limit if _WARM else limit + WARM_UP, _TimeIsUp()):
            return task(job)
    except _TimeIsUp:
        return Overdue(limit)
    finally:
        _WARM[:] = [True]
