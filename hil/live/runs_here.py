"""Live runs of this machine and user, by a small file each, so that who wants to stop them finds them.

A file is locked for as long as its run goes on: the kernel takes the lock back however the run ends, so that
one that was killed is not taken for one that goes on. It has no secrets; keys are for whoever joins to bring.
"""

from __future__ import annotations

import fcntl
import os
import stat
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import msgspec

from hil.errors import UsageError
from hil.wire.session import Endpoints

_LARGEST = 65536
"""Bytes of a file that is read."""


@dataclass(frozen=True, slots=True)
class RunHere:
    """A live run: where its wire is joined, its process, when it began [s since 1970], and its scenario.

    ``endpoint``: to connect to; where it is empty ``zenoh_config`` is the file to join by. All paths are
    absolute.
    """

    endpoint: str
    zenoh_config: str
    pid: int
    started_s: float
    scenario: str

    @property
    def has_keys(self) -> bool:
        """Whether nobody joins without keys."""
        return self.endpoint.startswith("tls/")

    @property
    def options(self) -> str:
        """What to give to a command that is to join it."""
        if not self.endpoint:
            return f"--zenoh-config {self.zenoh_config}"
        return f"--connect {self.endpoint}{' --secure DIR' if self.has_keys else ''}"


def runtime_folder(environment: Mapping[str, str], user: int) -> Path:
    """Where the files of a user's runs are: below his runtime folder, or that of the machine for all."""
    for given in (environment.get("XDG_RUNTIME_DIR", ""), f"/run/user/{user}"):
        if given and Path(given).is_dir() and os.access(given, os.W_OK | os.X_OK):
            return Path(given) / "abreast"
    return Path(tempfile.gettempdir()) / f"abreast-{user}"


def own_folder() -> Path:
    """The same of ours."""
    return runtime_folder(os.environ, os.getuid())


@contextmanager
def found_here(joining: Endpoints, scenario: Path, folder: Path) -> Iterator[None]:
    """Let others find a run for as long as the block lasts; where no file can be it goes on without."""
    config = str(joining.config_file.absolute()) if joining.config_file else ""
    run = RunHere(joining.connect or "", config, os.getpid(), time.time(), str(scenario.absolute()))
    path = folder / f"run-{run.pid}-{time.monotonic_ns()}.json"
    aside = path.with_suffix(".unfinished")
    descriptor = -1
    try:
        # A name that is no text cannot be told; it is refused by who is to read it.
        with suppress(OSError, UnicodeEncodeError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if _is_ours(folder):
                descriptor = os.open(aside, os.O_CREAT | os.O_WRONLY | os.O_TRUNC | os.O_NOFOLLOW, 0o600)
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                os.write(descriptor, msgspec.json.encode(run))
                # Nobody sees it before it is locked and whole.
                aside.replace(path)
        yield
    finally:
        if descriptor >= 0:
            with suppress(OSError):
                aside.unlink(missing_ok=True)
                path.unlink(missing_ok=True)
            os.close(descriptor)


def runs_here(folder: Path) -> list[RunHere]:
    """Runs that go on, the oldest first; what others may have put there is not believed."""
    if not _is_ours(folder):
        return []
    runs = (_run_in(path) for path in sorted(folder.glob("run-*.json")))
    return sorted((run for run in runs if run is not None), key=lambda run: run.started_s)


def _is_ours(folder: Path) -> bool:
    """Whether it is a folder of ours to which nobody else may write."""
    try:
        found = folder.lstat()
    except OSError:
        return False
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o022


def _run_in(path: Path) -> RunHere | None:
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return None
    try:
        if os.fstat(descriptor).st_uid != os.getuid():
            return None
        try:
            fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return _read(os.read(descriptor, _LARGEST))
        # Who left it is gone.
        path.unlink(missing_ok=True)
    except OSError:
        return None
    finally:
        os.close(descriptor)
    return None


def _read(text: bytes) -> RunHere | None:
    """The run that a file tells of; None for what tells of none."""
    try:
        run = msgspec.json.decode(text, type=RunHere)
        Endpoints(connect=run.endpoint or None)
    except (msgspec.DecodeError, UsageError):
        return None
    return run if run.endpoint or run.zenoh_config else None
