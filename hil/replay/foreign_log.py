"""Logs from other labs, read as if they were ours: their topics turned into the estimator's inputs."""

from __future__ import annotations

import bisect
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

from hil.errors import UsageError
from hil.log.events import Timed
from hil.log.reader import Log
from hil.nodes.findings import Findings
from hil.replay.foreign_clocks import Clocks, clock_finding, clocks_of
from hil.replay.foreign_samples import InputSample, PoseSample, motion_samples, pose_samples, sighting_samples
from hil.replay.pose_axes import axes_findings
from hil.replay.topic_map import TopicMap
from hil.scenario.links import bodies_of
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.messages import encode, header
from hil.wire.pose_sources import NamedPlace, pose_of

_TOGETHER = 2
"""Bodies that make a frame."""


@dataclass(frozen=True, slots=True, eq=False)
class ForeignInputs:
    """Inputs of an estimator in log order, each at its log time, and what was found to be wrong with them."""

    events: list[Timed]
    found: Findings


def foreign_events(log: Log, chart: TopicMap) -> list[Timed]:
    """Inputs of an estimator of the map's scenario; see :func:`foreign_inputs`."""
    return foreign_inputs(log, chart).events


def foreign_inputs(log: Log, chart: TopicMap) -> ForeignInputs:
    """Inputs of an estimator of the map's scenario, in log order.

    If all stamps run on another clock (ahead of the log, or more than a second behind it at best), log times
    are shifted so that the freshest input has no age; a topic whose clock differs from those of the others
    has its stamps shifted so. A stamp ahead of its neighbours by more than a second leaves its message out.
    Raises :class:`UsageError` if the log lacks a topic or a body of the map, if a topic is of a type that
    cannot be used, if the two bodies are told in different frames of reference, or if no two poses make up a
    frame.
    """
    poses, inputs = _poses(log, chart), [*motion_samples(log, chart), *sighting_samples(log, chart)]
    ages: dict[str, list[int]] = {}
    for pose in poses:
        ages.setdefault(pose.topic, []).append(pose.log_ns - pose.stamp_ns)
    for each in inputs:
        ages.setdefault(each.source, []).append(each.log_ns - each.stamp_ns)
    clocks = clocks_of(ages)
    wild = {topic: sum(clocks.is_wild(topic, age) for age in told) for topic, told in ages.items()}
    frames = _frames(log, chart, _right_poses(poses, clocks))
    made = sorted([*frames, *_right_inputs(inputs, clocks)], key=lambda each: each[2])
    events = [(Event(topic, encode(message)), log_ns - clocks.log_shift) for topic, message, log_ns in made]
    said = clock_finding(clocks, wild, {topic: len(told) for topic, told in ages.items()})
    found = {**({"clock": said} if said else {}), **axes_findings(pose.places for pose in poses)}
    return ForeignInputs(events, found)


_Made = tuple[str, msg.Message, int]
"""Topic, message and log time [ns] of an input."""


def _right_poses(poses: Iterable[PoseSample], clocks: Clocks) -> list[PoseSample]:
    return [
        replace(each, stamp_ns=each.stamp_ns + clocks.shifts.get(each.topic, 0))
        for each in poses
        if not clocks.is_wild(each.topic, each.log_ns - each.stamp_ns)
    ]


def _right_inputs(inputs: Iterable[InputSample], clocks: Clocks) -> Iterable[_Made]:
    for each in inputs:
        if clocks.is_wild(each.source, each.log_ns - each.stamp_ns):
            continue
        message, shift = each.message, clocks.shifts.get(each.source, 0)
        if shift:
            head = header(each.stamp_ns + shift, message.header.frame_id)
            message = replace(message, header=head)
        yield each.topic, message, each.log_ns


def _poses(log: Log, chart: TopicMap) -> list[PoseSample]:
    """Poses of the pair, as they were logged, in one frame of reference."""
    given = chart.topics
    if given.rigid_bodies is not None:
        poses = pose_samples(log, chart, given.rigid_bodies, named=True, body="")
        _check_bodies(log, chart, {place.body for each in poses for place in each.places})
    elif given.leader_pose is not None and given.follower_pose is not None:
        poses = []
        for name, body in ((given.leader_pose, chart.leader), (given.follower_pose, chart.follower)):
            of_body = pose_samples(log, chart, name, named=False, body=body)
            if not of_body:
                of_body = _of_another_name(log, chart, name, body)
            poses += of_body
    else:
        return []
    _check_frames_of_reference(log, chart, poses)
    return poses


