"""What a sweep goes through: its specification, the cells of its grid, and the seeds of its runs."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import UNSET, Meta, Struct, UnsetType

from estimation.filters.estimators import ESTIMATORS
from hil import __version__
from hil.errors import UsageError
from hil.extensions.reference import found, is_reference, short
from hil.scenario.brought import settled_references
from hil.scenario.checked_toml import checked, locate, meant, read_toml
from hil.scenario.files import load_scenario, with_overrides
from hil.scenario.schema import Scenario
from hil.scenario.section import Deviation, Probability, Span
from hil.sweep.axes import as_axes, refuse_lost, with_axes
from hil.sweep.refusals import refuse_unsweepable

SHORTEST_S = 1.0
"""Shortest run that a sweep takes: the judge looks at its second half."""
LONGEST_S = 3600.0
"""Longest one: a run is kept in memory as a whole until it is judged."""


class Grid(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Values of every axis: mocap noise [m], [rad], latency [s] of frames and the share of them lost.

    ``parameters``: values of each parameter of a law of one's own, if any are to be swept.
    """

    sigma_position: Annotated[tuple[Deviation, ...], Meta(min_length=1)]
    sigma_heading: Annotated[tuple[Deviation, ...], Meta(min_length=1)]
    latency_s: Annotated[tuple[Span, ...], Meta(min_length=1)] = (0.03,)
    loss: Annotated[tuple[Probability, ...], Meta(min_length=1)] = (0.0,)
    parameters: dict[str, Annotated[tuple[float, ...], Meta(min_length=1)]] | UnsetType = UNSET


class SweepSpec(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A sweep: every cell of the grid is ``runs`` runs of ``duration_s`` with each of the estimators.

    ``scenario``: a name or a path; ``set``: overrides of its keys, the same for all cells.
    """

    description: str = ""
    scenario: str = "turtlebot3"
    runs: Annotated[int, Meta(ge=1, le=10**9)] = 100
    seed: Annotated[int, Meta(ge=0, le=2**62)] = 1
    duration_s: Annotated[float, Meta(ge=SHORTEST_S, le=LONGEST_S)] = 30.0
    estimators: Annotated[tuple[str, ...], Meta(min_length=1)] = ("ekf",)
    set: tuple[str, ...] = ()
    grid: Grid


@dataclass(frozen=True, slots=True)
class Cell:
    """One point of the grid with one estimator. ``index`` counts cells in the order of the results.

    ``parameters``: names and values of the swept parameters of the law.
    """

    index: int
    sigma_position: float
    sigma_heading: float
    latency_s: float
    loss: float
    parameters: tuple[tuple[str, float], ...]
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
            *(f"controller.parameters.{name}={value!r}" for name, value in self.parameters),
        ]

    def point(self) -> dict[str, Any]:
        """Where it is, as the results have it; an estimator of one's own goes without its folders."""
        point = asdict(self) | {
            "parameters": dict(self.parameters) or None,
            "estimator": short(self.estimator),
        }
        point.pop("index")
        return {name: value for name, value in point.items() if value is not None}


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
            self._parameters(),
            self.spec.estimators,
        )
        return [Cell(index, *point) for index, point in enumerate(itertools.product(*axes))]

    def _parameters(self) -> list[tuple[tuple[str, float], ...]]:
        given = self.spec.grid.parameters
        swept = {} if isinstance(given, UnsetType) else given
        axes = [[(name, value) for value in values] for name, values in swept.items()]
        return list(itertools.product(*axes))

    def scenario_of(self, cell: Cell, seed: int = 0) -> Scenario:
        """Scenario of a cell's runs."""
        return with_overrides(self.scenario, [*cell.overrides(), f"run.seed={seed}"])

    def digest(self) -> str:
        """What tells this sweep from any other: a hash of all that its results depend on, our version too.

        That is also the source of a law or an estimator of one's own.
        """
        spec = msgspec.structs.replace(self.spec, description="")
        given = [*spec.estimators, self.scenario.controller.law]
        sources = [found(text, "sweep").digest() for text in given if is_reference(text)]
        identity = msgspec.json.encode([__version__, spec, self.scenario, sources])
        return hashlib.sha256(identity).hexdigest()


def load_sweep(
    given: str | Mapping[str, Any], overrides: Sequence[str] = (), axes: Sequence[str] = (), **changes: Any
) -> Sweep:
    """Read a specification by its shipped name, from a TOML file, or from what would stand in one.

    ``changes`` other than None override it; ``overrides`` of the scenario's keys come after those of the
    specification; one of an axis is its only value. ``axes``: such as ``sigma_position=0.001,0.005`` or
    ``parameters.k=0,0.5``, in place of those of the grid.

    Raises :class:`UsageError` for whatever is wrong in it, in its scenario, or in any of its cells.
    """
    if isinstance(given, str):
        path = locate("sweep", "sweeps", given)
        source, tree = f"sweep {path.stem}", read_toml(path, "sweep")
    else:
        source, tree = "sweep", dict(given)
    tree |= {key: value for key, value in changes.items() if value is not None}
    given_grid = tree.get("grid", {})
    swept = given_grid.get("parameters", {}) if isinstance(given_grid, Mapping) else {}
    as_given, overrides = as_axes(overrides, swept if isinstance(swept, Mapping) else ())
    tree["grid"] = with_axes(given_grid, [*as_given, *axes])
    spec = checked(tree, SweepSpec, source)
    estimators = tuple(map(_settled_estimator, spec.estimators))
    spec = msgspec.structs.replace(spec, set=(*spec.set, *overrides), estimators=estimators)
    for estimator in spec.estimators:
        if estimator not in ESTIMATORS and not is_reference(estimator):
            raise UsageError(
                f"{source}: estimators has {estimator!r}, expected some of: "
                f"{', '.join(ESTIMATORS)}, or file.py:factory{meant(estimator, ESTIMATORS)}"
            )
    scenario = load_scenario(spec.scenario, [*spec.set, f"run.duration_s={spec.duration_s!r}"])
    sweep = Sweep(spec, scenario)
    refuse_lost(spec.set, sweep.cells()[0].overrides(), source)
    for cell in sweep.cells():
        refuse_unsweepable(sweep.scenario_of(cell))
    return sweep


def _settled_estimator(text: str) -> str:
    return settled_references(None, text)["estimator"] or text


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
