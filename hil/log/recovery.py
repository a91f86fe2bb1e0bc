"""Making a log whole that was cut off or damaged: all that can be read is copied into one with an index."""

from __future__ import annotations

import mmap
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from hil.errors import AbreastError, UsageError
from hil.log.disk import disk_of
from hil.log.lost_spans import Span
from hil.log.mcap_summary import McapSummary, read_summary
from hil.log.reader import DAMAGE, DamagedLogError, check_mcap
from hil.log.whole_copy import WholeCopy


@dataclass(frozen=True, slots=True)
class Recovery:
    """What came of a recovery.

    ``messages``, ``bytes``: what the new log holds and its size. ``first_ns``, ``last_ns``: log time of its
    first and last message (None without messages). ``complete``: nothing is gone. ``damaged``: something else
    than an end that was cut off is gone. ``lost``: how many messages, None where nobody can know.
    ``lost_bytes``: bytes of the source that could not be used. ``lost_until_ns``: log time up to which lost
    messages reached at least, where the torn part still tells. ``gaps``: in log time, what is gone.
    ``restored``: names of metadata records that were taken from the log's messages, as they were not what was
    written; ``lost_metadata``: of those that are gone.
    """

    messages: int
    bytes: int
    first_ns: int | None
    last_ns: int | None
    complete: bool
    damaged: bool
    lost: int | None
    lost_bytes: int
    lost_until_ns: int | None
    gaps: tuple[Span, ...]
    restored: tuple[str, ...] = ()
    lost_metadata: tuple[str, ...] = ()

    def gaps_s(self) -> list[tuple[float, float]]:
        """The gaps in seconds since the log began, as far as that is known."""
        begin_ns = min(gap.from_ns for gap in self.gaps) if self.gaps else 0
        begin_ns = begin_ns if self.first_ns is None else min(begin_ns, self.first_ns)
        return [((gap.from_ns - begin_ns) * 1e-9, (gap.to_ns - begin_ns) * 1e-9) for gap in self.gaps]

    def said(self) -> str:
        """What is gone, in one line."""
        count = "an unknown number of" if self.lost is None else str(self.lost)
        where = ", ".join(f"{first:.3f} to {last:.3f} s" for first, last in self.gaps_s())
        names = f", and the metadata {', '.join(self.lost_metadata)}" if self.lost_metadata else ""
        gone = f"{count} messages{names} are gone, {self.messages} are kept"
        return gone + f" (gone: {where})" * bool(where)


def recover(source: Path, target: Path) -> Recovery:
    """Copy all whole messages and metadata of ``source``, which may be damaged, to the new log ``target``.

    Only the part that was being written when the log was cut off is lost, and chunks that are damaged. A
    whole log gives an equivalent copy. Raises :class:`UsageError` if the source is no MCAP file or nothing of
    it can be read, or the target exists or cannot be created, and :class:`AbreastError` if reading or writing
    fails on the way; there is no target then.
    """
    doubt = _doubt(source)
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
            summary = _summary_of(stream)
            with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
                copy = WholeCopy(written, data, summary)
                copy.take_all()
        if not copy.messages and not copy.is_all():
            raise doubt or UsageError(f"log {source}: holds nothing to recover: no message can be read")
    except OSError as error:
        target.unlink(missing_ok=True)
        reason = error.strerror or str(error)
        raise AbreastError(
            f"log {target}: recovering {source} failed ({reason}) on {disk_of(target)}; make room there"
        ) from error
    except BaseException:
        target.unlink(missing_ok=True)
        raise
    return _account(copy, target)


def _account(copy: WholeCopy, target: Path) -> Recovery:
    complete = copy.is_all()
    return Recovery(
        messages=copy.messages,
        bytes=target.stat().st_size,
        first_ns=copy.first_ns,
        last_ns=copy.last_ns,
        complete=complete,
        damaged=not complete and (copy.damaged or copy.saw_end),
        lost=copy.lost(),
        lost_bytes=copy.lost_bytes,
        lost_until_ns=copy.lost_until_ns,
        gaps=copy.gone.spans(),
        restored=tuple(copy.restored),
        lost_metadata=tuple(copy.lost_metadata),
    )


def _doubt(source: Path) -> DamagedLogError | None:
    """What speaks against a file being a log: its first bytes may be what is damaged."""
    try:
        check_mcap(source)
    except DamagedLogError as error:
        return error
    return None


def _summary_of(stream: BinaryIO) -> McapSummary:
    """What the end of a log tells of it; nothing where it has none that can be read."""
    try:
        summary = read_summary(stream) or McapSummary()
    except (*DAMAGE, OSError):
        return McapSummary()
    if not summary.summed:
        # Nothing tells whether its counts are what was written.
        summary.statistics = None
    return summary
