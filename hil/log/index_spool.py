"""What goes to the end of a log, kept aside on the disk until then: a run of days has too much for memory."""

from __future__ import annotations

import contextlib
import io
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO

_BLOCK_BYTES = 1 << 20


class IndexSpool:
    """Bytes in their order. ``folder``: of the log, None to keep them in memory.

    They lie in a file without a name, which is gone with the process. Where the disk takes no more of them
    ``lost`` is true, and there are none.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.lost = False
        self._file: IO[bytes] = io.BytesIO()
        if folder is not None:
            try:
                self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115  # it is held for as long as we are
            except OSError:
                self.lost = True

    def add(self, data: bytes) -> None:
        """Keep some more."""
        if self.lost:
            return
        try:
            self._file.write(data)
        except OSError:
            self._lose()

    def size(self) -> int:
        """How many bytes there are to be had; 0 where they are lost."""
        if not self.lost:
            try:
                self._file.flush()
                return self._file.tell()
            except OSError:
                self._lose()
        return 0

    def blocks(self) -> Iterator[bytes]:
        """All that was kept, piece by piece; raises :class:`OSError` where the disk does not give it back."""
        self._file.seek(0)
        while block := self._file.read(_BLOCK_BYTES):
            yield block

    def close(self) -> None:
        """Let go of the file; nothing can be kept after that."""
        self._lose()

    def _lose(self) -> None:
        self.lost = True
        # It may have something left that the disk does not take.
        with contextlib.suppress(OSError):
            self._file.close()
