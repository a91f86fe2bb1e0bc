"""A doctor's visit by the wire: listen for a while, and let a robot creep if that is wanted."""

from __future__ import annotations

import time
from collections.abc import Callable

from formation.pose import STANDSTILL, Motion
from hil.doctor.drive_checks import CREEP, CREEP_S, REST_S, TURN, TURN_S, Span
from hil.doctor.examination import Examination
from hil.errors import AbreastError
from hil.live.daemon import Ending
from hil.nodes.leader_driver import stop_reason
from hil.scenario.schema import Scenario
from hil.wire.drive_message import drive_message
from hil.wire.lab_robots import LabRobot
from hil.wire.messages import encode
from hil.wire.pubsub import Wire
from hil.wire.topics import STOP

_TICK_S = 0.02


class StoppedError(AbreastError):
    """Somebody said stop, or the doctor was ended, while a robot was driven."""


class Visit:
    """An examination of what comes by a wire. ``ending``: asked to end, it drives nobody on."""

    def __init__(self, scenario: Scenario, wire: Wire) -> None:
        self.examination = Examination(scenario, time.time_ns())
        self._stamped = scenario.controller.command_type == "TwistStamped"
        self._wire, self._stop = wire, b""
        self.ending = Ending()
        wire.subscribe((*self.examination.subscribes, STOP), shown=False)
        wire.watch_graph()

    def listen(self, seconds: float) -> None:
        """Hear what comes for a while."""
        until, ticked = time.monotonic() + seconds, 0.0
        while (left := until - time.monotonic()) > 0.0:
            event = self._wire.inbox.take(min(left, _TICK_S))
            if event is not None and event.topic == STOP:
                self._stop = event.payload
            elif event is not None and event.topic:
                self.examination.hear(event, time.time_ns())
            if time.monotonic() >= ticked:
                ticked = time.monotonic() + _TICK_S
                self.examination.tick(time.time_ns())

    def count_down(self, robot: LabRobot, say: Callable[[str], None], seconds: int = 3) -> None:
        """Say what is about to happen, and let it be stopped."""
        way, turn = CREEP.v * CREEP_S, TURN.u * TURN_S
        say(f"{robot.name} will creep {way:.2f} m ahead and turn {turn:.1f} rad to the left")
        for left in range(seconds, 0, -1):
            say(f"in {left} (Ctrl-C or abreast stop ends it)")
            self.listen(1.0)

    def tell(self, robot: LabRobot, motion: Motion, seconds: float) -> Span:
        """Tell a robot to move for a while; the span of time of it, from when it had time to get going.

        Raises :class:`StoppedError` where it is to move and somebody says stop, or asks for the end.
        """
        begun_ns, until = time.time_ns(), time.monotonic() + seconds
        topic = self.examination.found.commands_to(robot)
        stamped = self._stamped or topic != robot.cmd_vel
        while time.monotonic() < until:
            if motion != STANDSTILL and (self._stop or self.ending.asked):
                why = (
                    f"somebody said stop ({stop_reason(self._stop)})"
                    if self._stop
                    else "the doctor was ended"
                )
                raise StoppedError(f"{robot.name} stands: {why}")
            told = drive_message(motion, time.time_ns(), robot.namespace, stamped=stamped)
            self._wire.publish(topic, encode(told))
            self.listen(_TICK_S)
        return begun_ns + round(REST_S * 1e9), time.time_ns()
