"""The closed loop on a simulated clock: the lab, and for each follower an estimator and a controller.

It is what :class:`hil.lockstep.lockstep.Lockstep` does with the nodes of a run, event by event and to the
nanosecond, but for the messages in between: the same functions in the same order, so that a run is the same
to the last bit. What messages of one moment would be is done in the order in which they would be delivered.
"""

from __future__ import annotations

import math

from controllers.guard import CLOCK_TOLERANCE_NS
from estimation.models.measurement import PairSeen
from estimation.own_motion.odometry_check import OdometrySample
from estimation.tracking.prediction import Reported
from estimation.tracking.track_point import DUPLICATE, LATE
from estimation.tracking.tracker import COASTING, LOST, newest, status_of
from formation.kernel import kernel
from formation.pose import Motion
from formation.records import load, part, size, store
from hil.emulator.mocap import SeenPose
from hil.emulator.robot import Robot, pose_of, travelling
from hil.emulator.world import (
    CAPTURE,
    FRAME,
    NO_NUMBERS,
    NO_ROOM,
    NOTHING,
    SAMPLE,
    Happened,
    Odometry,
    World,
    advanced,
    due_ns,
    halted,
)
from hil.emulator.world import commanded as robot_commanded
from hil.lockstep.flight import (
    LANDED,
    RUNNING,
    SHORT_OF_NUMBERS,
    SHORT_OF_ROOM,
    STUCK,
    Clock,
    Flight,
    KeptCommand,
    KeptEstimate,
    Order,
    Plan,
    Rooms,
    TrueFrame,
    sent_of,
    tracks_of,
)
from hil.nodes import estimator_step
from hil.nodes.controller_step import (
    ControlRules,
    ControlState,
    at_time,
    can_be,
    commanded,
    heard_estimate,
    heard_leader,
    heard_order,
    heard_stop,
)
from hil.nodes.estimator_records import Known, Rules
from hil.nodes.own_motion_step import is_under_way, take_not_finite
from hil.wire.message_checks import ACCEPTED, NOT_FINITE, check_odometry, place_cause, planar
from hil.wire.records import Odometry as Message
from hil.wire.records import Placement, stamp_of

_NS = 1e-9
_NEVER = 2**62
_SAME_PLACE = 1e-3
_ESTIMATOR_TICK_NS = 50_000_000
_REPORT_NS = 500_000_000


@kernel(inline=False)
def flown(flight: Flight, plan: Plan, rooms: Rooms) -> Flight:
    """Run on until it is over or lacks something; with that given it goes on where it was."""
    n = size(rooms.clocks)
    while flight.stage == RUNNING:
        due, first = due_ns(flight.world, rooms.lab), -1
        for k in range(n):
            tick_ns = load(Clock, rooms.clocks, k).tick_ns
            if tick_ns < due:
                due, first = tick_ns, k
        for k in range(n):
            tick_ns = load(ControlState, rooms.controls, k).next_tick_ns
            if tick_ns < due:
                due, first = tick_ns, n + k
        if due > flight.end_ns:
            flight = _ended(flight, plan, rooms)
        elif first < 0:
            flight = _lab_tick(flight, plan, rooms, due)
        elif first < n:
            flight = _estimator_tick(flight, plan, rooms, first, due)
        else:
            flight = _controller_tick(flight, plan, rooms, first - n, due)
    return flight


@kernel(inline=False)
def _ended(flight: Flight, plan: Plan, rooms: Rooms) -> Flight:
    """What comes when the time is over: the stop after the drive, the end after the stop."""
    if flight.world.motion_since_ns < 0:
        return flight._replace(stage=STUCK)
    if flight.world.stopped:
        return flight._replace(stage=LANDED)
    now_ns, first = flight.end_ns, flight.commands
    flight = flight._replace(world=halted(flight.world, plan.lab, rooms.lab.robots, now_ns))
    for k in range(size(rooms.clocks)):
        control = heard_stop(at_time(load(ControlState, rooms.controls, k), now_ns))
        flight = _decided(flight, plan, rooms, k, control, now_ns)
    return _obeyed(flight, plan, rooms, first, now_ns)._replace(end_ns=now_ns + plan.after_ns)


