"""The guards in emulated followers: they take what is wanted of robots, and tell their drivers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hil.guard.order_of import guard_rules
from hil.guard.reading import read_wanted, read_word
from hil.guard.report import REPORT_NS, node_of, problem_of, values_of
from hil.guard.robot_guard import LOOK_S, Now, RobotGuard
from hil.nodes.node import Outgoing, diagnostics, is_due, outgoing
from hil.scenario.links import Link
from hil.wire import topics
from hil.wire.body_walk import spots_in
from hil.wire.events import Event
from hil.wire.outlet import sender_of
from hil.wire.topics import link_topics
from hil.wire.writing import DriveWriter

_LOOK_NS = round(LOOK_S * 1e9)


class EmulatedGuards:
    """Guards of the followers of a lab, by place from 1 on; they change in place.

    The host's clock stands for the monotonic one as well: the emulator's world goes by it too.
    """

    def __init__(self, links: Sequence[Link], now_ns: int) -> None:
        self._names = [link.follower for link in links]
        self._guards = [RobotGuard(guard_rules(link.scenario, link.bodies[1])) for link in links]
        pairs = [link_topics(link) for link in links]
        self._topics = [pair.cmd_vel for pair in pairs]
        self._writers = [DriveWriter(pair.follower, stamped=pair.stamped) for pair in pairs]
        self._looks_at_frames = any(guard.rules.is_fenced for guard in self._guards)
        self._report_ns = now_ns
        self.due_ns = now_ns

    def hear(self, place: int, event: Event, now_ns: int) -> Iterator[tuple[int, Outgoing]]:
        """Take in what is wanted of a robot; what its driver is told then."""
        now = _moment(now_ns)
        self._guards[place - 1].hear(read_wanted(event.payload), event.origin, now)
        yield from self._said(place, now, heard=True)

    def has_sender(self, place: int) -> bool:
        """Whether a robot has somebody whose commands it takes."""
        return self._guards[place - 1].sender is not None

    def stop(self, event: Event) -> None:
        """Somebody stops everybody."""
        word, who = read_word(event.payload), sender_of(event.origin)
        for guard in self._guards:
            guard.stop("for a reason that cannot be read" if word is None else word, who)

    def arm(self, event: Event, now_ns: int) -> None:
        """Let a robot be driven again, by its name, or all."""
        name = read_word(event.payload)
        for own, guard in zip(self._names, self._guards, strict=True):
            if name in ("", own):
                guard.arm(_moment(now_ns))

    def see(self, frame: bytes) -> None:
        """Take in a frame, where anybody looks at one."""
        if self._looks_at_frames:
            spots = spots_in(frame)
            for guard in self._guards:
                guard.see(spots)

    def look(self, now_ns: int) -> Iterator[tuple[int, Outgoing]]:
        """What drivers are told by the clock alone, by their places."""
        self.due_ns = now_ns + _LOOK_NS
        for place in range(1, len(self._guards) + 1):
            yield from self._said(place, _moment(now_ns))

    def reports(self, now_ns: int) -> Iterator[Outgoing]:
        """Diagnostics of all, when they are due."""
        if not is_due(self._report_ns, REPORT_NS, now_ns):
            return
        self._report_ns, now = now_ns + REPORT_NS, _moment(now_ns)
        for name, guard in zip(self._names, self._guards, strict=True):
            said = diagnostics(node_of(name), now_ns, problem_of(guard, now), values_of(guard, now))
            yield outgoing(topics.DIAGNOSTICS, said, now_ns)

    def _said(self, place: int, now: Now, *, heard: bool = False) -> Iterator[tuple[int, Outgoing]]:
        told = self._guards[place - 1].say(now, heard=heard)
        if told is not None:
            writer = self._writers[place - 1]
            payload = writer.write(told.motion, now.host_ns)
            yield place, Outgoing(self._topics[place - 1], writer.typename, payload, now.host_ns)


def _moment(now_ns: int) -> Now:
    return Now(now_ns, now_ns * 1e-9)
