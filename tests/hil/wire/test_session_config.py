"""Configurations of sessions: what a file leaves out is ours, what it says stays."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from hil.wire.role_keys import RoleKeys
from hil.wire.session_config import (
    connects_to,
    endpoint_config,
    file_config,
    keys_allowed,
    keys_config,
    listens_at,
)
from tests.tls_labs import lab_keys

QUEUE = "transport/link/tx/queue"


def said(config: zenoh.Config, key: str) -> Any:
    return json.loads(config.get_json(key))


def of_file(folder: Path, text: str) -> zenoh.Config:
    path = folder / "zenoh.json5"
    path.write_text(text)
    return file_config(path)


def test_a_file_that_says_only_whom_to_connect_to_opens_nothing(tmp_path: Path) -> None:
    config = of_file(tmp_path, '{ connect: { endpoints: ["tcp/192.0.2.10:7447"] } }  // no more')
    assert said(config, "mode") == "client"
    assert listens_at(config) == []
    assert connects_to(config) == ["tcp/192.0.2.10:7447"]
    for kind in ("multicast", "gossip"):
        assert said(config, f"scouting/{kind}/enabled") is False
    for priority in ("real_time", "data"):
        assert said(config, f"{QUEUE}/size/{priority}") == 16


def test_what_a_file_says_stays(tmp_path: Path) -> None:
    config = of_file(
        tmp_path,
        """{
          listen: { endpoints: ["tcp/192.0.2.10:7447"] },
          scouting: { multicast: { enabled: true } },
          transport: { link: { tx: { queue: { size: { data: 7 } } } } },
        }""",
    )
    assert said(config, "mode") == "router"
    assert listens_at(config) == ["tcp/192.0.2.10:7447"]
    assert said(config, "scouting/multicast/enabled") is True
    assert said(config, "scouting/gossip/enabled") is False
    assert said(config, f"{QUEUE}/size/data") == 7
    assert said(config, f"{QUEUE}/size/real_time") == 16


@pytest.mark.parametrize("mode", ["client", "peer", "router"])
def test_no_mode_listens_by_itself(mode: str, tmp_path: Path) -> None:
    config = of_file(tmp_path, json.dumps({"mode": mode, "connect": {"endpoints": ["tcp/127.0.0.1:1"]}}))
    assert said(config, "mode") == mode
    assert listens_at(config) == []
    # Else it would go on alone, and say nothing.
    assert mode == "client" or said(config, "connect/exit_on_failure") is True


@given(connects=st.booleans(), listens=st.booleans())
def test_endpoints_give_the_mode(connects: bool, listens: bool) -> None:
    connect, listen = "tcp/127.0.0.1:1" if connects else None, "tcp/127.0.0.1:2" if listens else None
    config = endpoint_config(connect, listen)
    assert said(config, "mode") == ("router" if listens else "client")
    assert connects_to(config) == [connect][: int(connects)]
    assert listens_at(config) == [listen][: int(listens)]


def test_keys_may_be_copied_elsewhere(tmp_path: Path) -> None:
    lab_keys(tmp_path / "here")
    shutil.copytree(tmp_path / "here", tmp_path / "there")
    config = keys_config(RoleKeys(tmp_path / "there", "recorder"), "tls/192.0.2.10:7447", None)
    assert said(config, "transport/link/tls/connect_private_key") == str(tmp_path / "there" / "recorder.key")
    assert connects_to(config) == ["tls/192.0.2.10:7447"]
    assert listens_at(config) == []


def test_a_role_knows_what_it_may_say(tmp_path: Path) -> None:
    lab_keys(tmp_path / "keys", "wire.prefix=lab7")
    assert keys_allowed(RoleKeys(tmp_path / "keys", "viewer")) == set()
    wanted = {"lab7/diagnostics", "lab7/follower/command", "lab7/follower/cmd_vel_wanted"}
    assert keys_allowed(RoleKeys(tmp_path / "keys", "controller")) == wanted
