"""Work shared out: by this process, by others on this machine, or by a Dask cluster."""

from __future__ import annotations

import importlib
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import connection
from typing import Any, TypeVar

from hil.errors import CheckFailedError, UsageError
from hil.extras import needs_extra

Item = TypeVar("Item")
Result = TypeVar("Result")

_CONNECT_TIMEOUT = "30s"


class LostWorkerError(CheckFailedError):
    """A worker process died with what it was doing."""


def shared_here(
    task: Callable[[Item], Result], items: Sequence[Item], workers: int
) -> Iterator[tuple[Item, Result]]:
    """Items with what a task made of them, as they are done; one worker is this process itself.

    Raises :class:`LostWorkerError` when a worker dies; what was not given by then is not done.
    """
    if workers == 1:
        for item in items:
            yield item, task(item)
        return
    # Spawned processes inherit neither threads nor locks, and numba's code comes out of its cache.
    spawn = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(workers, len(items) or 1), mp_context=spawn, initializer=_begin_work)
    try:
        waiting = {pool.submit(task, item): item for item in items}
        for done in as_completed(waiting):
            yield waiting[done], done.result()
    except BrokenProcessPool:
        raise LostWorkerError("a worker died") from None
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def shared_on_cluster(
    task: Callable[[Item], Result], items: Sequence[Item], scheduler: str, key: Callable[[Item], str]
) -> Iterator[tuple[Item, Result]]:
    """Items with what a task made of them, as they are done, by the workers of a Dask scheduler.

    ``key``: what tells an item, and what is done with it, from all others. What a lost worker had begun or
    held goes to another. Raises :class:`UsageError` if the scheduler cannot be reached or Dask is not
    installed, and :class:`LostWorkerError` for an item that ended one worker after another.
    """
    try:
        distributed: Any = importlib.import_module("distributed")
        killed = importlib.import_module("distributed.scheduler").KilledWorker
    except ModuleNotFoundError as error:
        raise needs_extra(f"--scheduler {scheduler}", error) from None
    try:
        client = distributed.Client(scheduler, timeout=_CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise UsageError(
            f"--scheduler {scheduler}: not reachable ({type(error).__name__}); "
            "start one with `dask scheduler`, and workers with `dask worker ADDRESS`"
        ) from None
    with client:
        waiting = {client.submit(task, item, key=key(item), retries=5): item for item in items}
        for done in distributed.as_completed(waiting, loop=client.loop):
            try:
                result = done.result()
            except killed as error:
                raise LostWorkerError(f"workers died over {waiting[done]}: {error}") from None
            yield waiting[done], result


def _begin_work() -> None:
    """Leave stdout to results, and end with who began it, however that ends.

    What laws and estimators of others print in a worker goes to stderr.
    """
    sys.stdout = sys.stderr
    # Ctrl-C reaches all of a terminal: who shares the work ends its workers, which finish what they are at.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    """End this process once another has, by its sentinel: one that was killed tells nobody to end."""
    connection.wait([sentinel])
    os._exit(1)
