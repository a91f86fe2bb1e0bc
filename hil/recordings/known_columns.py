"""Columns of a recording that are known by their names, so that no map need say what they are."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from hil.errors import UsageError
from hil.recordings.column_map import Source
from hil.recordings.pair_log import TRUTH
from hil.recordings.units import factor_of, is_unit, spelled

_BRACKETED = re.compile(r"\s*[\[(]\s*([^\])]*?)\s*[\])]\s*$")
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|\N{DEGREE SIGN}")
_LEADER = frozenset({"leader", "lead", "l", "1", "target"})
_FOLLOWER = frozenset({"follower", "follow", "f", "2", "self", "own", "ego"})
_FILLING = frozenset(
    {"pose", "position", "pos", "orientation", "rotation", "rot", "robot", "mocap", "world", "translation",
     "quat", "quaternion", "twist", "linear", "angular", "odom", "meas", "measured", "tb", "raw", "lidar"}
)  # fmt: skip
_TIME = frozenset({"t", "time", "timestamp", "stamp", "seconds", "secs", "sec"})
_QUANTITIES = {
    "x": "x", "y": "y", "z": "z", "tx": "x", "ty": "y", "tz": "z",
    "qx": "qx", "qy": "qy", "qz": "qz", "qw": "qw",
    "theta": "theta", "th": "theta", "yaw": "theta", "heading": "theta", "psi": "theta",
    "v": "v", "speed": "v", "velocity": "v", "vel": "v",
    "u": "u", "w": "u", "omega": "u", "gyro": "u",
    "rho": "rho", "range": "rho", "distance": "rho", "dist": "rho", "alpha": "alpha", "bearing": "alpha",
}  # fmt: skip
_PAIRED = {("leader", "v"): "v1", ("leader", "u"): "u1", ("follower", "v"): "v2", ("follower", "u"): "u2"}
_NOT_MEASURED = ("v1", "u1")


class KnownColumns(NamedTuple):
    """Sources by quantity as a column map has them: what is measured, and what is known besides."""

    columns: dict[str, Source]
    truth: dict[str, Source]


def known_columns(names: Sequence[str], units: Mapping[str, str]) -> KnownColumns:
    """Tell what the columns of these names hold; ``units``: of some of them, as a line below the names tells.

    Poses are measured where there are both, else range and bearing. Raises :class:`UsageError` for two
    columns that could be the same, and for names that don't make up a measurement.
    """
    found: dict[str, Source] = {}
    twice: dict[str, str] = {}
    for name in names:
        quantity, unit = _meaning(name, units.get(name))
        if quantity is None:
            continue
        if quantity in found:
            twice.setdefault(quantity, name)
        else:
            found[quantity] = Source(column=name, unit=unit)
    truth = {name: found.pop(name) for name in _NOT_MEASURED if name in found and name not in twice}
    for role in ("leader", "follower"):
        turned = [f"{role}_q{axis}" for axis in "xyzw"]
        if not all(name in found for name in turned):
            found = {name: source for name, source in found.items() if name not in turned}
    poses = {name: source for name, source in found.items() if name.startswith(("leader_", "follower_"))}
    heading = {"follower_theta"} if "follower_theta" in poses else {f"follower_q{axis}" for axis in "xyzw"}
    if {"t", "leader_x", "leader_y", "follower_x", "follower_y"} | heading <= found.keys():
        columns = {name: found[name] for name in found if name not in ("rho", "alpha2")}
    elif {"t", "rho", "alpha2", "v2", "u2"} <= found.keys():
        columns = {name: found[name] for name in found if name not in poses}
        truth |= {name: source for name, source in poses.items() if name in TRUTH and name not in twice}
    else:
        raise UsageError(
            "its columns are not known by their names; give --map FILE, or call them t, leader_x, leader_y, "
            f"follower_x, follower_y, follower_theta (there are: {', '.join(names)})"
        )
    if len(columns.keys() & {"v2", "u2"}) == 1:
        columns = {name: source for name, source in columns.items() if name not in ("v2", "u2")}
    for name in columns:
        if name in twice:
            raise UsageError(
                f"columns {found[name].column!r} and {twice[name]!r} could both be {name}; say which by "
                "--map FILE"
            )
    return KnownColumns(columns, truth)


def bracketed(name: str) -> tuple[str, str | None]:
    """A column's name without a unit in brackets at its end, and that unit."""
    match = _BRACKETED.search(name)
    if match is None or not is_unit(match[1]):
        return name, None
    return name[: match.start()], match[1]


def _meaning(name: str, unit: str | None) -> tuple[str | None, str | None]:
    bare, told = bracketed(name)
    unit = unit or told
    words = [word.lower() for word in _WORD.findall(bare)]
    split = [part for word in words for part in _parts(word)]
    if unit is None:
        split, unit = _with_unit(split)
    roles = {
        role
        for role, known in (("leader", _LEADER), ("follower", _FOLLOWER))
        for word in split
        if word in known
    }
    rest = [word for word in split if word not in _LEADER | _FOLLOWER | _FILLING]
    if not roles and rest and all(word in _TIME for word in rest):
        return "t", unit if unit is not None and factor_of("t", unit) else None
    if rest == ["turn", "rate"] or rest == ["yaw", "rate"]:
        rest = ["u"]
    if len(rest) == 2 and rest[0] == "q" and rest[1] in "xyzw":
        rest = ["q" + rest[1]]
    if len(rest) != 1 or len(roles) > 1 or rest[0] not in _QUANTITIES:
        return None, None
    quantity = _named(_QUANTITIES[rest[0]], next(iter(roles), None))
    if quantity is None or (unit is not None and factor_of(quantity, unit) is None):
        return None, None
    return quantity, unit


def _parts(word: str) -> list[str]:
    """A word, or the letter of a robot and what it is of: lx, fth."""
    if len(word) > 1 and word[0] in "lf" and word[1:] in _QUANTITIES and word not in _QUANTITIES:
        return [word[0], word[1:]]
    return [word]


def _with_unit(words: list[str]) -> tuple[list[str], str | None]:
    """Words without a unit at their end, as in x_mm or v_m_s."""
    if len(words) > 2 and words[-1] == "s" and is_unit(f"{words[-2]}/s"):
        return words[:-2], f"{words[-2]}/s"
    if len(words) > 1 and words[-1] not in _TIME | {"in", "1"} and is_unit(words[-1]):
        return words[:-1], spelled(words[-1])
    return words, None


def _named(quantity: str, role: str | None) -> str | None:
    if quantity == "rho":
        return "rho" if role is None else None
    if quantity == "alpha":
        return "alpha2" if role != "leader" else None
    if quantity in ("v", "u"):
        return _PAIRED[role or "follower", quantity]
    return f"{role}_{quantity}" if role is not None else None
