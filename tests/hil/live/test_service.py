"""What systemd hears of daemons that it has started."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hil.live.service import Service
from hil.wire.session import reserved_endpoint
from tests.routers import router

PATIENCE = 60.0
READY = b"READY=1\nSTATUS=takes part"


@pytest.fixture
def ear(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> socket.socket:
    """A socket as systemd makes one; what is started hears of it."""
    ear = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    ear.bind(str(tmp_path / "notify"))
    ear.settimeout(PATIENCE)
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
    return ear


def heard_for(ear: socket.socket, seconds: float) -> list[bytes]:
    """All that is heard until nothing is for so long."""
    ear.settimeout(seconds)
    heard = []
    with contextlib.suppress(TimeoutError):
        while True:
            heard.append(ear.recv(64))
    return heard


def test_it_says_that_it_goes_round_once_it_is_ready_and_not_too_often(ear: socket.socket) -> None:
    ear.settimeout(0.05)
    service = Service()
    with ear:
        service.goes_round(0.0)
        with pytest.raises(TimeoutError):
            ear.recv(64)
        service.ready(1.0)
        for at in range(200):
            service.goes_round(1.0 + at * 0.01)
        service.ends()
        assert [ear.recv(64) for _ in range(6)] == [READY, *[b"WATCHDOG=1"] * 4, b"STOPPING=1"]


def test_a_service_waits_for_its_router_for_ever_and_ends_when_it_is_told(
    ear: socket.socket, tmp_path: Path
) -> None:
    with ear, reserved_endpoint() as nobody:
        assert Service().patience_s("tcp/192.0.2.10:7447") == math.inf
        assert ear.recv(64) == b"STATUS=waits for tcp/192.0.2.10:7447"
        command = [sys.executable, "-m", "hil", "follower", "turtlebot3", "--connect", nobody]
        with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL) as process:
            assert ear.recv(64).startswith(b"STATUS=waits for")
            process.terminate()
            assert process.wait(PATIENCE) == 130


def test_nobody_hears_where_nobody_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    service = Service()
    service.ready(0.0)
    service.goes_round(1.0)
    service.ends()
    assert service.patience_s("tcp/192.0.2.10:7447") < 60.0


@pytest.mark.parametrize(
    "command", [("router", "--listen"), ("recorder", "turtlebot3", "--out", "run.mcap", "--connect")]
)
def test_a_daemon_says_when_it_is_ready_lives_and_ends_and_nothing_while_it_is_frozen(
    command: tuple[str, ...], ear: socket.socket, tmp_path: Path
) -> None:
    with ear, router() as (endpoint, _), reserved_endpoint() as free:
        own = free if command[0] == "router" else endpoint
        process = subprocess.Popen(
            [sys.executable, "-m", "hil", *command, own],
            cwd=tmp_path,
            env={**os.environ, "NOTIFY_SOCKET": ear.getsockname()},
            stderr=subprocess.DEVNULL,
        )
        try:
            if command[0] != "router":
                assert ear.recv(64).startswith(b"STATUS=waits for tcp/")
            assert [ear.recv(64) for _ in range(4)] == [READY, *[b"WATCHDOG=1"] * 3]
            process.send_signal(signal.SIGSTOP)
            time.sleep(0.1)
            # What it said just before.
            assert len(heard_for(ear, 1.5)) <= 1
            assert heard_for(ear, 1.5) == []
            process.send_signal(signal.SIGCONT)
            ear.settimeout(PATIENCE)
            assert ear.recv(64) == b"WATCHDOG=1"
            process.send_signal(signal.SIGTERM)
            while (said := ear.recv(64)) == b"WATCHDOG=1":
                pass
            assert said == b"STOPPING=1"
            assert process.wait(PATIENCE) == 0
        finally:
            process.kill()
            process.wait()
