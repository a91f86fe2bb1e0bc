"""When a log can only be fed to an estimator, its inputs in log order, and why.

Receipts say which inputs an output rests on, and the log's scenario who made it. Where other tools left the
scenario out or changed the inputs, neither leads back to what happened: what is there can still be estimated
from, but nothing can be verified.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Sequence

from hil.errors import UsageError
from hil.log.events import Receipt
from hil.log.reader import Log
from hil.scenario.files import Overrides, load_scenario, with_overrides
from hil.scenario.links import Link, refuse_chain
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import MalformedPayloadError, decode_as, typename_of

BASE = "turtlebot3"
"""Scenario for logs that do not say by which they were made."""

_BESIDE_NS = 100_000_000
_FOLLOWERS_OWN = ("leader_estimate", "certified", "command", "leader_sighting")
_FRAMES_TO_LOOK_AT = 1000


def why_edited(consumed: Iterable[Receipt], logged: Iterable[Receipt]) -> str:
    """Why receipts do not lead to the inputs of a log; empty if they do, or if inputs are merely missing.

    ``consumed``: what outputs say that they rest on. ``logged``: digest and log time [ns] of each input. A
    consumed input that is not there was edited if another one, which nobody consumed, was logged about when
    it was taken in; if the most part is not there, whenever the others were logged.
    """
    received = dict(consumed)
    times: dict[int, int] = dict(logged)
    found = [at_ns for digest, at_ns in received.items() if digest in times]
    first_ns, last_ns = min(found, default=0), max(found, default=2**63)
    gone = [at_ns for digest, at_ns in received.items() if digest not in times]
    others = sorted(at_ns for digest, at_ns in times.items() if digest not in received)
    edited = _pairs(sorted(at_ns for at_ns in gone if first_ns <= at_ns <= last_ns), others)
    if not edited and 2 * len(gone) > len(received) and others:
        edited = len(gone)
    if not edited:
        return ""
    return f"{edited} of the {len(received)} inputs that its estimates rest on have others in their place"


def guessed_link(log: Log, leader: str | None, follower: str | None, *changes: Overrides) -> Link:
    """The pair of a log that has our topics but does not say who made it, by the scenario :data:`BASE`.

    ``leader``, ``follower``: their names, where the topics and the bodies in the frames leave it open.
    Raises :class:`UsageError` if the log does not tell who they are.
    """
    bodies = _bodies(log)
    robots = {name.removesuffix("/odom") for name in log.topics if name.endswith("/odom")}
    told = {
        robot for robot, _, what in (name.rpartition("/") for name in log.topics) if what in _FOLLOWERS_OWN
    }
    base = load_scenario(BASE)
    follower = follower or _only(told) or _only((robots & bodies or robots) - {leader})
    follower = follower or _if_there(base.follower.name, robots)
    leader = leader or _only(bodies - {follower}) or _if_there(base.leader.name, bodies | robots)
    if follower is None or leader is None or follower == leader:
        there = ", ".join(sorted(log.topics)) or "none"
        raise UsageError(
            f"log {log.path}: does not say by which scenario it was made, nor who follows whom; give "
            f"--leader and --follower, or name its topics with --map FILE (topics there: {there})"
        )
    named = {"leader.name": leader, "follower.name": follower}
    if topics.RIGID_BODIES not in log.topics:
        named["estimator.front_end"] = "body"
    scenario = with_overrides(base, named, *changes)
    refuse_chain(scenario, "a log without a scenario is taken for that of a pair; leave out what sets chain")
    return Link(scenario)


def why_guessed(link: Link) -> str:
    """What to say of a log that is fed to the estimator of a guessed pair."""
    scenario = link.scenario
    return (
        f"it does not say by which scenario it was made, {BASE} is taken (leader {scenario.leader.name!r}, "
        f"follower {scenario.follower.name!r}; change that with --set)"
    )


def _pairs(gone: Sequence[int], others: Sequence[int]) -> int:
    """How many of the times have another one of their own beside them; both in order."""
    pairs = at = 0
    for time_ns in gone:
        at = max(at, bisect_left(others, time_ns - _BESIDE_NS))
        if at < len(others) and others[at] <= time_ns + _BESIDE_NS:
            pairs, at = pairs + 1, at + 1
    return pairs


def _bodies(log: Log) -> set[str]:
    """Names of bodies in the first frames."""
    names: set[str] = set()
    if log.topics.get(topics.RIGID_BODIES) != typename_of(msg.RigidBodies):
        return names
    for record, _ in zip(log.records([topics.RIGID_BODIES]), range(_FRAMES_TO_LOOK_AT), strict=False):
        try:
            frame = decode_as(record.payload, msg.RigidBodies)
        except MalformedPayloadError:
            continue
        names.update(body.rigid_body_name for body in frame.rigidbodies)
    return names


def _if_there(name: str, names: set[str]) -> str | None:
    return name if name in names else None


def _only(names: set[str]) -> str | None:
    return next(iter(names)) if len(names) == 1 else None
