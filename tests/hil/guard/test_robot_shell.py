"""The threads of a guard: what breaks in them makes the robot stand, and ends the guard."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator

import pytest

from formation.pose import STANDSTILL, Motion
from hil.errors import CheckFailedError
from hil.guard import serving
from hil.guard.order_of import guard_order
from hil.guard.robot_shell import STUCK_S, RobotShell
from hil.scenario.files import load_scenario
from hil.wire.mailbox import Bell
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint

ORDER = guard_order(load_scenario("turtlebot3"), "follower")
PATIENCE = 30.0


class Driver:
    """Takes down what it is told; it takes nothing until it is ``free``."""

    def __init__(self) -> None:
        self.told: list[Motion] = []
        self.fails, self.closed = False, False
        self.free = threading.Event()
        self.free.set()

    def tell(self, motion: Motion, now_ns: int) -> None:
        self.free.wait()
        if self.fails:
            raise OSError("the link is gone")
        self.told.append(motion)

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def parts() -> Iterator[tuple[RobotShell, Driver]]:
    with reserved_endpoint() as endpoint:
        session = open_session(Endpoints(listen=endpoint))
        driver = Driver()
        shell = RobotShell(session, ORDER, driver)
        yield shell, driver
        driver.free.set()
        if not driver.closed:
            shell.close()
        close_session(session)


def until(is_so: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.01)


def broken(*_: object, **__: object) -> None:
    raise ZeroDivisionError


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_guard_that_breaks_down_is_told_apart_and_its_robot_stands(
    parts: tuple[RobotShell, Driver], monkeypatch: pytest.MonkeyPatch
) -> None:
    shell, driver = parts
    assert shell.decides()
    monkeypatch.setattr(type(shell.guard), "say", broken)
    until(lambda: not shell.decides())
    assert "broken down" in shell.report()
    driver.told.clear()
    shell.close()
    assert driver.told
    assert set(driver.told) == {STANDSTILL}


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_the_process_ends_with_an_error_and_a_standstill(monkeypatch: pytest.MonkeyPatch) -> None:
    driver = Driver()
    with reserved_endpoint() as endpoint:
        session = open_session(Endpoints(listen=endpoint))
        monkeypatch.setattr("hil.guard.robot_guard.RobotGuard.say", broken)
        with pytest.raises(CheckFailedError, match="broken down"):
            serving._guard(session, ORDER, driver, Bell(), PATIENCE)
        close_session(session)
    assert driver.closed
    assert set(driver.told) == {STANDSTILL}


def test_a_driver_that_takes_nothing_is_named_and_holds_nobody_up(parts: tuple[RobotShell, Driver]) -> None:
    shell, driver = parts
    driver.free.clear()
    until(shell.is_stuck)
    assert f"more than {STUCK_S:g} s" in shell.report()
    assert shell.decides()
    driver.free.set()
    until(lambda: not shell.is_stuck())
    assert shell.report() == ""


def test_commands_that_a_driver_refuses_are_counted(parts: tuple[RobotShell, Driver]) -> None:
    shell, driver = parts
    driver.fails = True
    until(lambda: shell.failures > 0)
    assert shell.decides()
