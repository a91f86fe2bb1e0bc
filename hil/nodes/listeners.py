"""What is wrong with who listens to a robot's commands, by the types that they take them for."""

from __future__ import annotations

from collections.abc import Sequence

from hil.nodes.findings import Findings


def listener_findings(name: str, typename: str, heard_as: Sequence[str]) -> Findings:
    """That nobody listens to a topic of this name and type, or that who does takes it for another type.

    ``heard_as``: the type by which each listener takes it.

    >>> listener_findings("/follower/cmd_vel", "geometry_msgs/msg/Twist", [])
    {'deaf_robot': 'nobody listens to /follower/cmd_vel, expected its robot to'}
    """
    if typename in heard_as:
        return {}
    if heard_as:
        types = ", ".join(sorted(set(heard_as)))
        return {"command_type": f"{name} is listened to as {types}, and is a {typename}"}
    return {"deaf_robot": f"nobody listens to {name}, expected its robot to"}
