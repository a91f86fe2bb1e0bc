"""Logs from other labs, read as if they were ours: their topics turned into the estimator's inputs."""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from rosbags.typesys.stores.ros2_humble import geometry_msgs__msg__PointStamped as PointStamped
from rosbags.typesys.stores.ros2_humble import geometry_msgs__msg__PoseStamped as PoseStamped

from hil.emulator.lab_messages import odometry_frames
from hil.errors import UsageError
from hil.log.events import Timed
from hil.log.reader import Log, Record
from hil.replay.topic_map import TopicMap, needs_odometry
from hil.scenario.links import bodies_of
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.messages import MalformedPayloadError, decode, decode_as, encode, header, to_ns, typename_of
from hil.wire.topics import topics_of

_OTHER_CLOCK_NS = 1_000_000_000
_FRAMES = (typename_of(msg.RigidBodies), "mocap_msgs/msg/RigidBodies")
_POSES = (typename_of(PoseStamped), typename_of(msg.Odometry))
_MOTIONS = (typename_of(msg.Odometry), typename_of(msg.TwistStamped))
_SIGHTINGS = (typename_of(msg.RangeBearing), typename_of(PoseStamped), typename_of(PointStamped))
_STAMPED = (PoseStamped, PointStamped, msg.Odometry, msg.TwistStamped, msg.RangeBearing)
_UNKNOWN_COVARIANCE = np.zeros(36)
# A quaternion of zeros stands for none.
_NO_POSE = msg.Pose(
    position=msg.Point(x=0.0, y=0.0, z=0.0), orientation=msg.Quaternion(x=0.0, y=0.0, z=0.0, w=0.0)
)


@dataclass(frozen=True, slots=True)
class _Input:
    """A message for the estimator, what time it speaks of, and when it was logged."""

    topic: str
    message: msg.Message
    stamp_ns: int
    log_ns: int


@dataclass(frozen=True, slots=True)
class _SeenPose:
    pose: msg.Pose
    stamp_ns: int
    log_ns: int


def foreign_events(log: Log, chart: TopicMap) -> list[Timed]:
    """Inputs of an estimator of the map's scenario, in log order, each at its log time.

    If the stamps run on another clock (ahead of the log, or more than a second behind it at best), all times
    are shifted so that the freshest input has no age. Raises :class:`UsageError` if the log lacks a topic or
    a body of the map, if a topic is of a type that cannot be used, or if no two poses make up a frame.
    """
    frames: list[_Input] = []
    if chart.topics.rigid_bodies is not None:
        frames = _frames(log, chart)
    elif chart.topics.leader_pose is not None:
        frames = _paired_frames(log, chart)
    inputs = [*frames, *_sightings(log, chart), *_motions(log, chart)]
    inputs.sort(key=lambda each: each.log_ns)
    age_ns = min(each.log_ns - each.stamp_ns for each in inputs)
    shift_ns = 0 if 0 <= age_ns <= _OTHER_CLOCK_NS else age_ns
    return [(Event(each.topic, encode(each.message)), each.log_ns - shift_ns) for each in inputs]


def _frames(log: Log, chart: TopicMap) -> list[_Input]:
    """Mocap frames with the pair's bodies under the scenario's names."""
    topic = _present(log, chart, chart.topics.rigid_bodies or "", _FRAMES)
    leader, follower = bodies_of(chart.scenario)
    names = {chart.leader: leader, chart.follower: follower}
    frames: list[_Input] = []
    seen: set[str] = set()
    for record in log.records([topic]):
        try:
            # By our definition, not the log's: the older package has the same layout under another name.
            frame = decode_as(record.payload, msg.RigidBodies)
            stamp_ns = _stamp_ns(record, frame.header, chart)
        except MalformedPayloadError:
            continue
        seen.update(body.rigid_body_name for body in frame.rigidbodies)
        pair = [
            replace(body, rigid_body_name=names[body.rigid_body_name])
            for body in frame.rigidbodies
            if body.rigid_body_name in names
        ]
        frame = replace(frame, header=header(stamp_ns, frame.header.frame_id), rigidbodies=pair)
        frames.append(_Input(topics.RIGID_BODIES, frame, stamp_ns, record.log_ns))
    for role, name in (("leader", chart.leader), ("follower", chart.follower)):
        if name not in seen:
            there = ", ".join(sorted(seen)) or "none"
            raise UsageError(
                f"log {log.path}: {role} {name!r} is not among the bodies on {topic!r}; "
                f"give --{role} one of: {there}"
            )
    return frames


def _paired_frames(log: Log, chart: TopicMap) -> list[_Input]:
    """Frames of the leader's poses, each with the follower's nearest in time, where that is near enough."""
    leaders = _poses(log, chart, chart.topics.leader_pose or "")
    followers = sorted(_poses(log, chart, chart.topics.follower_pose or ""), key=lambda seen: seen.stamp_ns)
    stamps = [seen.stamp_ns for seen in followers]
    frames: list[_Input] = []
    gaps: list[int] = []
    for number, leader in enumerate(leaders):
        place = bisect.bisect_left(stamps, leader.stamp_ns)
        follower = min(
            followers[max(0, place - 1) : place + 1], key=lambda seen: abs(seen.stamp_ns - leader.stamp_ns)
        )
        gaps.append(abs(follower.stamp_ns - leader.stamp_ns))
        if gaps[-1] <= chart.topics.pair_within_s * 1e9:
            frames.append(_pair(leader, follower, number, chart))
    if not frames:
        nearest = min(gaps) * 1e-9
        raise UsageError(
            f"log {log.path}: no pose of the leader has one of the follower within "
            f"{chart.topics.pair_within_s:g} s (the nearest are {nearest:.3g} s apart); "
            "raise topics.pair_within_s in the map"
        )
    return frames


