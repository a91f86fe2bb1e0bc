"""Whether a lab is open, and to whom."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from hil.doctor.access_check import _own_address, access_check, access_of_lab, reached_by_others
from hil.wire.role_keys import RoleKeys
from hil.wire.session import Endpoints

LOOPBACK = "tcp/127.0.0.1:7447"


def test_an_open_lab_is_no_failure_but_is_said_to_be_one_where_others_reach_it() -> None:
    alone = access_check([LOOPBACK], None, (), "")
    assert alone.ok
    assert alone.advice == ""
    reached = access_check([LOOPBACK], None, (), "tcp/192.0.2.10:7447")
    assert reached.ok
    assert "whoever reaches tcp/192.0.2.10:7447" in reached.seen
    assert "abreast secure init" in reached.advice


def test_keys_tell_who_is_who() -> None:
    keys = RoleKeys(Path("keys"), "operator")
    found = access_check(["tls/192.0.2.10:7447"], keys, ("router",), "tls/192.0.2.10:7447")
    assert found.seen == "by keys: we are operator, at the other end is router"
    assert found.advice == ""


def test_encryption_of_ones_own_is_taken_for_what_it_is() -> None:
    assert access_check(["tls/192.0.2.10:7447"], None, (), "tls/192.0.2.10:7447").advice == ""
    assert access_check(["tls/192.0.2.10:7447", LOOPBACK], None, (), "tcp/192.0.2.10:7447").advice


@pytest.mark.parametrize(
    ("endpoint", "reached"),
    [
        ("tcp/192.0.2.10:7447", True),
        ("tcp/0.0.0.0:7447", True),
        ("tcp/[::]:7447", True),
        ("tcp/lab:7447", True),
        ("tcp/127.0.0.1:1", False),
        ("tcp/localhost:1", False),
        ("tcp/[::1]:1", False),
        ("unixsock-stream/some.sock", False),
    ],
)
def test_what_is_not_on_loopback_is_reached_by_others(endpoint: str, reached: bool) -> None:
    assert reached_by_others(endpoint) == (endpoint if reached else "")


def test_a_router_on_all_interfaces_is_found_out_by_knocking() -> None:
    own = _own_address()
    with socket.create_server(("0.0.0.0", 0)) as everywhere, socket.create_server(("127.0.0.1", 0)) as here:
        port = everywhere.getsockname()[1]
        found = reached_by_others(f"tcp/127.0.0.1:{port}")
        # Without a network nobody else is there.
        assert found == (f"tcp/{own}:{port}" if own and not own.startswith("127.") else "")
        assert reached_by_others(f"tcp/127.0.0.1:{here.getsockname()[1]}") == ""


def test_endpoints_of_a_config_file_count_too(tmp_path: Path) -> None:
    (tmp_path / "zenoh.json5").write_text('{ connect: { endpoints: ["tcp/192.0.2.10:7447"] } }')
    assert access_of_lab(Endpoints(config_file=tmp_path / "zenoh.json5"), ()).advice
    assert not access_of_lab(Endpoints(connect="tcp/127.0.0.1:1"), ()).advice
