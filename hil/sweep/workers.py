"""Who does the pieces of a sweep: this process, others on this machine, or a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hil.errors import CheckFailedError
from hil.sweep.shared_work import LostWorkerError, shared_here, shared_on_cluster
from hil.sweep.spec import Sweep
from hil.sweep.work import Piece, fly_piece

Done = tuple[Piece, NDArray[np.void]]


def fly_here(sweep: Sweep, pieces: Sequence[Piece], workers: int) -> Iterator[Done]:
    """Tallies of pieces as they are done, by so many processes; one worker is this process itself."""
    yield from _kept(shared_here(partial(fly_piece, sweep), pieces, workers))


def fly_on_cluster(sweep: Sweep, pieces: Sequence[Piece], scheduler: str) -> Iterator[Done]:
    """Tallies of pieces as they are done, by the workers of a Dask scheduler.

    Raises :class:`UsageError` as :func:`~hil.sweep.shared_work.shared_on_cluster`.
    """
    digest = sweep.digest()
    task = partial(fly_piece, sweep)
    yield from _kept(shared_on_cluster(task, pieces, scheduler, lambda piece: f"{digest}-{piece.name}"))


def _kept(work: Iterator[Done]) -> Iterator[Done]:
    """What comes of work, and where a worker is lost what to do about it."""
    try:
        yield from work
    except LostWorkerError:
        raise CheckFailedError(
            "a worker of the sweep died; what was done is kept: run the same command again to go on"
        ) from None