def _pair(leader: _SeenPose, follower: _SeenPose, number: int, chart: TopicMap) -> _Input:
    """Frame of two poses. It is there once both are."""
    names = bodies_of(chart.scenario)
    bodies = [
        msg.RigidBody(name, [], seen.pose) for name, seen in zip(names, (leader, follower), strict=True)
    ]
    frame = msg.RigidBodies(header(leader.stamp_ns, "world"), number, bodies)
    return _Input(topics.RIGID_BODIES, frame, leader.stamp_ns, max(leader.log_ns, follower.log_ns))


def _poses(log: Log, chart: TopicMap, name: str) -> list[_SeenPose]:
    topic = _present(log, chart, name, _POSES)
    poses: list[_SeenPose] = []
    for record, message in _messages(log, topic, chart):
        if isinstance(message, PoseStamped):
            poses.append(_SeenPose(message.pose, _stamp_ns(record, message.header, chart), record.log_ns))
        elif isinstance(message, msg.Odometry):
            stamp_ns = _stamp_ns(record, message.header, chart)
            poses.append(_SeenPose(message.pose.pose, stamp_ns, record.log_ns))
    if not poses:
        raise UsageError(f"log {log.path}: topic {topic!r} has no pose that can be read; correct the map")
    return poses


def _motions(log: Log, chart: TopicMap) -> list[_Input]:
    name, own = chart.topics.odometry, topics_of(chart.scenario)
    if name is None or (name not in _bare(log.topics) and not _is_missed(log, chart)):
        return []
    topic = _present(log, chart, name, _MOTIONS)
    motions: list[_Input] = []
    for record, message in _messages(log, topic, chart):
        if isinstance(message, msg.Odometry):
            pose, twist = message.pose.pose, message.twist
        elif isinstance(message, msg.TwistStamped):
            pose = _NO_POSE
            twist = msg.TwistWithCovariance(twist=message.twist, covariance=_UNKNOWN_COVARIANCE)
        else:
            continue
        stamp_ns = _stamp_ns(record, message.header, chart)
        frame_id, child_frame_id = odometry_frames(own.follower)
        odometry = msg.Odometry(
            header=header(stamp_ns, frame_id),
            child_frame_id=child_frame_id,
            pose=msg.PoseWithCovariance(pose=pose, covariance=_UNKNOWN_COVARIANCE),
            twist=twist,
        )
        motions.append(_Input(own.odom, odometry, stamp_ns, record.log_ns))
    if not motions:
        raise UsageError(f"log {log.path}: topic {topic!r} has no odometry that can be read; correct the map")
    return motions


def _is_missed(log: Log, chart: TopicMap) -> bool:
    """Whether odometry that the log does not have is needed, or seems to be there under another name."""
    poses = {chart.topics.leader_pose, chart.topics.follower_pose}
    others = {name for name, typename in log.topics.items() if typename in _MOTIONS}
    misnamed = chart.scenario.estimator.own_motion == "auto" and _bare(others) - poses
    return needs_odometry(chart.scenario) or bool(misnamed)


def _sightings(log: Log, chart: TopicMap) -> list[_Input]:
    """The leader as the follower saw it, by range and bearing out of whatever tells its place."""
    name, own = chart.topics.sighting, topics_of(chart.scenario)
    if name is None:
        return []
    topic = _present(log, chart, name, _SIGHTINGS)
    sightings: list[_Input] = []
    for record, message in _messages(log, topic, chart):
        if isinstance(message, msg.RangeBearing):
            rho, alpha2 = message.rho, message.alpha2
        elif isinstance(message, PoseStamped | PointStamped):
            at = message.point if isinstance(message, PointStamped) else message.pose.position
            rho, alpha2 = math.hypot(at.x, at.y), math.atan2(at.y, at.x)
        else:
            continue
        stamp_ns = _stamp_ns(record, message.header, chart)
        seen = msg.RangeBearing(header(stamp_ns, own.follower), rho, alpha2)
        sightings.append(_Input(own.sighting, seen, stamp_ns, record.log_ns))
    if not sightings:
        raise UsageError(f"log {log.path}: topic {topic!r} has no sighting that can be read; correct the map")
    return sightings


def _messages(log: Log, topic: str, chart: TopicMap) -> Iterator[tuple[Record, msg.Message]]:
    """Messages of a topic that can be decoded and have a stamp that is one."""
    for record in log.records([topic]):
        try:
            told = chart.topics.types.get(topic.removeprefix("/"))
            message = decode(record.payload, told) if told else log.decode(record)
            if isinstance(message, _STAMPED):
                to_ns(message.header.stamp)
                yield record, message
        except MalformedPayloadError:
            continue


def _stamp_ns(record: Record, given: msg.Header, chart: TopicMap) -> int:
    return record.log_ns if chart.topics.stamps == "log" else to_ns(given.stamp)


def _bare(names: Iterable[str]) -> set[str]:
    return {name.removeprefix("/") for name in names}


def _present(log: Log, chart: TopicMap, name: str, accepted: tuple[str, ...]) -> str:
    """Name of a topic of the map as the log has it."""
    for topic, typename in log.topics.items():
        if topic.removeprefix("/") != name:
            continue
        typename = chart.topics.types.get(name, typename)
        if typename not in accepted:
            raise UsageError(
                f"log {log.path}: topic {topic!r} is {typename}, expected {' or '.join(accepted)}; "
                f"correct map {chart.path}"
            )
        return topic
    there = ", ".join(sorted(log.topics)) or "none"
    raise UsageError(
        f"log {log.path}: topic {name!r} of map {chart.path} is not in the log; topics there: {there}"
    )
