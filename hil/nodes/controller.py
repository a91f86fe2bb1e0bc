"""The controller daemon: estimates in, commands out; it predicts, asks the law, and lets the guard decide."""

from __future__ import annotations

from msgspec import Struct, field
from msgspec.structs import replace

from controllers.follower import Command
from controllers.station_keeper import StationState, at_station
from estimation.tracking.prediction import SentCommand, Sight, rows_for
from estimation.tracking.tracker import Status
from formation.pose import Motion
from formation.records import Rows, columns_of, copy_of, load, row_of, rows_of
from formation.ring import place
from formation.station import Side
from hil.nodes.command_writer import CommandWriter
from hil.nodes.control_rules import control_rules
from hil.nodes.controller_entries import NO_REPORT, ControlEvent, Happening, Outcome, hear_estimate
from hil.nodes.controller_entries import control as control_step
from hil.nodes.controller_step import ControlState, begun
from hil.nodes.leader_turn import SOURCES, TurnSource
from hil.nodes.node import (
    Counts,
    Outgoing,
    consumed,
    counted,
    diagnostics,
    is_due,
    named_counts,
    no_counts,
    outgoing,
)
from hil.scenario.parts import station
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.drive_message import read_drive
from hil.wire.events import Event
from hil.wire.messages import MalformedPayloadError, decode_as, in_little_endian, typename_of
from hil.wire.records import Receipt
from hil.wire.topics import topics_of
from hil.wire.writing import MOST_RECEIPTS, DriveWriter

NAME = "controller"
_DIAGNOSTICS_NS = 500_000_000
_COMMAND, _ESTIMATE = typename_of(msg.Command), typename_of(msg.LeaderEstimate)
_CAUSES = {Outcome.BAD_STAMP.value: "bad_stamp", Outcome.UNSAFE_ORDER.value: "unsafe_side_change"}


class ControllerState(Struct, frozen=True):
    """All that the controller remembers.

    ``control`` (1,) and ``commands``, those on their way: rows that no step writes to, each has its own.
    """

    control: Rows[ControlState]
    commands: Rows[SentCommand]
    receipts: tuple[Receipt, ...] = ()
    refused: Counts = field(default_factory=no_counts)
    decided: Counts = field(default_factory=no_counts)
    next_diagnostics_ns: int = 0

    @property
    def known(self) -> ControlState:
        """What is known of estimates, orders and the last command."""
        return load(ControlState, self.control, 0)

    @property
    def stopped(self) -> bool:
        """Whether a stop was ordered."""
        return self.known.stopped

    @property
    def station(self) -> StationState:
        """The side that was ordered, and where the follower is on its way there."""
        return self.known.follower.station

    @property
    def estimate(self) -> Sight | None:
        """The newest estimate that may move the robot."""
        known = self.known
        return known.sight if known.known else None

    @property
    def sent(self) -> tuple[SentCommand, ...]:
        """Commands since the capture of that, oldest first, and the one before."""
        sent = self.known.sent
        places = [place(sent, self.commands, k) for k in range(sent.length)]
        return tuple(load(SentCommand, self.commands, k) for k in places)


