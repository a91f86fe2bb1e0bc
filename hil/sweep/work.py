"""The work of a sweep in pieces that any process can do, and where their results are kept."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hil.errors import UsageError
from hil.lockstep.flyer import STOPPING_S, Flyer
from hil.log.written_aside import written_aside
from hil.scenario.certificate import assumptions_of
from hil.scenario.files import build_scenario, scenario_text
from hil.scenario.schema import Scenario
from hil.sweep.spec import Cell, Sweep, run_seed
from hil.sweep.tally import TALLY, judge_run, judged_span, orbit_of

RUNS_AT_ONCE = 50
"""Runs of a piece: fractions of a second of work, so that little is lost and nobody waits long."""


@dataclass(frozen=True, slots=True)
class Piece:
    """Runs ``first`` up to ``last``, that excluded, of a cell."""

    cell: Cell
    first: int
    last: int

    @property
    def name(self) -> str:
        """Name of the file that holds its results."""
        return f"{self.cell.index:05d}-{self.first:06d}.npy"


def pieces_of(sweep: Sweep) -> Iterator[Piece]:
    """All pieces of a sweep, in the order of its results."""
    runs = sweep.spec.runs
    for cell in sweep.cells():
        for first in range(0, runs, RUNS_AT_ONCE):
            yield Piece(cell, first, min(first + RUNS_AT_ONCE, runs))


def fly_piece(sweep: Sweep, piece: Piece) -> NDArray[np.void]:
    """Tallies of the runs of a piece; they depend on nothing else."""
    scenario = sweep.scenario_of(piece.cell)
    from_ns, latency_s = judged_span(scenario).from_ns, scenario.mocap.latency_s
    flyer = Flyer(scenario, judged_from_ns=from_ns, after_s=min(latency_s, STOPPING_S))
    allowed, orbit = allowed_distances(sweep.scenario), orbit_of(scenario)
    tallies = np.zeros(piece.last - piece.first, TALLY)
    for row, run in enumerate(range(piece.first, piece.last)):
        flown = flyer.fly(run_seed(sweep.spec.seed, run))
        tallies[row] = judge_run(scenario, flown, allowed, orbit)[0]
    return tallies


def allowed_distances(scenario: Scenario) -> tuple[float, float] | None:
    """Distances of the certificate's invariant set, which no noise changes; None where it has none."""
    return _allowed(scenario_text(scenario))


@lru_cache(maxsize=4)
def _allowed(text: str) -> tuple[float, float] | None:
    from estimation.bounds.certificate import formation_claim  # compiled kernels behind it

    figures = formation_claim(assumptions_of(build_scenario(tomllib.loads(text)))).figures
    return (figures["rho_min"], figures["rho_max"]) if figures else None


class Store:
    """Results of pieces in a folder, so that an interrupted sweep can go on.

    Raises :class:`UsageError` if the folder belongs to another sweep.
    """

    def __init__(self, folder: Path, sweep: Sweep) -> None:
        self._parts = folder / "parts"
        mark = self._parts / "sweep.sha256"
        try:
            self._parts.mkdir(parents=True, exist_ok=True)
            if not mark.exists():
                # Whole or not there, and left alone ever after: half a mark would be that of another sweep.
                with written_aside(mark) as aside:
                    aside.write_text(sweep.digest())
            elif mark.read_text() != sweep.digest():
                raise UsageError(
                    f"--out {folder}: holds another sweep, or one of another version of abreast; "
                    "give another folder, or remove it"
                )
        except OSError as error:
            raise UsageError(f"--out {folder}: cannot be used ({error.strerror}); give another") from None

    def load(self, piece: Piece) -> NDArray[np.void] | None:
        """Tallies of a piece; None if it is still to be done, or its file does not hold them."""
        try:
            found: NDArray[np.void] = np.load(self._parts / piece.name, allow_pickle=False)
        except (OSError, ValueError, EOFError):
            return None
        return found if found.dtype == TALLY and len(found) == piece.last - piece.first else None

    def save(self, piece: Piece, tallies: NDArray[np.void]) -> None:
        """Keep the tallies of a piece; a file is either whole or not there."""
        with written_aside(self._parts / piece.name) as aside, aside.open("wb") as file:
            np.save(file, tallies, allow_pickle=False)