@kernel
def _lab_tick(flight: Flight, plan: Plan, rooms: Rooms, now_ns: int) -> Flight:
    """Everything that is due in the lab now, and what follows from it."""
    waiting = 0
    while True:
        step = advanced(flight.world, plan.lab, rooms.lab, now_ns)
        happened = step.happened
        if happened.kind == NO_ROOM:
            return flight._replace(stage=SHORT_OF_ROOM)
        if happened.kind == NO_NUMBERS:
            return flight._replace(stage=SHORT_OF_NUMBERS)
        if happened.kind == NOTHING:
            break
        arrives = step.world.lost == flight.world.lost
        flight = flight._replace(world=step.world)
        if happened.kind == CAPTURE:
            flight = _captured(flight, plan, rooms, happened, arrives)
        elif happened.kind == FRAME:
            waiting = _frame(plan, rooms, happened, now_ns, waiting)
        else:
            _odometry(plan, rooms, happened)
    return _delivered(flight, plan, rooms, waiting, now_ns)


@kernel
def _captured(flight: Flight, plan: Plan, rooms: Rooms, happened: Happened, arrives: bool) -> Flight:
    """Keep the truth of a capture, and pass an operator's orders on."""
    world, n = flight.world, size(rooms.clocks)
    for k in range(n):
        ahead, behind = load(Robot, rooms.lab.robots, k), load(Robot, rooms.lab.robots, k + 1)
        led = travelling(ahead)
        true = TrueFrame(happened.at_ns, arrives, led.pose, pose_of(behind), led.motion, behind.motion)
        store(rooms.truth, happened.number * n + k, true)
    flight = flight._replace(captures=happened.number + 1)
    if world.motion_since_ns < 0:
        return flight
    if world.motion_since_ns == happened.at_ns:
        flight = flight._replace(end_ns=happened.at_ns + plan.duration_ns)
    t = (happened.at_ns - world.motion_since_ns) * _NS
    while not world.stopped and flight.orders < size(rooms.orders):
        order = load(Order, rooms.orders, flight.orders)
        if t < order.at:
            break
        control = at_time(load(ControlState, rooms.controls, 0), happened.at_ns)
        heard = heard_order(control, load(ControlRules, rooms.control_rules, 0), order.sign)
        store(rooms.controls, 0, heard.state)
        flight = flight._replace(orders=flight.orders + 1)
    return flight


@kernel
def _frame(plan: Plan, rooms: Rooms, happened: Happened, now_ns: int, waiting: int) -> int:
    """A frame has arrived: every estimator looks at its pair; the number of estimates on their way."""
    capture_ns = happened.stamp_ns - plan.offset_ns
    if capture_ns < 0 or capture_ns > now_ns + CLOCK_TOLERANCE_NS:
        return waiting
    n = size(rooms.clocks)
    for k in range(n):
        first = happened.slot * (n + 1) + k
        leader = _placed(load(SeenPose, rooms.lab.seen, first))
        follower = _placed(load(SeenPose, rooms.lab.seen, first + 1))
        if place_cause(leader) == ACCEPTED and place_cause(follower) == ACCEPTED:
            dx, dy = leader.x - follower.x, leader.y - follower.y
            if math.sqrt(dx * dx + dy * dy) >= _SAME_PLACE:
                seen = PairSeen(leader.x, leader.y, planar(follower))
                waiting = _seen(plan, rooms, k, capture_ns, seen, now_ns, waiting)
    return waiting


@kernel
def _placed(seen: SeenPose) -> Placement:
    """The whole pose that a frame has of a body."""
    return Placement(seen.x, seen.y, 0.0, 0.0, 0.0, seen.qz, seen.qw)


