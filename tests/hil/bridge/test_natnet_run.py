"""The paper's robot experiment with its motion capture by NatNet: emulator, bridge, follower, recorder."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from hil.wire.session import reserved_endpoint

pytestmark = pytest.mark.slow

PATIENCE = 300.0


def daemon(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "hil", *arguments], cwd=folder, stderr=subprocess.PIPE, text=True
    )


def line_of(process: subprocess.Popen[str], words: str) -> str:
    """The first line on its standard error that has these words in it."""
    assert process.stderr is not None
    line = next((line for line in process.stderr if words in line), "")
    assert line
    return line


def test_by_natnet_the_pair_drives_as_it_does_without(tmp_path: Path) -> None:
    with reserved_endpoint() as endpoint:
        at = ("turtlebot3", "--connect", endpoint)
        daemons = [daemon(tmp_path, "recorder", "turtlebot3", "--listen", endpoint, "--out", "lab.mcap")]
        try:
            line_of(daemons[0], "ready")
            ports = ("--natnet-command-port", "0", "--natnet-data-port", "0")
            served = ("--natnet", "--natnet-version", "4.1", *ports, "--duration", "40")
            daemons.append(daemon(tmp_path, "follower", *at))
            line_of(daemons[1], "ready")
            emulator = daemon(
                tmp_path, "emulator", *at, *served, "--natnet-data-port", "0", "--duration", "40"
            )
            daemons.append(emulator)
            port = line_of(emulator, "command port").partition("command port ")[2].partition(",")[0]
            daemons.append(daemon(tmp_path, "bridge", "natnet", *at, "--server", f"127.0.0.1:{port}"))
            line_of(daemons[3], "sees 'leader', 'follower'")
            assert emulator.wait(PATIENCE) == 0
            for process in (daemons[1], daemons[3], daemons[0]):
                process.terminate()
                assert process.wait(PATIENCE) == 0
        finally:
            for process in daemons:
                process.kill()
                process.communicate()
    judged = subprocess.run(
        [sys.executable, "-m", "hil", "replay", "lab.mcap", "--verify", "--json"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=True,
    )
    summary = json.loads(judged.stdout)
    assert summary["formation"]["orbit_deviation_rms"]["rho"] < 0.003
    assert summary["frames"]["rejected"] == 0
    assert {finding["name"] for finding in summary["findings"]} <= {"noise", "command_gaps"}
    assert all(parity["mismatched"] == 0 for parity in summary["parity"].values())
