"""What a run's supervisor knows of the run while it goes on, from what passes on the wire."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, TypeVar

import zenoh

from estimation.tracking.tracker import Status
from formation.pose import Motion
from hil.guard.report import GUARDS
from hil.nodes.at_rest import stands
from hil.nodes.findings import Findings, findings_in
from hil.nodes.leader_driver import stop_reason
from hil.nodes.reported_number import reported_number
from hil.scenario.links import STARTERS
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.intake import Intake
from hil.wire.key_layout import OURS, KeyLayout
from hil.wire.messages import MalformedPayloadError, decode_as, to_ns
from hil.wire.newest import Newest
from hil.wire.outlet import origin_of, sender_of
from hil.wire.topics import Topics
from hil.wire.undeclare import undeclare

M = TypeVar("M", bound=msg.Message)

_LONGEST_GLANCE = 0.25
_COMPILES_S = 15.0
"""Between two looks [s]; more than this says that the machine stood still."""
_MOST_NAMES = 4096
"""Nodes of which something is kept: anybody may report under any name."""


class Held(NamedTuple):
    """Whom a guard holds its robot for, and why, in words."""

    who: str
    text: str


@dataclass(slots=True, eq=False)
class Snapshot:
    """The newest of everything, by the follower that it is of.

    ``followers``: their names from the leader on. ``observed_s``: for how long we have looked. ``heard``: at
    which ``observed_s`` each node last reported, ``problems``: what it said, ``findings``: what it found.
    ``wheels``: what real robots say of their own motion, by topic. ``stopped``: by what stop, ``stopped_by``
    whom. ``held``: why guards let robots be driven no more, by their nodes.
    """

    followers: tuple[str, ...] = ()
    observed_s: float = 0.0
    heard: dict[str, float] = field(default_factory=dict)
    problems: dict[str, str] = field(default_factory=dict)
    findings: dict[str, Findings] = field(default_factory=dict)
    motion_since_ns: int | None = None
    stopped: str | None = None
    stopped_by: str = ""
    held: dict[str, Held] = field(default_factory=dict)
    estimates: dict[str, msg.LeaderEstimate] = field(default_factory=dict)
    certified: dict[str, msg.CertifiedEstimate] = field(default_factory=dict)
    commands: dict[str, msg.Command] = field(default_factory=dict)
    truths: dict[str, msg.Truth] = field(default_factory=dict)
    wheels: dict[str, Motion] = field(default_factory=dict)

    @property
    def standing(self) -> bool:
        """Whether all robots stand, as far as wheel encoders can tell."""
        truths = self.truths.values()
        return len(truths) == len(self.followers) and all(
            stands(Motion(truth.v1, truth.u1)) and stands(Motion(truth.v2, truth.u2)) for truth in truths
        )

    def stands(self, wheels: str) -> bool:
        """Whether a real robot says that it stands, by the topic of its odometry."""
        motion = self.wheels.get(wheels)
        return motion is not None and stands(motion)

    def waits_for(self, names: Iterable[str]) -> str:
        """What the start waits for, in words, empty for nothing that anybody tells.

        ``names``: the nodes that are needed.
        """
        unheard = [name for name in names if name not in self.heard]
        if unheard:
            patience = " yet; a first start compiles for minutes" if self.observed_s > _COMPILES_S else ""
            return f"nothing was heard of {', '.join(unheard)}{patience}"
        # A copy: Zenoh's thread may add to it meanwhile.
        said = list(self.problems.items())
        return "; ".join(f"{name}: {problem}" for name, problem in said if problem)

    def silent(self, names: Iterable[str], patience: float) -> str | None:
        """A node that has reported before but not in the last ``patience`` [s]."""
        since = self.observed_s - patience
        return next((n for n in names if n in self.heard and self.heard[n] < since), None)

    def advance(self, seconds: float) -> None:
        """Time has passed. Where it was long, we stood still too: the daemons may not be to blame."""
        self.observed_s += min(seconds, _LONGEST_GLANCE)

    def line(self, elapsed: float, duration: float) -> str:
        """One line for the person who watches."""
        parts = [f"{elapsed:5.1f} / {duration:g} s"]
        parts += self._of_chain() if len(self.followers) > 1 else self._of_pair()
        return "  ".join(parts)

    def _of_pair(self) -> Iterator[str]:
        for seen in self.estimates.values():
            yield f"{Status(seen.status).name.lower():12s}"
            yield f"rho {seen.rho:.3f} m  v1 {seen.v1 * 1e3:4.0f} mm/s  alpha1 {seen.alpha1:+.2f} rad"
        for sure in self.certified.values():
            yield sure.failed or f"certain to {sure.radius_v1 * 1e3:3.0f} mm/s, {sure.radius_alpha1:.2f} rad"
        for sent in self.commands.values():
            yield sent.stop or f"v2 {sent.v2:+.3f} m/s  u2 {sent.u2:+.2f} rad/s"

    def _of_chain(self) -> Iterator[str]:
        seen = [self.estimates[name] for name in self.followers if name in self.estimates]
        tracking = sum(each.status == Status.TRACKING for each in seen)
        yield f"{tracking} of {len(self.followers)} tracking"
        yield f"rho {' '.join(f'{each.rho:.3f}' for each in seen)} m"
        sent = [self.commands[name] for name in self.followers if name in self.commands]
        yield f"v2 {' '.join(each.stop or f'{each.v2:+.3f}' for each in sent)} m/s"


class RunMonitor:
    """Keeps a :class:`Snapshot` up to date from a session's subscriptions.

    Zenoh keeps the newest payload of a topic for us: Python is not called for each one of a long chain's.
    ``wheels``: topics of the odometry that is to be looked at.
    """

    def __init__(
        self,
        session: zenoh.Session,
        pairs: Sequence[Topics],
        layout: KeyLayout = OURS,
        wheels: Sequence[str] = (),
    ) -> None:
        self.snapshot = Snapshot(tuple(pair.follower for pair in pairs))
        self._updated_at = time.monotonic()
        self._intake = Intake()
        self._diagnostics = session.declare_subscriber(layout.heard(topics.DIAGNOSTICS), self._on_diagnostics)
        told = (topic for pair in pairs for topic in _told_of(pair))
        self._newest = Newest(session, layout, dict.fromkeys((topics.STOP, *wheels, *told), 1))
        self._pairs, self._wheels = pairs, wheels

    def update(self) -> Snapshot:
        """The snapshot as of now. Payloads are decoded here, not in Zenoh's threads."""
        came = {event.topic: event for event in self._newest.take()}
        latest = {topic: event.payload for topic, event in came.items()}
        snapshot, now = self.snapshot, time.monotonic()
        snapshot.advance(now - self._updated_at)
        self._updated_at = now
        if topics.STOP in latest and snapshot.stopped is None:
            snapshot.stopped = stop_reason(latest[topics.STOP])
            snapshot.stopped_by = sender_of(came[topics.STOP].origin)
        for pair in self._pairs:
            who = pair.follower
            if seen := _sound(latest, pair.estimate, msg.LeaderEstimate):
                # A status that does not exist can't be shown either.
                with contextlib.suppress(ValueError):
                    snapshot.estimates[who] = replace(seen, status=Status(seen.status))
            if sure := _sound(latest, pair.certified, msg.CertifiedEstimate):
                snapshot.certified[who] = sure
            if sent := _sound(latest, pair.command, msg.Command):
                snapshot.commands[who] = sent
            if true := _sound(latest, pair.truth, msg.Truth):
                snapshot.truths[who] = true
        for topic in self._wheels:
            if turned := _sound(latest, topic, msg.Odometry):
                twist = turned.twist.twist
                snapshot.wheels[topic] = Motion(twist.linear.x, twist.angular.z)
        return snapshot

    def close(self) -> None:
        """End the subscriptions."""
        undeclare(self._diagnostics)
        self._newest.close()

    def _on_diagnostics(self, sample: zenoh.Sample) -> None:
        said = Event(topics.DIAGNOSTICS, sample.payload.to_bytes(), origin_of(sample))
        if not self._intake.takes(said, time.monotonic_ns()):
            return
        try:
            report = decode_as(said.payload, msg.DiagnosticArray)
            stamp_ns = to_ns(report.header.stamp)
        except MalformedPayloadError:
            return
        found = findings_in(report)
        for status in report.status:
            name = status.name.removeprefix("abreast/")
            if name not in self.snapshot.heard and len(self.snapshot.heard) >= _MOST_NAMES:
                continue
            self.snapshot.findings[name] = found[name]
            self.snapshot.heard[name] = self.snapshot.observed_s
            self.snapshot.problems[name] = status.message if status.level else ""
            told = {value.key: value.value for value in status.values if value.key.startswith("latched")}
            if name.startswith(GUARDS) and told.get("latched"):
                self.snapshot.held[name] = Held(told.get("latched_by", ""), status.message)
            else:
                self.snapshot.held.pop(name, None)
            for value in status.values:
                if name not in STARTERS or value.key != "motion_since_ns":
                    continue
                if (since_ns := reported_number(value.value)) is not None:
                    self.snapshot.motion_since_ns = min(since_ns, stamp_ns)


def _told_of(pair: Topics) -> tuple[str, ...]:
    return pair.estimate, pair.certified, pair.command, pair.truth


def _sound(latest: Mapping[str, bytes], topic: str, kind: type[M]) -> M | None:
    """The newest message of a topic; what can't be decoded is for those to count who act on it."""
    if topic not in latest:
        return None
    with contextlib.suppress(MalformedPayloadError):
        return decode_as(latest[topic], kind)
    return None
