"""CSV files that OptiTrack's Motive exports: tracks of rigid bodies below a heading of several lines.

The first line tells of the take in pairs of a key and a value, in any order. Then come lines of types, names,
ids (and since format 1.25 parents) of what the columns belong to, of what they are, and of their axes.
Formats from 1.2 on are read.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from formation.angles import FloatArray
from hil.errors import UsageError
from hil.recordings.body_tracks import BodyTrack, Export
from hil.recordings.delimited import Layout, find_layout, split_line
from hil.recordings.export_cells import ExportCells, Place, read_export
from hil.recordings.text_file import Text
from hil.recordings.units import factor_of

_HEADING_LINES = 14
_BODY = "rigid body"


class _Columns(NamedTuple):
    """Columns of a body by axis: of its rotation, X, Y, Z and W if it is a quaternion, and its position."""

    rotation: dict[str, int]
    position: dict[str, int]


def is_motive(text: Text) -> bool:
    """Whether a text is an export of Motive."""
    first = next((line for line in text.lines if line.strip()), "")
    return first.lstrip('"').lower().startswith("format version") or (
        "take name" in first.lower() and "rotation type" in first.lower()
    )


def read_motive(path: Path, text: Text) -> Export:
    """Read the tracks of all rigid bodies.

    Raises :class:`UsageError` for an export without rigid bodies, of local coordinates, or of a rotation or a
    unit that is none, and as :func:`hil.recordings.export_cells.read_export`.
    """
    source = f"recording {path}: Motive export"
    top = next(k for k, line in enumerate(text.lines) if line.strip())
    layout = find_layout(text.lines[top : top + 1])
    about = _about(split_line(text.lines[top], layout.delimiter))
    axes_at = _axes_line(source, text, layout)
    heading = [
        split_line(line, layout.delimiter) for line in text.lines[top + 1 : axes_at] if line.strip(' ,;\t"')
    ]
    if len(heading) < 3:
        raise UsageError(
            f"{source}: expected lines of types, names and axes above {text.lines[axes_at][:20]!r}"
        )
    axes = split_line(text.lines[axes_at], layout.delimiter)
    order = _rotation_order(source, about.get("rotation type", "Quaternion"))
    columns = _columns(heading[0], heading[1], heading[-1], axes)
    turned = set("XYZW") if order is None else set("XYZ")
    columns = {
        name: body
        for name, body in columns.items()
        if body.position.keys() == set("XYZ") and body.rotation.keys() == turned
    }
    if not columns:
        raise UsageError(
            f"{source}: has no rigid bodies; export with the option for rigid bodies switched on"
        )
    unit = about.get("length units", "Meters")
    scale = factor_of("leader_x", unit)
    if scale is None:
        raise UsageError(f"{source}: Length Units is {unit!r}, expected Meters, Centimeters or Millimeters")
    wanted = [1, *(k for body in columns.values() for part in body for k in part.values())]
    cells = read_export(path, text, Place(axes_at + 1, len(axes), layout), wanted)
    bodies = [BodyTrack(name, _placements(cells, body, scale, order)) for name, body in columns.items()]
    facts = [f"Motive export, format {about.get('format version', 'unknown')}", unit.lower()]
    facts.append("quaternions" if order is None else f"Euler angles {order}")
    if about.get("coordinate space", "Global").lower() != "global":
        facts.append(f"coordinates {about['coordinate space']}")
    details = {key: about[key] for key in ("take name", "capture start time") if about.get(key)}
    return Export(cells.t_ns, bodies, "y", facts, details, cells.damage)


def _about(cells: Sequence[str]) -> dict[str, str]:
    """What the first line tells; a value may be empty."""
    return {key.lower(): value for key, value in zip(cells[0::2], cells[1::2], strict=False)}


def _axes_line(source: str, text: Text, layout: Layout) -> int:
    for k, line in enumerate(text.lines[:_HEADING_LINES]):
        cells = split_line(line, layout.delimiter)
        if len(cells) > 2 and cells[0].lower() == "frame" and cells[1].lower().startswith("time"):
            return k
    raise UsageError(f"{source}: has no line that begins with Frame and Time; export it with its header")


def _columns(
    types: Sequence[str], names: Sequence[str], kinds: Sequence[str], axes: Sequence[str]
) -> dict[str, _Columns]:
    """Columns of the bodies by name, as far as they are there."""
    found: dict[str, _Columns] = {}
    for k, (kind, name, what, axis) in enumerate(zip(types, names, kinds, axes, strict=False)):
        if kind.lower() != _BODY or axis.upper() not in ("X", "Y", "Z", "W"):
            continue
        body = found.setdefault(name, _Columns({}, {}))
        if what.lower() == "rotation":
            body.rotation[axis.upper()] = k
        elif what.lower() == "position":
            body.position[axis.upper()] = k
    return found


def _rotation_order(source: str, rotation: str) -> str | None:
    """Axes of Euler angles, each turned about as the one before left it; None for a quaternion."""
    if rotation.lower().startswith("quat"):
        return None
    order = rotation.upper().removeprefix("EULER").strip(" ()-")
    if sorted(order) == ["X", "Y", "Z"]:
        return order
    raise UsageError(f"{source}: Rotation Type is {rotation!r}, expected Quaternion or an order such as XYZ")


def _placements(cells: ExportCells, body: _Columns, scale: float, order: str | None) -> FloatArray:
    position = np.column_stack([cells.columns[body.position[axis]] for axis in "XYZ"]) * scale
    if order is None:
        turned = np.column_stack([cells.columns[body.rotation[axis]] for axis in "XYZW"])
    else:
        turned = euler_quaternions(
            np.column_stack([cells.columns[body.rotation[axis]] for axis in order]), order
        )
    return seen_only(np.column_stack([position, turned]))


def euler_quaternions(angles: FloatArray, order: str) -> FloatArray:
    """Quaternions (n, 4) x, y, z, w of angles (n, 3) [deg] about axes that turn along; NaN stays NaN."""
    quaternions = np.full((len(angles), 4), np.nan)
    there = np.isfinite(angles).all(axis=1)
    if there.any():
        quaternions[there] = Rotation.from_euler(order, angles[there], degrees=True).as_quat()
    return quaternions


def seen_only(placements: FloatArray) -> FloatArray:
    """Poses with rows of NaN where anything is missing or the quaternion is none: the body is lost."""
    kept = np.isfinite(placements).all(axis=1) & (np.abs(placements[:, 3:]).max(axis=1) > 1e-6)
    return np.where(kept[:, None], placements, np.nan)
