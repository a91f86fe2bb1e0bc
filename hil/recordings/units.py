"""Units that recordings come in, and what makes SI units of them."""

from __future__ import annotations

import math
import re

_DEGREE = math.pi / 180.0
_LENGTH = {"m": 1.0, "mm": 0.001, "cm": 0.01, "km": 1000.0, "in": 0.0254, "ft": 0.3048}
_ANGLE = {"rad": 1.0, "deg": _DEGREE}
_TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
_SPEED = {"m/s": 1.0, "mm/s": 0.001, "cm/s": 0.01, "km/h": 1.0 / 3.6}
_TURN = {"rad/s": 1.0, "deg/s": _DEGREE, "rpm": math.pi / 30.0}
_NUMBER = {"1": 1.0}

_SAME = {
    "meter": "m", "meters": "m", "metre": "m", "metres": "m",
    "millimeter": "mm", "millimeters": "mm", "millimetre": "mm", "millimetres": "mm",
    "centimeter": "cm", "centimeters": "cm", "centimetre": "cm", "centimetres": "cm",
    "inch": "in", "inches": "in", "feet": "ft",
    "radian": "rad", "radians": "rad", "degree": "deg", "degrees": "deg", "degs": "deg",
    "sec": "s", "secs": "s", "second": "s", "seconds": "s",
    "msec": "ms", "millis": "ms", "milliseconds": "ms",
    "usec": "us", "microseconds": "us", "\N{MICRO SIGN}s": "us", "\N{GREEK SMALL LETTER MU}s": "us",
    "nsec": "ns", "nanoseconds": "ns",
    "\N{DEGREE SIGN}": "deg", "\N{DEGREE SIGN}/s": "deg/s", "degrees/s": "deg/s", "radians/s": "rad/s",
    "meters/s": "m/s", "m/sec": "m/s",
    "mps": "m/s", "rps": "rad/s", "dps": "deg/s", "": "1", "-": "1",
}  # fmt: skip


def factor_of(quantity: str, unit: str) -> float | None:
    """What makes SI units of a quantity of a column map in this unit; None if it is no unit of such a one."""
    return _units(quantity).get(spelled(unit))


def units_of(quantity: str) -> list[str]:
    """Units that a quantity may come in."""
    return list(_units(quantity))


def spelled(text: str) -> str:
    """A unit as this module spells it, without brackets around it; any other text in lower case."""
    bare = re.sub(r"^[\[(]\s*|\s*[\])]$", "", text.strip()).strip()
    low = bare.lower().replace(" per ", "/").replace("*", "").replace("s^-1", "/s").replace("s-1", "/s")
    low = low.replace(" ", "")
    return _SAME.get(low, low)


def is_unit(text: str) -> bool:
    """Whether a text is a unit of something."""
    return any(spelled(text) in units for units in (_LENGTH, _ANGLE, _TIME, _SPEED, _TURN, _NUMBER))


def _units(quantity: str) -> dict[str, float]:
    bare = quantity.removeprefix("leader_").removeprefix("follower_")
    if bare == "t":
        return _TIME
    if bare in ("x", "y", "z", "rho"):
        return _LENGTH
    if bare in ("theta", "alpha2"):
        return _ANGLE
    if bare in ("v1", "v2"):
        return _SPEED
    return _TURN if bare in ("u1", "u2") else _NUMBER
