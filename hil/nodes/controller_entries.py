"""A step of the controller, compiled: what Python enters once or twice for everything that happens.

What happens is put down first, an estimate by :func:`hear_estimate`; then :func:`control` decides. All work
on the node's :class:`hil.nodes.controller_desk.Desk`, in a row (1,), by the kernels of
:mod:`hil.nodes.controller_inputs`.
"""

from __future__ import annotations

from formation.kernel import entry
from formation.records import Rows, load
from hil.nodes import controller_inputs as inputs
from hil.nodes.controller_desk import Desk
from hil.nodes.counting import count


@entry
def hear(desks: Rows[Desk], digest: int, now_ns: int) -> None:
    """Note the receipt of a message that is no estimate."""
    inputs.noted(load(Desk, desks, 0), digest, now_ns)


@entry
def refuse(desks: Rows[Desk], cause: int) -> None:
    """Count an input that is not used, by its cause."""
    count(load(Desk, desks, 0).counts, cause)


@entry
def hear_estimate(desks: Rows[Desk], payload: bytes, digest: int, now_ns: int) -> bool:
    """Put an estimate down as what has happened, and nothing if it is none; whether it is one."""
    return inputs.estimate_heard(load(Desk, desks, 0), payload, digest, now_ns)


@entry
def control(desks: Rows[Desk], stops: bytes, now_ns: int) -> int:
    """Step of a controller with what has happened; the length of its decision's message, 0 for none.

    ``stops``: texts of the reasons to stand still, by their code.
    """
    return inputs.controlled(load(Desk, desks, 0), stops, now_ns)
