"""The same jobs on a Ray cluster: the way past one machine (extra `ray`).

Tasks compute and hand the files back; only the driver writes, so the machines need no common disk.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from itertools import islice
from typing import Any, TypeVar

from scenewright.errors import InputError
from scenewright.graph.batch.pool import TRIES, Died

JobT = TypeVar("JobT")
ResultT = TypeVar("ResultT")

SHARD = 8
"""Jobs of one Ray task: few enough to lose with a worker, enough to pay for the task."""
AHEAD = 2
"""Tasks in flight for each worker, so that none waits for the driver."""


def spread_on_ray(
    jobs: Iterable[JobT], task: Callable[[JobT], ResultT], *, workers: int
) -> Iterator[tuple[JobT, ResultT | Died]]:
    """(job, result) as tasks of a Ray cluster come to an end.

    Joins the cluster that RAY_ADDRESS names, else starts one on this machine with `workers` CPUs.
    A task whose worker dies is run again by Ray, at most TRIES times in all.

    Raises:
        InputError: Ray is not installed.
    """
    ray = _ray()
    started = not ray.is_initialized()
    if started:
        _begin(ray, workers)
    try:
        yield from _spread(ray, iter(jobs), task, workers)
    finally:
        if started:
            ray.shutdown()


def _ray() -> Any:
    try:
        return import_module("ray")
    except ImportError as error:
        raise InputError(
            "--engine ray needs the extra: pip install 'scenewright[ray]', or make ray"
        ) from error


def _begin(ray: Any, workers: int) -> None:
    address = os.environ.get("RAY_ADDRESS")
    local = {} if address else {"num_cpus": workers, "include_dashboard": False}
    ray.init(address=address, log_to_driver=False, logging_level="ERROR", **local)


def _spread(
    ray: Any, jobs: Iterator[JobT], task: Callable[[JobT], ResultT], workers: int
) -> Iterator[tuple[JobT, ResultT | Died]]:
    remote = ray.remote(num_cpus=1, max_retries=TRIES - 1)(_shard)
    flying: dict[Any, list[JobT]] = {}
    while True:
        while len(flying) < AHEAD * workers and (shard := list(islice(jobs, SHARD))):
            flying[remote.remote(task, shard)] = shard
        if not flying:
            return
        done, _ = ray.wait(list(flying), num_returns=1, timeout=1.0)
        for each in done:
            shard = flying.pop(each)
            yield from zip(shard, _results(ray, each, len(shard)), strict=True)


def _shard(task: Callable[[Any], Any], jobs: list[Any]) -> list[Any]:
    return [task(job) for job in jobs]


def _results(ray: Any, reference: Any, count: int) -> list[Any]:
    try:
        found: list[Any] = ray.get(reference)
    except ray.exceptions.RayTaskError:
        raise
    except ray.exceptions.RayError:
        return [Died(None)] * count
    return found
