"""Topic maps: how a rosbag2 log from another lab names what the estimator reads.

A map is a TOML file. ``[topics]`` names the topics, either ``rigid_bodies`` or ``leader_pose`` and
``follower_pose``, or ``sighting``, and ``odometry`` of the follower, if there is any. An entry is a topic's
name or ``{ topic, type }``. ``[bodies]`` names the two bodies in the frames.
``[scenario]`` has a ``base`` (name or path) and what differs from it: noise, limits, front end.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from msgspec import Struct

from hil.errors import UsageError
from hil.scenario.checked_toml import checked, locate, read_toml
from hil.scenario.files import Overrides, merged_scenario, with_overrides
from hil.scenario.links import refuse_chain
from hil.scenario.schema import Scenario
from hil.scenario.section import Factor, Span

MAPS = "maps"


class TypedTopic(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A topic and how it is read.

    ``type``: where the log has another name for that or none. ``stamp``: ``receive`` takes the log's time.
    """

    topic: str
    type: str | None = None
    stamp: Literal["header", "receive"] | None = None


Entry = str | TypedTopic


class TopicNames(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Topics of a foreign log, with or without their leading slash.

    ``rigid_bodies``: RigidBodies, NamedPoseArray, TFMessage or TransformStamped with both bodies by name, or
    ``leader_pose``, ``follower_pose``: any of these, or PoseStamped, PoseWithCovarianceStamped or Odometry,
    in one frame of reference. ``odometry``: motion of the follower, Odometry, TwistStamped, or Twist, as
    commands are; without it the follower's own poses tell its motion. ``sighting``: the leader as the
    follower sees it, our RangeBearing, or PoseStamped or PointStamped of the leader in the follower's own
    frame (x ahead, y to the left); ``leader_sighting`` is another name for it. ``stamp``: ``receive`` takes
    the time of logging for the time of capture, as is done with stamps of 0; ``stamps = "log"`` is the same.
    ``up``: the axis of the poses that points up. ``scale``: what their unit of length is in metres.
    ``pair_within_s``: how far apart in time two poses may be to make a frame.
    """

    odometry: Entry | None = None
    rigid_bodies: Entry | None = None
    leader_pose: Entry | None = None
    follower_pose: Entry | None = None
    sighting: Entry | None = None
    leader_sighting: Entry | None = None
    stamps: Literal["header", "log"] = "header"
    stamp: Literal["header", "receive"] | None = None
    up: Literal["z", "y"] | None = None
    scale: Factor | None = None
    pair_within_s: Span = 0.002


class BodyNames(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What the frames call the two bodies; the scenario's names by default."""

    leader: str | None = None
    follower: str | None = None


class _File(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    topics: TopicNames
    bodies: BodyNames = BodyNames()
    scenario: dict[str, Any] = {}


@dataclass(frozen=True, slots=True)
class MappedTopics:
    """Topics of :class:`TopicNames` without leading slashes.

    ``types``: that the map tells of them; ``received``: those whose stamps are the log's, all if None.
    """

    odometry: str | None
    rigid_bodies: str | None
    leader_pose: str | None
    follower_pose: str | None
    sighting: str | None
    up: Literal["z", "y"]
    scale: float
    pair_within_s: float
    types: Mapping[str, str]
    received: frozenset[str] | None

    def is_received(self, name: str) -> bool:
        """Whether messages of a topic are taken to speak of when they were logged."""
        return self.received is None or name in self.received


@dataclass(frozen=True, slots=True)
class TopicMap:
    """A topic map with the scenario that it leads to. ``leader``, ``follower``: bodies in the frames."""

    path: Path
    topics: MappedTopics
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
    topics = _mapped(file.topics)
    _check_measurement(topics, source)
    tree = _on_body(file.scenario) if topics.sighting is not None else file.scenario
    scenario = with_overrides(merged_scenario(tree, path.stem, f"{source}: scenario"), *overrides)
    if topics.sighting is not None:
        _check_sighted(topics, scenario, source)
    if topics.odometry is None and needs_odometry(scenario):
        raise UsageError(
            f"{source}: topics.odometry is missing, and estimator.own_motion is "
            f"{scenario.estimator.own_motion!r}; name the topic, or set own_motion to 'auto' or 'mocap'"
        )
    topics = replace(
        topics,
        up=file.topics.up or scenario.source.up,
        scale=file.topics.scale or scenario.source.scale,
    )
    refuse_chain(scenario, "a map names the topics of two robots; leave out what sets chain")
    return TopicMap(
        path=path,
        topics=topics,
        leader=leader or file.bodies.leader or scenario.leader.name,
        follower=follower or file.bodies.follower or scenario.follower.name,
        scenario=scenario,
    )


def needs_odometry(scenario: Scenario) -> bool:
    """Whether nothing can be estimated without the follower's odometry."""
    return scenario.estimator.own_motion not in ("auto", "mocap")


def _check_measurement(topics: MappedTopics, source: str) -> None:
    poses = (topics.leader_pose, topics.follower_pose)
    if topics.rigid_bodies is None and None in poses and (topics.sighting is None or poses != (None, None)):
        raise UsageError(
            f"{source}: topics: give rigid_bodies, or both of leader_pose and follower_pose, or sighting"
        )
    if topics.rigid_bodies is not None and poses != (None, None):
        raise UsageError(f"{source}: topics: give either rigid_bodies or leader_pose and follower_pose")


def _on_body(tree: Mapping[str, Any]) -> dict[str, Any]:
    """The scenario's part of a map with sightings: on the body front end, unless it says otherwise."""
    given = tree.get("estimator", {})
    if not isinstance(given, dict):
        return dict(tree)
    return {**tree, "estimator": {"front_end": "body", **given}}


def _check_sighted(topics: MappedTopics, scenario: Scenario, source: str) -> None:
    if scenario.estimator.front_end != "body":
        raise UsageError(
            f"{source}: topics.sighting needs the body front end; set scenario.estimator.front_end = 'body'"
        )
    if topics.odometry is None and topics.rigid_bodies is None and topics.leader_pose is None:
        raise UsageError(f"{source}: topics.sighting needs the follower's motion; name topics.odometry")


def _mapped(names: TopicNames) -> MappedTopics:
    types: dict[str, str] = {}
    received: set[str] = set()

    def bare(entry: Entry | None) -> str | None:
        if entry is None:
            return None
        if isinstance(entry, str):
            return entry.removeprefix("/")
        name = entry.topic.removeprefix("/")
        if entry.type is not None:
            types[name] = entry.type
        if entry.stamp == "receive":
            received.add(name)
        return name

    sighting = names.sighting if names.sighting is not None else names.leader_sighting
    of_log = names.stamp == "receive" or names.stamps == "log"
    return MappedTopics(
        odometry=bare(names.odometry),
        rigid_bodies=bare(names.rigid_bodies),
        leader_pose=bare(names.leader_pose),
        follower_pose=bare(names.follower_pose),
        sighting=bare(sighting),
        up=names.up or "z",
        scale=names.scale or 1.0,
        pair_within_s=names.pair_within_s,
        types=types,
        received=None if of_log else frozenset(received),
    )
