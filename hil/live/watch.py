"""What a run's supervisor knows of the run while it goes on, from what passes on the wire."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass, field

import zenoh

from estimation.tracking import Status
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import MalformedPayloadError, decode_as, to_ns
from hil.wire.topics import Topics

_STILL_V = 0.01
_STILL_U = 0.05


@dataclass(slots=True)
class Picture:
    """The newest of everything. ``heard``: when each daemon last reported (monotonic seconds)."""

    heard: dict[str, float] = field(default_factory=dict)
    problems: dict[str, str] = field(default_factory=dict)
    motion_since_ns: int | None = None
    estimate: msg.LeaderEstimate | None = None
    command: msg.Command | None = None
    truth: msg.Truth | None = None

    @property
    def standing(self) -> bool:
        """Whether both robots stand, as far as wheel encoders can tell."""
        truth = self.truth
        return truth is not None and (
            max(abs(truth.v1), abs(truth.v2)) < _STILL_V and max(abs(truth.u1), abs(truth.u2)) < _STILL_U
        )

    def silent(self, names: Iterable[str], patience: float) -> str | None:
        """A daemon that has reported before but not in the last ``patience`` [s]."""
        now = time.monotonic()
        return next((n for n in names if n in self.heard and now - self.heard[n] > patience), None)

    def line(self, elapsed: float, duration: float) -> str:
        """One line for the person who watches."""
        parts = [f"{elapsed:5.1f} / {duration:g} s"]
        if self.estimate is not None:
            seen = self.estimate
            parts.append(f"{Status(seen.status).name.lower():12s}")
            parts.append(f"rho {seen.rho:.3f} m  v1 {seen.v1 * 1e3:4.0f} mm/s  alpha1 {seen.alpha1:+.2f} rad")
        if self.command is not None:
            sent = self.command
            parts.append(sent.stop or f"v2 {sent.v2:+.3f} m/s  u2 {sent.u2:+.2f} rad/s")
        return "  ".join(parts)


class Watch:
    """Keeps a :class:`Picture` up to date from a session's subscriptions."""

    def __init__(self, session: zenoh.Session, names: Topics) -> None:
        self.picture = Picture()
        self._lock = threading.Lock()
        self._latest: dict[str, bytes] = {}
        self._subscribers = [
            session.declare_subscriber(topics.DIAGNOSTICS, self._on_diagnostics),
            *(
                session.declare_subscriber(topic, self._keep)
                for topic in (names.estimate, names.command, topics.TRUTH)
            ),
        ]
        self._names = names

    def look(self) -> Picture:
        """The picture as of now. Payloads are decoded here, not in Zenoh's threads."""
        with self._lock:
            latest, self._latest = self._latest, {}
        picture = self.picture
        try:
            if self._names.estimate in latest:
                picture.estimate = decode_as(latest[self._names.estimate], msg.LeaderEstimate)
            if self._names.command in latest:
                picture.command = decode_as(latest[self._names.command], msg.Command)
            if topics.TRUTH in latest:
                picture.truth = decode_as(latest[topics.TRUTH], msg.Truth)
        except (MalformedPayloadError, ValueError):
            pass  # somebody else's noise; those who act on these topics count it
        return picture

    def close(self) -> None:
        """Stop watching."""
        for subscriber in self._subscribers:
            subscriber.undeclare()  # type: ignore[no-untyped-call]
        self._subscribers.clear()

    def _keep(self, sample: zenoh.Sample) -> None:
        with self._lock:
            self._latest[str(sample.key_expr)] = sample.payload.to_bytes()

    def _on_diagnostics(self, sample: zenoh.Sample) -> None:
        try:
            report = decode_as(sample.payload.to_bytes(), msg.DiagnosticArray)
            stamp_ns = to_ns(report.header.stamp)
        except MalformedPayloadError:
            return
        for status in report.status:
            name = status.name.removeprefix("abreast/")
            self.picture.heard[name] = time.monotonic()
            self.picture.problems[name] = status.message if status.level else ""
            for value in status.values:
                if name == "emulator" and value.key == "motion_since_ns" and value.value.isdecimal():
                    self.picture.motion_since_ns = min(int(value.value), stamp_ns)
