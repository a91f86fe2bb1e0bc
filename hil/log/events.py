"""What a log tells of the nodes: their inputs as events, and their outputs with what these rest on."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

from hil.errors import UsageError
from hil.log.reader import Log
from hil.scenario.links import bodies_of
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.messages import MalformedPayloadError, decode_as, to_ns, typename_of
from hil.wire.topics import topics_of

Timed = tuple[Event, int]
"""An event and the ``now_ns`` at which a node takes it in."""

Receipt = tuple[int, int]
"""The digest of an input and the ``now_ns`` at which it was taken in."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """An output as it was logged.

    ``computed_ns``: when it was made, None if its payload cannot be read. ``consumed``: the inputs since the
    output before, in order.
    """

    payload: bytes
    computed_ns: int | None
    consumed: tuple[Receipt, ...] = ()


def logged_events(log: Log, names: Collection[str]) -> Iterator[Timed]:
    """Inputs on the given topics in log order, each at its log time.

    A payload that could not be decoded is kept on a topic of its own when it is logged; here it comes back on
    the topic that it came in on.
    """
    for topic, payload, log_ns in logged_records(log, names):
        yield Event(topic, payload), log_ns


def logged_records(log: Log, names: Collection[str]) -> Iterator[tuple[str, bytes, int]]:
    """The same as topic, payload and log time."""
    present = [name for name in (*names, topics.MALFORMED) if name in log.topics]
    for record in log.records(present):
        if record.topic != topics.MALFORMED:
            yield record.topic, record.payload, record.log_ns
            continue
        try:
            kept = decode_as(record.payload, msg.Malformed)
        except MalformedPayloadError:
            continue
        if kept.topic in names:
            yield kept.topic, kept.payload.tobytes(), record.log_ns


def recorded_estimates(log: Log, topic: str) -> list[Recorded]:
    """Estimates as they were logged, in their order; none if the log does not have the topic."""
    if log.topics.get(topic) != typename_of(msg.LeaderEstimate):
        return []
    return [_recorded_estimate(record.payload) for record in log.records([topic])]


def recorded_commands(log: Log, topic: str) -> list[Recorded]:
    """Commands as they were logged, in their order; none if the log does not have the topic."""
    if log.topics.get(topic) != typename_of(msg.Command):
        return []
    return [_recorded_command(record.payload) for record in log.records([topic])]


def check_inputs(log: Log, scenario: Scenario) -> None:
    """Raise :class:`UsageError` if the log lacks what an estimator of the scenario lives on.

    That is mocap frames with both bodies or, for the body front end, sightings; and odometry of the follower,
    where its own poses do not tell its motion.
    """
    names = topics_of(scenario)
    if topics.RIGID_BODIES in log.topics:
        _check_bodies(log, dict(zip(("leader", "follower"), bodies_of(scenario), strict=True)))
    elif names.sighting not in log.topics:
        wanted = f"{topics.RIGID_BODIES!r} or {names.sighting!r}"
        raise UsageError(
            f"log {log.path}: has no measurement of the leader, expected topic {wanted}; {_there(log)}"
        )
    elif scenario.estimator.front_end == "world":
        raise UsageError(
            f"log {log.path}: has sightings, no mocap frames; expected estimator.front_end = 'body', "
            "correct the map or the scenario that it was made with"
        )
    posed = topics.RIGID_BODIES in log.topics and scenario.estimator.own_motion in ("auto", "mocap")
    if names.odom not in log.topics and not posed:
        raise UsageError(
            f"log {log.path}: has no odometry of follower {names.follower!r}, expected topic {names.odom!r}; "
            f"{_there(log)}"
        )


def _check_bodies(log: Log, wanted: dict[str, str]) -> None:
    seen: set[str] = set()
    for record in log.records([topics.RIGID_BODIES]):
        try:
            frame = decode_as(record.payload, msg.RigidBodies)
        except MalformedPayloadError:
            continue
        seen.update(body.rigid_body_name for body in frame.rigidbodies)
        if seen.issuperset(wanted.values()):
            return
    for role, name in wanted.items():
        if name not in seen:
            there = ", ".join(sorted(seen)) or "none"
            raise UsageError(
                f"log {log.path}: {role} {name!r} is not among the bodies of its frames; "
                f"give --{role} one of: {there}"
            )


def _there(log: Log) -> str:
    return f"topics there: {', '.join(sorted(log.topics)) or 'none'}"


def _recorded_estimate(payload: bytes) -> Recorded:
    try:
        message = decode_as(payload, msg.LeaderEstimate)
        return Recorded(payload, to_ns(message.computed), _receipts(message.consumed))
    except MalformedPayloadError:
        return Recorded(payload, None)


def _recorded_command(payload: bytes) -> Recorded:
    try:
        message = decode_as(payload, msg.Command)
        return Recorded(payload, to_ns(message.header.stamp), _receipts(message.consumed))
    except MalformedPayloadError:
        return Recorded(payload, None)


def _receipts(consumed: Collection[msg.Consumed]) -> tuple[Receipt, ...]:
    return tuple((receipt.digest, to_ns(receipt.received)) for receipt in consumed)
