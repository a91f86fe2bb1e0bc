"""The controller daemon: estimates in, commands out; it predicts, asks the law, and lets the guard decide."""

from __future__ import annotations

import functools
from types import ModuleType

from controllers.follower import Command
from controllers.station_keeper import StationState, at_station
from estimation.tracking.prediction import SentCommand, Sight, rows_for
from estimation.tracking.tracker import Status
from formation.lending import lent
from formation.pose import STANDSTILL, Motion
from formation.records import columns_of, copy_of, load, row_of, rows_of, store
from formation.ring import place
from formation.station import Side
from hil.nodes.answer_watch import UNASKED, AnswerWatch, answer_findings, with_answer
from hil.nodes.control_rules import control_rules
from hil.nodes.controller_desk import (
    COUNTED,
    DECISIONS,
    DRIVING,
    MALFORMED,
    REFUSALS,
    STOPS,
    UNKNOWN_SIDE,
    Desk,
    NodeRules,
    Notes,
)
from hil.nodes.controller_events import NOTHING, STOP, TICK, ControlEvent, Happening, happened
from hil.nodes.controller_step import ControlState, begun
from hil.nodes.counting import Count, counts_in
from hil.nodes.findings import Findings, named_findings
from hil.nodes.leader_turn import TurnSource, source_of
from hil.nodes.node import LAW_FAILURE, Counts, Outgoing, diagnostics, is_due, named_counts, outgoing
from hil.scenario.brought import law_of
from hil.scenario.parts import station
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.cdr import packed_texts
from hil.wire.drive_message import drive_type, read_drive
from hil.wire.events import Event
from hil.wire.messages import MalformedPayloadError, decode_as, in_little_endian, typename_of
from hil.wire.records import Receipt
from hil.wire.templates import command_template, drive_template
from hil.wire.topics import topics_of
from hil.wire.writing import MOST_RECEIPTS

NAME = "controller"
_DIAGNOSTICS_NS = 500_000_000
_COMMAND, _ESTIMATE = typename_of(msg.Command), typename_of(msg.LeaderEstimate)
_STOPS = packed_texts(["", *STOPS])


class ControllerState:
    """All that the controller remembers; it changes in place.

    ``desk``: rows with all but when the next report is due, and the ``answers`` seen at reports.
    """

    __slots__ = ("_due_ns", "answers", "desk", "lent", "next_diagnostics_ns")

    def __init__(self, desk: Desk, next_diagnostics_ns: int, answers: AnswerWatch = UNASKED) -> None:
        self.desk = desk
        self.lent = lent(desk)
        self.next_diagnostics_ns = next_diagnostics_ns
        self.answers = answers
        self._due_ns = columns_of(desk.control)["next_tick_ns"]

    def copy(self) -> ControllerState:
        """The same state, to go on from twice."""
        desk = self.desk
        kept = desk._replace(
            control=copy_of(desk.control),
            commands=copy_of(desk.commands),
            notes=copy_of(desk.notes),
            receipts=copy_of(desk.receipts),
            counts=copy_of(desk.counts),
            event=copy_of(desk.event),
            result=copy_of(desk.result),
        )
        return ControllerState(kept, self.next_diagnostics_ns, self.answers)

    def due_ns(self) -> int:
        """When the next command is due."""
        due_ns: int = self._due_ns.item(0)
        return due_ns

    @property
    def known(self) -> ControlState:
        """What is known of estimates, orders and the last command."""
        return load(ControlState, self.desk.control, 0)

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
        sent, commands = self.known.sent, self.desk.commands
        return tuple(load(SentCommand, commands, place(sent, commands, k)) for k in range(sent.length))

    @property
    def asked(self) -> Motion:
        """What the robot was told last."""
        sent, commands = self.known.sent, self.desk.commands
        if not sent.length:
            return STANDSTILL
        newest = load(SentCommand, commands, place(sent, commands, sent.length - 1))
        return Motion(newest.v, newest.u)

    @property
    def shown(self) -> Motion | None:
        """How the robot moves by the newest estimate; None where that is not tracking."""
        known = self.known
        if not known.known or known.status != Status.TRACKING or not known.sight.sound:
            return None
        return Motion(known.sight.v2, known.sight.u2)

    @property
    def receipts(self) -> tuple[Receipt, ...]:
        """Inputs since the last decision."""
        count = load(Notes, self.desk.notes, 0).receipts
        return tuple(load(Receipt, self.desk.receipts, k) for k in range(count))

    @property
    def refused(self) -> Counts:
        """Inputs that were not used, by cause."""
        return counts_in(self.desk.counts, REFUSALS)

    @property
    def decided(self) -> Counts:
        """How often the robot was driven, or stopped and why."""
        return counts_in(self.desk.counts, DECISIONS, DRIVING)


