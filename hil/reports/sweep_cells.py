"""What can be said of a sweep's cell at all, and which estimators are in a sweep to compare with only."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

Cell = Mapping[str, Any]

_POINT = ("sigma_position", "sigma_heading", "latency_s", "loss", "parameters")

FOILS = ("difference", "shape-ekf")
"""Estimators to compare others with: the paper's literal way, and a filter that knows no speed of zero."""


def is_known(cell: Cell) -> bool:
    """Whether a cell has errors to speak of: samples, and a run that did not diverge."""
    return int(cell["samples"]) > 0 and int(cell["diverged"]) < int(cell["runs"])


def is_sound(cell: Cell) -> bool:
    """Whether a cell's figures are those of all its runs: none of them diverged."""
    return is_known(cell) and not int(cell["diverged"])


def point_of(cell: Cell) -> str:
    """Where a cell is in the grid, whatever its estimator, as text that tells it from all others."""
    return json.dumps({name: cell[name] for name in _POINT if name in cell}, sort_keys=True)


def estimators_of(cells: Sequence[Cell]) -> tuple[list[str], list[str]]:
    """Estimators that a sweep is about, and its foils, each in the order of the cells.

    Who asks for foils alone asks about these.
    """
    names = list(dict.fromkeys(str(cell["estimator"]) for cell in cells))
    asked = [name for name in names if name not in FOILS]
    return (asked, [name for name in names if name in FOILS]) if asked else (names, [])


def number(value: object) -> float | None:
    """A value that is a finite number, else None."""
    return float(value) if isinstance(value, (int, float)) and math.isfinite(value) else None
