"""Who does the pieces of a sweep: this process, others on this machine, or a Dask cluster."""

from __future__ import annotations

import importlib
import multiprocessing
import os
import sys
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import connection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.errors import CheckFailedError, UsageError
from hil.extras import needs_extra
from hil.sweep.spec import Sweep
from hil.sweep.work import Piece, fly_piece

Done = tuple[Piece, NDArray[np.void]]

_CONNECT_TIMEOUT = "30s"


def fly_here(sweep: Sweep, pieces: Sequence[Piece], workers: int) -> Iterator[Done]:
    """Tallies of pieces as they are done, by so many processes; one worker is this process itself."""
    if workers == 1:
        for piece in pieces:
            yield piece, fly_piece(sweep, piece)
        return
    # Spawned processes inherit neither threads nor locks, and numba's code comes out of its cache.
    spawn = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, mp_context=spawn, initializer=_begin_work)
    try:
        waiting = {pool.submit(fly_piece, sweep, piece): piece for piece in pieces}
        for done in as_completed(waiting):
            yield waiting[done], done.result()
    except BrokenProcessPool:
        raise CheckFailedError(
            "a worker of the sweep died; what was done is kept: run the same command again to go on"
        ) from None
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _begin_work() -> None:
    """Leave stdout to results, and end with the sweep, however that ends.

    What laws and estimators of others print in a worker goes to stderr.
    """
    sys.stdout = sys.stderr
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    """End this process once another has, by its sentinel: one that was killed tells nobody to end."""
    connection.wait([sentinel])
    os._exit(1)


def fly_on_cluster(sweep: Sweep, pieces: Sequence[Piece], scheduler: str) -> Iterator[Done]:
    """Tallies of pieces as they are done, by the workers of a Dask scheduler.

    What a lost worker had begun or held goes to another. Raises :class:`UsageError` if the scheduler cannot
    be reached or Dask is not installed.
    """
    try:
        distributed: Any = importlib.import_module("distributed")
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
        waiting = {
            client.submit(fly_piece, sweep, piece, key=f"{sweep.digest()}-{piece.name}", retries=5): piece
            for piece in pieces
        }
        for done, tallies in distributed.as_completed(waiting, loop=client.loop, with_results=True):
            yield waiting[done], tallies
