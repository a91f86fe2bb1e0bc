"""Writing a run's log: MCAP with ROS 2 messages, safe against a kill, same messages giving same bytes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from hil import __version__
from hil.errors import AbreastError, UsageError
from hil.log import metadata_sums
from hil.log.disk import disk_of
from hil.log.mcap_chunks import ChunkedMcap
from hil.wire.messages import definition, rihs01

LIBRARY = f"abreast {__version__}"
"""What our logs name as the software that wrote them."""

_CHUNK_LIMIT_BYTES = 1 << 20


class LogWriter:
    """A log open for writing. Use as a context manager, or call :meth:`close`.

    The metadata records (name to entries) come first in the file, so that a log that was cut off has them.
    No chunk spans ``flush_every_s`` of log time or more: what is in memory reaches the operating system
    before the first message that far off from any of it is taken. As no clock is looked at, a writer whose
    messages cease for a while should call :meth:`flush`. Not for use from several threads.

    Types and topics are told again every ``repeat_every_s`` of log time (0: never), so that what is damaged
    in front does not take with it what follows. Metadata are followed by their sums.

    Raises :class:`UsageError` if the file exists or can't be created, and :class:`AbreastError` from any
    method once the disk refuses to take more; the file then ends behind what was written before, without a
    summary. ``messages``, ``bytes``: how many were taken, and the size of the file.
    """

    def __init__(
        self,
        path: Path,
        metadata: Mapping[str, Mapping[str, str]],
        flush_every_s: float = 0.2,
        repeat_every_s: float = 1.0,
    ) -> None:
        self.path = path
        self.messages = 0
        self.bytes = 0
        self._flush_every_ns = round(flush_every_s * 1e9)
        # Earliest log time in the open chunk, and the one that it does not reach; equal while it is empty.
        self._first_ns = self._until_ns = 0
        self._repeat_every_ns = round(repeat_every_s * 1e9)
        self._told_ns: int | None = None
        self._sums: dict[str, str] = {}
        self._schema_ids: dict[str, int] = {}
        self._channel_ids: dict[tuple[str, str], int] = {}
        self._failed = False
        self._whole_bytes: int | None = None
        try:
            self._file = path.open("xb", buffering=0)
        except FileExistsError:
            raise UsageError(f"log {path}: exists already; give another name or move it away") from None
        except OSError as error:
            raise UsageError(
                f"log {path}: cannot be written ({error.strerror}); give another place"
            ) from None
        try:
            self._mcap = ChunkedMcap(self._emit, profile="ros2", library=LIBRARY, folder=path.parent)
        except AbreastError:
            self._file.close()
            raise
        try:
            self.add_metadata(metadata)
        except AbreastError:
            self._mcap.close()
            self._file.close()
            raise

    def write(self, topic: str, typename: str, payload: bytes, log_ns: int, publish_ns: int) -> None:
        """Append a message: CDR payload, when it was logged and when it was published."""
        channel_id = self._channel_ids.get((topic, typename))
        if channel_id is None:
            channel_id = self._declare(topic, typename)
        if not self._first_ns <= log_ns < self._until_ns:
            self._make_room(log_ns)
        self.messages += 1
        if self._mcap.add_message(channel_id, log_ns, publish_ns, payload) >= _CHUNK_LIMIT_BYTES:
            self.flush()

    def add_metadata(self, metadata: Mapping[str, Mapping[str, str]]) -> None:
        """Write more metadata records, at once, and the sums of all of them."""
        if not metadata:
            return
        for name, entries in metadata.items():
            self._mcap.add_metadata(name, entries)
        self._sums |= metadata_sums.sums_of(metadata)
        self._mcap.add_metadata(metadata_sums.RECORD, self._sums)

    def descriptor(self) -> int:
        """Descriptor of the file, for as long as it is open."""
        return self._file.fileno()

    @property
    def index_lost(self) -> bool:
        """Whether the file will end without a summary, as the disk did not keep what goes into it."""
        return self._mcap.index_lost

    def flush(self) -> None:
        """Hand everything written so far to the operating system: it then survives a kill of the process."""
        self._mcap.close_chunk()
        self._first_ns = self._until_ns = 0

    def close(self) -> None:
        """Finish the file; further calls do nothing."""
        if self._file.closed:
            return
        try:
            if not self._failed:
                self._mcap.close_chunk()
                # Where the summary does not fit, the data go on to their end all the same.
                self._whole_bytes = self.bytes
                try:
                    self._mcap.finish()
                except OSError as error:
                    raise self._given_up(error) from error
        finally:
            self._mcap.close()
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _make_room(self, log_ns: int) -> None:
        """Let the open chunk begin earlier for a message, or end, so that it spans no more than it may.

        Log times of different topics need not be in order.
        """
        first_ns, last_ns = self._mcap.open_span() or (log_ns, log_ns)
        if max(last_ns, log_ns) - min(first_ns, log_ns) >= self._flush_every_ns:
            self.flush()
            first_ns = log_ns
        if self._first_ns == self._until_ns:
            self._tell_again(log_ns)
        self._first_ns = min(first_ns, log_ns)
        self._until_ns = self._first_ns + self._flush_every_ns

    def _tell_again(self, log_ns: int) -> None:
        """Begin a chunk with all types and topics where that is due."""
        if self._told_ns is None:
            self._told_ns = log_ns
        elif 0 < self._repeat_every_ns <= abs(log_ns - self._told_ns):
            self._mcap.repeat_declarations()
            self._told_ns = log_ns

    def _declare(self, topic: str, typename: str) -> int:
        if typename not in self._schema_ids:
            text = definition(typename).encode()
            self._schema_ids[typename] = self._mcap.add_schema(typename, "ros2msg", text)
        # ROS 2 tools read these two keys; an empty list of profiles makes `ros2 bag play` use its default.
        metadata = {"offered_qos_profiles": "[]", "topic_type_hash": rihs01(typename)}
        channel_id = self._mcap.add_channel(topic, self._schema_ids[typename], "cdr", metadata)
        self._channel_ids[topic, typename] = channel_id
        return channel_id

    def _emit(self, data: bytes) -> None:
        if self._failed:
            raise AbreastError(f"log {self.path}: given up after an earlier write error")
        try:
            self._put(data)
        except OSError as error:
            raise self._given_up(error) from error
        self.bytes += len(data)

    def _given_up(self, error: OSError) -> AbreastError:
        """End the file before its time, as the disk does not take or give what it should."""
        self._failed = True
        reason, disk = error.strerror or str(error), disk_of(self.path)
        whole = self._end_early()
        kept = "it is whole up to there" if whole else "abreast recover keeps what is whole"
        return AbreastError(f"log {self.path}: writing failed ({reason}) on {disk}; {kept}, make room there")

    def _put(self, data: bytes) -> None:
        rest = memoryview(data)
        while rest:
            rest = rest[self._file.write(rest) :]

    def _end_early(self) -> bool:
        """End the file behind the last records that are whole; whether the disk has room for that."""
        try:
            whole_bytes = self.bytes if self._whole_bytes is None else self._whole_bytes
            self._file.truncate(whole_bytes)
            self._file.seek(whole_bytes)
            self._put(ChunkedMcap.bare_end())
        except OSError:
            return False
        return True
