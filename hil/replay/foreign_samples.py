"""What the topics of a foreign log tell, by its topic map: poses, motion of the follower, sightings."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from rosbags.typesys.stores.ros2_humble import geometry_msgs__msg__PointStamped as PointStamped

from hil.emulator.lab_messages import odometry_frames
from hil.errors import UsageError
from hil.log.reader import Log, Record
from hil.replay.topic_map import TopicMap, needs_odometry
from hil.wire import message_types as msg
from hil.wire.messages import MalformedPayloadError, decode, header, to_ns, typename_of
from hil.wire.pose_sources import MESSAGES, NamedPlace, PoseStamped, places_in, source_type, upright
from hil.wire.topics import topics_of

OLD_FRAMES = "mocap_msgs/msg/RigidBodies"
"""The name of mocap4r2_msgs' frames in their older package, of the same layout."""

OF_ALL = ("RigidBodies", "NamedPoseArray", "TFMessage", "TransformStamped")
"""Types of source whose messages say whose the poses are."""

MOTIONS = tuple(map(typename_of, (msg.Odometry, msg.TwistStamped, msg.Twist)))
SIGHTINGS = tuple(map(typename_of, (msg.RangeBearing, PoseStamped, PointStamped)))
_STAMPED = (PoseStamped, PointStamped, msg.Odometry, msg.TwistStamped, msg.RangeBearing)
_UNKNOWN_COVARIANCE = np.zeros(36)
# A quaternion of zeros stands for none.
_NO_POSE = msg.Pose(
    position=msg.Point(x=0.0, y=0.0, z=0.0), orientation=msg.Quaternion(x=0.0, y=0.0, z=0.0, w=0.0)
)


@dataclass(frozen=True, slots=True)
class PoseSample:
    """Bodies that one message tells of, with z up and in metres, under the names of the log."""

    topic: str
    places: tuple[NamedPlace, ...]
    stamp_ns: int
    log_ns: int


@dataclass(frozen=True, slots=True, eq=False)
class InputSample:
    """A message for the estimator as it is to get it, but for its stamp; ``source``: the log's topic."""

    source: str
    topic: str
    message: msg.Odometry | msg.RangeBearing
    stamp_ns: int
    log_ns: int


def pose_samples(log: Log, chart: TopicMap, name: str, *, named: bool, body: str) -> list[PoseSample]:
    """Poses on a topic, in the order of the log; those of other bodies than ``body`` are left out.

    ``named``: whether messages have to tell whose poses they hold; ``body`` is empty to take all.
    Raises :class:`UsageError` for a topic that the log does not have, or of a type that tells no poses.
    """
    accepted = [typename_of(kind) for kind_name, kind in MESSAGES.items() if kind_name in OF_ALL or not named]
    topic, typename = present(log, chart, name, [*accepted, OLD_FRAMES])
    kind = source_type(typename) or "RigidBodies"
    samples: list[PoseSample] = []
    for record in log.records([topic]):
        try:
            # By our definition, not the log's: the older package has the same layout under another name.
            places = places_in(kind, record.payload, "" if kind in OF_ALL else body)
        except MalformedPayloadError:
            continue
        samples += _samples_of(record, places, body, chart)
    return samples


def _samples_of(
    record: Record, places: Iterable[NamedPlace], body: str, chart: TopicMap
) -> Iterator[PoseSample]:
    """Samples of a message: one for each stamp in it."""
    topics = chart.topics
    by_stamp: dict[int, list[NamedPlace]] = {}
    for each in places:
        if body in ("", each.body):
            place = upright(each.place, topics.up, topics.scale)
            by_stamp.setdefault(each.stamp_ns, []).append(each._replace(place=place))
    name = record.topic.removeprefix("/")
    for told_ns, group in by_stamp.items():
        received = topics.is_received(name) or chart.scenario.source.stamp == "receive"
        stamp_ns = record.log_ns if received else told_ns or record.log_ns
        yield PoseSample(record.topic, tuple(group), stamp_ns, record.log_ns)


