"""Sections of a scenario on what a lab has at both ends: motion capture that comes in, topics on the wire."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import UNSET, Meta, UnsetType

from hil.scenario.section import Factor, Namespace, Section, Span

SourceType = Literal[
    "RigidBodies",
    "NamedPoseArray",
    "PoseStamped",
    "PoseWithCovarianceStamped",
    "Odometry",
    "TransformStamped",
    "TFMessage",
]


class SourceSection(Section, frozen=True, kw_only=True):
    """The motion capture that comes in: its messages, its clock and its axes.

    ``type``: RigidBodies of mocap4ros2, NamedPoseArray of motion_capture_tracking, one of four messages for a
    body each, or TFMessage of transforms whose child frames are the bodies. ``topic``: where they come; of
    messages for one body each with ``{body}`` in the place of its name. Empty for the usual one of the type.
    ``stamp``: header, or receive where the stamps of the source cannot be used; stamps of 0 are never used.
    ``up``: the axis that points up, ``y`` as Motive streams by default. ``scale``: what its unit of length is
    in metres. ``pair_within_s``: how far apart two poses may be to be one frame. ``emulated``: the robot that
    does not exist, and whose pose the emulator adds to the lab's frames; empty for none.
    """

    type: SourceType = "RigidBodies"
    topic: str = ""
    stamp: Literal["header", "receive"] = "header"
    up: Literal["z", "y"] = "z"
    scale: Factor = 1.0
    pair_within_s: Span = 0.002
    emulated: Literal["", "leader", "follower"] = ""


class WireSection(Section, frozen=True, kw_only=True):
    """How topics are laid out on the wire.

    ``layout``: keys as of zenoh-bridge-ros2dds or of rmw_zenoh. ``prefix``: in front of every key, the
    bridge's own ``namespace``. ``domain``, ``distro``: ROS domain id and distribution, of rmw_zenoh.
    ``topics``: names of topics on the wire that differ from ours, such as ``"follower/odom" =
    "tb3_1/wheel/odom"``; logs have ours.
    """

    layout: Literal["ros2dds", "rmw_zenoh"] = "ros2dds"
    prefix: Namespace = ""
    domain: Annotated[int, Meta(ge=0, le=232)] = 0
    distro: Literal["humble", "iron", "jazzy", "kilted", "rolling"] = "jazzy"
    topics: dict[str, str] | UnsetType = UNSET