class ControllerNode:
    """Pure step of the controller of one follower.

    ``may_change``: whether it takes orders to change sides; in a chain others may be where it would go.
    """

    def __init__(self, scenario: Scenario, name: str = NAME, *, may_change: bool = True) -> None:
        self.name = name
        self.topics = topics_of(scenario)
        self.rules = row_of(control_rules(scenario))
        self.station = station(scenario)
        self.writer = CommandWriter(self.topics.follower)
        self.driver = DriveWriter(self.topics.follower, stamped=self.topics.stamped)
        self.rows = rows_for(scenario.controller.max_age_s + scenario.controller.transport_s)
        is_told = SOURCES[scenario.controller.law] is TurnSource.TOLD
        leader = (self.topics.leader_cmd_vel,) if is_told else ()
        orders = (self.topics.side,) if may_change else ()
        self.subscribes: tuple[str, ...] = (self.topics.estimate, topics.STOP, *leader, *orders)

    def begin(self, now_ns: int) -> ControllerState:
        """State of a controller that has heard nothing: it keeps the robot still."""
        control = row_of(begun(at_station(self.station), now_ns))
        return ControllerState(control, rows_of(SentCommand, self.rows), next_diagnostics_ns=now_ns)

    def due_ns(self, state: ControllerState) -> int:
        """Time of the next tick: a command leaves at least that often."""
        return int(columns_of(state.control)["next_tick_ns"][0])

    def step(
        self, state: ControllerState, event: Event, now_ns: int
    ) -> tuple[ControllerState, tuple[Outgoing, ...]]:
        """Take in an estimate, a stop or a tick; each leads to a command."""
        if event.topic:
            receipts = (*state.receipts, consumed(event, now_ns))[-MOST_RECEIPTS:]
            state = replace(state, receipts=receipts)
        happened, cause = self._read(event)
        state = replace(state, control=copy_of(state.control), commands=copy_of(state.commands))
        result = rows_of(Command, 1)
        outcome = control_step(state.control, self.rules, state.commands, happened, result, now_ns)
        if cause := cause or _CAUSES.get(outcome, ""):
            return replace(state, refused=counted(state.refused, cause)), ()
        if outcome != Outcome.COMMAND:
            return state, ()
        command = load(Command, result, 0)
        fresh = bool(columns_of(happened)["status"][0] == Status.TRACKING)
        record = self.writer.write(state.control, result, state.receipts, now_ns, fresh=fresh)
        drive = self.driver.write(Motion(command.v, command.u), now_ns)
        out = (
            Outgoing(self.topics.cmd_vel, self.driver.typename, drive, now_ns),
            Outgoing(self.topics.command, _COMMAND, record, now_ns),
        )
        word = command.stop.value if command.stop else "driving"
        return self._speak(replace(state, receipts=(), decided=counted(state.decided, word)), out, now_ns)

    def _read(self, event: Event) -> tuple[Rows[ControlEvent], str]:
        """What an event says, or that it is nothing and by what cause."""
        if not event.topic:
            return _TICK, ""
        if event.topic == self.topics.estimate:
            heard, whole = rows_of(ControlEvent, 1), in_little_endian(event.payload, _ESTIMATE)
            return (heard, "") if hear_estimate(whole, heard) else (_NOTHING, "malformed")
        if event.topic == topics.STOP:
            return _happened(Happening.STOP), ""
        try:
            if event.topic == self.topics.leader_cmd_vel:
                told = read_drive(event.payload, stamped=self.topics.stamped)
                return _happened(Happening.LEADER, told.u), ""
            if event.topic == self.topics.side:
                word = decode_as(event.payload, msg.String).data
                return _happened(Happening.ORDER, Side(word).sign), ""
        except MalformedPayloadError:
            return _NOTHING, "malformed"
        except ValueError:
            return _NOTHING, "unknown_side"
        return _NOTHING, ""

    def _speak(
        self, state: ControllerState, out: tuple[Outgoing, ...], now_ns: int
    ) -> tuple[ControllerState, tuple[Outgoing, ...]]:
        if not is_due(state.next_diagnostics_ns, _DIAGNOSTICS_NS, now_ns):
            return state, out
        state = replace(state, next_diagnostics_ns=now_ns + _DIAGNOSTICS_NS)
        return state, (*out, self.report(state, now_ns))

    def report(self, state: ControllerState, now_ns: int) -> Outgoing:
        """Diagnostics: what was decided how often, and what was refused."""
        known = state.known
        problem = "" if known.heard else "waiting for estimates"
        values: dict[str, object] = {"estimate": Status(known.status).name.lower()}
        values |= _side_report(known.follower.station)
        values |= named_counts("decided", state.decided) | named_counts("refused", state.refused)
        return outgoing(topics.DIAGNOSTICS, diagnostics(self.name, now_ns, problem, values), now_ns)


def _happened(kind: Happening, number: float = 0.0) -> Rows[ControlEvent]:
    return row_of(ControlEvent(kind.value, 0, number, NO_REPORT))


_TICK, _NOTHING = _happened(Happening.TICK), _happened(Happening.NOTHING)


def _side_report(station: StationState) -> dict[str, object]:
    """The side that is kept or gone to, and what holds a change up."""
    if station.waits:
        change = "waits for a leader that turns less"
    else:
        change = "none" if station.change.arrived else "under way"
    return {"side": station.ordered.value, "side_change": change}
