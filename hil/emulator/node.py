"""The emulator daemon: the robots of a pair or a chain, and a motion capture that stand in for the lab.

The leader stands until everything behind it is alive (start barrier): estimators, controllers and, where the
run has one, recorder have reported that they are well, and a command has reached every follower.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Callable
from functools import partial
from itertools import pairwise

from msgspec import Struct, field
from msgspec.structs import replace

from formation.pose import STANDSTILL, Motion, Pose
from hil.emulator.faults import Pair, faulty
from hil.emulator.lab_messages import frame_message, odometry_message, truth_message
from hil.emulator.mocap import (
    CaptureClock,
    Delivery,
    Draw,
    MocapNoise,
    Stream,
    draw_frame,
    normals,
    observe,
)
from hil.emulator.robot import Actuators, Robot, drive
from hil.nodes.node import Counts, Outgoing, counted, diagnostics, named_counts, no_counts, outgoing
from hil.scenario.links import links_of, node_names
from hil.scenario.ordered_sides import ordered_sides
from hil.scenario.parts import leader_program
from hil.scenario.schema import Scenario
from hil.scenario.start import chain_poses
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.drive_message import drive_message, read_drive
from hil.wire.events import Event
from hil.wire.messages import MalformedPayloadError, decode_as
from hil.wire.topics import link_topics

NAME = "emulator"
_NS = 1e-9
_DIAGNOSTICS_NS = 500_000_000


class EmulatorState(Struct, frozen=True):
    """The world: all robots at ``time_ns``, the leader first, what is on its way, and what is due next.

    ``alive``: nodes that have reported to be well. ``commanded``: followers that have had a command, by
    their place. ``motion_since_ns``: when the leader set off, None before. ``pending``: captured frames, and
    odometry that is told later, by release time. ``shown``: what the newest frame shows of every robot.
    ``orders``: how many orders to change sides were given.
    """

    time_ns: int
    begun_ns: int
    robots: tuple[Robot, ...]
    frames: int = 0
    odometry: int = 0
    lost: int = 0
    pending: tuple[tuple[int, int, Outgoing], ...] = ()
    alive: frozenset[str] = frozenset()
    commanded: frozenset[int] = frozenset()
    stopped: bool = False
    motion_since_ns: int | None = None
    refused: Counts = field(default_factory=no_counts)
    next_diagnostics_ns: int = 0
    shown: tuple[Pose, ...] = ()
    orders: int = 0


class EmulatorNode:
    """Pure step of the emulator daemon.

    ``needs``: the daemons that the start barrier waits for; where these host a node for each follower of a
    chain, all of them.
    """

    name = NAME

    def __init__(
        self, scenario: Scenario, needs: frozenset[str] = frozenset({"estimator", "controller"})
    ) -> None:
        robot, mocap = scenario.robot, scenario.mocap
        self.scenario = scenario
        links = links_of(scenario)
        self.needs = frozenset(name for need in needs for name in node_names(need, links))
        self.pairs = [link_topics(link) for link in links]
        self.topics = self.pairs[0]
        self.names = (self.topics.leader, *(pair.follower for pair in self.pairs))
        self.program = leader_program(scenario)
        self.poses = chain_poses(scenario, len(self.names))
        self.actuators = Actuators(
            robot.lag_s, robot.v_max, robot.u_max, robot.v_resolution, robot.u_resolution
        )
        self.noise = MocapNoise(mocap.sigma_position, mocap.sigma_heading, mocap.static_fraction)
        self.delivery = Delivery(mocap.latency_s, mocap.jitter_s, mocap.loss)
        self.clock = CaptureClock(
            mocap.clock_offset_s, mocap.clock_drift_ppm * 1e-6, mocap.clock_jump_s, mocap.clock_jump_at_s
        )
        self.orders = ordered_sides(scenario)
        self._handlers: dict[str, Callable[[EmulatorState, bytes, int], EmulatorState]] = {
            **{pair.cmd_vel: partial(self._on_command, k) for k, pair in enumerate(self.pairs, start=1)},
            topics.STOP: self._on_stop,
            topics.DIAGNOSTICS: self._on_diagnostics,
        }
        self.subscribes = tuple(self._handlers)

    def begin(self, now_ns: int) -> EmulatorState:
        """All robots stand at their start poses."""
        return EmulatorState(now_ns, now_ns, tuple(map(Robot, self.poses)), next_diagnostics_ns=now_ns)

    def due_ns(self, state: EmulatorState) -> int:
        """Time of the next capture, odometry sample, or release of a captured frame."""
        due = min(self._capture_ns(state), self._odometry_ns(state))
        return min(due, state.pending[0][0]) if state.pending else due

    def step(
        self, state: EmulatorState, event: Event, now_ns: int
    ) -> tuple[EmulatorState, tuple[Outgoing, ...]]:
        """Let the world go on to ``now_ns``, then take in a command, a stop or a report.

        The robots move from one thing that matters to them to the next, so that it makes no difference how
        often a node is called in between.
        """
        state, out = self._catch_up(state, now_ns)
        handler = self._handlers.get(event.topic)
        if handler is None:
            return state, out
        try:
            return handler(state, event.payload, now_ns), out
        except MalformedPayloadError:
            return replace(state, refused=counted(state.refused, "malformed")), out

    def _on_command(self, place: int, state: EmulatorState, payload: bytes, now_ns: int) -> EmulatorState:
        wanted = STANDSTILL if state.stopped else read_drive(payload, stamped=self.topics.stamped)
        state = self._move(state, now_ns)
        return replace(
            _with_command(state, place, self.actuators.accept(wanted)), commanded=state.commanded | {place}
        )

    def _on_stop(self, state: EmulatorState, payload: bytes, now_ns: int) -> EmulatorState:
        state = self._move(state, now_ns)
        robots = tuple(robot.told(STANDSTILL) for robot in state.robots)
        return replace(state, stopped=True, robots=robots)

    def _on_diagnostics(self, state: EmulatorState, payload: bytes, now_ns: int) -> EmulatorState:
        report = decode_as(payload, msg.DiagnosticArray)
        well = {status.name.removeprefix("abreast/") for status in report.status if status.level == 0}
        return replace(state, alive=state.alive | (well & self.needs))

    def _catch_up(self, state: EmulatorState, now_ns: int) -> tuple[EmulatorState, tuple[Outgoing, ...]]:
        """Do everything that was due until now, in the order in which it was."""
        out: list[Outgoing] = []
        while (due_ns := self.due_ns(state)) <= now_ns:
            if state.pending and state.pending[0][0] == due_ns:
                out.append(state.pending[0][2])
                state = replace(state, pending=state.pending[1:])
            elif self._odometry_ns(state) == due_ns:
                state = self._sample_odometry(self._move(state, due_ns), out)
            else:
                state = self._capture(self._move(state, due_ns), out)
        return state, tuple(out)

    def _move(self, state: EmulatorState, until_ns: int) -> EmulatorState:
        dt = (until_ns - state.time_ns) * _NS
        if dt <= 0.0:
            return state
        robots = tuple(drive(robot, self.actuators, dt) for robot in state.robots)
        return replace(state, time_ns=until_ns, robots=robots)

    def _capture(self, state: EmulatorState, out: list[Outgoing]) -> EmulatorState:
        """Take a mocap frame, publish the truth, and let the leader's program go on."""
        at_ns, number = state.time_ns, state.frames
        state = self._lead(state, at_ns)
        for pair, (leader, follower) in zip(self.pairs, pairwise(state.robots), strict=True):
            out.append(outgoing(pair.truth, truth_message(at_ns, number, leader, follower), at_ns))
        state = self._order(state, out)
        draw = draw_frame(self.scenario.run.seed, number, self.delivery, len(state.robots))
        state = replace(state, frames=number + 1)
        shown = () if draw.lost else self._shown(state, draw)
        if not shown:
            state = replace(state, lost=state.lost + 1)
        else:
            bodies = zip(self.names, shown, strict=True)
            stamp_ns = self.clock.stamp_ns(at_ns, state.begun_ns, state.motion_since_ns)
            frame = outgoing(topics.RIGID_BODIES, frame_message(stamp_ns, number, bodies), at_ns)
            state = replace(state, shown=shown)
            state = _with_pending(state, at_ns + round(draw.delay / _NS), number, frame)
        if at_ns >= state.next_diagnostics_ns:
            out.append(self.report(state, at_ns))
            state = replace(state, next_diagnostics_ns=at_ns + _DIAGNOSTICS_NS)
        return state

    def _shown(self, state: EmulatorState, draw: Draw) -> tuple[Pose, ...]:
        """All bodies as the motion capture shows them now, faults included; empty for no frame at all."""
        mocap = self.scenario.mocap
        poses = tuple(
            observe(robot.pose, robot.motion, self.noise, normal)
            for robot, normal in zip(state.robots, draw.bodies, strict=True)
        )
        if not mocap.faults or state.motion_since_ns is None:
            return poses
        t = (state.time_ns - state.motion_since_ns) * _NS
        last = Pair(*state.shown[:2]) if state.shown else None
        pair = faulty(mocap.faults, t, 1.0 / mocap.rate_hz, Pair(*poses[:2]), last)
        return () if pair is None else (pair.leader, pair.follower, *poses[2:])

    def _lead(self, state: EmulatorState, at_ns: int) -> EmulatorState:
        """Give the leader its next command; it sets off once all are alive."""
        if state.stopped:
            return state
        since_ns = state.motion_since_ns
        if since_ns is None:
            if len(state.commanded) < len(self.pairs) or not state.alive >= self.needs:
                return state
            since_ns = at_ns
            state = replace(state, motion_since_ns=at_ns, next_diagnostics_ns=at_ns)
        command = self.actuators.accept(self.program((at_ns - since_ns) * _NS))
        return _with_command(state, 0, command)

    def _order(self, state: EmulatorState, out: list[Outgoing]) -> EmulatorState:
        """Tell the follower to go to the other side when the scenario says so, as an operator would."""
        if state.motion_since_ns is None or state.stopped:
            return state
        t = (state.time_ns - state.motion_since_ns) * _NS
        while state.orders < len(self.orders) and t >= self.orders[state.orders][0]:
            order = msg.String(data=self.orders[state.orders][1].value)
            state = replace(state, orders=state.orders + 1)
            out.append(outgoing(self.topics.side, order, state.time_ns))
        return state

    def _sample_odometry(self, state: EmulatorState, out: list[Outgoing]) -> EmulatorState:
        number, at_ns, robot = state.odometry, state.time_ns, self.scenario.robot
        for stream, (name, body) in enumerate(
            zip(self.names, state.robots, strict=True), start=Stream.LEADER_ODOMETRY
        ):
            normal = normals(self.scenario.run.seed, stream, number, 2)
            moving = 0.0 if body.motion == STANDSTILL else 1.0
            measured = Motion(
                robot.odometry_scale_v * body.motion.v + moving * robot.odometry_sigma_v * normal[0],
                robot.odometry_scale_u * body.motion.u + moving * robot.odometry_sigma_u * normal[1],
            )
            told_ns = at_ns + round(robot.odometry_delay_s / _NS)
            message = outgoing(f"{name}/odom", odometry_message(told_ns, name, body.pose, measured), told_ns)
            if told_ns == at_ns:
                out.append(message)
            else:
                state = _with_pending(state, told_ns, number, message)
        leader_drives = drive_message(
            state.robots[0].command, at_ns, self.topics.leader, stamped=self.topics.stamped
        )
        out.append(outgoing(self.topics.leader_cmd_vel, leader_drives, at_ns))
        return replace(state, odometry=number + 1)

    def _capture_ns(self, state: EmulatorState) -> int:
        return state.begun_ns + round(state.frames / self.scenario.mocap.rate_hz / _NS)

    def _odometry_ns(self, state: EmulatorState) -> int:
        return state.begun_ns + round(state.odometry / self.scenario.robot.odometry_rate_hz / _NS)

    def report(self, state: EmulatorState, now_ns: int) -> Outgoing:
        """Diagnostics: what the start barrier still waits for, since when the leader moves, frames lost."""
        missing = sorted(self.needs - state.alive)
        if not state.commanded:
            missing.append("a command")
        elif len(state.commanded) < len(self.pairs):
            missing += [
                f"a command to {pair.follower}"
                for place, pair in enumerate(self.pairs, start=1)
                if place not in state.commanded
            ]
        problem = f"waiting for {', '.join(missing)}" if missing else ""
        values: dict[str, object] = {"stopped": state.stopped, "frames": state.frames, "lost": state.lost}
        if state.motion_since_ns is not None:
            values["motion_since_ns"] = state.motion_since_ns
        values |= named_counts("refused", state.refused)
        return outgoing(topics.DIAGNOSTICS, diagnostics(self.name, now_ns, problem, values), now_ns)


def _with_command(state: EmulatorState, place: int, command: Motion) -> EmulatorState:
    robots = state.robots
    return replace(state, robots=(*robots[:place], robots[place].told(command), *robots[place + 1 :]))


def _with_pending(state: EmulatorState, release_ns: int, number: int, message: Outgoing) -> EmulatorState:
    pending = list(state.pending)
    insort(pending, (release_ns, number, message), key=lambda item: item[:2])
    return replace(state, pending=tuple(pending))
