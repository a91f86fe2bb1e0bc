"""A log as a file for viewers: its messages under ROS names, with transforms and a scene beside them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from heapq import merge
from pathlib import Path
from typing import Any

from mcap.writer import Writer

from hil.errors import UsageError
from hil.log.reader import Log, Record
from hil.log.written_aside import written_aside
from hil.nodes.node import Outgoing
from hil.scenario.schema import Scenario
from hil.scene.lab_scene import LabScene
from hil.wire.messages import definition

FILE = "foxglove.mcap"


@dataclass(slots=True)
class FoxgloveExport:
    """What was written. ``messages``: by topic; ``left_out``: topics that no viewer could read, with why."""

    path: Path
    messages: dict[str, int] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)
    damage: str = ""

    def as_dict(self) -> dict[str, Any]:
        """The same as JSON."""
        return {
            "file": str(self.path),
            "messages": self.messages,
            "left_out": self.left_out,
            "damage": self.damage or None,
        }


@dataclass(frozen=True, slots=True)
class Made:
    """Messages that a replay has made, by their stamps in log time.

    ``instead``: topics on which these take the place of the log's own messages; all else is for the scene
    alone. ``alone``: whether the scene is made of nothing else, as the log has other topics than ours.
    """

    messages: Iterable[Outgoing] = ()
    instead: frozenset[str] = frozenset()
    alone: bool = False


RECORDED = Made()
"""Nothing made: all is in the log."""


def write_foxglove(log: Log, scenario: Scenario, path: Path, made: Made = RECORDED) -> FoxgloveExport:
    """Write all messages of a log, and what the scene of a scenario is, in the order of log time.

    Raises :class:`UsageError` for a damaged log, or if the file cannot be written.
    """
    done = FoxgloveExport(path, damage=log.damage)
    scene = LabScene(scenario)
    topics = [topic for topic in _readable(log, done) if topic.strip("/") not in made.instead]
    told: tuple[Iterable[Outgoing | Record], ...] = (made.messages, log.records(topics))
    with _mcap(path) as writer:
        channels = _Channels(writer, log.definitions, done)
        for each in merge(*told, key=_moment_ns):
            at_ns = _moment_ns(each)
            if isinstance(each, Outgoing):
                kept, heard, publish_ns = each.topic in made.instead, True, at_ns
            else:
                kept, heard, publish_ns = True, not made.alone, each.publish_ns
            if kept:
                channels.add(each.topic, each.typename, each.payload, at_ns, publish_ns)
            if heard:
                channels.add_all(scene.hear(each.topic, each.payload, at_ns))
    return done


def _moment_ns(each: Outgoing | Record) -> int:
    return each.stamp_ns if isinstance(each, Outgoing) else each.log_ns


def ros_name(topic: str) -> str:
    """A topic under its ROS name, which viewers want: with a leading slash."""
    return topic if topic.startswith("/") else f"/{topic}"


def _readable(log: Log, done: FoxgloveExport) -> list[str]:
    readable = []
    for topic, typename in log.topics.items():
        try:
            log.check_encodings([topic])
            _definition(log.definitions, typename)
        except UsageError as error:
            done.left_out[topic] = str(error).partition(": ")[2] or str(error)
            continue
        readable.append(topic)
    return readable


def _definition(definitions: Mapping[str, str], typename: str) -> str:
    return definitions.get(typename) or definition(typename)


class _Channels:
    """Topics of a file, declared as they come."""

    def __init__(self, writer: Any, definitions: Mapping[str, str], done: FoxgloveExport) -> None:
        self._writer, self._definitions, self._done = writer, definitions, done
        self._schemas: dict[str, int] = {}
        self._channels: dict[tuple[str, str], int] = {}

    def add(self, topic: str, typename: str, payload: bytes, log_ns: int, publish_ns: int) -> None:
        """Append a message."""
        channel = self._channels.get((topic, typename))
        if channel is None:
            channel = self._declared(topic, typename)
        self._writer.add_message(channel, log_ns, payload, publish_ns)
        self._done.messages[ros_name(topic)] = self._done.messages.get(ros_name(topic), 0) + 1

    def add_all(self, messages: Iterator[Outgoing]) -> None:
        """Append what is due now."""
        for each in messages:
            self.add(each.topic, each.typename, each.payload, each.stamp_ns, each.stamp_ns)

    def _declared(self, topic: str, typename: str) -> int:
        if typename not in self._schemas:
            text = _definition(self._definitions, typename).encode()
            self._schemas[typename] = self._writer.register_schema(typename, "ros2msg", text)
        channel: int = self._writer.register_channel(ros_name(topic), "cdr", self._schemas[typename])
        self._channels[topic, typename] = channel
        return channel


@contextmanager
def _mcap(path: Path) -> Iterator[Any]:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with written_aside(path) as aside, aside.open("wb") as stream:
            writer: Any = Writer(stream)
            writer.start(profile="ros2", library="abreast")
            yield writer
            writer.finish()
    except OSError as error:
        raise UsageError(
            f"{path}: cannot be written ({error.strerror or error}); give another place"
        ) from None
