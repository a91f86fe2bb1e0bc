"""Axes of a sweep's grid as they are given on a command line, and keys that are theirs."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from hil.errors import UsageError

_PARAMETERS = "parameters."
_AXES = {f"mocap.{name}": name for name in ("sigma_position", "sigma_heading", "latency_s", "loss")}
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


def as_axes(overrides: Sequence[str], swept: Collection[str] = ()) -> tuple[list[str], list[str]]:
    """Overrides of keys that are axes, as those, and all others: one value in place of the grid's.

    ``swept``: parameters of a law that the grid goes through.

    >>> as_axes(["mocap.loss=0.1", "mocap.jitter_s=0.01"])
    (['loss=0.1'], ['mocap.jitter_s=0.01'])
    """
    axes, others = [], []
    known = _AXES | {f"controller.{_PARAMETERS}{name}": f"{_PARAMETERS}{name}" for name in swept}
    for override in overrides:
        key, _, value = override.partition("=")
        if (name := known.get(key.strip())) is None:
            others.append(override)
        else:
            axes.append(f"{name}={value.strip()}")
    return axes, others


def refuse_lost(overrides: Sequence[str], of_cells: Sequence[str], source: str) -> None:
    """Raise :class:`UsageError` for overrides of keys that every cell sets by itself: they would be lost.

    ``of_cells``: the overrides of a cell.
    """
    sets = {each.partition("=")[0] for each in of_cells}
    for override in overrides:
        key, _, value = override.partition("=")
        key = key.strip()
        if key in _OPTIONS:
            raise UsageError(f"{source}: --set {override}: a sweep sets that itself; give {_OPTIONS[key]}")
        if key in sets:
            name = _AXES.get(f"mocap.{key.rpartition('.')[2]}", key.removeprefix("controller."))
            raise UsageError(
                f"{source}: --set {override}: every cell sets that itself, to the noise that it has; give "
                f"--grid {name}={value}, or [grid] in the specification"
            )
