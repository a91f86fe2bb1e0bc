"""How a guard tells its robot's driver what to do: by the wire, or by ROS on the robot itself."""

from __future__ import annotations

import struct
from typing import Protocol

import zenoh

from formation.pose import Motion
from hil.guard.order import GuardOrder
from hil.wire.outlet import Outlet, gid_of
from hil.wire.undeclare import undeclare

_STAMP_AT, _TURN_AFTER = 4, 40
_NS_PER_S = 1_000_000_000


class Driver(Protocol):
    """What drives a robot."""

    def tell(self, motion: Motion, now_ns: int) -> None:
        """Drive like this from now on."""

    def close(self) -> None:
        """Let go of it."""


def drive_bytes(order: GuardOrder, motion: Motion, now_ns: int) -> bytes:
    """A command to a robot's driver, as the driver takes it."""
    payload = bytearray.fromhex(order.drive)
    if order.stamped:
        struct.pack_into("<iI", payload, _STAMP_AT, *divmod(now_ns, _NS_PER_S))
    struct.pack_into("<d", payload, order.twist_at, motion.v)
    struct.pack_into("<d", payload, order.twist_at + _TURN_AFTER, motion.u)
    return bytes(payload)


class WireDriver:
    """A driver that hears its commands on the wire, behind a bridge or by rmw_zenoh."""

    def __init__(self, session: zenoh.Session, order: GuardOrder) -> None:
        self._order = order
        publisher = session.declare_publisher(
            order.cmd_vel,
            encoding=zenoh.Encoding.APPLICATION_CDR,
            express=True,
            priority=zenoh.Priority.REAL_TIME,
            congestion_control=zenoh.CongestionControl.DROP,
        )
        told = f"{session.zid()}/{order.cmd_vel}"
        self._outlet = Outlet(publisher, gid_of(told) if order.attached else b"")

    def tell(self, motion: Motion, now_ns: int) -> None:
        """Publish a command."""
        self._outlet.put(drive_bytes(self._order, motion, now_ns))

    def close(self) -> None:
        """Take the publisher back."""
        undeclare(self._outlet.publisher)
