"""Axes of a sweep's grid as they are given on a command line, and keys that are theirs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hil.errors import UsageError

_PARAMETERS = "parameters."
_OPTIONS = {
    "estimator.kind": "--estimators A,B, or estimators in the specification",
    "run.seed": "--seed N, or seed in the specification",
    "run.duration_s": "--duration S, or duration_s in the specification",
}
"""Keys that a sweep sets in every cell, and what is given in their place."""


def with_axes(grid: Any, axes: Sequence[str]) -> Any:
    """A grid with other values of some axes; an axis that there is none of is left to who reads the grid.

    Raises :class:`UsageError` for what is no axis with numbers.

    >>> with_axes({"loss": [0.0]}, ["sigma_position=0.001,0.005", "parameters.k=0.5"])
    {'loss': [0.0], 'sigma_position': [0.001, 0.005], 'parameters': {'k': [0.5]}}
    """
    if not axes or not isinstance(grid, Mapping):
        return grid
    changed = {name: dict(value) if isinstance(value, Mapping) else value for name, value in grid.items()}
    for axis in axes:
        name, equals, text = axis.partition("=")
        try:
            values = [float(each) for each in text.strip().strip("[]").split(",")]
        except ValueError:
            values = []
        if not (name and equals and values):
            raise UsageError(
                f"--grid {axis!r}: expected an axis with its values, such as sigma_position=0.001,0.005"
            )
        if name.startswith(_PARAMETERS):
            changed.setdefault("parameters", {})[name.removeprefix(_PARAMETERS)] = values
        else:
            changed[name] = values
    return changed


def refuse_of_axes(overrides: Sequence[str], of_cells: Sequence[str], source: str) -> None:
    """Raise :class:`UsageError` for overrides of keys that every cell sets by itself: they would be lost.

    ``of_cells``: the overrides of a cell.
    """
    axes = {key for key in (each.partition("=")[0] for each in of_cells) if key not in _OPTIONS}
    for override in overrides:
        key, _, value = override.partition("=")
        key = key.strip()
        name = key.removeprefix("controller.").rpartition("mocap.")[2].rpartition("estimator.")[2]
        if key in _OPTIONS:
            raise UsageError(f"{source}: --set {override}: a sweep sets that itself; give {_OPTIONS[key]}")
        if key in axes:
            raise UsageError(
                f"{source}: --set {override}: is an axis of the sweep, which every cell sets itself; give "
                f"--grid {name}={value}, or [grid] in the specification"
            )
