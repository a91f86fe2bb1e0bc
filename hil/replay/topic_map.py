"""Topic maps: how a rosbag2 log from another lab names what the estimator reads.

A map is a TOML file. ``[topics]`` names the topics, either ``rigid_bodies`` or ``leader_pose`` and
``follower_pose``, and ``odometry`` of the follower, if there is any. ``[bodies]`` names the two bodies in the
frames.
``[scenario]`` has a ``base`` (name or path) and what differs from it: noise, limits, front end.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgspec
from msgspec import Struct

from hil.errors import UsageError
from hil.scenario.checked_toml import checked, locate, read_toml
from hil.scenario.files import Overrides, merged_scenario, with_overrides
from hil.scenario.links import refuse_chain
from hil.scenario.schema import NonNegative, Scenario

MAPS = "maps"


class TopicNames(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Topics of a foreign log, with or without their leading slash.

    ``rigid_bodies``: mocap frames, or ``leader_pose``, ``follower_pose``: PoseStamped or Odometry in one
    world frame. ``odometry``: motion of the follower, Odometry or TwistStamped; without it the follower's own
    poses tell its motion. ``stamps``: ``log`` takes the
    time of logging for the time of capture, where the stamps of the sources come from different clocks.
    ``pair_within_s``: how far apart in time two poses may be to make a frame.
    """

    odometry: str | None = None
    rigid_bodies: str | None = None
    leader_pose: str | None = None
    follower_pose: str | None = None
    stamps: Literal["header", "log"] = "header"
    pair_within_s: NonNegative = 0.002


class BodyNames(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What the frames call the two bodies; the scenario's names by default."""

    leader: str | None = None
    follower: str | None = None


class _File(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    topics: TopicNames
    bodies: BodyNames = BodyNames()
    scenario: dict[str, Any] = {}


@dataclass(frozen=True, slots=True)
class TopicMap:
    """A topic map with the scenario that it leads to. ``leader``, ``follower``: bodies in the frames."""

    path: Path
    topics: TopicNames
    leader: str
    follower: str
    scenario: Scenario


def load_topic_map(
    name_or_path: str,
    leader: str | None = None,
    follower: str | None = None,
    *overrides: Overrides,
) -> TopicMap:
    """Read a topic map by path.

    ``leader``, ``follower`` take the place of the body names it gives; ``overrides`` change its scenario as
    ``section.key=value``.

    Raises :class:`UsageError` for a file that isn't there or not TOML, an unknown key (naming the nearest
    known one), a wrong value, or topics that don't make up a measurement.
    """
    path = locate("map", MAPS, name_or_path)
    source = f"map {path.stem}"
    tree = read_toml(path, "map")
    if "columns" in tree:
        raise UsageError(f"{source}: maps the columns of a CSV recording; take it to: abreast import csv")
    file = checked(tree, _File, source)
    poses = (file.topics.leader_pose, file.topics.follower_pose)
    if file.topics.rigid_bodies is None and None in poses:
        raise UsageError(f"{source}: topics: give rigid_bodies, or both of leader_pose and follower_pose")
    if file.topics.rigid_bodies is not None and poses != (None, None):
        raise UsageError(f"{source}: topics: give either rigid_bodies or leader_pose and follower_pose")
    scenario = with_overrides(merged_scenario(file.scenario, path.stem, f"{source}: scenario"), *overrides)
    if file.topics.odometry is None and needs_odometry(scenario):
        raise UsageError(
            f"{source}: topics.odometry is missing, and estimator.own_motion is "
            f"{scenario.estimator.own_motion!r}; name the topic, or set own_motion to 'auto' or 'mocap'"
        )
    refuse_chain(scenario, "a map names the topics of two robots; leave out what sets chain")
    return TopicMap(
        path=path,
        topics=_without_slashes(file.topics),
        leader=leader or file.bodies.leader or scenario.leader.name,
        follower=follower or file.bodies.follower or scenario.follower.name,
        scenario=scenario,
    )


def needs_odometry(scenario: Scenario) -> bool:
    """Whether nothing can be estimated without the follower's odometry."""
    return scenario.estimator.own_motion not in ("auto", "mocap")


def _without_slashes(names: TopicNames) -> TopicNames:
    return msgspec.structs.replace(
        names,
        odometry=names.odometry and names.odometry.removeprefix("/"),
        rigid_bodies=names.rigid_bodies and names.rigid_bodies.removeprefix("/"),
        leader_pose=names.leader_pose and names.leader_pose.removeprefix("/"),
        follower_pose=names.follower_pose and names.follower_pose.removeprefix("/"),
    )
