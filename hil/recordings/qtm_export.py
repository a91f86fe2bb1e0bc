"""Files of tab-separated 6DOF data that Qualisys Track Manager exports (``_6D.tsv``).

A heading of keys and values, among them FREQUENCY and BODY_NAMES, then a line of column names, in which each
body's first has the body's name before its X, then rows. Positions are in mm. Rotation matrices are told by
columns.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from formation.angles import FloatArray
from hil.errors import UsageError
from hil.recordings.body_tracks import BodyTrack, Export
from hil.recordings.delimited import Layout
from hil.recordings.export_cells import ExportCells, Place, read_export
from hil.recordings.motive_export import euler_quaternions, seen_only
from hil.recordings.text_file import Text

_FIRST = ("NO_OF_FRAMES", "FILE_VERSION")
_MM = 0.001
_MATRIX = tuple(f"Rot[{k}]" for k in range(9))
_ANGLES = ("Roll", "Pitch", "Yaw")
_TABS = Layout("\t", ".")
_HEADING_LINES = 60
_NO_ROTATION = 0.1
_KEY = re.compile(r"[A-Z][A-Z0-9_]{3,}")


class _Body(NamedTuple):
    """A body, and the places of its columns by their names."""

    name: str
    places: dict[str, int]


def is_qtm(text: Text) -> bool:
    """Whether a text is an export of QTM with its heading."""
    first = next((line for line in text.lines if line.strip()), "")
    return first.split("\t")[0].strip() in _FIRST


def read_qtm(path: Path, text: Text) -> Export:
    """Read the tracks of all bodies; one is lost where its matrix or all of its cells are zero.

    Raises :class:`UsageError` for an export of other data than 6DOF, or of bodies without an orientation, and
    as :func:`hil.recordings.export_cells.read_export`.
    """
    source = f"recording {path}: QTM export"
    about, names_at = _heading(source, text)
    kind = about.get("DATA_INCLUDED", ["6D"])[0]
    names = [name for name in about.get("BODY_NAMES", []) if name]
    if not kind.upper().startswith("6D") or not names:
        raise UsageError(
            f"{source}: holds {kind} data, expected 6D; export 6DOF data as TSV, with its header"
        )
    titles = [title.strip() for title in text.lines[names_at].split("\t")]
    bodies = _bodies(source, names, titles)
    timed = [title.lower() for title in titles].index("time") if "time" in map(str.lower, titles) else None
    wanted = [] if timed is None else [timed]
    wanted += [place for body in bodies for place in body.places.values()]
    period_s = 0.0 if timed is not None else 1.0 / _rate(source, about)
    cells = read_export(path, text, Place(names_at + 1, len(titles), _TABS), wanted, period_s)
    tracks = [BodyTrack(body.name, _placements(cells, body)) for body in bodies]
    how = "rotation matrices" if _MATRIX[0] in bodies[0].places else "Euler angles"
    details = {key.lower(): " ".join(about[key]) for key in ("TIME_STAMP",) if key in about}
    return Export(cells.t_ns, tracks, "z", ["QTM export", "millimeters", how], details, cells.damage)


def _heading(source: str, text: Text) -> tuple[dict[str, list[str]], int]:
    """Values of the heading's keys, and the number of the line of column names, counted from 0."""
    about: dict[str, list[str]] = {}
    for k, line in enumerate(text.lines[:_HEADING_LINES]):
        key, *values = (cell.strip() for cell in line.split("\t"))
        if _KEY.fullmatch(key):
            about[key] = values
        elif {"X", "Y", "Z"} & {key, *values} or key.endswith(" X"):
            return about, k
    kind = about.get("DATA_INCLUDED", ["other"])[0]
    raise UsageError(f"{source}: holds {kind} data without columns X, Y, Z; export 6DOF data with its header")


def _bodies(source: str, names: Sequence[str], titles: Sequence[str]) -> list[_Body]:
    """A body's columns begin where the title ends in X."""
    starts = [k for k, title in enumerate(titles) if title == "X" or title.endswith(" X")]
    if len(starts) != len(names):
        raise UsageError(
            f"{source}: has columns of {len(starts)} bodies, expected {len(names)} as in BODY_NAMES"
        )
    bodies: list[_Body] = []
    for name, start, end in zip(names, starts, [*starts[1:], len(titles)], strict=True):
        places = {"X": start} | {titles[k]: k for k in range(start + 1, end) if titles[k]}
        some = _MATRIX if set(_MATRIX) <= places.keys() else _ANGLES
        if not {"Y", "Z", *some} <= places.keys():
            raise UsageError(
                f"{source}: body {name!r} lacks columns; expected X, Y, Z, and Rot[0] to Rot[8] or Roll, "
                "Pitch, Yaw"
            )
        bodies.append(_Body(name, {title: places[title] for title in ("X", "Y", "Z", *some)}))
    return bodies


def _rate(source: str, about: dict[str, list[str]]) -> float:
    told = about.get("FREQUENCY", ["none"])[0]
    try:
        rate = float(told)
    except ValueError:
        rate = 0.0
    if rate <= 0.0:
        raise UsageError(f"{source}: FREQUENCY is {told!r}, expected a rate; export with the column Time")
    return rate


def _placements(cells: ExportCells, body: _Body) -> FloatArray:
    position = np.column_stack([cells.columns[body.places[axis]] for axis in "XYZ"]) * _MM
    if _MATRIX[0] in body.places:
        matrix = np.column_stack([cells.columns[body.places[title]] for title in _MATRIX])
        quaternions = _matrix_quaternions(matrix)
    else:
        angles = np.column_stack([cells.columns[body.places[title]] for title in _ANGLES])
        # QTM's own definition: about x, then the new y, then the new z.
        quaternions = euler_quaternions(angles, "XYZ")
        quaternions[~np.hstack([position, angles]).any(axis=1)] = np.nan
    return seen_only(np.column_stack([position, quaternions]))


def _matrix_quaternions(matrix: FloatArray) -> FloatArray:
    """Quaternions (n, 4) of matrices (n, 9) told by columns; NaN for what is no rotation, as all zeros."""
    quaternions = np.full((len(matrix), 4), np.nan)
    turned = np.nan_to_num(matrix, posinf=0.0, neginf=0.0).reshape(-1, 3, 3).transpose(0, 2, 1)
    there = np.abs(np.linalg.det(turned) - 1.0) < _NO_ROTATION
    if there.any():
        quaternions[there] = Rotation.from_matrix(turned[there]).as_quat()
    return quaternions
