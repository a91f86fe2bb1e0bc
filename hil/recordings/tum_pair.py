"""Pairs of trajectories in TUM's format: a file a body, rows of t x y z qx qy qz qw [s, m]."""

from __future__ import annotations

from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from formation.angles import FloatArray
from hil.errors import UsageError
from hil.recordings.body_tracks import BodyTrack, Export, at_times
from hil.recordings.delimited import find_layout, is_comment
from hil.recordings.export_cells import Place, read_export
from hil.recordings.imported import period_ns
from hil.recordings.motive_export import seen_only
from hil.recordings.pair_log import Times
from hil.recordings.text_file import Text, read_text

_WIDTH = 8
_PERIODS = 5


class _Trajectory(NamedTuple):
    t_ns: Times
    placements: FloatArray
    damage: tuple[str, ...]


def is_tum(text: Text) -> bool:
    """Whether a text looks like a trajectory: rows of eight numbers, without names, of a unit quaternion."""
    some = islice((line for line in text.lines if line.strip() and not is_comment(line)), 20)
    rows: list[list[float]] = []
    for line in some:
        try:
            rows.append([float(cell) for cell in line.replace(",", " ").split()])
        except ValueError:
            return False
    return bool(rows) and all(
        len(row) == _WIDTH and abs(np.linalg.norm(row[4:]) - 1.0) < 0.01 for row in rows
    )


def read_tum_pair(leader: Path, follower: Path) -> Export:
    """Read two trajectories as tracks at the times of the follower's rows, the leader's between its own.

    Where the leader's neighbouring rows are more than five periods apart it is lost. Raises
    :class:`UsageError` for a file that is no such trajectory, and for two without a time in common.
    """
    led, follows = _read(leader), _read(follower)
    if led.t_ns[0] > follows.t_ns[-1] or follows.t_ns[0] > led.t_ns[-1]:
        raise UsageError(
            f"recordings {leader} and {follower}: have no time in common ({_span(led.t_ns)} and "
            f"{_span(follows.t_ns)}); use trajectories of one recording, by one clock"
        )
    most_ns = int(_PERIODS * period_ns(led.t_ns))
    met = at_times(led.t_ns, led.placements, follows.t_ns, most_ns)
    facts = ["TUM trajectories", "meters", "quaternions"]
    between = int(np.count_nonzero(~np.isin(follows.t_ns, led.t_ns)))
    if between:
        facts.append(f"the leader between its own rows in {between} of {len(follows.t_ns)}")
    tracks = [BodyTrack(str(leader), met), BodyTrack(str(follower), follows.placements)]
    return Export(follows.t_ns, tracks, "z", facts, {}, (*led.damage, *follows.damage))


def _read(path: Path) -> _Trajectory:
    text = read_text(path)
    if not is_tum(text):
        raise UsageError(f"recording {path}: is no TUM trajectory; expected rows of t x y z qx qy qz qw")
    lines = ["" if is_comment(line) else line for line in text.lines]
    layout = find_layout([line for line in lines if line][:40])
    cells = read_export(path, text._replace(lines=lines), Place(0, _WIDTH, layout), range(_WIDTH))
    if len(cells.t_ns) < 2:
        raise UsageError(f"recording {path}: has a single row; expected a trajectory")
    placements = seen_only(np.column_stack([cells.columns[k] for k in range(1, _WIDTH)]))
    return _Trajectory(cells.t_ns, placements, tuple(f"{path.name}: {fault}" for fault in cells.damage))


def _span(t_ns: Times) -> str:
    return f"{t_ns[0] * 1e-9:.3f} to {t_ns[-1] * 1e-9:.3f} s"
