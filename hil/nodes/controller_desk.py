"""What a controller's node works with: its rules, and the rows in which all lies that it remembers."""

from __future__ import annotations

from typing import NamedTuple

from controllers.follower import Command
from controllers.guard import StopReason
from estimation.tracking.prediction import SentCommand
from formation.records import Buffer, Rows
from hil.nodes.controller_events import ControlEvent
from hil.nodes.controller_step import ControlRules, ControlState
from hil.nodes.counting import Count
from hil.wire.records import Receipt

REFUSALS = ("malformed", "bad_stamp", "unsafe_side_change", "unknown_side")
MALFORMED, BAD_STAMP, UNSAFE_SIDE_CHANGE, UNKNOWN_SIDE = range(len(REFUSALS))

STOPS = tuple(reason.value for reason in sorted(StopReason, key=lambda reason: reason.code))
"""Reasons to stand still, by their code, which counts from 1."""

DECISIONS = ("driving", *STOPS)
DRIVING = len(REFUSALS)

COUNTED = len(REFUSALS) + len(DECISIONS)
"""How many counts there are: of refusals, then of decisions."""


class NodeRules(NamedTuple):
    """All that is fixed about a controller's node.

    ``times_at``, ``twist_at``: where the numbers of a decision and of a drive command stand.
    """

    control: ControlRules
    times_at: int
    twist_at: int


class Notes(NamedTuple):
    """How many receipts there are since the last decision."""

    receipts: int


class Desk(NamedTuple):
    """Rows of a node: (1,) but for commands on their way, receipts and counts.

    ``event``: what has happened. ``result``: what was decided. ``decision``, ``drive``: the messages of that.
    """

    rules: Rows[NodeRules]
    control: Rows[ControlState]
    commands: Rows[SentCommand]
    notes: Rows[Notes]
    receipts: Rows[Receipt]
    counts: Rows[Count]
    event: Rows[ControlEvent]
    result: Rows[Command]
    decision: Buffer
    drive: Buffer
