"""A scenario of a lab of one's own to begin with: the keys that labs differ by, each with its meaning."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import msgspec
import tomli_w

from hil.scenario.schema import Scenario


class _Line(NamedTuple):
    """A key with its meaning; ``instead``: what stands for one that the scenario has not."""

    key: str
    meaning: str
    instead: Any = None


_SECTIONS: dict[str, tuple[_Line, ...]] = {
    "run": (
        _Line("duration_s", "how long the leader drives [s]"),
        _Line("evaluate_from_s", "judged from here on [s]"),
    ),
    "formation": (
        _Line("rho_0", "the distance to keep [m]"),
        _Line("side", 'of the leader, on which the follower drives: "right" or "left"'),
    ),
    "controller": (
        _Line("law", "independent, ideal, feedforward, faded, or file.py:function"),
        _Line("mu1", "gain [rad/s]; abreast gains FILE proposes all three"),
        _Line("mu2", "gain [rad/s]"),
        _Line("mu_rho", "gain [1/m]"),
        _Line("v_max", "limit of what is sent [m/s]"),
        _Line("u_max", "the same [rad/s]"),
        _Line("lag_s", "lag of the actuators [s]; abreast calibrate LOG finds it"),
        _Line("transport_s", "way of a command to the robot [s]; found likewise"),
        _Line("command_type", 'what its driver takes: "TwistStamped" or "Twist"'),
    ),
    "leader": (
        _Line("name", "of the robot; its topics lie below it"),
        _Line("body", "what the motion capture calls it; else its name", "Rigid Body 1"),
        _Line("namespace", 'of its topics, "" for none; else its name', "tb3_0"),
        _Line("k_v", "the fastest that it drives [m/s]; bounds rest on it"),
        _Line("k_u", "the hardest that it turns [rad/s]"),
        _Line("program", "what it drives, where it drives by itself"),
    ),
    "follower": (
        _Line("name", "of the robot"),
        _Line("body", "as of the leader", "Rigid Body 2"),
        _Line("namespace", "as of the leader", "tb3_1"),
    ),
    "mocap": (
        _Line("rate_hz", "frames a second"),
        _Line("sigma_position", "noise of positions [m], of the emulated one"),
        _Line("sigma_heading", "noise of headings [rad]"),
        _Line("latency_s", "how old a frame is when it comes [s]"),
        _Line("loss", "share of frames that are lost"),
    ),
    "estimator": (
        _Line("kind", "ekf, ukf, imm, mhe, ..., or file.py:factory"),
        _Line(
            "own_motion", 'where the follower\'s own motion comes from: "auto", "odometry", "mocap", "fused"'
        ),
        _Line("sigma_position", "noise of positions that is told [m]; abreast calibrate LOG finds it"),
        _Line("sigma_heading", "noise of headings [rad]"),
    ),
    "source": (
        _Line(
            "topic", "where the motion capture comes in, {body} for a body's name", "vrpn_mocap/{body}/pose"
        ),
        _Line("type", "type of its messages, PoseStamped say"),
        _Line("up", 'its up axis: "z" or "y"'),
    ),
    "wire": (
        _Line("layout", 'of keys: "ros2dds" (zenoh-bridge-ros2dds) or "rmw_zenoh"'),
        _Line("domain", "ROS domain"),
    ),
    "guard": (
        _Line("fence", "where a robot may be: [x_min, y_min, x_max, y_max] [m]", [-2.0, -1.5, 2.0, 1.5]),
        _Line("separation", "the least distance between robots [m]", 0.3),
    ),
}

_HEAD = """\
# A lab of one's own. What is not said here is as in {base}: abreast scenario show {base}
# A line behind # says what holds without it, or what could be said: take the # away to set it.
# All keys, with their meanings: docs/scenario.md. SI units, radians.
base = {quoted}
description = "my lab"
"""


def begun_from(scenario: Scenario, base: str) -> str:
    """TOML of a scenario that differs in nothing from another one so far; ``base``: its name or a path."""
    values = msgspec.to_builtins(scenario)
    lines = [_HEAD.format(base=base, quoted=_toml(base))]
    for section, entries in _SECTIONS.items():
        lines.append(f"[{section}]")
        lines += [_line(values.get(section, {}), entry) for entry in entries]
        lines.append("")
    return "\n".join(lines)


def _line(values: Mapping[str, Any], entry: _Line) -> str:
    value = values.get(entry.key)
    given = entry.instead if value in (None, "") else value
    return f"# {entry.key} = {_toml(given)}  # {entry.meaning}"


def _toml(value: Any) -> str:
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{key} = {_toml(item)}' for key, item in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    return tomli_w.dumps({"value": value}).partition("=")[2].strip()