def _of_another_name(log: Log, chart: TopicMap, name: str, body: str) -> list[PoseSample]:
    """Poses of a topic on which nobody has the name that was looked for, if there is but one other body."""
    poses = pose_samples(log, chart, name, named=False, body="")
    others = {place.body for each in poses for place in each.places}
    if not poses:
        raise UsageError(f"log {log.path}: topic {name!r} has no pose that can be read; correct the map")
    if len(others) > 1:
        raise UsageError(
            f"log {log.path}: body {body!r} is not on topic {name!r}; expected under [bodies] of the map one "
            f"of: {', '.join(sorted(others))}"
        )
    named = [tuple(place._replace(body=body) for place in each.places) for each in poses]
    return [replace(each, places=places) for each, places in zip(poses, named, strict=True)]


def _check_bodies(log: Log, chart: TopicMap, seen: Collection[str]) -> None:
    for role, name in (("leader", chart.leader), ("follower", chart.follower)):
        if name not in seen:
            there = ", ".join(sorted(seen)) or "none"
            raise UsageError(
                f"log {log.path}: {role} {name!r} is not among the bodies on "
                f"{chart.topics.rigid_bodies!r}; give --{role} one of: {there}"
            )


def _check_frames_of_reference(log: Log, chart: TopicMap, poses: Iterable[PoseSample]) -> None:
    """Refuse two bodies that are never told in one frame of reference; an empty frame_id says nothing."""
    told: dict[str, set[str]] = {chart.leader: set(), chart.follower: set()}
    for each in poses:
        for place in each.places:
            if place.body in told and place.frame_id:
                told[place.body].add(place.frame_id)
    of_leader, of_follower = told[chart.leader], told[chart.follower]
    if of_leader and of_follower and not of_leader & of_follower:
        raise UsageError(
            f"log {log.path}: the leader's poses are in frame {_listed(of_leader)}, the follower's in "
            f"{_listed(of_follower)}, which tells nothing of where they are to each other; expected topics "
            "with poses in one frame_id, of a motion capture say; correct the map"
        )


def _listed(names: Collection[str]) -> str:
    return ", ".join(repr(name) for name in sorted(names))


def _frames(log: Log, chart: TopicMap, poses: list[PoseSample]) -> list[_Made]:
    """Mocap frames with the pair's bodies under the scenario's names."""
    names = dict(zip((chart.leader, chart.follower), bodies_of(chart.scenario), strict=True))
    if chart.topics.rigid_bodies is not None and _are_together(poses, names):
        return [
            _frame([p for p in each.places if p.body in names], names, each.stamp_ns, each.log_ns, number)
            for number, each in enumerate(poses)
        ]
    return _paired(log, chart, poses, names) if poses else []


def _are_together(poses: Iterable[PoseSample], names: Mapping[str, str]) -> bool:
    """Whether messages hold both bodies, as frames do, and transforms may or may not."""
    return any(sum(place.body in names for place in each.places) >= _TOGETHER for each in poses)


def _paired(log: Log, chart: TopicMap, poses: Iterable[PoseSample], names: Mapping[str, str]) -> list[_Made]:
    """Frames of the leader's poses, each with the follower's nearest in time, where that is near enough.

    A frame is there once both are.
    """
    of: dict[str, list[tuple[NamedPlace, PoseSample]]] = {name: [] for name in names}
    for each in poses:
        for place in each.places:
            if place.body in of:
                of[place.body].append((place, each))
    followers = sorted(of[chart.follower], key=lambda seen: seen[1].stamp_ns)
    stamps = [sample.stamp_ns for _, sample in followers]
    frames: list[_Made] = []
    gaps: list[int] = []
    for number, (leader, sample) in enumerate(of[chart.leader]):
        at = bisect.bisect_left(stamps, sample.stamp_ns)
        near = followers[max(0, at - 1) : at + 1]
        follower, other = min(near, key=lambda seen: abs(seen[1].stamp_ns - sample.stamp_ns))
        gaps.append(abs(other.stamp_ns - sample.stamp_ns))
        if gaps[-1] <= chart.topics.pair_within_s * 1e9:
            log_ns = max(sample.log_ns, other.log_ns)
            frames.append(_frame([leader, follower], names, sample.stamp_ns, log_ns, number))
    if not frames:
        nearest = min(gaps) * 1e-9
        raise UsageError(
            f"log {log.path}: no pose of the leader has one of the follower within "
            f"{chart.topics.pair_within_s:g} s (the nearest are {nearest:.3g} s apart); "
            "raise topics.pair_within_s in the map"
        )
    return frames


def _frame(
    places: Iterable[NamedPlace], names: Mapping[str, str], stamp_ns: int, log_ns: int, number: int
) -> _Made:
    bodies = [msg.RigidBody(names[each.body], [], pose_of(each.place)) for each in places]
    return topics.RIGID_BODIES, msg.RigidBodies(header(stamp_ns, "world"), number, bodies), log_ns
