"""A log in pieces, for runs of hours: each piece is a log by itself, and their folder is read as one.

The pieces of ``run.mcap`` are ``run/run_0.mcap``, ``run/run_1.mcap`` and so on, as ``ros2 bag record`` names
them.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from hil.errors import UsageError
from hil.log.described_log import DescribedLog
from hil.scenario.lab import RecorderSection


def log_place(path: Path, recorder: RecorderSection) -> Path:
    """Where a log is that is called by a path: there, or in a folder of pieces with that name."""
    return path.with_suffix("") if recorder.rotates else path


def pieces_of(place: Path) -> list[Path]:
    """The files of a log, in their order; empty if it is not there."""
    if not place.is_dir():
        return [place] if place.exists() else []
    found = [each for each in place.glob(f"{place.name}_*.mcap") if _number(each) is not None]
    return sorted(found, key=lambda each: _number(each) or 0)


class RotatingLog:
    """A :class:`DescribedLog` that is ended, and begun anew in the next piece, by its size and its time.

    Not for use from several threads. Raises as that.
    """

    def __init__(
        self, path: Path, metadata: Mapping[str, Mapping[str, str]], recorder: RecorderSection
    ) -> None:
        self._place, self._recorder = log_place(path, recorder), recorder
        self._metadata = dict(metadata)
        self._number = 0
        self._earlier = 0
        self._since_ns: int | None = None
        if recorder.rotates:
            try:
                self._place.mkdir()
            except FileExistsError:
                raise UsageError(
                    f"log {self._place}: exists already; give another name or move it away"
                ) from None
            except OSError as error:
                raise UsageError(
                    f"log {self._place}: cannot be made ({error.strerror}); give another place"
                ) from None
        self.log = DescribedLog(self._file(), self._metadata)

    @property
    def messages(self) -> int:
        """How many messages were taken, in all pieces."""
        return self._earlier + self.log.messages

    def write(self, topic: str, typename: str, payload: bytes, log_ns: int, publish_ns: int) -> None:
        """Append a message, in the next piece if this one is full."""
        if self._since_ns is None:
            self._since_ns = log_ns
        elif self._is_full(log_ns - self._since_ns):
            self._begin_next()
            self._since_ns = log_ns
        self.log.write(topic, typename, payload, log_ns, publish_ns)

    def add_metadata(self, metadata: Mapping[str, Mapping[str, str]]) -> None:
        """Write more metadata records, at once and in all pieces to come."""
        self._metadata |= metadata
        self.log.add_metadata(metadata)

    def flush(self) -> None:
        """As that of the piece."""
        self.log.flush()

    def close(self) -> None:
        """Finish the file; further calls do nothing."""
        self.log.close()

    def _is_full(self, span_ns: int) -> bool:
        most_bytes, most_ns = self._recorder.rotate_mb * 1e6, self._recorder.rotate_s * 1e9
        return 0.0 < most_bytes <= self.log.bytes or 0.0 < most_ns <= span_ns

    def _begin_next(self) -> None:
        before = self.log
        before.close()
        self._earlier += before.messages
        self._number += 1
        self.log = DescribedLog(self._file(), self._metadata, begun_ns=before.begun_ns)

    def _file(self) -> Path:
        if not self._recorder.rotates:
            return self._place
        return self._place / f"{self._place.name}_{self._number}.mcap"


def _number(piece: Path) -> int | None:
    number = piece.stem.rpartition("_")[2]
    return int(number) if number.isdecimal() else None
