"""Runs of one scenario in the compiled loop, each to the last bit the lockstep run of the same seed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from controllers.station_keeper import at_station
from estimation.consistency.filter_bank import Member
from estimation.consistency.slip_estimate import BANK
from estimation.filters.filter import Filter
from estimation.own_motion.odometry_check import WayEntry
from estimation.own_motion.odometry_history import MotionSample
from estimation.own_motion.own_track import OwnPoint
from estimation.tracking.prediction import SentCommand, rows_for
from estimation.tracking.track_point import TrackPoint
from formation.pose import Motion
from formation.records import Rows, columns_of, row_of, rows_of, store
from hil.emulator.mocap import BodyNormals, Shares, Stream, block_length, draw_into
from hil.emulator.odometry_faults import Reckoning
from hil.emulator.plant import lab_of, memory_of, world_at
from hil.emulator.robot import standing
from hil.emulator.world import Memory
from hil.errors import CheckFailedError
from hil.lockstep.flight import (
    LANDED,
    SHORT_OF_ROOM,
    Clock,
    Flight,
    KeptCommand,
    KeptEstimate,
    Order,
    Plan,
    Rooms,
    Share,
    TrueFrame,
)
from hil.lockstep.lockstep import EPOCH_NS
from hil.nodes.control_rules import control_rules
from hil.nodes.controller_step import ControlRules, ControlState, begun
from hil.nodes.estimator_desk import NOTHING_KNOWN
from hil.nodes.estimator_memory import HISTORY, WAYS, room_for, rules_of
from hil.nodes.estimator_records import Known, Rules
from hil.scenario.links import links_of
from hil.scenario.ordered_sides import ordered_sides
from hil.scenario.parts import station
from hil.scenario.schema import Scenario
from hil.scenario.start import chain_poses

START_TIMEOUT_S = 10.0
"""When the leader must have set off."""

STOPPING_S = 0.6
"""Time given to the robots to come to rest after the stop."""

_SOON_S = 3.0  # nearly every leader has set off by then, with less noise to draw
_SPARE_S = 0.5
_NS = 1e-9
_LEAST_ROOM = 64
_SPARE_RATE = 1.25  # small rings stay in the processor's cache
_MORE_COMMANDS_HZ = 25.0  # of the estimator's ticks, and one for the stop


_NEW = Clock(EPOCH_NS, EPOCH_NS, EPOCH_NS, -1, estimator_well=False, controller_well=False, commanded=False)


@dataclass(frozen=True, slots=True, eq=False)
class Flown:
    """What a run left behind, as views that the next run overwrites; times are on the simulated clock.

    ``since_ns``: when the leader set off. ``truth``: of all captures, for each its pairs in order.
    ``estimates``, ``commands``: of all followers, in the order in which they were made.
    """

    pairs: int
    since_ns: int
    truth: NDArray[np.void]
    estimates: NDArray[np.void]
    commands: NDArray[np.void]


class Flyer:
    """Flies runs of a scenario that differ by their seed.

    ``judged_from_ns``: from when after the leader's start estimates are kept, -1 for all; ``after_s``:
    how long a run goes on past the stop. An estimator that cannot be compiled flies through the same loop in
    plain Python. Raises :class:`~hil.errors.UsageError` as the nodes of the scenario do.
    """

    def __init__(self, scenario: Scenario, *, judged_from_ns: int = -1, after_s: float = STOPPING_S) -> None:
        self.scenario = scenario
        links = links_of(scenario)
        self.followers = len(links)
        self._pairs = [link.scenario for link in links]
        self._rules = [rules_of(pair) for pair in self._pairs]
        self._compiled = all(isinstance(rules.filter, Filter) for rules in self._rules)
        self._poses = chain_poses(scenario, self.followers + 1)
        orders = () if len(links) > 1 else ordered_sides(scenario)
        self._orders = rows_of(Order, len(orders))
        for k, (at, side) in enumerate(orders):
            store(self._orders, k, Order(float(at), float(side.sign)))
        duration_ns = round(scenario.run.duration_s * 1e9)
        offset_ns = round(scenario.estimator.stamp_offset_s * 1e9)
        self._after_s, self._judged_from_ns = after_s, judged_from_ns
        control, window = scenario.controller, self._rules[0].settings.window
        self._share = Share(
            points=room_for(window, _SPARE_RATE * scenario.mocap.rate_hz),
            history=room_for(HISTORY, _SPARE_RATE * scenario.robot.odometry_rate_hz),
            own=room_for(window, _SPARE_RATE * scenario.mocap.rate_hz),
            ways=WAYS,
            sent=rows_for(control.max_age_s + control.transport_s),
        )
        after_ns, lab = round(after_s * 1e9), lab_of(scenario)
        self._plan = Plan(lab, 0, duration_ns, after_ns, judged_from_ns, offset_ns, self._share)
        self._in_flight = _LEAST_ROOM
        self._furnish(_SOON_S)

    def fly(self, seed: int) -> Flown:
        """One run. Raises :class:`CheckFailedError` if the leader never sets off."""
        while (stage := self._flown(seed)) != LANDED:
            if stage == SHORT_OF_ROOM:
                self._in_flight *= 2
                self._furnish(self._patience)
            elif self._patience < START_TIMEOUT_S:
                self._furnish(START_TIMEOUT_S)
            else:
                raise CheckFailedError(
                    f"run with seed {seed}: the start barrier did not open within {START_TIMEOUT_S:g} s of "
                    "simulated time; a follower gets no frames or no odometry: check mocap.loss, "
                    "mocap.latency_s and the rates"
                )
        flight = columns_of(self._flight)[0]
        rooms = self.rooms
        return Flown(
            pairs=self.followers,
            since_ns=int(flight["world"]["motion_since_ns"]),
            truth=columns_of(rooms.truth)[: int(flight["captures"]) * self.followers],
            estimates=columns_of(rooms.estimates)[: int(flight["estimates"])],
            commands=columns_of(rooms.commands)[: int(flight["commands"])],
        )

    def _flown(self, seed: int) -> int:
        """Fly from the begin; the stage in which that ends."""
        self._draw(seed)
        self._reset()
        if self._compiled:
            from hil.lockstep.loop_entries import fly

            enter: Callable[..., int] = fly
            return enter(self._flight, self._plans, *self.rooms.lab, *self.rooms[1:])
        from hil.lockstep.loop import flown

        flight = flown(self._start(), self._planned, self.rooms)
        store(self._flight, 0, flight)
        return flight.stage

    def _furnish(self, patience: float) -> None:
        """Memory for runs that set off within ``patience`` [s]."""
        scenario, n = self.scenario, self.followers
        self._patience = patience
        self._planned = self._plan._replace(patience_ns=EPOCH_NS + round(patience * 1e9))
        self._plans, self._flight = row_of(self._planned), rows_of(Flight, 1)
        seconds = patience + _SPARE_S + scenario.run.duration_s + self._after_s
        frames = math.ceil(seconds * scenario.mocap.rate_hz) + 2
        commands = n * (frames + math.ceil(seconds * (scenario.controller.tick_hz + _MORE_COMMANDS_HZ)) + 2)
        lab = memory_of(scenario, self._poses, self._in_flight)
        samples = math.ceil(seconds * scenario.robot.odometry_rate_hz) + 2
        self._frame_blocks = math.ceil(frames / block_length(Stream.MOCAP))
        self._sample_blocks = math.ceil(samples / block_length(Stream.LEADER_ODOMETRY))
        drawn, sampled = self._drawn
        lab = lab._replace(
            normals=rows_of(BodyNormals, drawn * (n + 1)),
            shares=rows_of(Shares, drawn),
            odometry_normals=rows_of(Motion, sampled * (n + 1)),
        )
        self.rooms = self._rooms(lab, frames, commands)

    @property
    def _drawn(self) -> tuple[int, int]:
        """Frames and odometry samples that there are random numbers for."""
        frames = self._frame_blocks * block_length(Stream.MOCAP)
        return frames, self._sample_blocks * block_length(Stream.LEADER_ODOMETRY)

    def _rooms(self, lab: Memory, frames: int, commands: int) -> Rooms:
        n, share = self.followers, self._share
        rules, controls = rows_of(Rules, n), rows_of(ControlRules, n)
        points: Any = rows_of(TrackPoint, n * share.points)
        if self._compiled:
            for k, each in enumerate(self._rules):
                store(rules, k, each)
        else:
            rules = cast("Rows[Rules]", list(self._rules))
            points = [None] * (n * share.points)
        for k, pair in enumerate(self._pairs):
            store(controls, k, control_rules(pair))
        return Rooms(
            lab,
            rows_of(Clock, n),
            rows_of(Known, n),
            rows_of(ControlState, n),
            rules,
            controls,
            points,
            rows_of(MotionSample, n * share.history),
            rows_of(OwnPoint, n * share.own),
            rows_of(WayEntry, n * share.ways),
            rows_of(Member, n * BANK),
            rows_of(SentCommand, n * share.sent),
            self._orders,
            rows_of(KeptEstimate, n * (self._in_flight + 1)),
            rows_of(TrueFrame, n * frames),
            rows_of(KeptEstimate, commands),
            rows_of(KeptCommand, commands),
        )

    def _start(self) -> Flight:
        drawn, sampled = self._drawn
        world = world_at(EPOCH_NS)._replace(frames_drawn=drawn, samples_drawn=sampled)
        return Flight(0, world, self._planned.patience_ns, 0, 0, 0, 0)

    def _reset(self) -> None:
        """Everything as at the begin of a run."""
        lab = self.rooms.lab
        store(self._flight, 0, self._start())
        for k, pose in enumerate(self._poses):
            store(lab.robots, k, standing(pose))
            store(lab.reckoned, k, Reckoning(pose, pose))
        columns_of(lab.underway)["slot"] = np.arange(len(lab.underway))
        columns_of(self.rooms.bank)[:] = 0
        for k, pair in enumerate(self._pairs):
            control = begun(at_station(station(pair)), EPOCH_NS)
            store(self.rooms.clocks, k, _NEW)
            store(self.rooms.knowns, k, NOTHING_KNOWN)
            store(self.rooms.controls, k, control)

    def _draw(self, seed: int) -> None:
        """The random numbers of a seed."""
        lab, n = self.rooms.lab, self.followers + 1
        normals = _numbers(lab.normals).reshape(self._frame_blocks, -1)
        shares = _numbers(lab.shares).reshape(self._frame_blocks, -1)
        nothing, varies = np.empty(0), self._plan.lab.delivery.varies()
        for block in range(self._frame_blocks):
            draw_into(normals[block], shares[block] if varies else nothing, seed, Stream.MOCAP, block)
        odometry = _numbers(lab.odometry_normals).reshape(n, self._sample_blocks, -1)
        for robot in range(n):
            for block in range(self._sample_blocks):
                draw_into(odometry[robot, block], nothing, seed, Stream.LEADER_ODOMETRY + robot, block)


def _numbers(rows: Rows[Any]) -> NDArray[np.float64]:
    """Rows of floats as one flat array."""
    return columns_of(rows).view(np.float64)
