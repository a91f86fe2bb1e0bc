"""What goes to the end of a log, kept aside on the disk until then: a run of days has too much for memory."""

from __future__ import annotations

import io
import tempfile
from pathlib import Path
from typing import IO


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

    def all(self) -> bytes:
        """All that was kept; nothing where it is lost."""
        if not self.lost:
            try:
                self._file.flush()
                self._file.seek(0)
                return self._file.read()
            except OSError:
                self._lose()
        return b""

    def close(self) -> None:
        """Let go of the file; nothing can be kept after that."""
        self._lose()

    def _lose(self) -> None:
        self.lost = True
        try:
            self._file.close()
        except OSError:
            # It had something left to write.
            return
