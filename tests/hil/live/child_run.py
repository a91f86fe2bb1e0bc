"""An ``abreast run`` as a child process, and an ear on its wire: tests wait for events, not for times."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.nodes.findings import findings_in
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import decode_as
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints, close_session, open_session

PATIENCE = 300.0
"""For what takes a few seconds on a machine that has nothing else to do [s]."""

DRIVING_V = 0.03


@dataclass
class Run:
    """A run, the folder of its results, where its router listens, and how many daemons it has."""

    folder: Path
    endpoint: str
    process: subprocess.Popen[str]
    size: int

    @property
    def log(self) -> Path:
        return self.folder / "run.mcap"

    def daemons(self) -> dict[str, int]:
        """Process ids of the run's daemons by name."""
        found = {}
        for entry in Path("/proc").iterdir():
            if not entry.name.isdecimal():
                continue
            try:
                words = (entry / "cmdline").read_bytes().split(b"\0")
            except OSError:
                continue
            if str(self.folder / "scenario.toml").encode() in words:
                found[words[3].decode()] = int(entry.name)
        return found

    def wait_until(self, what: Callable[[], object]) -> None:
        """Wait while the run goes on."""
        deadline = time.monotonic() + PATIENCE
        while not what():
            assert self.process.poll() is None, self.process.communicate()[1]
            assert time.monotonic() < deadline, "waited in vain"
            time.sleep(0.05)

    def wait_until_driving(self, *truths: str) -> None:
        """Wait until leader and follower of every pair drive: ``truths`` are the topics that tell."""
        self.wait_until(lambda: len(self.daemons()) == self.size)
        driving: set[str] = set()

        def look() -> bool:
            while (event := wire.inbox.take(0.0)) is not None:
                moving = decode_as(event.payload, msg.Truth)
                if min(moving.v1, moving.v2) > DRIVING_V:
                    driving.add(event.topic)
            return driving == set(truths)

        with self.listening(*truths) as wire:
            self.wait_until(look)

    def wait_until_found(self, node: str, name: str) -> None:
        """Wait until a node reports a finding."""

        def look() -> bool:
            while (event := wire.inbox.take(0.0)) is not None:
                found = findings_in(decode_as(event.payload, msg.DiagnosticArray))
                if name in found.get(node, {}):
                    return True
            return False

        with self.listening(topics.DIAGNOSTICS) as wire:
            self.wait_until(look)

    @contextmanager
    def listening(self, *names: str) -> Iterator[Wire]:
        """A wire of our own to the run's router, with an inbox of these topics."""
        session = open_session(Endpoints(connect=self.endpoint), patience=PATIENCE)
        wire = Wire(session)
        try:
            wire.subscribe(names)
            yield wire
        finally:
            wire.close()
            close_session(session)

    def finish(self) -> tuple[int, dict[str, Any], str]:
        """Exit code, summary and words of the ended run."""
        out, err = self.process.communicate(timeout=PATIENCE)
        return self.process.returncode, json.loads(out) if out.strip() else {}, err
