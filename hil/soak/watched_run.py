"""A live run as a process of its own, and the memory of each of its processes while it goes on."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.live.process_table import memory_mb, pids_with
from hil.soak.memory import Sample

_EACH_S = 5.0
_LOOK_S = 0.2

SUPERVISOR = "run"
"""What the process of the supervisor is called, which is the router too."""


@dataclass(frozen=True, slots=True)
class WatchedRun:
    """How a run ended: its exit code, its summary (empty where it told none) and what it said at its end.

    ``memory``: samples of each of its processes, by its name. ``interrupted``: by Ctrl-C, before its time.
    """

    code: int
    summary: dict[str, Any]
    said: str
    memory: dict[str, list[Sample]]
    interrupted: bool = False


def watched_run(arguments: Sequence[str], folder: Path, say: Callable[[float, str], None]) -> WatchedRun:
    """Run ``abreast run ARGUMENTS --out FOLDER --json`` to its end, whatever comes, and watch it.

    ``say`` gets the time [s] since it was begun and what each process holds, with each sample. Ctrl-C ends
    the run, which leaves its verdict, and is not raised. The memory that the verdict itself takes, once the
    daemons have ended, is not among the samples.
    """
    memory: dict[str, list[Sample]] = {}
    with tempfile.TemporaryFile() as told, tempfile.TemporaryFile() as words:
        command = [sys.executable, "-m", "hil", "run", *arguments, "--out", str(folder), "--json"]
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=told, stderr=words, start_new_session=True
        )
        interrupted = False
        try:
            _sample(process, folder, time.monotonic(), memory, say)
        except KeyboardInterrupt:
            interrupted = True
            process.send_signal(signal.SIGINT)
        finally:
            code = _ended(process)
        told.seek(0)
        words.seek(0)
        result = told.read().decode(errors="replace").strip()
        lines = words.read().decode(errors="replace").strip().splitlines()
    summary = json.loads(result) if result else {}
    return WatchedRun(code, summary, lines[-1] if lines else "", memory, interrupted)


def _sample(
    process: subprocess.Popen[bytes],
    folder: Path,
    begun_s: float,
    memory: dict[str, list[Sample]],
    say: Callable[[float, str], None],
) -> None:
    due_s = begun_s
    while process.poll() is None:
        if (now_s := time.monotonic()) >= due_s:
            due_s += _EACH_S
            held = {name: memory_mb(pid) for name, pid in _processes(folder).items()}
            if held.keys() <= {SUPERVISOR}:
                continue
            for name, mb in held.items():
                if mb > 0.0:
                    memory.setdefault(name, []).append(Sample(now_s - begun_s, mb))
            say(now_s - begun_s, ", ".join(f"{name} {mb:.0f} MB" for name, mb in sorted(held.items())))
        time.sleep(_LOOK_S)


def _processes(folder: Path) -> dict[str, int]:
    """Processes of the run by their names; where several serve followers, by whom each serves."""
    found = {}
    for pid, words in sorted(pids_with(str(folder)).items()):
        if "hil" not in words or words[words.index("hil") - 1] != "-m":
            continue
        daemon, *rest = words[words.index("hil") + 1 :]
        if daemon == "soak":
            continue
        served = [rest[at + 1] for at, word in enumerate(rest[:-1]) if word == "--follower"]
        name = "-".join([daemon, *served])
        found[name if name not in found else f"{name}-{pid}"] = pid
    return found


def _ended(process: subprocess.Popen[bytes]) -> int:
    """Exit code of a run that is at its end: it may have hours to judge. A further Ctrl-C kills it."""
    try:
        return process.wait()
    except KeyboardInterrupt:
        # Its daemons end with it.
        process.kill()
        return process.wait()
