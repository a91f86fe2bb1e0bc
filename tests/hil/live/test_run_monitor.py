"""What a supervisor makes of what is on the wire."""

from __future__ import annotations

import math
import time

import numpy as np

from hil.live.run_monitor import RunMonitor, Snapshot
from hil.nodes.node import diagnostics
from hil.wire import message_types as msg
from hil.wire.messages import encode, header, to_time
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint
from hil.wire.topics import DIAGNOSTICS, Topics

PATIENCE = 3.0
PAIR = Topics("leader", "follower", stamped=True)


def estimate(status: int) -> msg.LeaderEstimate:
    seen = (0.5, 1.5, 0.0, 0.0, 0.1, -1.5, 0.3, 0.1, 0.3)
    bounds = (0.1, 0.2, 0.3)
    none: list[msg.Consumed] = []
    return msg.LeaderEstimate(
        header(1, ""), to_time(1), to_time(1), *seen, np.zeros(25), 1.0, status, "", *bounds, none
    )


def command(stop: str) -> msg.Command:
    return msg.Command(
        header(1, ""), to_time(1), to_time(1), 0.0, 0.0, math.nan, math.nan, False, stop, False, []
    )


def test_an_estimate_that_cannot_be_is_not_shown_and_hides_nothing_else() -> None:
    with reserved_endpoint() as endpoint:
        session = open_session(Endpoints(listen=endpoint))
    monitor = RunMonitor(session, [PAIR])
    try:
        session.put(PAIR.estimate, encode(estimate(status=1)))
        session.put(PAIR.certified, b"rubbish")
        session.put(PAIR.command, encode(command(stop="first")))
        deadline = time.monotonic() + 60.0
        while not monitor.update().commands and time.monotonic() < deadline:
            time.sleep(0.005)
        session.put(PAIR.estimate, encode(estimate(status=200)))
        session.put(PAIR.command, encode(command(stop="[/second]")))
        while monitor.update().commands["follower"].stop == "first" and time.monotonic() < deadline:
            time.sleep(0.005)
        line = monitor.snapshot.line(1.0, 2.0)
    finally:
        monitor.close()
        close_session(session)
    assert "tracking" in line
    assert "[/second]" in line


def observed(snapshot: Snapshot, looks: int, seconds: float) -> str | None:
    for _ in range(looks):
        snapshot.advance(seconds)
    return snapshot.silent(("estimator", "emulator"), PATIENCE)


def test_a_daemon_that_was_heard_and_falls_silent_is_named() -> None:
    snapshot = Snapshot()
    assert observed(snapshot, 100, 0.05) is None
    snapshot.heard["emulator"] = snapshot.observed_s
    assert observed(snapshot, 50, 0.05) is None
    assert observed(snapshot, 20, 0.05) == "emulator"


def test_a_machine_that_stands_still_makes_nobody_silent() -> None:
    snapshot = Snapshot()
    snapshot.heard["estimator"] = snapshot.observed_s
    assert observed(snapshot, 1, 60.0) is None
    assert observed(snapshot, 50, 0.05) is None
    assert observed(snapshot, 20, 0.05) == "estimator"


def test_what_nodes_find_is_known_as_long_as_they_do() -> None:
    with reserved_endpoint() as endpoint:
        session = open_session(Endpoints(listen=endpoint))
    monitor = RunMonitor(session, [PAIR])
    deadline = time.monotonic() + 60.0
    try:
        for found in ({"finding.clock": "an hour behind"}, {}):
            session.put(DIAGNOSTICS, encode(diagnostics("estimator", 1, "", found)))
            wanted = {"clock": "an hour behind"} if found else {}
            while monitor.update().findings.get("estimator") != wanted and time.monotonic() < deadline:
                time.sleep(0.005)
            assert monitor.snapshot.findings == {"estimator": wanted}
    finally:
        monitor.close()
        close_session(session)


def test_a_time_of_the_start_that_is_no_number_is_none() -> None:
    with reserved_endpoint() as endpoint:
        session = open_session(Endpoints(listen=endpoint))
    monitor = RunMonitor(session, [PAIR])
    deadline = time.monotonic() + 60.0
    try:
        for said in ("7" * 5000, "7" * 20, "²", "-7"):
            values = {"motion_since_ns": said}
            session.put(DIAGNOSTICS, encode(diagnostics("leader", 9, said[:2], values)))
        session.put(DIAGNOSTICS, encode(diagnostics("emulator", 9, "", {})))
        while "emulator" not in monitor.update().heard and time.monotonic() < deadline:
            time.sleep(0.005)
        assert monitor.snapshot.motion_since_ns is None
        session.put(DIAGNOSTICS, encode(diagnostics("leader", 9, "", {"motion_since_ns": 7})))
        while monitor.update().motion_since_ns is None and time.monotonic() < deadline:
            time.sleep(0.005)
        assert monitor.snapshot.motion_since_ns == 7
    finally:
        monitor.close()
        close_session(session)


def test_a_node_may_report_while_it_is_said_what_the_start_waits_for() -> None:
    snapshot = Snapshot()

    class Meanwhile(str):
        """A problem that another node reports beside while this one is read."""

        def __bool__(self) -> bool:
            snapshot.problems["controller"] = "waiting for an estimate"
            return True

    snapshot.problems["estimator"] = Meanwhile("waiting for mocap")
    assert snapshot.waits_for(()) == "estimator: waiting for mocap"
    assert snapshot.waits_for(()) == "estimator: waiting for mocap; controller: waiting for an estimate"
