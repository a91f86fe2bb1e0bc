"""What a session is on the wire: roles, by which a router with keys knows who may do what."""

from __future__ import annotations

from typing import Literal, get_args

Role = Literal[
    "router", "estimator", "controller", "follower", "leader", "recorder", "guard", "mocap", "robot",
    "bridge", "emulator", "operator", "viewer",
]  # fmt: skip
"""What a session is on the wire; ``bridge``: robots and motion capture in one, as of a bridge to ROS 2."""

ROLES: tuple[Role, ...] = get_args(Role)
ROUTER: Role = "router"
OPERATOR: Role = "operator"
VIEWER: Role = "viewer"
GUARD: Role = "guard"
