from __future__ import annotations

import errno
import os
import threading
from pathlib import Path

from hil.live.disk_sync import DiskSync

PATIENCE = 60.0


def inode(descriptor: int) -> int:
    return os.fstat(descriptor).st_ino


def test_a_file_is_synced_again_and_again_and_the_one_before_once_more(tmp_path: Path) -> None:
    synced: list[int] = []
    often, seen = threading.Event(), threading.Event()

    def sync(descriptor: int) -> None:
        os.fdatasync(descriptor)
        synced.append(inode(descriptor))
        if synced.count(first) >= 3:
            often.set()
        if second in synced:
            seen.set()

    with (tmp_path / "a").open("xb") as one, (tmp_path / "b").open("xb") as two:
        first, second = inode(one.fileno()), inode(two.fileno())
        disk = DiskSync(0.001, sync)
        disk.follow(tmp_path / "a", one.fileno())
        assert often.wait(PATIENCE)
        one.write(b"the end")
        one.close()
        synced.clear()
        disk.follow(tmp_path / "b", two.fileno())
        assert seen.wait(PATIENCE)
    disk.close()
    disk.close()
    assert synced.index(first) <= synced.index(second)
    assert tmp_path.stat().st_ino in synced
    assert synced[-1] == second
    assert disk.failure == ""


def test_a_disk_that_refuses_is_told_of(tmp_path: Path) -> None:
    def broken(_descriptor: int) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    with (tmp_path / "a").open("xb") as file:
        disk = DiskSync(1000.0, broken)
        disk.follow(tmp_path / "a", file.fileno())
        disk.close()
    assert disk.failure == "Input/output error"