class ControllerNode:
    """Step of the controller of one follower.

    ``may_change``: whether it takes orders to change sides; in a chain others may be where it would go.
    """

    def __init__(self, scenario: Scenario, name: str = NAME, *, may_change: bool = True) -> None:
        self.name = name
        self.topics = topics_of(scenario)
        follower, stamped = self.topics.follower, self.topics.wanted_stamped
        self.decision = command_template(follower, MOST_RECEIPTS)
        self.drive = drive_template(follower, stamped=stamped)
        places = self.decision.numbers_at, self.drive.numbers_at
        self.rules = row_of(NodeRules(control_rules(scenario), *places))
        self.station = station(scenario)
        self.law = law_of(scenario)
        self.rows = rows_for(scenario.controller.max_age_s + scenario.controller.transport_s)
        is_told = source_of(scenario.controller.law) is TurnSource.TOLD
        leader = (self.topics.leader_cmd_vel,) if is_told else ()
        self._estimate, self._command = self.topics.estimate, self.topics.command
        self._wanted = self.topics.wanted
        orders = (self.topics.side,) if may_change else ()
        self.subscribes: tuple[str, ...] = (self.topics.estimate, topics.STOP, *leader, *orders)
        self._drive_type = drive_type(stamped=stamped)

    @functools.cached_property
    def _entries(self) -> ModuleType:
        """The steps, loaded once somebody takes one: a replay in one pass has entries of its own."""
        from hil.nodes import controller_entries

        return controller_entries

    def begin(self, now_ns: int) -> ControllerState:
        """State of a controller that has heard nothing: it keeps the robot still."""
        _ = self._entries
        return self.rows_only(now_ns)

    def rows_only(self, now_ns: int) -> ControllerState:
        """The same for who steps it by entries of his own."""
        desk = Desk(
            rules=self.rules,
            control=row_of(begun(at_station(self.station), now_ns)),
            commands=rows_of(SentCommand, self.rows),
            notes=rows_of(Notes, 1),
            receipts=rows_of(Receipt, MOST_RECEIPTS),
            counts=rows_of(Count, COUNTED),
            event=row_of(TICK),
            result=rows_of(Command, 1),
            decision=self.decision.buffer,
            drive=self.drive.buffer,
        )
        return ControllerState(desk, now_ns)

    def due_ns(self, state: ControllerState) -> int:
        """Time of the next tick: a command leaves at least that often."""
        return state.due_ns()

    def step(
        self, state: ControllerState, event: Event, now_ns: int
    ) -> tuple[ControllerState, tuple[Outgoing, ...]]:
        """Take in an estimate, a stop or a tick; each leads to a command."""
        topic, entries = event.topic, self._entries
        if topic == self._estimate:
            whole = in_little_endian(event.payload, _ESTIMATE)
            if not entries.hear_estimate(state.lent, whole, event.signed_digest, now_ns):
                entries.refuse(state.lent, MALFORMED)
        elif topic:
            entries.hear(state.lent, event.signed_digest, now_ns)
            store(state.desk.event, 0, self._read(state, event))
        else:
            store(state.desk.event, 0, TICK)
        length = entries.control(state.lent, _STOPS, now_ns)
        if not length:
            return state, ()
        decided, driven = state.desk.decision[:length].tobytes(), state.desk.drive.tobytes()
        decision = Outgoing(self._command, _COMMAND, decided, now_ns)
        drive = Outgoing(self._wanted, self._drive_type, driven, now_ns)
        if not is_due(state.next_diagnostics_ns, _DIAGNOSTICS_NS, now_ns):
            return state, (drive, decision)
        state.next_diagnostics_ns = now_ns + _DIAGNOSTICS_NS
        return state, (drive, decision, self.report(state, now_ns))

    def _read(self, state: ControllerState, event: Event) -> ControlEvent:
        """What a message says that is no estimate; what cannot be read says nothing, and is counted."""
        if event.topic == topics.STOP:
            return STOP
        try:
            if event.topic == self.topics.leader_cmd_vel:
                return happened(Happening.LEADER, read_drive(event.payload, stamped=self.topics.stamped).u)
            if event.topic == self.topics.side:
                word = decode_as(event.payload, msg.String).data
                return happened(Happening.ORDER, Side(word).sign)
        except MalformedPayloadError:
            self._entries.refuse(state.lent, MALFORMED)
        except ValueError:
            self._entries.refuse(state.lent, UNKNOWN_SIDE)
        return NOTHING

    def report(self, state: ControllerState, now_ns: int) -> Outgoing:
        """Diagnostics: what was decided how often, and what was refused."""
        known = state.known
        state.answers = with_answer(state.answers, now_ns, state.asked, state.shown)
        problem = "" if known.heard else "waiting for estimates"
        values: dict[str, object] = {"estimate": Status(known.status).name.lower()}
        values |= _side_report(known.follower.station)
        if self.law is not None and (failure := self.law.failure()):
            values[LAW_FAILURE] = failure
        values |= named_counts("decided", state.decided) | named_counts("refused", state.refused)
        values |= named_findings(self.findings(state, now_ns))
        return outgoing(topics.DIAGNOSTICS, diagnostics(self.name, now_ns, problem, values), now_ns)

    def findings(self, state: ControllerState, now_ns: int) -> Findings:
        """What is wrong with what the controller gets, as long as it is; reads rows, and takes no step."""
        return answer_findings(state.answers, now_ns)


def _side_report(station: StationState) -> dict[str, object]:
    """The side that is kept or gone to, and what holds a change up."""
    if station.waits:
        change = "waits for a leader that turns less"
    else:
        change = "none" if station.change.arrived else "under way"
    return {"side": station.ordered.value, "side_change": change}
