"""The emulator daemon: two robots and a motion capture that stand in for the lab.

The leader stands until the whole chain is alive (start barrier): estimator, controller and, where the run has
one, recorder have reported that they are well, and a command has reached the follower.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Callable

from msgspec import Struct, field
from msgspec.structs import replace

from formation.pose import STANDSTILL, Motion
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
from hil.nodes.node import Counts, Event, Outgoing, counted, diagnostics, named_counts, no_counts, outgoing
from hil.scenario.parts import leader_program, start_poses
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.drive_message import drive_message, read_drive
from hil.wire.messages import MalformedPayloadError, decode_as
from hil.wire.topics import topics_of

NAME = "emulator"
_NS = 1e-9
_DIAGNOSTICS_NS = 500_000_000


class EmulatorState(Struct, frozen=True):
    """The world: both robots at ``time_ns``, what is on its way, and what is due next.

    ``alive``: daemons that have reported to be well. ``motion_since_ns``: when the leader set off, None
    before. ``pending``: captured frames, and odometry that is told later, by release time. ``shown``: what
    the newest frame shows.
    """

    time_ns: int
    begun_ns: int
    leader: Robot
    follower: Robot
    frames: int = 0
    odometry: int = 0
    lost: int = 0
    pending: tuple[tuple[int, int, Outgoing], ...] = ()
    alive: frozenset[str] = frozenset()
    commanded: bool = False
    stopped: bool = False
    motion_since_ns: int | None = None
    refused: Counts = field(default_factory=no_counts)
    next_diagnostics_ns: int = 0
    shown: Pair | None = None


class EmulatorNode:
    """Pure step of the emulator daemon. ``needs``: names of the daemons that the start barrier waits for."""

    name = NAME

    def __init__(
        self, scenario: Scenario, needs: frozenset[str] = frozenset({"estimator", "controller"})
    ) -> None:
        robot, mocap = scenario.robot, scenario.mocap
        self.scenario = scenario
        self.needs = needs
        self.topics = topics_of(scenario)
        self.program = leader_program(scenario)
        self.poses = start_poses(scenario)
        self.actuators = Actuators(
            robot.lag_s, robot.v_max, robot.u_max, robot.v_resolution, robot.u_resolution
        )
        self.noise = MocapNoise(mocap.sigma_position, mocap.sigma_heading, mocap.static_fraction)
        self.delivery = Delivery(mocap.latency_s, mocap.jitter_s, mocap.loss)
        self.clock = CaptureClock(
            mocap.clock_offset_s, mocap.clock_drift_ppm * 1e-6, mocap.clock_jump_s, mocap.clock_jump_at_s
        )
        self._handlers: dict[str, Callable[[EmulatorState, bytes, int], EmulatorState]] = {
            self.topics.cmd_vel: self._on_command,
            topics.STOP: self._on_stop,
            topics.DIAGNOSTICS: self._on_diagnostics,
        }
        self.subscribes = tuple(self._handlers)

    def begin(self, now_ns: int) -> EmulatorState:
        """Both robots stand at their start poses."""
        leader, follower = self.poses
        return EmulatorState(now_ns, now_ns, Robot(leader), Robot(follower), next_diagnostics_ns=now_ns)

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

    def _on_command(self, state: EmulatorState, payload: bytes, now_ns: int) -> EmulatorState:
        wanted = STANDSTILL if state.stopped else read_drive(payload, stamped=self.topics.stamped)
        state = self._move(state, now_ns)
        follower = state.follower.told(self.actuators.accept(wanted))
        return replace(state, follower=follower, commanded=True)

    def _on_stop(self, state: EmulatorState, payload: bytes, now_ns: int) -> EmulatorState:
        state = self._move(state, now_ns)
        return replace(
            state,
            stopped=True,
            leader=state.leader.told(STANDSTILL),
            follower=state.follower.told(STANDSTILL),
        )

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
        leader = drive(state.leader, self.actuators, dt)
        follower = drive(state.follower, self.actuators, dt)
        return replace(state, time_ns=until_ns, leader=leader, follower=follower)

    def _capture(self, state: EmulatorState, out: list[Outgoing]) -> EmulatorState:
        """Take a mocap frame, publish the truth, and let the leader's program go on."""
        at_ns, number = state.time_ns, state.frames
        state = self._lead(state, at_ns)
        leader, follower = state.leader, state.follower
        out.append(outgoing(topics.TRUTH, truth_message(at_ns, number, leader, follower), at_ns))
        draw = draw_frame(self.scenario.run.seed, number, self.delivery)
        state = replace(state, frames=number + 1)
        shown = None if draw.lost else self._shown(state, draw)
        if shown is None:
            state = replace(state, lost=state.lost + 1)
        else:
            bodies = ((self.topics.leader, shown.leader), (self.topics.follower, shown.follower))
            stamp_ns = self.clock.stamp_ns(at_ns, state.begun_ns, state.motion_since_ns)
            frame = outgoing(topics.RIGID_BODIES, frame_message(stamp_ns, number, bodies), at_ns)
            state = replace(state, shown=shown)
            state = _with_pending(state, at_ns + round(draw.delay / _NS), number, frame)
        if at_ns >= state.next_diagnostics_ns:
            out.append(self.report(state, at_ns))
            state = replace(state, next_diagnostics_ns=at_ns + _DIAGNOSTICS_NS)
        return state

    def _shown(self, state: EmulatorState, draw: Draw) -> Pair | None:
        """Both bodies as the motion capture shows them now, faults included; None for no frame at all."""
        leader, follower, mocap = state.leader, state.follower, self.scenario.mocap
        pair = Pair(
            observe(leader.pose, leader.motion, self.noise, draw.leader),
            observe(follower.pose, follower.motion, self.noise, draw.follower),
        )
        if not mocap.faults or state.motion_since_ns is None:
            return pair
        t = (state.time_ns - state.motion_since_ns) * _NS
        return faulty(mocap.faults, t, 1.0 / mocap.rate_hz, pair, state.shown)

    def _lead(self, state: EmulatorState, at_ns: int) -> EmulatorState:
        """Give the leader its next command; it sets off once all are alive."""
        if state.stopped:
            return state
        since_ns = state.motion_since_ns
        if since_ns is None:
            if not (state.commanded and state.alive >= self.needs):
                return state
            since_ns = at_ns
            state = replace(state, motion_since_ns=at_ns, next_diagnostics_ns=at_ns)
        command = self.actuators.accept(self.program((at_ns - since_ns) * _NS))
        return replace(state, leader=state.leader.told(command))

    def _sample_odometry(self, state: EmulatorState, out: list[Outgoing]) -> EmulatorState:
        number, at_ns, robot = state.odometry, state.time_ns, self.scenario.robot
        for name, stream, body in (
            (self.topics.leader, Stream.LEADER_ODOMETRY, state.leader),
            (self.topics.follower, Stream.FOLLOWER_ODOMETRY, state.follower),
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
            state.leader.command, at_ns, self.topics.leader, stamped=self.topics.stamped
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
        problem = f"waiting for {', '.join(missing)}" if missing else ""
        values: dict[str, object] = {"stopped": state.stopped, "frames": state.frames, "lost": state.lost}
        if state.motion_since_ns is not None:
            values["motion_since_ns"] = state.motion_since_ns
        values |= named_counts("refused", state.refused)
        return outgoing(topics.DIAGNOSTICS, diagnostics(self.name, now_ns, problem, values), now_ns)


def _with_pending(state: EmulatorState, release_ns: int, number: int, message: Outgoing) -> EmulatorState:
    pending = list(state.pending)
    insort(pending, (release_ns, number, message), key=lambda item: item[:2])
    return replace(state, pending=tuple(pending))
