"""A guard as a process: from its order to its end by a signal."""

from __future__ import annotations

import math
import signal
import sys
import threading
import time
from types import FrameType

import zenoh

from hil.errors import CheckFailedError
from hil.guard.driver import Driver, WireDriver
from hil.guard.order import GuardOrder
from hil.guard.report import REPORT_NS
from hil.guard.robot_shell import RobotShell
from hil.guard.sd_notify import sd_notify
from hil.wire.mailbox import Bell
from hil.wire.session import Endpoints, GaveUpError, close_session, open_session

_REPORT_S = REPORT_NS * 1e-9
_SILENT_S = 2.0
"""After so long [s] it says that it waits."""


def serve(
    order: GuardOrder, endpoints: Endpoints, *, ros: bool = False, duration_s: float = math.inf
) -> None:
    """Guard a robot until a signal asks for the end; the router to connect to is waited for.

    ``ros``: its driver is reached by rclpy, else by the wire. Raises what :func:`open_session` does, and
    :class:`~hil.errors.UsageError` where there is no rclpy.
    """
    asked: list[int] = []
    ended = Bell()

    def end(number: int, _frame: FrameType | None) -> None:
        asked.append(number)
        ended.ring()

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, end)
    waiting = threading.Timer(_SILENT_S, _say, [f"waits for {endpoints.describe()}; is the router up?"])
    waiting.daemon = True
    waiting.start()
    try:
        session = open_session(endpoints, patience=math.inf, give_up=lambda: bool(asked))
    except GaveUpError:
        return
    finally:
        waiting.cancel()
    try:
        _guard(session, order, _driver(session, order, ros), ended, duration_s)
    finally:
        close_session(session)


def _driver(session: zenoh.Session, order: GuardOrder, ros: bool) -> Driver:
    if not ros:
        return WireDriver(session, order)
    from hil.guard.ros_driver import RosDriver

    return RosDriver(order)


def _guard(session: zenoh.Session, order: GuardOrder, driver: Driver, ended: Bell, duration_s: float) -> None:
    shell = RobotShell(session, order, driver)
    try:
        _say(f"ready, guards {order.robot}")
        sd_notify("READY=1")
        until, said = time.monotonic() + duration_s, ""
        while not ended.wait(_REPORT_S) and time.monotonic() < until:
            problem = shell.report()
            if problem != said:
                _say(problem or "well again")
                sd_notify(f"STATUS={problem or 'well'}")
                said = problem
            if not shell.decides():
                raise CheckFailedError(problem)
            if not shell.is_stuck():
                sd_notify("WATCHDOG=1")
    finally:
        # However it ends, the driver is told to stand.
        sd_notify("STOPPING=1")
        shell.close()


def _say(line: str) -> None:
    sys.stderr.write(f"abreast guard: {' '.join(line.split())}\n")
    sys.stderr.flush()
