"""The estimator's step, compiled: what Python enters once or twice for every message that comes in.

An input is first read and checked, ``see_*``, and then taken into the tracks, ``take``; in between Python
may look at it. Both work on the node's :class:`hil.nodes.estimator_desk.Desk`, in a row (1,), by the kernels
of :mod:`hil.nodes.estimator_inputs`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, cast

from estimation.tracking.tracker import newest as newest_point
from estimation.tracking.tracker import status_of
from formation.kernel import entry, interpreted
from formation.records import Rows, load
from hil.nodes import estimator_inputs as inputs
from hil.nodes.estimator_desk import Desk, NodeRules
from hil.nodes.estimator_records import Known


@entry
def see_frame(desks: Rows[Desk], payload: bytes, names: bytes, again: bool, digest: int, now_ns: int) -> int:
    """Read a mocap frame. ``names``: of the bodies, packed; ``again``: it has been read by another node."""
    return inputs.frame_seen(load(Desk, desks, 0), payload, names, again, digest, now_ns)


@entry
def see_odometry(desks: Rows[Desk], payload: bytes, digest: int, now_ns: int) -> int:
    """Read the follower's odometry."""
    return inputs.odometry_seen(load(Desk, desks, 0), payload, digest, now_ns)


@entry
def see_sighting(desks: Rows[Desk], payload: bytes, digest: int, now_ns: int) -> int:
    """Read a sighting of the leader, and put it right by what is known of the sensor."""
    return inputs.sighting_seen(load(Desk, desks, 0), payload, digest, now_ns)


@entry
def take(desks: Rows[Desk], what: int, reasons: bytes, now_ns: int) -> int:
    """Take what was seen into the tracks; the length of the estimate's message, 0 for none."""
    return inputs.taken(load(Desk, desks, 0), what, reasons, now_ns)


@entry
def tick(desks: Rows[Desk], reasons: bytes, now_ns: int) -> int:
    """Speak up if measurements are missing; the length of the message, 0 for none."""
    return inputs.ticked(load(Desk, desks, 0), reasons, now_ns)


@entry
def status(desks: Rows[Desk], now_ns: int) -> int:
    """Status of a track that has a point, for one who looks at it now."""
    desk = load(Desk, desks, 0)
    point = newest_point(desk.points, load(Known, desk.known, 0).track)
    return status_of(point, now_ns, load(NodeRules, desk.rules, 0).step.settings)


class Steps(NamedTuple):
    """The entries, or the plain functions behind them."""

    see_frame: Callable[[Rows[Desk], bytes, bytes, bool, int, int], int]
    see_odometry: Callable[[Rows[Desk], bytes, int, int], int]
    see_sighting: Callable[[Rows[Desk], bytes, int, int], int]
    take: Callable[[Rows[Desk], int, bytes, int], int]
    tick: Callable[[Rows[Desk], bytes, int], int]
    status: Callable[[Rows[Desk], int], int]


COMPILED = Steps(
    see_frame,
    see_odometry,
    see_sighting,
    take,
    tick,
    status,
)
PLAIN = Steps._make(interpreted(each) for each in cast("tuple[Any, ...]", COMPILED))
