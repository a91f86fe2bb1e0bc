"""This machine: a full disk, a port that is taken, a router that is not there."""

from __future__ import annotations

import socket
from pathlib import Path

from hil.doctor.machine_checks import disk_check, port_check, route_check


def test_room_is_looked_for_where_the_folder_is_to_be_made(tmp_path: Path) -> None:
    assert disk_check(tmp_path / "not" / "yet", least_gb=0.0).ok
    full = disk_check(tmp_path, least_gb=1e9)
    assert not full.ok
    assert "make room" in full.advice


def test_a_port_is_taken_while_somebody_listens_there() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        taken = port_check(port)
        assert not taken.ok
        assert f"127.0.0.1:{port} is taken" in taken.seen
    assert port_check(port).ok


def test_a_router_that_is_not_reached_has_a_reason() -> None:
    endpoint = "tcp/127.0.0.1:1"
    assert route_check(endpoint, "").ok
    assert route_check(endpoint, "no session").seen == "no session"
    assert not route_check(endpoint, "no session").ok
