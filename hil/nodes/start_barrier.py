"""The start barrier: the leader stands until everything behind it is alive and followers have commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from hil.scenario.links import Link, node_names
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.drive_message import drive_type
from hil.wire.events import Event
from hil.wire.messages import decode, decode_as
from hil.wire.topics import link_topics


@dataclass(frozen=True, slots=True)
class Attendance:
    """Who is there: ``well``, nodes whose last report has no problem; ``commanded``, followers by place."""

    well: frozenset[str] = frozenset()
    commanded: frozenset[int] = frozenset()

    def with_command(self, place: int) -> Attendance:
        """The same once a command has reached a follower, whose place counts from 1."""
        return self if place in self.commanded else replace(self, commanded=self.commanded | {place})


NOBODY = Attendance()


class StartBarrier:
    """What has to be before the leader may set off.

    ``needs``: daemons that must be well; where these host a node for each follower of a chain, all of them.
    """

    def __init__(self, needs: frozenset[str], links: Sequence[Link]) -> None:
        self.needs = frozenset(name for need in needs for name in node_names(need, links))
        self._followers = [link.follower for link in links]
        pairs = [link_topics(link) for link in links]
        self._places = {pair.wanted: place for place, pair in enumerate(pairs, start=1)}
        self._drive_type = drive_type(stamped=pairs[0].wanted_stamped)
        self.subscribes = (topics.DIAGNOSTICS, *self._places)

    def after(self, present: Attendance, event: Event) -> Attendance:
        """Attendance after an event on one of the topics in ``subscribes``.

        Raises :class:`~hil.wire.messages.MalformedPayloadError` for a payload that is not what it must be.
        """
        if event.topic == topics.DIAGNOSTICS:
            return self.heard(present, event.payload)
        decode(event.payload, self._drive_type)
        return present.with_command(self._places[event.topic])

    def heard(self, present: Attendance, report: bytes) -> Attendance:
        """Attendance after a diagnostics message.

        Raises :class:`~hil.wire.messages.MalformedPayloadError` for a payload that is none.
        """
        said = {
            status.name.removeprefix("abreast/"): status.level == 0
            for status in decode_as(report, msg.DiagnosticArray).status
        }
        well = {name for name, is_well in said.items() if is_well} & self.needs
        now = (present.well - said.keys()) | well
        return present if now == present.well else replace(present, well=now)

    def is_open(self, present: Attendance) -> bool:
        """Whether the leader may set off."""
        return present.well >= self.needs and len(present.commanded) == len(self._followers)

    def waits_for(self, present: Attendance) -> str:
        """What is missing, in words; empty for nothing."""
        missing = sorted(self.needs - present.well)
        if not present.commanded:
            missing.append("a command")
        else:
            missing += [
                f"a command to {follower}"
                for place, follower in enumerate(self._followers, start=1)
                if place not in present.commanded
            ]
        return f"waiting for {', '.join(missing)}" if missing else ""
