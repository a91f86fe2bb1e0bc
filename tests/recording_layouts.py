"""Writes a pair's tracks in the layouts that recordings come in, for tests of what reads them."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta, timezone
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

ROWS = 24
NAN = float("nan")


@dataclass(frozen=True, eq=False)
class Tracks:
    """Times [ns], and poses (n, 7) of leader and follower [m, quaternion], z up; rows of NaN are lost."""

    t_ns: list[int]
    leader: Array
    follower: Array
    motion: Array


def tracks(seed: int, *, planar: bool, gaps: bool, start_ns: int = 0) -> Tracks:
    """Two robots that turn by more than a right angle; their bodies tilt a little unless ``planar``."""
    draw = np.random.default_rng(seed)
    t = np.arange(ROWS) / 120.0
    t_ns = [start_ns + round(k * 1e9 / 120.0) for k in range(ROWS)]
    poses = []
    for radius in (0.5, 0.8):
        heading = draw.uniform(-3.0, 3.0) + 9.0 * t
        place = draw.uniform(-2.0, 2.0, 2)
        tilt = np.zeros((ROWS, 2)) if planar else draw.normal(0.0, 0.02, (ROWS, 2))
        turned = Rotation.from_euler("ZYX", np.column_stack([heading, tilt])).as_quat()
        height = np.zeros(ROWS) if planar else 0.1 + draw.normal(0.0, 0.001, ROWS)
        x, y = place[0] + radius * np.sin(heading), place[1] - radius * np.cos(heading)
        poses.append(np.column_stack([x, y, height, turned]))
    if gaps:
        poses[0][5:8] = poses[1][11] = NAN
    motion = np.column_stack([draw.uniform(0.0, 0.2, ROWS), draw.uniform(-1.0, 1.0, ROWS)])
    return Tracks(t_ns, poses[0], poses[1], motion)


@dataclass(frozen=True)
class Table:
    """How a table of columns is laid out."""

    delimiter: str = ","
    decimal: str = "."
    newline: str = "\n"
    encoding: str = "utf-8"
    names: str = "leader_x"
    length: str = "m"
    angle: str = "rad"
    told: str = "suffix"
    time: str = "s"
    turned: str = "theta"
    odometry: int = 1
    empty: str = ""
    extra: bool = False
    quotes: bool = False
    comments: bool = False
    end: bool = True
    pad: bool = False
    shuffled: int = 0
    mapped: bool = False
    up: str = "z"
    gaps: bool = True


_STYLES = {
    "leader_x": ("leader_{}", "follower_{}"),
    "lx": ("l{}", "f{}"),
    "x1": ("{}1", "{}2"),
    "Leader X": ("Leader {}", "Follower {}"),
    "leader.position.x": ("leader.pose.position.{}", "follower.pose.position.{}"),
    "leaderX": ("leader{}", "follower{}"),
    "x_leader": ("x_leader", "x_follower"),
}
STYLES = tuple(_STYLES)
_SCALE = {"m": Decimal(1), "mm": Decimal(1000), "cm": Decimal(100)}


def table_text(layout: Table, pair: Tracks) -> bytes:
    """The pair as a table of this layout."""
    columns = list(_columns(layout, pair))
    if layout.shuffled:
        random.Random(layout.shuffled).shuffle(columns)
    lines: list[list[str]] = [[_titled(layout, name, unit) for name, unit, _ in columns]]
    if layout.told == "row":
        lines.append([unit for _, unit, _ in columns])
    lines += [list(row) for row in zip(*(cells for _, _, cells in columns), strict=True)]
    text = [layout.delimiter.join(_celled(layout, cell) for cell in line) for line in lines]
    if layout.comments:
        text[:0] = ["# recorded by hand, on a rainy day", ""]
        text.insert(len(text) - 3, "# the battery was changed here")
    return (layout.newline.join(text) + layout.newline * layout.end).encode(layout.encoding)


def table_map(layout: Table, pair: Tracks) -> str:
    """A column map for the table of :func:`table_text`."""
    lines = [f'up = "{layout.up}"', "[columns]"]
    for name, unit, _ in _columns(layout, pair):
        if name == "note":
            continue
        told = f', unit = "{unit}"' if unit else ""
        title = _titled(layout, name, unit).strip()
        lines.append(f'{name} = {{ column = "{title}"{told} }}')
    return "\n".join(lines)


def _columns(layout: Table, pair: Tracks) -> Iterator[tuple[str, str, list[str]]]:
    """Quantity, unit and cells of each column."""
    time_unit = layout.time if layout.time in ("s", "ms", "ns") else ""
    yield "t", time_unit, [_time(layout, t_ns) for t_ns in pair.t_ns]
    for role, poses in (("leader", pair.leader), ("follower", pair.follower)):
        x, y, z = poses[:, 0], poses[:, 1], poses[:, 2]
        turned = poses[:, 3:]
        axes = {"x": x, "y": y, "z": z}
        if layout.up == "y":
            axes = {"x": x, "y": z, "z": -y}
            turned = np.column_stack([turned[:, 0], turned[:, 2], -turned[:, 1], turned[:, 3]])
        if layout.turned == "theta":
            axes.pop("z")
        for axis, values in axes.items():
            yield f"{role}_{axis}", layout.length, _cells(layout, values, _SCALE[layout.length])
        if layout.turned == "theta":
            theta = 2.0 * np.arctan2(turned[:, 2], turned[:, 3])
            theta = np.degrees(theta) if layout.angle == "deg" else theta
            yield f"{role}_theta", layout.angle, _cells(layout, theta)
        else:
            for k, axis in enumerate("xyzw"):
                yield f"{role}_q{axis}", "", _cells(layout, turned[:, k])
    if layout.odometry:
        kept = np.where(np.arange(ROWS)[:, None] % layout.odometry == 0, pair.motion, NAN)
        turn = np.degrees(kept[:, 1]) if layout.angle == "deg" else kept[:, 1]
        yield (
            "v2",
            f"{layout.length}/s" if layout.length != "cm" else "cm/s",
            _cells(layout, kept[:, 0], _SCALE[layout.length]),
        )
        yield "u2", f"{layout.angle}/s", _cells(layout, turn)
    if layout.extra:
        yield "note", "", ["calm"] * ROWS


def _titled(layout: Table, name: str, unit: str) -> str:
    role, _, rest = name.partition("_")
    title = name
    if rest:
        form = _STYLES[layout.names][role == "follower"]
        title = form.format(rest.upper() if "X" in layout.names else rest)
        if layout.names == "x_leader":
            title = f"{rest}_{role}"
    if unit in ("", "m", "rad", "s", "m/s", "rad/s") or layout.told == "row":
        return title
    if layout.told == "brackets":
        return f"{title} [{unit}]"
    return f"{title}_{unit.replace('/', '_')}"


def _cells(layout: Table, values: Array, scale: Decimal = Decimal(1)) -> list[str]:
    return [
        layout.empty if math.isnan(value) else _decimal(layout, Decimal(f"{value:.12f}") * scale)
        for value in values.tolist()
    ]


def _decimal(layout: Table, value: Decimal) -> str:
    return f"{value:f}".replace(".", layout.decimal)


def _time(layout: Table, t_ns: int) -> str:
    if layout.time in ("s", "ms", "ns"):
        digits = {"s": 9, "ms": 6, "ns": 0}[layout.time]
        return _decimal(layout, Decimal(t_ns).scaleb(-digits))
    zone = timezone(timedelta(hours=2)) if "+" in layout.time else UTC
    moment = datetime.fromtimestamp(t_ns // 10**9, zone)
    mark = " " if " " in layout.time else "T"
    end = {"Z": "Z", "+": "+02:00"}.get(layout.time[-1], "")
    return f"{moment:%Y-%m-%d}{mark}{moment:%H:%M:%S}{layout.decimal}{t_ns % 10**9:09d}{end}"


def _celled(layout: Table, cell: str) -> str:
    if layout.quotes:
        return f'"{cell}"'
    return f" {cell} " if layout.pad else cell


@dataclass(frozen=True)
class Motive:
    """How an export of Motive is laid out."""

    version: str = "1.23"
    unit: str = "Meters"
    rotation: str = "Quaternion"
    up: str = "y"
    error: bool = False
    markers: bool = False
    timecode: bool = False
    strangers: int = 0
    shuffled: int = 0
    first: int = 0
    newline: str = "\n"
    gaps: bool = True
    names: tuple[str, str] = ("leader", "follower")
    encoding: str = "utf-8"
    fields: dict[str, str] = field(default_factory=dict)


def motive_text(layout: Motive, pair: Tracks) -> bytes:
    """The pair as an export of this layout."""
    lines = _motive_heading(layout)
    labels = layout.version != "1.21"
    blocks: list[tuple[str, str, list[str], list[str], list[list[str]]]] = []
    bodies = [*zip(layout.names, (pair.leader, pair.follower), strict=True)]
    bodies[1:1] = [(f"Box {k}", pair.leader) for k in range(layout.strangers)]
    for name, poses in bodies:
        blocks.append(("Rigid Body", name, *_motive_body(layout, poses)))
        if layout.markers:
            place = [[f"{value:.6f}" for value in row] for row in np.nan_to_num(poses[:, :3]).tolist()]
            blocks.append(("Rigid Body Marker", f"{name}:Marker 001", ["Position"] * 3, [*"XYZ"], place))
    for k, label in enumerate(("Type", "Name", "ID", "Parent")):
        if label == "Parent" and layout.version != "1.25":
            continue
        cells = [
            {"Type": kind, "Name": name, "ID": f'"{hash(name) & 0xFFFF:X}"', "Parent": ""}[label]
            for kind, name, kinds, _, _ in blocks
            for _ in kinds
        ]
        lines.append(["", label if labels else "", *[""] * layout.timecode, *cells])
        assert k < 4
    lines.append(["", "", *[""] * layout.timecode, *(kind for block in blocks for kind in block[2])])
    time = "Time (Seconds)" if labels else "Time"
    timecode = ["TimeCode"] if layout.timecode else []
    lines.append(["Frame", time, *timecode, *(axis for block in blocks for axis in block[3])])
    for row, t_ns in enumerate(pair.t_ns):
        code = [f"15:26:46:{row}.02"] if layout.timecode else []
        cells = [cell for block in blocks for cell in block[4][row]]
        lines.append([str(layout.first + row), f"{Decimal(t_ns).scaleb(-9):f}", *code, *cells])
    return (layout.newline.join(",".join(line) for line in lines) + layout.newline).encode(layout.encoding)


def _motive_heading(layout: Motive) -> list[list[str]]:
    fields = {
        "Take Name": "Take 2026-01-05 03.49.50 PM", "Take Notes": "", "Capture Frame Rate": "120.000000",
        "Export Frame Rate": "120.000000", "Capture Start Time": "2026-01-05 03.49.50.755 PM",
        "Total Exported Frames": str(ROWS), "Rotation Type": layout.rotation, "Length Units": layout.unit,
        "Coordinate Space": "Global",
    } | layout.fields  # fmt: skip
    pairs = list(fields.items())
    if layout.shuffled:
        random.Random(layout.shuffled).shuffle(pairs)
    return [["Format Version", layout.version, *(cell for pair in pairs for cell in pair)], []]


def _motive_body(layout: Motive, poses: Array) -> tuple[list[str], list[str], list[list[str]]]:
    scale = {"Meters": 1.0, "Centimeters": 100.0, "Millimeters": 1000.0}[layout.unit]
    x, y, z, qx, qy, qz, qw = poses.T
    if layout.up == "y":
        y, z, qy, qz = z, -y, qz, -qy
    quaternions = np.column_stack([qx, qy, qz, qw])
    turned = quaternions
    axes = [*"XYZW"]
    if layout.rotation != "Quaternion":
        axes = [*"XYZ"]
        turned = np.full((ROWS, 3), NAN)
        seen = np.isfinite(quaternions).all(axis=1)
        order: Any = layout.rotation
        angles = Rotation.from_quat(quaternions[seen]).as_euler(order, degrees=True)
        turned[seen] = angles[:, [layout.rotation.index(axis) for axis in "XYZ"]]
    values = np.column_stack([turned, np.column_stack([x, y, z]) * scale])
    kinds = ["Rotation"] * len(axes) + ["Position"] * 3
    axes += [*"XYZ"]
    rows = [["" if math.isnan(value) else f"{value:.9f}" for value in row] for row in values.tolist()]
    if layout.error:
        kinds, axes = [*kinds, "Mean Marker Error"], [*axes, ""]
        rows = [[*row, "" if row[0] == "" else "0.000113"] for row in rows]
    return kinds, axes, rows


@dataclass(frozen=True)
class Qtm:
    """How an export of QTM is laid out."""

    version: bool = False
    turned: str = "both"
    timed: bool = True
    tab: bool = True
    lost: str = "zero"
    strangers: int = 0
    decimal: str = "."
    newline: str = "\r\n"
    names: tuple[str, str] = ("leader", "follower")
    events: int = 0
    gaps: bool = True


def qtm_text(layout: Qtm, pair: Tracks) -> bytes:
    """The pair as an export of this layout."""
    bodies = [*zip(layout.names, (pair.leader, pair.follower), strict=True)]
    bodies[1:1] = [(f"Box {k}", pair.leader) for k in range(layout.strangers)]
    heading = ["FILE_VERSION\t2.0.0"] if layout.version else []
    heading += [f"NO_OF_FRAMES\t{ROWS}", "NO_OF_CAMERAS\t4", f"NO_OF_BODIES\t{len(bodies)}", "FREQUENCY\t120"]
    heading += [
        "DESCRIPTION\t--",
        "TIME_STAMP\t2026-01-22, 17:47:17.123\t22107.99179716",
        "DATA_INCLUDED\t6D",
    ]
    heading += [f"EVENT\tstart {k}\t{k}\t{k / 120.0:.5f}" for k in range(layout.events)]
    heading.append("\t".join(["BODY_NAMES", *(name for name, _ in bodies)]))
    titles = ["Frame", "Time"] if layout.timed else []
    rest = ["Y", "Z"]
    rest += [] if layout.turned == "matrix" else ["Roll", "Pitch", "Yaw"]
    rest += ["Residual"]
    rest += [] if layout.turned == "angles" else [f"Rot[{k}]" for k in range(9)]
    for name, _ in bodies:
        titles += [f"{name} X", *rest]
    lines = [titles]
    columns = [_qtm_rows(layout, poses) for _, poses in bodies]
    for row, t_ns in enumerate(pair.t_ns):
        time = f"{Decimal(t_ns).scaleb(-9):f}".replace(".", layout.decimal)
        start = [str(row + 1), time] if layout.timed else []
        lines.append([*start, *(cell for rows in columns for cell in rows[row])])
    text = heading + ["\t".join(line) + "\t" * layout.tab for line in lines]
    return (layout.newline.join(text) + layout.newline).encode()


def _qtm_rows(layout: Qtm, poses: Array) -> list[list[str]]:
    rows: list[list[str]] = []
    for pose in poses.tolist():
        if math.isnan(pose[0]):
            width = 3 + 1 + 3 * (layout.turned != "matrix") + 9 * (layout.turned != "angles")
            rows.append([{"zero": "0.00000", "empty": "", "null": "NULL"}[layout.lost]] * width)
            continue
        turned = Rotation.from_quat(pose[3:])
        values = [1000.0 * value for value in pose[:3]]
        if layout.turned != "matrix":
            values += turned.as_euler("XYZ", degrees=True).tolist()
        values.append(0.4)
        if layout.turned != "angles":
            values += turned.as_matrix().T.ravel().tolist()
        rows.append([f"{value:.9f}".replace(".", layout.decimal) for value in values])
    return rows


def tum_text(t_ns: Sequence[int], poses: Array, *, comments: bool, delimiter: str = " ") -> bytes:
    """A body's poses in TUM's format, without rows where it is lost."""
    lines = ["# timestamp tx ty tz qx qy qz qw"] if comments else []
    for at_ns, pose in zip(t_ns, poses.tolist(), strict=True):
        if not math.isnan(pose[0]):
            cells = [f"{Decimal(at_ns).scaleb(-9):f}", *(f"{value:.9f}" for value in pose)]
            lines.append(delimiter.join(cells))
    return ("\n".join(lines) + "\n").encode()
