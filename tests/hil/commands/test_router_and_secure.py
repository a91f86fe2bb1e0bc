"""A router on its own and the keys of a lab, as commands."""

from __future__ import annotations

import os
import re
import signal
import stat
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from hil.wire.session import reserved_endpoint
from tests.tls_labs import lab_keys

PATIENCE, COMPILES = 60.0, 280.0


def abreast(*arguments: str, patience: float = PATIENCE) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "hil", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=patience, check=False)


@contextmanager
def routing(*arguments: str, listen: str) -> Iterator[subprocess.Popen[str]]:
    """A router that is ready."""
    command = [sys.executable, "-m", "hil", "router", "--listen", listen, *arguments]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            line = process.stderr.readline()
            assert "ready" in line, line
            yield process
        finally:
            process.terminate()


@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM])
def test_a_router_ends_well_by_a_signal_and_refuses_a_port_that_is_taken(by: signal.Signals) -> None:
    with reserved_endpoint() as endpoint, routing(listen=endpoint) as process:
        second = abreast("router", "--listen", endpoint)
        assert second.returncode == 2
        assert "somebody may listen at" in second.stderr
        assert len(second.stderr.strip().splitlines()) == 1
        process.send_signal(by)
        assert process.wait(PATIENCE) == 0


def test_a_router_listens_on_loopback_unless_told_otherwise() -> None:
    shown = abreast("router", "--help").stdout
    assert "tcp/127.0.0.1:7447" in shown


def test_a_config_file_must_say_where_a_router_listens(tmp_path: Path) -> None:
    (tmp_path / "zenoh.json5").write_text("{ mode: 'router' }")
    said = abreast("router", "--zenoh-config", str(tmp_path / "zenoh.json5"))
    assert said.returncode == 2
    assert "it listens nowhere" in said.stderr
    both = abreast("router", "--zenoh-config", str(tmp_path / "zenoh.json5"), "--listen", "tcp/127.0.0.1:1")
    assert both.returncode == 2


def test_keys_are_made_used_and_told_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keys = tmp_path / "keys"
    # A generous umask must not show anything.
    before = os.umask(0)
    try:
        monkeypatch.setenv("TZ", "Asia/Tokyo")
        made = abreast("secure", "init", str(keys), "--host", "192.0.2.10", "--days", "3")
    finally:
        os.umask(before)
    assert made.returncode == 0, made.stderr
    # When they end is told in the time of the place, with its zone.
    assert re.search(r"valid until 2\d{3}-\d\d-\d\d \d\d:\d\d:\d\d \+0900 \(JST\)", made.stdout)
    assert "PRIVATE" not in made.stdout + made.stderr
    assert not any(stat.S_IMODE(each.stat().st_mode) & 0o077 for each in (keys, *keys.iterdir()))
    again = abreast("secure", "init", str(keys))
    assert again.returncode == 2
    assert "--force" in again.stderr
    lab_keys(tmp_path / "foreign")
    with reserved_endpoint("tls") as endpoint, routing("--secure", str(keys), listen=endpoint) as router:
        seen = abreast("status", "--once", "--json", "--secure", str(keys), "--connect", endpoint)
        assert seen.returncode == 0, seen.stderr
        strange = abreast("status", "--once", "--secure", str(tmp_path / "foreign"), "--connect", endpoint)
        assert strange.returncode == 1
        assert "the router's certificate is refused" in strange.stderr
        (keys / "operator.key").unlink()
        stopped = abreast("stop", "--secure", str(keys), "--connect", endpoint)
        assert stopped.returncode == 2
        assert "there is no operator.key" in stopped.stderr
        router.terminate()
        assert router.stderr is not None
        said = router.stderr.read()
    assert "viewer came, from tls/127.0.0.1:" in said
    assert "somebody came" not in said
    assert "refused somebody who showed no certificate of this lab: received fatal alert" in said


@pytest.mark.parametrize(
    "command", [("status",), ("follower", "turtlebot3"), ("bridge", "natnet", "--server", "127.0.0.1")]
)
def test_ctrl_c_while_nobody_answers_ends_quietly_with_130(command: tuple[str, ...]) -> None:
    with reserved_endpoint() as nobody:
        arguments = [sys.executable, "-m", "hil", *command, "--connect", nobody]
        process = subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True)
        try:
            process.wait(2.0)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, said
    assert "is the router up" not in said
    assert "Traceback" not in said


@pytest.mark.slow
def test_an_emulated_run_works_by_keys(tmp_path: Path) -> None:
    lab_keys(tmp_path / "keys")
    out = tmp_path / "out"
    options = ("--set", "run.duration_s=4", "--secure", str(tmp_path / "keys"), "--out", str(out))
    ran = abreast("run", "turtlebot3", *options, patience=COMPILES)
    assert ran.returncode == 0, ran.stderr
    assert "0 lost" in ran.stdout
    verified = abreast("replay", str(out / "run.mcap"), "--verify", patience=COMPILES)
    assert verified.returncode == 0, verified.stderr
