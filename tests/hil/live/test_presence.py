"""What daemons show of themselves in the ROS graph."""

from __future__ import annotations

import subprocess
import sys
import time

from tests.routers import router

PATIENCE = 60.0


def test_who_only_overhears_commands_shows_as_no_listener_of_theirs() -> None:
    with router() as (endpoint, wire):
        wire.watch_graph()
        leader = subprocess.Popen(
            [sys.executable, "-m", "hil", "leader", "turtlebot3", "--connect", endpoint]
        )
        try:
            until = time.monotonic() + PATIENCE
            while not (shown := {each.key for each in wire.graph() if not each.publishes}):
                assert time.monotonic() < until
                time.sleep(0.05)
            time.sleep(0.5)
            shown |= {each.key for each in wire.graph() if not each.publishes}
        finally:
            leader.terminate()
            assert leader.wait(PATIENCE) == 0
    assert "diagnostics" in shown
    assert "follower/cmd_vel" not in shown