@kernel
def _seen(
    plan: Plan, rooms: Rooms, k: int, capture_ns: int, seen: PairSeen, now_ns: int, waiting: int
) -> int:
    """The k-th estimator takes in its pair; the number of estimates on their way."""
    rules, tracks = load(Rules, rooms.rules, k), tracks_of(rooms, plan.share, k)
    seen = estimator_step.with_robot(seen, rules.mounts)
    knowns = part(Known, rooms.knowns, k, 1)
    taken = estimator_step.take_frame(knowns, tracks, rules, capture_ns, seen)
    if taken.verdict in (DUPLICATE, LATE):
        return waiting
    store(rooms.clocks, k, load(Clock, rooms.clocks, k)._replace(published_ns=now_ns))
    told = estimator_step.estimate(load(Known, knowns, 0), tracks.points, rules, now_ns)
    store(rooms.waiting, waiting, KeptEstimate(k, now_ns, told.estimate))
    return waiting + 1


@kernel(inline=False)
def _odometry(plan: Plan, rooms: Rooms, happened: Happened) -> None:
    """Odometry has arrived, or was sampled: estimators take theirs, and the leader tells what it drives."""
    n = size(rooms.clocks)
    for k in range(n):
        told = load(Odometry, rooms.lab.odometry, happened.slot * (n + 1) + k + 1)
        if told.arrives_ns == happened.stamp_ns:
            _heard(plan, rooms, k, told, happened.stamp_ns)
    if happened.kind == SAMPLE:
        u1 = load(Robot, rooms.lab.robots, 0).goal.u
        store(rooms.controls, 0, heard_leader(load(ControlState, rooms.controls, 0), u1))


@kernel(inline=False)
def _heard(plan: Plan, rooms: Rooms, k: int, told: Odometry, now_ns: int) -> None:
    """The k-th estimator hears odometry now."""
    known = load(Known, rooms.knowns, k)
    message = Message(True, stamp_of(now_ns), _placed(told.pose), told.motion.v, told.motion.u)
    motion = check_odometry(message, now_ns + CLOCK_TOLERANCE_NS)
    if motion.cause == NOT_FINITE:
        store(rooms.knowns, k, take_not_finite(known, now_ns))
    if motion.cause != ACCEPTED:
        return
    sample = OdometrySample(motion.stamp_ns, motion.v2, motion.u2, motion.has_pose, motion.pose)
    tracks, rules = tracks_of(rooms, plan.share, k), load(Rules, rooms.rules, k)
    estimator_step.take_odometry(part(Known, rooms.knowns, k, 1), tracks, rules, sample)


@kernel(inline=False)
def _delivered(flight: Flight, plan: Plan, rooms: Rooms, waiting: int, now_ns: int) -> Flight:
    """Estimates reach their controllers, whose commands reach the robots."""
    first = flight.commands
    for k in range(waiting):
        flight = _told(flight, plan, rooms, load(KeptEstimate, rooms.waiting, k), now_ns)
    return _obeyed(flight, plan, rooms, first, now_ns)


@kernel
def _told(flight: Flight, plan: Plan, rooms: Rooms, kept: KeptEstimate, now_ns: int) -> Flight:
    """An estimate reaches its controller: it is kept if it is to be judged, and leads to a command."""
    since_ns, judged_ns = flight.world.motion_since_ns, plan.judged_from_ns
    k, e = kept.follower, kept.estimate
    if judged_ns < 0 or (since_ns >= 0 and e.capture_ns >= since_ns + judged_ns):
        store(rooms.estimates, flight.estimates, kept)
        flight = flight._replace(estimates=flight.estimates + 1)
    control = at_time(load(ControlState, rooms.controls, k), now_ns)
    reported = Reported(
        e.capture_ns,
        e.measured_ns,
        e.rho,
        e.alpha2,
        e.v1,
        e.alpha1,
        e.u1,
        e.joint.u_u,
        e.v2,
        e.u2,
        e.joint.b_u,
    )
    if not can_be(reported, now_ns):
        store(rooms.controls, k, control)
        return flight
    control = heard_estimate(control, load(ControlRules, rooms.control_rules, k), reported, e.status, now_ns)
    return _decided(flight, plan, rooms, k, control, now_ns)


