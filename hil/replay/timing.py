"""What a log tells of its timing: how late the robot answers to commands, and how late mocap stamps are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from estimation.calibration.actuator_response import ActuatorResponse, fit_response
from estimation.own_motion.input_alignment import UNKNOWN, Alignment, Known
from estimation.own_motion.odometry_correction import LEAST_LAG, is_surely_off
from hil.log.events import logged_events
from hil.log.metadata import IMPORT, mode_of
from hil.log.reader import Log
from hil.replay.odometry_alignment import OwnRecord, own_alignment, own_record, response_settings
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.drive_message import read_drive
from hil.wire.messages import MalformedPayloadError, decode_as, to_ns
from hil.wire.topics import Topics, topics_of

EARLY_SDS = 3.0
LEAST_EARLY = 0.005
"""An answer that comes before its command by more than both, in standard deviations and [s], shows odometry
that is stamped too early; by less it shows noise."""

VAGUE = 0.01
"""A correction of stamps that is less certain than this [s] may do more harm than good."""

Motions = dict[int, tuple[float, float]]
"""Speed [m/s] and turn rate [rad/s] by time [ns]."""


@dataclass(frozen=True, slots=True)
class Timing:
    """Timing of a follower as its log tells it; ``unknown``: why something is not known, a line each.

    ``response``: of its odometry, by the odometry's own stamps, to its commands. ``lateness`` [s]: by how
    much its mocap track, as the scenario of the log times it, comes after its odometry. ``alignment``: all
    that the two tell of each other.
    """

    response: ActuatorResponse | None
    lateness: Known | None
    unknown: tuple[str, ...] = ()
    alignment: Alignment = UNKNOWN

    @property
    def known(self) -> bool:
        """Whether the log tells anything."""
        return self.response is not None or self.alignment.late is not None or self.lateness is not None

    def keys(self, scenario: Scenario) -> dict[str, Known]:
        """What is known by its name: lag_s, transport_s, their sum delay_s, and the correction of stamps.

        Of trusted stamps that is ``stamp_offset_s``, by how much they are late in all, of estimated ones
        ``transport_latency_s``: what the log was made with plus what it shows to be left.
        """
        found: dict[str, Known] = {}
        if self.response is not None:
            known, answers = self.response, self.alignment.lag
            shift = scenario.estimator.input_delay_s
            # Odometry that tells commands has answered them already, and the robot answers odometry.
            later = (
                answers if is_surely_off(answers, 0.0, LEAST_LAG) and answers is not None else Known(0.0, 0.0)
            )
            found |= {
                "lag_s": _sum(known.lag, later),
                "transport_s": Known(known.transport.value + shift, known.transport.sd),
                "delay_s": _sum(Known(known.delay.value + shift, known.delay.sd), later),
            }
        if self.lateness is not None:
            name, before = _correction(scenario)
            left = self.lateness.value - scenario.estimator.input_delay_s
            found[name] = Known(before + left, self.lateness.sd)
        return found

    def settings(self, scenario: Scenario) -> dict[str, float]:
        """Scenario keys that make the next run right, in seconds to a tenth of a millisecond.

        A robot cannot answer before it is told to: an answer that comes clearly too early shows odometry that
        is stamped early, which is moved by ``estimator.input_delay_s``, and with it the stamps of mocap. A
        correction of stamps that is less certain than :data:`VAGUE` is left out.
        """
        found = self.keys(scenario)
        given: dict[str, float] = {}
        early = 0.0
        if "delay_s" in found:
            transport = found["transport_s"]
            if -transport.value > max(EARLY_SDS * transport.sd, LEAST_EARLY):
                early = -transport.value
                given["estimator.input_delay_s"] = scenario.estimator.input_delay_s + early
            way = max(0.0, transport.value + early)
            given["controller.lag_s"] = max(0.0, found["delay_s"].value + early - way)
            given["controller.transport_s"] = way
        name, before = _correction(scenario)
        sure = name in found and found[name].sd < VAGUE
        if sure or early:
            late = (found[name].value if sure else before) - early
            given[f"estimator.{name}"] = max(0.0, late) if name == "transport_latency_s" else late
        given |= response_settings(self.alignment, scenario)
        return {key: round(value, 4) + 0.0 for key, value in given.items()}


def _sum(a: Known, b: Known) -> Known:
    return Known(a.value + b.value, math.hypot(a.sd, b.sd))


def _correction(scenario: Scenario) -> tuple[str, float]:
    """Key of the estimator that corrects stamps, and its value."""
    given = scenario.estimator
    if given.clock == "estimated":
        return "transport_latency_s", given.transport_latency_s
    return "stamp_offset_s", given.stamp_offset_s


def timing_of(log: Log, scenario: Scenario, from_s: float | None = None, to_s: float | None = None) -> Timing:
    """Timing of a pair's follower by a log, or by its span from ``from_s`` to ``to_s``.

    Times [s] are the source's own in an imported log, else they count from the first odometry.
    """
    names, given = topics_of(scenario), scenario.estimator
    if names.odom not in log.topics:
        return Timing(None, None, (f"timing unknown: the log has no odometry on {names.odom!r}",))
    record = own_record(log, scenario)
    zero_ns = 0 if mode_of(log) == IMPORT else min(record.motions, default=0)
    begin_ns = -1 if from_s is None else zero_ns + round(from_s * 1e9)
    end_ns = 2**63 if to_s is None else zero_ns + round(to_s * 1e9)
    span = OwnRecord(
        {at_ns: pose for at_ns, pose in record.poses.items() if begin_ns <= at_ns <= end_ns},
        {at_ns: motion for at_ns, motion in record.motions.items() if begin_ns <= at_ns <= end_ns},
    )
    alignment = own_alignment(span)
    lateness = alignment.delay
    if given.input_lag_s > 0.0:
        return Timing(None, None, (_of_commands(given.input_lag_s, alignment.late),), alignment)
    unknown: list[str] = []
    commands = _commands(log, names)
    response = _response(commands, span.motions)
    if not commands:
        unknown.append(
            f"lag and transport unknown: the log has no commands on {names.command!r} or {names.wanted!r}"
        )
    elif response is None:
        unknown.append(
            "lag and transport unknown: commands and odometry tell too little, drive for 10 s or longer, "
            "with turns and changes of speed"
        )
    if topics.RIGID_BODIES not in log.topics:
        unknown.append(f"offset of stamps unknown: the log has no mocap frames on {topics.RIGID_BODIES!r}")
    elif lateness is None:
        unknown.append(
            f"offset of stamps unknown: odometry and mocap of {names.follower!r} tell too little, drive for "
            "10 s or longer, with turns and changes of speed"
        )
    return Timing(response, lateness, tuple(unknown), alignment)


def _of_commands(lag: float, lateness: Known | None) -> str:
    """Why odometry that is made of commands tells neither of the actuators alone nor of stamps alone."""
    sum_of_both = (
        "" if lateness is None else f" (together {lateness.value:.4f} s, give or take {lateness.sd:.4f})"
    )
    return (
        f"timing unknown: in this log commands stand in for odometry (estimator.input_lag_s is {lag:g}), so "
        f"that a late robot and late stamps{sum_of_both} are not told apart; record wheel odometry"
    )


def _commands(log: Log, names: Topics) -> Motions:
    """Commands to the follower by when they were issued: the controller's records, else its drives."""
    wanted = names.command if names.command in log.topics else names.wanted
    found: Motions = {}
    for event, now_ns in logged_events(log, [wanted]):
        try:
            if wanted == names.command:
                record = decode_as(event.payload, msg.Command)
                found[to_ns(record.header.stamp)] = (record.v2, record.u2)
            elif names.wanted_stamped:
                drive = decode_as(event.payload, msg.TwistStamped)
                found[to_ns(drive.header.stamp)] = (drive.twist.linear.x, drive.twist.angular.z)
            else:
                motion = read_drive(event.payload, stamped=False)
                found[now_ns] = (motion.v, motion.u)
        except MalformedPayloadError:
            continue
    return {at_ns: motion for at_ns, motion in found.items() if np.all(np.isfinite(motion))}


def _response(commands: Motions, motions: Mapping[int, tuple[float, float]]) -> ActuatorResponse | None:
    if not (commands and motions):
        return None
    zero_ns = min(commands)
    command_ns, seen_ns = sorted(commands), sorted(motions)
    return fit_response(
        np.array([(at_ns - zero_ns) * 1e-9 for at_ns in command_ns]),
        np.array([commands[at_ns] for at_ns in command_ns]),
        np.array([(at_ns - zero_ns) * 1e-9 for at_ns in seen_ns]),
        np.array([motions[at_ns] for at_ns in seen_ns]),
    )
