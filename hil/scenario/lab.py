"""Sections of a scenario on a lab: motion capture, topics on the wire, guards, the log on the disk."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import UNSET, Meta, UnsetType

from hil.scenario.section import Namespace, NonNegative, Positive, Section

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
    scale: Positive = 1.0
    pair_within_s: NonNegative = 0.002
    emulated: Literal["", "leader", "follower"] = ""


class RecorderSection(Section, frozen=True, kw_only=True):
    """How the recorder of a live run keeps its log.

    ``rotate_mb``, ``rotate_s``: begin a new file once one has this size or covers this time; 0 for never.
    """

    rotate_mb: NonNegative = 0.0
    rotate_s: NonNegative = 0.0

    @property
    def rotates(self) -> bool:
        """Whether the log comes in pieces."""
        return self.rotate_mb > 0.0 or self.rotate_s > 0.0


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


class GuardSection(Section, frozen=True, kw_only=True):
    """The guard on every robot that is commanded: between the wire and its driver.

    ``present``: controllers send to guards, on ``cmd_vel_wanted``, and not to drivers; live commands set it
    unless they are told ``--no-guard``. ``age_s``: oldest command and longest silence that a robot drives on;
    ``latch_s``: silence after which it has to be armed. ``fence``: x_min, y_min, x_max, y_max [m] that the
    body of every robot has to stay in; ``separation``: its least distance [m] to any other, 0 for none.
    """

    present: bool = False
    age_s: Annotated[float, Meta(gt=0.0, le=10.0)] = 0.15
    latch_s: Annotated[float, Meta(gt=0.0, le=1e5)] = 1.0
    fence: tuple[float, float, float, float] | UnsetType = UNSET
    separation: NonNegative = 0.0
