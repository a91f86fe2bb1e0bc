"""Two sweeps over each other: maps of the ratio of errors over noise, cell by cell."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape

from hil.compare.group import Group
from hil.reports.cell_looks import ABSENT, DIVERGED, LOOKS, Look, ink_on, marked_lost
from hil.reports.heat_maps import (
    noise_labels,
    noise_map,
    off_run,
    off_station,
    quantity_labels,
    slice_of,
    slices_of,
)
from hil.reports.plots import Panel
from hil.reports.sweep_cells import Cell, estimators_of, is_sound, number, point_of

_BETTER, _SAME, _WORSE = (0x00, 0x72, 0xB2), (0xF4, 0xF4, 0xF4), (0xD5, 0x5E, 0x00)
"""Blue, white and vermilion, which eyes of every kind tell apart."""
_FULL = math.log(2.0)
"""A ratio of two, or of a half, has the full colour."""

LEGEND = (
    '<ul class="keys">'
    '<li><span aria-hidden="true" style="height:.9rem;width:5rem;background:linear-gradient(to right, '
    '#0072b2, #f4f4f4, #d55e00)"></span>half of the error, the same, twice</li>'
    f'<li><span aria-hidden="true" style="height:.9rem;background:#dcdcdc"></span>n → m {DIVERGED}: runs '
    "diverged, in the first and in the other</li></ul>\n"
)


STATION, OWN_RUN = "station", "own_run"
_FORMATION = {
    STATION: ("ρ off the station [mm]", off_station),
    OWN_RUN: ("ρ off its own noise-free run [mm]", off_run),
}


def map_labels(cells: Sequence[Cell], *, laws_differ: bool) -> dict[str, str]:
    """What maps can show, in words by its key: errors of quantities, and how well the formation was kept.

    The latter first where laws differ: by that they are told apart.
    """
    keys = [STATION] if laws_differ else [OWN_RUN, STATION]
    kept = {
        key: _FORMATION[key][0] for key in keys if any(_FORMATION[key][1](cell) is not None for cell in cells)
    }
    errors = quantity_labels(cells)
    return {**kept, **errors} if laws_differ else {**errors, **kept}


def ratio_maps(first: Group, other: Group, chosen: Sequence[str]) -> list[Panel]:
    """One map for every estimator of another sweep: its error over that of the first, where both have a cell.

    ``chosen``: keys of what can be chosen, that which is shown at first in front. Cells with runs that
    diverged in one of the two have no colour.
    """
    before, after = _cells(first), _cells(other)
    _, foils = estimators_of(after)
    rows, columns = noise_labels(after, "sigma_position"), noise_labels(after, "sigma_heading")
    panels = []
    for estimator in dict.fromkeys(str(cell["estimator"]) for cell in after):
        data: dict[str, list[str]] = {
            "row": [row for row in rows.values() for _ in columns],
            "column": [column for _ in rows for column in columns.values()],
        }
        twins = _twins(before, [cell for cell in after if str(cell["estimator"]) == estimator])
        for quantity in chosen:
            for n, each in enumerate(slices_of(before)):
                looks = {
                    (new["sigma_position"], new["sigma_heading"]): _look(old, new, quantity)
                    for old, new in twins
                    if slice_of(new) == each
                }
                shown = [looks.get((row, column), ABSENT) for row in rows for column in columns]
                data |= {f"{name}|{quantity}|{n}": [getattr(look, name) for look in shown] for name in LOOKS}
        if chosen:
            data |= {name: data[f"{name}|{chosen[0]}|0"] for name in LOOKS}
            title = f"{other.label}: {estimator}{' (foil)' * (estimator in foils)}"
            says = f"Error over that of {first.label}; below 1 is better."
            across, up = list(columns.values()), list(rows.values())
            panels.append(noise_map(title, says, data, up, across, leads=False))
    return panels


def _cells(group: Group) -> Sequence[Cell]:
    cells: Sequence[Cell] = group.tree["cells"]
    return cells


def _twins(before: Sequence[Cell], after: Sequence[Cell]) -> list[tuple[Cell, Cell]]:
    """Cells of both sweeps at the same place, of the same estimator or of each one's only one."""
    alone = len({str(cell["estimator"]) for cell in before}) == 1
    known: Mapping[tuple[str, str], Cell] = {
        (point_of(cell), "" if alone else str(cell["estimator"])): cell for cell in before
    }
    found = [(known.get((point_of(cell), "" if alone else str(cell["estimator"]))), cell) for cell in after]
    return [(old, new) for old, new in found if old is not None]


def _error(cell: Cell, quantity: str) -> float | None:
    if quantity in _FORMATION:
        return _FORMATION[quantity][1](cell)
    return number(cell.get("rmse", {}).get(quantity))


def _look(old: Cell, new: Cell, quantity: str) -> Look:
    errors = [_error(cell, quantity) for cell in (old, new)]
    if not (is_sound(old) and is_sound(new)):
        counts = f"{old['diverged']} → {new['diverged']}"
        return marked_lost(
            f"{counts} {DIVERGED}", f"{counts} of {old['runs']} and {new['runs']} runs diverged"
        )
    before, after = errors
    if not before or not after:
        return marked_lost("–", "not known")
    ratio = after / before
    share = min(max(math.log(ratio) / _FULL, -1.0), 1.0)
    end = _WORSE if share > 0.0 else _BETTER
    mixed = [round(same + abs(share) * (full - same)) for same, full in zip(_SAME, end, strict=True)]
    colour = "#{:02x}{:02x}{:02x}".format(*mixed)
    return Look(colour, ink_on(colour), f"{ratio:.2f}", f"{before:.3g} → {after:.3g} SI", "blank", "#")


def labels_of_maps(group: Group) -> str:
    """What the maps are against, in words."""
    return f"<p>Error of each cell over that of {escape(group.label)}.</p>\n{LEGEND}"