@kernel
def _decided(flight: Flight, plan: Plan, rooms: Rooms, k: int, control: ControlState, now_ns: int) -> Flight:
    """The k-th controller decides on a command, which is on its way then."""
    rules = load(ControlRules, rooms.control_rules, k)
    controlled = commanded(control, rules, sent_of(rooms, plan.share, k), now_ns)
    store(rooms.controls, k, controlled.state)
    clock = load(Clock, rooms.clocks, k)
    if not now_ns < clock.control_report_ns <= now_ns + _REPORT_NS:
        well = clock.controller_well or controlled.state.heard
        clock = clock._replace(control_report_ns=now_ns + _REPORT_NS, controller_well=well)
        store(rooms.clocks, k, clock)
    store(rooms.commands, flight.commands, KeptCommand(k, now_ns, controlled.command))
    return flight._replace(commands=flight.commands + 1)


@kernel
def _obeyed(flight: Flight, plan: Plan, rooms: Rooms, first: int, now_ns: int) -> Flight:
    """Commands from the ``first`` on reach their robots, and whoever follows those."""
    world = flight.world
    for number in range(first, flight.commands):
        sent = load(KeptCommand, rooms.commands, number)
        k, wanted = sent.follower, Motion(sent.command.v, sent.command.u)
        world = robot_commanded(world, plan.lab, rooms.lab.robots, k + 1, wanted, now_ns)
        if not world.ready:
            store(rooms.clocks, k, load(Clock, rooms.clocks, k)._replace(commanded=True))
        if k + 1 < size(rooms.clocks):
            behind = load(ControlState, rooms.controls, k + 1)
            store(rooms.controls, k + 1, heard_leader(behind, sent.command.u))
    return flight._replace(world=_readied(world, rooms))


@kernel(inline=False)
def _controller_tick(flight: Flight, plan: Plan, rooms: Rooms, k: int, now_ns: int) -> Flight:
    """A command leaves, since none has for long."""
    first = flight.commands
    control = at_time(load(ControlState, rooms.controls, k), now_ns)
    return _obeyed(_decided(flight, plan, rooms, k, control, now_ns), plan, rooms, first, now_ns)


@kernel(inline=False)
def _estimator_tick(flight: Flight, plan: Plan, rooms: Rooms, k: int, now_ns: int) -> Flight:
    """Speak up while measurements are missing, and report on the node itself."""
    clock, known, rules = (
        load(Clock, rooms.clocks, k),
        load(Known, rooms.knowns, k),
        load(Rules, rooms.rules, k),
    )
    waiting, points = 0, tracks_of(rooms, plan.share, k).points
    if known.track.length > 0:
        status = status_of(newest(points, known.track), now_ns, rules.settings)
        missing = status in (COASTING, LOST)
        if missing and (now_ns - clock.published_ns) * 2 > _ESTIMATOR_TICK_NS:
            told = estimator_step.estimate(known, points, rules, now_ns)
            store(rooms.waiting, 0, KeptEstimate(k, now_ns, told.estimate))
            waiting = 1
            clock = clock._replace(published_ns=now_ns)
    if not now_ns < clock.report_ns <= now_ns + _REPORT_NS:
        well = clock.estimator_well or is_under_way(known, rules)
        clock = clock._replace(report_ns=now_ns + _REPORT_NS, estimator_well=well)
    store(rooms.clocks, k, clock._replace(tick_ns=now_ns + _ESTIMATOR_TICK_NS))
    flight = _delivered(flight, plan, rooms, waiting, now_ns)
    return flight._replace(world=_readied(flight.world, rooms))


@kernel
def _readied(world: World, rooms: Rooms) -> World:
    """World in which the leader may set off, once all are well and every robot has had a command."""
    if world.ready:
        return world
    for k in range(size(rooms.clocks)):
        clock = load(Clock, rooms.clocks, k)
        if not (clock.estimator_well and clock.controller_well and clock.commanded):
            return world
    return world._replace(ready=True)
