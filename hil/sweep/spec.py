"""What a sweep goes through: its specification, the cells of its grid, and the seeds of its runs."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta, Struct

from estimation.filters.estimators import ESTIMATORS
from hil import __version__
from hil.errors import UsageError
from hil.scenario.checked_toml import checked, locate, read_toml
from hil.scenario.files import load_scenario, with_overrides
from hil.scenario.schema import NonNegative, Positive, Probability, Scenario
from hil.sweep.refusals import refuse_unsweepable

SHORTEST_S = 1.0
"""Shortest run that a sweep takes: the judge looks at its second half."""
LONGEST_S = 3600.0
"""Longest one: a run is kept in memory as a whole until it is judged."""


class Grid(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Values of every axis: mocap noise [m], [rad], latency [s] of frames and the share of them lost."""

    sigma_position: Annotated[tuple[Positive, ...], Meta(min_length=1)]
    sigma_heading: Annotated[tuple[Positive, ...], Meta(min_length=1)]
    latency_s: Annotated[tuple[NonNegative, ...], Meta(min_length=1)] = (0.03,)
    loss: Annotated[tuple[Probability, ...], Meta(min_length=1)] = (0.0,)


class SweepSpec(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A sweep: every cell of the grid is ``runs`` runs of ``duration_s`` with each of the estimators.

    ``scenario``: a name or a path; ``set``: overrides of its keys, the same for all cells.
    """

    description: str = ""
    scenario: str = "turtlebot3"
    runs: Annotated[int, Meta(ge=1)] = 100
    seed: Annotated[int, Meta(ge=0, le=2**62)] = 1
    duration_s: Annotated[float, Meta(ge=SHORTEST_S, le=LONGEST_S)] = 30.0
    estimators: Annotated[tuple[str, ...], Meta(min_length=1)] = ("ekf",)
    set: tuple[str, ...] = ()
    grid: Grid


@dataclass(frozen=True, slots=True)
class Cell:
    """One point of the grid with one estimator. ``index`` counts cells in the order of the results."""

    index: int
    sigma_position: float
    sigma_heading: float
    latency_s: float
    loss: float
    estimator: str

    def overrides(self) -> list[str]:
        """Overrides of the scenario; the estimator knows the noise."""
        return [
            f"mocap.sigma_position={self.sigma_position!r}",
            f"mocap.sigma_heading={self.sigma_heading!r}",
            f"estimator.sigma_position={self.sigma_position!r}",
            f"estimator.sigma_heading={self.sigma_heading!r}",
            f"mocap.latency_s={self.latency_s!r}",
            f"mocap.loss={self.loss!r}",
            f"estimator.kind={self.estimator}",
        ]


@dataclass(frozen=True, slots=True)
class Sweep:
    """A specification with its scenario, ready to be flown, and to be sent to other processes."""

    spec: SweepSpec
    scenario: Scenario

    def cells(self) -> list[Cell]:
        """All cells, the estimator changing fastest."""
        grid = self.spec.grid
        axes: tuple[Sequence[Any], ...] = (
            *(grid.sigma_position, grid.sigma_heading, grid.latency_s, grid.loss),
            self.spec.estimators,
        )
        return [Cell(index, *point) for index, point in enumerate(itertools.product(*axes))]

    def scenario_of(self, cell: Cell, seed: int = 0) -> Scenario:
        """Scenario of a cell's runs."""
        return with_overrides(self.scenario, [*cell.overrides(), f"run.seed={seed}"])

    def digest(self) -> str:
        """What tells this sweep from any other: a hash of all that its results depend on, our version too."""
        spec = msgspec.structs.replace(self.spec, description="")
        identity = msgspec.json.encode([__version__, spec, self.scenario])
        return hashlib.sha256(identity).hexdigest()


def load_sweep(given: str | Mapping[str, Any], overrides: Sequence[str] = (), **changes: Any) -> Sweep:
    """Read a specification by its shipped name, from a TOML file, or from what would stand in one.

    ``changes`` other than None override it; ``overrides`` of the scenario's keys come after those of the
    specification, and before those of the cells.

    Raises :class:`UsageError` for whatever is wrong in it, in its scenario, or in any of its cells.
    """
    if isinstance(given, str):
        path = locate("sweep", "sweeps", given)
        source, tree = f"sweep {path.stem}", read_toml(path, "sweep")
    else:
        source, tree = "sweep", dict(given)
    tree |= {key: value for key, value in changes.items() if value is not None}
    spec = checked(tree, SweepSpec, source)
    spec = msgspec.structs.replace(spec, set=(*spec.set, *overrides))
    for estimator in spec.estimators:
        if estimator not in ESTIMATORS:
            raise UsageError(
                f"{source}: estimators has {estimator!r}, expected some of: {', '.join(ESTIMATORS)}"
            )
    scenario = load_scenario(spec.scenario, [*spec.set, f"run.duration_s={spec.duration_s!r}"])
    sweep = Sweep(spec, scenario)
    for cell in sweep.cells():
        refuse_unsweepable(sweep.scenario_of(cell))
    return sweep


def run_seed(seed: int, run: int) -> int:
    """Seed of a run by its number: the same in every cell, so that cells differ by nothing but their noise.

    A counter-based generator gives it, whose key is the sweep's seed and whose counter is the run.
    """
    random = np.random.Philox(key=[seed, 0], counter=[0, 0, 0, run])
    return int(random.random_raw()) >> 2


def spec_json(spec: SweepSpec) -> dict[str, Any]:
    """Specification as plain values."""
    plain: dict[str, Any] = json.loads(msgspec.json.encode(spec))
    return plain
