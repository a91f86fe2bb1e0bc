from __future__ import annotations

import socket
from pathlib import Path

from hil.doctor.machine_checks import disk_check, port_check, route_check


def test_a_disk_without_room_is_told(tmp_path: Path) -> None:
    assert disk_check(tmp_path / "logs" / "of today", least_gb=1e-6).ok
    full = disk_check(tmp_path, least_gb=1e9)
    assert (full.name, full.ok) == ("disk", False)
    assert "room" in full.advice


def test_a_port_that_is_taken_is_told() -> None:
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        held.listen()
        port = held.getsockname()[1]
        assert not port_check(port).ok
    assert port_check(0).ok


def test_a_router_that_is_not_there_is_told() -> None:
    assert route_check("tcp/127.0.0.1:7447", "").ok
    assert route_check("tcp/127.0.0.1:7447", "connection refused").seen == "connection refused"