def motion_samples(log: Log, chart: TopicMap) -> list[InputSample]:
    """Motion of the follower, by odometry, twists, or commands without a stamp, which have the log's time."""
    name, own = chart.topics.odometry, topics_of(chart.scenario)
    if name is None or (name not in _bare(log.topics) and not _is_missed(log, chart)):
        return []
    topic, _ = present(log, chart, name, MOTIONS)
    frame_id, child_frame_id = odometry_frames(own.follower)
    motions: list[InputSample] = []
    for record, message in _messages(log, topic, chart):
        if isinstance(message, msg.Odometry):
            pose, twist = message.pose.pose, message.twist
        elif isinstance(message, msg.TwistStamped | msg.Twist):
            pose = _NO_POSE
            told = message if isinstance(message, msg.Twist) else message.twist
            twist = msg.TwistWithCovariance(twist=told, covariance=_UNKNOWN_COVARIANCE)
        else:
            continue
        stamp_ns = _stamp_ns(record, message, chart)
        odometry = msg.Odometry(
            header=header(stamp_ns, frame_id),
            child_frame_id=child_frame_id,
            pose=msg.PoseWithCovariance(pose=pose, covariance=_UNKNOWN_COVARIANCE),
            twist=twist,
        )
        motions.append(InputSample(topic, own.odom, odometry, stamp_ns, record.log_ns))
    if not motions:
        raise UsageError(f"log {log.path}: topic {topic!r} has no odometry that can be read; correct the map")
    return motions


def sighting_samples(log: Log, chart: TopicMap) -> list[InputSample]:
    """The leader as the follower saw it, by range and bearing out of whatever tells its place."""
    name, own = chart.topics.sighting, topics_of(chart.scenario)
    if name is None:
        return []
    topic, _ = present(log, chart, name, SIGHTINGS)
    sightings: list[InputSample] = []
    for record, message in _messages(log, topic, chart):
        if isinstance(message, msg.RangeBearing):
            rho, alpha2 = message.rho, message.alpha2
        elif isinstance(message, PoseStamped | PointStamped):
            at = message.point if isinstance(message, PointStamped) else message.pose.position
            rho, alpha2 = math.hypot(at.x, at.y), math.atan2(at.y, at.x)
        else:
            continue
        stamp_ns = _stamp_ns(record, message, chart)
        seen = msg.RangeBearing(header(stamp_ns, own.follower), rho, alpha2)
        sightings.append(InputSample(topic, own.sighting, seen, stamp_ns, record.log_ns))
    if not sightings:
        raise UsageError(f"log {log.path}: topic {topic!r} has no sighting that can be read; correct the map")
    return sightings


def present(log: Log, chart: TopicMap, name: str, accepted: Collection[str]) -> tuple[str, str]:
    """Name of a topic of the map as the log has it, and the type by which it is read."""
    for topic, typename in log.topics.items():
        if topic.removeprefix("/") != name:
            continue
        typename = chart.topics.types.get(name, typename)
        if typename not in accepted:
            raise UsageError(
                f"log {log.path}: topic {topic!r} is {typename}, expected {' or '.join(accepted)}; "
                f"correct map {chart.path}"
            )
        return topic, typename
    there = ", ".join(sorted(log.topics)) or "none"
    raise UsageError(
        f"log {log.path}: topic {name!r} of map {chart.path} is not in the log; topics there: {there}"
    )


def _is_missed(log: Log, chart: TopicMap) -> bool:
    """Whether odometry that the log does not have is needed, or seems to be there under another name."""
    poses = {chart.topics.leader_pose, chart.topics.follower_pose}
    others = {name for name, typename in log.topics.items() if typename in MOTIONS}
    misnamed = chart.scenario.estimator.own_motion == "auto" and _bare(others) - poses
    return needs_odometry(chart.scenario) or bool(misnamed)


def _messages(log: Log, topic: str, chart: TopicMap) -> Iterator[tuple[Record, msg.Message]]:
    """Messages of a topic that can be decoded and have a stamp that is one."""
    for record in log.records([topic]):
        try:
            told = chart.topics.types.get(topic.removeprefix("/"))
            message = decode(record.payload, told) if told else log.decode(record)
            if isinstance(message, _STAMPED):
                to_ns(message.header.stamp)
                yield record, message
            elif isinstance(message, msg.Twist):
                yield record, message
        except MalformedPayloadError:
            continue


def _stamp_ns(record: Record, message: msg.Message, chart: TopicMap) -> int:
    """When a message speaks of: by its stamp, or by the log where there is none or it is not to be used."""
    if not isinstance(message, _STAMPED) or chart.topics.is_received(record.topic.removeprefix("/")):
        return record.log_ns
    return to_ns(message.header.stamp) or record.log_ns


def _bare(names: Iterable[str]) -> set[str]:
    return {name.removeprefix("/") for name in names}
