"""The emulator daemon: the robots of a pair or a chain, and a motion capture that stand in for the lab.

The leader stands until everything behind it is alive (start barrier): estimators, controllers and, where the
run has one, recorder have reported that they are well, and a command has reached every follower.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial

from hil.emulator.guarded import EmulatedGuards
from hil.emulator.lab_writer import LabWriter
from hil.emulator.plant import Plant
from hil.emulator.robot import Robot
from hil.emulator.world import CAPTURE, FRAME, NOTHING, SAMPLE, Happened
from hil.nodes.node import Counts, Outgoing, counted, diagnostics, named_counts, no_counts, outgoing
from hil.nodes.start_barrier import NOBODY, Attendance, StartBarrier
from hil.scenario.links import links_of
from hil.scenario.ordered_sides import ordered_sides
from hil.scenario.schema import Scenario
from hil.scenario.start import chain_poses
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.messages import MalformedPayloadError
from hil.wire.topics import link_topics

NAME = "emulator"
_NS = 1e-9
_DIAGNOSTICS_NS = 500_000_000


@dataclass(slots=True, eq=False)
class EmulatorState:
    """The lab, when its next thing is due, and what the node knows besides; it changes in place.

    ``present``: who is there for the start. ``orders``: how many orders to change sides were given.
    ``guards``: those of the followers, where the scenario has them.
    """

    plant: Plant
    due_ns: int
    present: Attendance = NOBODY
    refused: Counts = field(default_factory=no_counts)
    next_diagnostics_ns: int = 0
    orders: int = 0
    guards: EmulatedGuards | None = None

    @property
    def motion_since_ns(self) -> int | None:
        """When the leader set off, None before."""
        since_ns = self.plant.motion_since_ns
        return None if since_ns < 0 else since_ns

    @property
    def robots(self) -> tuple[Robot, ...]:
        """All robots as they are now, the leader first."""
        return self.plant.robots()


class EmulatorNode:
    """Step of the emulator daemon.

    ``needs``: the daemons that the start barrier waits for; where these host a node for each follower of a
    chain, all of them.
    """

    name = NAME

    def __init__(
        self, scenario: Scenario, needs: frozenset[str] = frozenset({"estimator", "controller"})
    ) -> None:
        self.scenario = scenario
        links = links_of(scenario)
        self.barrier = StartBarrier(needs, links)
        self.pairs = [link_topics(link) for link in links]
        self.topics = self.pairs[0]
        bodies = (links[0].bodies[0], *(link.bodies[1] for link in links))
        self.writer = LabWriter(bodies, self.pairs)
        self.poses = chain_poses(scenario, len(bodies))
        self.orders = ordered_sides(scenario)
        self._links = links
        take = self._on_wanted if scenario.guard.present else self._on_command
        self._handlers: dict[str, Callable[[EmulatorState, Event, int], Iterable[Outgoing]]] = {
            **{pair.wanted: partial(take, k) for k, pair in enumerate(self.pairs, start=1)},
            topics.STOP: self._on_stop,
            topics.DIAGNOSTICS: self._on_diagnostics,
            **({topics.ARM: self._on_arm} if scenario.guard.present else {}),
        }
        self.subscribes = tuple(self._handlers)

    def begin(self, now_ns: int) -> EmulatorState:
        """All robots stand at their start poses."""
        plant = Plant(self.scenario, self.poses, now_ns)
        guards = EmulatedGuards(self._links, now_ns) if self.scenario.guard.present else None
        return EmulatorState(plant, now_ns, next_diagnostics_ns=now_ns, guards=guards)

    def due_ns(self, state: EmulatorState) -> int:
        """Time of the next capture, odometry sample, release of a captured frame, or look of a guard."""
        return state.due_ns if state.guards is None else min(state.due_ns, state.guards.due_ns)

    def step(
        self, state: EmulatorState, event: Event, now_ns: int
    ) -> tuple[EmulatorState, tuple[Outgoing, ...]]:
        """Let the world go on to ``now_ns``, then take in a command, an order or a report.

        The robots move from one thing that matters to them to the next, so that it makes no difference how
        often a node is called in between.
        """
        out = self._catch_up(state, now_ns) if state.due_ns <= now_ns else ()
        handler = self._handlers.get(event.topic)
        if handler is not None:
            try:
                out = (*out, *handler(state, event, now_ns))
            except MalformedPayloadError:
                state.refused = counted(state.refused, "malformed")
        if state.guards is not None and state.guards.due_ns <= now_ns:
            out = (*out, *self._obeyed(state, state.guards.look(now_ns)), *state.guards.reports(now_ns))
        return state, out

    def _on_command(
        self, place: int, state: EmulatorState, event: Event, now_ns: int
    ) -> tuple[Outgoing, ...]:
        state.plant.command(place, event.payload, now_ns)
        self._commanded(place, state)
        return ()

    def _on_wanted(self, place: int, state: EmulatorState, event: Event, now_ns: int) -> tuple[Outgoing, ...]:
        assert state.guards is not None
        told = tuple(self._obeyed(state, state.guards.hear(place, event, now_ns)))
        if state.guards.has_sender(place):
            self._commanded(place, state)
        return told

    def _obeyed(self, state: EmulatorState, told: Iterable[tuple[int, Outgoing]]) -> Iterator[Outgoing]:
        """What guards tell drivers, done by these."""
        for place, message in told:
            state.plant.command(place, message.payload, message.stamp_ns)
            yield message

    def _commanded(self, place: int, state: EmulatorState) -> None:
        state.present = state.present.with_command(place)
        self._get_ready(state)

    def _on_stop(self, state: EmulatorState, event: Event, now_ns: int) -> tuple[Outgoing, ...]:
        if state.guards is not None:
            state.guards.stop(event)
        state.plant.halt(now_ns)
        return ()

    def _on_arm(self, state: EmulatorState, event: Event, now_ns: int) -> tuple[Outgoing, ...]:
        if state.guards is not None:
            state.guards.arm(event, now_ns)
        return ()

    def _on_diagnostics(self, state: EmulatorState, event: Event, now_ns: int) -> tuple[Outgoing, ...]:
        # Once nobody has to be waited for any more it is left: a chain reports a hundred times a second.
        if not self.barrier.is_open(state.present):
            state.present = self.barrier.heard(state.present, event.payload)
            self._get_ready(state)
        return ()

    def _get_ready(self, state: EmulatorState) -> None:
        """Open the start barrier once all are alive and commanded."""
        if self.barrier.is_open(state.present):
            state.plant.let_go()

    def _catch_up(self, state: EmulatorState, now_ns: int) -> tuple[Outgoing, ...]:
        """Do everything that was due until now, in the order in which it was."""
        out: list[Outgoing] = []
        while state.due_ns <= now_ns:
            happened = state.plant.advance(now_ns)
            if happened.kind == NOTHING:
                break
            state.due_ns = happened.due_ns
            if happened.kind == CAPTURE:
                self._tell_truth(state, happened, out)
            elif happened.kind == FRAME:
                seen = (happened.slot, happened.stamp_ns, happened.number, happened.at_ns)
                out.append(self.writer.frame(state.plant, *seen))
                if state.guards is not None:
                    state.guards.see(out[-1].payload)
            else:
                self._tell_odometry(state.plant, happened, out)
        return tuple(out)

    def _tell_truth(self, state: EmulatorState, happened: Happened, out: list[Outgoing]) -> None:
        """Publish the truth of a capture, and what goes with it: an operator's order, a report."""
        at_ns, number, since_ns = happened.at_ns, happened.number, state.plant.motion_since_ns
        out += self.writer.truths(state.plant, at_ns, number)
        if self.orders and since_ns >= 0 and not state.plant.stopped:
            self._order(state, (at_ns - since_ns) * _NS, at_ns, out)
        if at_ns >= state.next_diagnostics_ns or at_ns == since_ns:
            out.append(self.report(state, at_ns))
            state.next_diagnostics_ns = at_ns + _DIAGNOSTICS_NS

    def _order(self, state: EmulatorState, t: float, at_ns: int, out: list[Outgoing]) -> None:
        """Tell the follower to go to the other side when the scenario says so, as an operator would."""
        while state.orders < len(self.orders) and t >= self.orders[state.orders][0]:
            order = msg.String(data=self.orders[state.orders][1].value)
            state.orders += 1
            out.append(outgoing(self.topics.side, order, at_ns))

    def _tell_odometry(self, plant: Plant, happened: Happened, out: list[Outgoing]) -> None:
        """Publish odometry that arrives, without delay at the sample itself, and what the leader drives."""
        out += self.writer.odometry(plant, happened.slot, happened.stamp_ns)
        if happened.kind == SAMPLE:
            out.append(self.writer.drives(plant, happened.stamp_ns))

    def report(self, state: EmulatorState, now_ns: int) -> Outgoing:
        """Diagnostics: what the start barrier still waits for, since when the leader moves, frames lost."""
        problem = self.barrier.waits_for(state.present)
        world = state.plant.world()
        values: dict[str, object] = {"stopped": world.stopped, "frames": world.frames, "lost": world.lost}
        if world.motion_since_ns >= 0:
            values["motion_since_ns"] = world.motion_since_ns
        values |= named_counts("refused", state.refused)
        return outgoing(topics.DIAGNOSTICS, diagnostics(self.name, now_ns, problem, values), now_ns)
