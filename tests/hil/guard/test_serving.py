"""A guard whose router is not there yet: it says so, waits, and ends when it is told to."""

from __future__ import annotations

import signal
import subprocess
import sys

from hil.wire.session import reserved_endpoint

PATIENCE = 60.0


def test_a_guard_that_waits_for_its_router_says_so_and_ends_well() -> None:
    with reserved_endpoint() as endpoint:
        given = ["guard", "turtlebot3", "--robot", "follower", "--connect", endpoint]
        guard = subprocess.Popen([sys.executable, "-m", "hil", *given], stderr=subprocess.PIPE, text=True)
        assert guard.stderr is not None
        assert guard.stderr.readline() == f"abreast guard: waits for {endpoint}; is the router up?\n"
        guard.send_signal(signal.SIGTERM)
        _, rest = guard.communicate(timeout=PATIENCE)
    assert (guard.returncode, rest) == (0, "")
