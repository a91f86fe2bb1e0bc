"""Making a cut-off log whole: everything up to the cut is copied into a new file with an index and an end."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk
from mcap.writer import Writer

from hil.errors import AbreastError, UsageError
from hil.log.mcap_chunks import MAGIC
from hil.log.reader import DAMAGE, check_mcap
from hil.log.writer import LIBRARY

_RECORD_HEAD = struct.Struct("<BQ")
_CHUNK_SPAN = struct.Struct("<QQ")
_UNREADABLE_HEADER = Header(profile="ros2", library="")
_PLAIN_RECORDS: dict[int, type[Header | Schema | Channel | Metadata | Attachment]] = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.METADATA: Metadata,
    Opcode.ATTACHMENT: Attachment,
}


@dataclass(frozen=True, slots=True)
class Recovery:
    """What came of a recovery.

    ``messages``, ``bytes``: what the new log holds and its size. ``last_ns``: log time of its last message
    (None without messages). ``complete``: the source had all its messages, none was lost. ``lost_bytes``:
    bytes of the source that could not be used. ``lost_until_ns``: log time up to which lost messages reached
    at least, where the torn part still tells.
    """

    messages: int
    bytes: int
    last_ns: int | None
    complete: bool
    lost_bytes: int
    lost_until_ns: int | None


def recover(source: Path, target: Path) -> Recovery:
    """Copy all whole messages and metadata of ``source``, which may be cut off, to the new log ``target``.

    Only the part that was being written when the log was cut off is lost. A whole log gives an equivalent
    copy. Raises :class:`UsageError` if the source is no MCAP file or the target exists or cannot be created,
    and :class:`AbreastError` if reading or writing fails on the way; there is no target then.
    """
    check_mcap(source)
    if target.exists() and target.samefile(source):
        raise UsageError(f"log {target}: is the log to recover; give another name for the recovered one")
    try:
        written = target.open("xb")
    except FileExistsError:
        raise UsageError(f"log {target}: exists already; give another name or move it away") from None
    except OSError as error:
        raise UsageError(f"log {target}: cannot be written ({error.strerror}); give another place") from None
    try:
        with written, source.open("rb") as stream:
            copy = _Copy(written)
            copy.take_all(stream, source.stat().st_size)
            copy.finish()
    except OSError as error:
        target.unlink(missing_ok=True)
        reason = error.strerror or str(error)
        raise AbreastError(f"log {target}: recovering {source} failed ({reason}); free the disk") from error
    except BaseException:
        target.unlink(missing_ok=True)
        raise
    return Recovery(
        messages=copy.messages,
        bytes=target.stat().st_size,
        last_ns=copy.last_ns,
        complete=copy.saw_end and not copy.lost_bytes,
        lost_bytes=copy.lost_bytes,
        lost_until_ns=copy.lost_until_ns,
    )


class _Copy:
    """The new log, and the account of what went into it and what didn't."""

    def __init__(self, target: BinaryIO) -> None:
        self._writer = Writer(target)
        self._started = False
        self._schema_ids: dict[int, int] = {0: 0}
        self._channel_ids: dict[int, int] = {}
        self.messages = 0
        self.last_ns: int | None = None
        self.saw_end = False
        self.lost_bytes = 0
        self.lost_until_ns: int | None = None

    def take_all(self, stream: BinaryIO, size: int) -> None:
        """Take every whole record of the source's data section."""
        stream.seek(len(MAGIC))
        used = len(MAGIC)
        for opcode, body in _whole_records(stream, size):
            used = stream.tell()
            if opcode == Opcode.DATA_END:
                self.saw_end = True
                return
            try:
                records = _parse(opcode, body)
            except DAMAGE:
                self._lose(len(body), opcode, body)
                continue
            for record in records:
                self._take(record)
        stream.seek(used)
        torn = stream.read()
        if torn:
            self._lose(len(torn), torn[0], torn[_RECORD_HEAD.size :])

    def finish(self) -> None:
        """Write the index and the end of the new log."""
        self._start(_UNREADABLE_HEADER)
        self._writer.finish()  # type: ignore[no-untyped-call]  # the package leaves it unannotated

    def _start(self, header: Header) -> None:
        if not self._started:
            self._writer.start(profile=header.profile, library=LIBRARY)
            self._started = True

    def _take(self, record: McapRecord) -> None:
        self._start(record if isinstance(record, Header) else _UNREADABLE_HEADER)
        if isinstance(record, Message):
            self._take_message(record)
        elif isinstance(record, Schema) and record.id not in self._schema_ids:
            self._schema_ids[record.id] = self._writer.register_schema(
                record.name, record.encoding, record.data
            )
        elif isinstance(record, Channel) and record.id not in self._channel_ids:
            if record.schema_id in self._schema_ids:
                self._channel_ids[record.id] = self._writer.register_channel(
                    record.topic,
                    record.message_encoding,
                    self._schema_ids[record.schema_id],
                    record.metadata,
                )
        elif isinstance(record, Metadata):
            self._writer.add_metadata(record.name, record.metadata)
        elif isinstance(record, Attachment):
            self._writer.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )

    def _take_message(self, message: Message) -> None:
        channel_id = self._channel_ids.get(message.channel_id)
        if channel_id is None:
            self.lost_bytes += len(message.data)
            return
        self._writer.add_message(
            channel_id, message.log_time, message.data, message.publish_time, message.sequence
        )
        self.messages += 1
        self.last_ns = max(message.log_time, self.last_ns or 0)

    def _lose(self, count: int, opcode: int, body: bytes) -> None:
        self.lost_bytes += count
        if opcode == Opcode.CHUNK and len(body) >= _CHUNK_SPAN.size:
            _, last_ns = _CHUNK_SPAN.unpack_from(body)
            self.lost_until_ns = max(last_ns, self.lost_until_ns or 0)


def _whole_records(stream: BinaryIO, size: int) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and body of the records from here on, up to the first that isn't there whole."""
    while len(head := stream.read(_RECORD_HEAD.size)) == _RECORD_HEAD.size:
        opcode, length = _RECORD_HEAD.unpack(head)
        if length > size - stream.tell():
            return
        yield opcode, stream.read(length)


def _parse(opcode: int, body: bytes) -> list[McapRecord]:
    """Return the records that matter for a copy; raises one of DAMAGE for a body that makes no sense."""
    data = ReadDataStream(BytesIO(body))
    if opcode == Opcode.CHUNK:
        return breakup_chunk(Chunk.read(data), validate_crc=True)
    if opcode == Opcode.MESSAGE:
        return [Message.read(data, len(body))]
    kind = _PLAIN_RECORDS.get(opcode)
    return [kind.read(data)] if kind else []
