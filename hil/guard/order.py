"""All that a guard is told before it begins: its robot, its rules, and where on the wire it hears and speaks.

It is made of a scenario once, and may be carried to a robot as a file, where no scenario can be read.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hil.errors import UsageError
from hil.guard.robot_guard import GuardRules

VERSION = 1
SESSION = "{session}"
"""Stands in the tokens of an order for the session that shows them."""


@dataclass(frozen=True, slots=True)
class GuardOrder:
    """What a guard is to do.

    ``wanted``, ``stop``, ``arm``, ``frames``, ``overheard``: keys that it hears; ``cmd_vel``,
    ``diagnostics``: keys that it speaks on. ``drive``: a command to the driver as bytes, in hexadecimal
    digits, with its motion at ``twist_at``; ``stamped`` whether it has a stamp. ``attached``: whether
    messages carry what rmw_zenoh asks for. ``ros_topic``: the name of the driver's topic in ROS,
    ``ros_domain`` its domain, 0 for that of the environment. ``tokens``: what shows the guard in ROS.
    """

    robot: str
    rules: GuardRules
    wanted: str
    stop: str
    arm: str
    frames: str
    overheard: str
    cmd_vel: str
    diagnostics: str
    drive: str
    twist_at: int
    stamped: bool
    attached: bool
    ros_topic: str
    ros_domain: int
    tokens: tuple[str, ...] = ()

    def tokens_of(self, session: str) -> tuple[str, ...]:
        """The tokens of a session."""
        return tuple(token.replace(SESSION, session) for token in self.tokens)

    def as_text(self) -> str:
        """The order as a file has it."""
        held: dict[str, Any] = {"abreast_guard": VERSION, **asdict(self)}
        held["rules"] = {name: _finite(value) for name, value in self.rules._asdict().items()}
        return json.dumps(held, indent=2) + "\n"


def read_order(path: Path) -> GuardOrder:
    """The order in a file that ``abreast guard --write`` made; :class:`UsageError` if it holds none."""
    try:
        held = json.loads(path.read_text(encoding="utf-8"))
        if held.pop("abreast_guard") != VERSION:
            raise ValueError("it is of another version")
        rules = {name: _infinite(name, value) for name, value in held.pop("rules").items()}
        order = GuardOrder(rules=GuardRules(**rules), **{**held, "tokens": tuple(held["tokens"])})
        bytes.fromhex(order.drive)
        _check(order.rules)
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror or error}; give a file of abreast guard --write") from None
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        told = " ".join(str(error).split())
        raise UsageError(f"{path}: no order for a guard ({told}); make it by abreast guard --write") from None
    return order


def _check(rules: GuardRules) -> None:
    limits = rules.age_s, rules.latch_s, rules.v_max, rules.u_max
    if not all(math.isfinite(each) and each > 0.0 for each in limits):
        raise ValueError(f"age_s, latch_s, v_max, u_max are {limits}, expected positive numbers")
    more = (rules.v_rate, rules.u_rate, rules.separation)
    if not all(each >= 0.0 for each in more):
        raise ValueError(f"v_rate, u_rate, separation are {more}, expected numbers that are not negative")


def _finite(value: Any) -> Any:
    """A value as JSON has it, which knows no infinity."""
    if isinstance(value, tuple):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and math.isinf(value) else value


def _infinite(name: str, value: Any) -> Any:
    if name == "fence":
        ends = (-math.inf, -math.inf, math.inf, math.inf)
        return tuple(end if edge is None else float(edge) for edge, end in zip(value, ends, strict=True))
    return math.inf if value is None else value
