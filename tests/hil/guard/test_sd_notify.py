"""What systemd hears of a guard, by a socket as it makes one."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from hil.guard.sd_notify import sd_notify


@pytest.mark.parametrize("abstract", [False, True])
def test_a_state_reaches_the_socket_that_the_environment_names(
    abstract: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    named = f"@abreast-test-{tmp_path.name}" if abstract else str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ear:
        ear.bind("\0" + named[1:] if abstract else named)
        monkeypatch.setenv("NOTIFY_SOCKET", named)
        assert sd_notify("WATCHDOG=1")
        assert ear.recv(64) == b"WATCHDOG=1"


@pytest.mark.parametrize("named", ["", "relative", "/no/such/socket"])
def test_nobody_who_hears_is_no_error(named: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NOTIFY_SOCKET", named)
    assert not sd_notify("READY=1")
