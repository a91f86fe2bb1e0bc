"""The guard's decisions: what a robot is told, whatever is heard on the wire."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formation.pose import STANDSTILL, Motion
from hil.guard.robot_guard import (
    CLOCK,
    DRIVING,
    FENCE,
    LATE,
    NO_COMMAND,
    RESTART,
    SECOND_SENDER,
    SEPARATION,
    SILENT,
    STOPPED,
    GuardRules,
    Now,
    RobotGuard,
    WantedDrive,
)
from hil.wire.body_walk import Spot
from hil.wire.events import Origin

RULES = GuardRules(age_s=0.15, latch_s=1.0, v_max=0.22, u_max=2.84)
FORWARD = Motion(0.1, 0.5)
BEGUN_NS = 1_700_000_000 * 10**9


def at(t: float) -> Now:
    """A moment; the monotonic clock began at another time than 1970."""
    return Now(BEGUN_NS + round(t * 1e9), 1000.0 + t)


class Sender:
    """Sends commands under one session."""

    def __init__(self, guard: RobotGuard, session: str = "aa") -> None:
        self.guard, self.session, self.number = guard, session, 0

    def say(self, t: float, motion: Motion = FORWARD, age: float = 0.0) -> None:
        self.number += 1
        origin = Origin(self.session, 1, self.number)
        self.guard.hear(WantedDrive(motion, at(t - age).host_ns), origin, at(t))


def driving(rules: GuardRules = RULES) -> tuple[RobotGuard, Sender]:
    """A guard whose robot drives at time 0."""
    guard = RobotGuard(rules)
    sender = Sender(guard)
    sender.say(-0.02, STANDSTILL)
    assert guard.told(at(-0.02)).motion == STANDSTILL
    sender.say(0.0)
    return guard, sender


def latched(guard: RobotGuard) -> str:
    assert guard.latch is not None
    return guard.latch.reason


def test_it_drives_while_commands_are_fresh_and_stands_as_soon_as_they_are_not() -> None:
    guard, _ = driving()
    assert guard.told(at(0.0)) == (FORWARD, DRIVING)
    assert guard.told(at(0.149)).motion == FORWARD
    assert guard.told(at(0.151)) == (STANDSTILL, SILENT)
    assert guard.gaps == 1


def test_it_drives_on_by_itself_after_a_gap_but_not_after_a_long_silence() -> None:
    guard, sender = driving()
    guard.told(at(0.5))
    sender.say(0.6)
    assert guard.told(at(0.6)).motion == FORWARD
    assert guard.gaps == 1
    assert guard.longest_gap_s == pytest.approx(0.6)
    guard.told(at(1.7))
    sender.say(1.71)
    assert guard.told(at(1.71)) == (STANDSTILL, SILENT)
    guard.arm(at(1.8))
    sender.say(1.81)
    assert guard.told(at(1.81)).motion == FORWARD


def test_silence_counts_by_the_monotonic_clock_whatever_the_host_clock_does() -> None:
    guard, _ = driving()
    stuck = Now(at(0.0).host_ns, at(0.2).mono_s)
    assert guard.told(stuck).motion == STANDSTILL
    guard, _ = driving()
    ahead = Now(at(0.2).host_ns, at(0.0).mono_s)
    assert guard.told(ahead).motion == STANDSTILL
    guard, _ = driving()
    set_back = Now(at(-60.0).host_ns, at(0.01).mono_s)
    assert guard.told(set_back) == (STANDSTILL, CLOCK)


def test_an_old_command_is_not_obeyed_and_not_taken_for_a_sign_of_life() -> None:
    guard, sender = driving()
    for k in range(1, 60):
        sender.say(0.02 * k, age=0.2)
        told = guard.told(at(0.02 * k))
        assert told.motion == (FORWARD if 0.02 * k <= 0.15 else STANDSTILL)
    assert guard.counts["late"] > 0
    assert latched(guard) == LATE


def test_what_waited_in_a_link_that_was_cut_is_not_obeyed_when_it_comes() -> None:
    guard, sender = driving()
    guard.told(at(0.9))
    for k in range(45):
        sender.say(0.95, age=0.93 - 0.02 * k)
        assert (guard.told(at(0.95)).motion == STANDSTILL) == (0.93 - 0.02 * k > 0.15)


def test_a_command_that_was_heard_already_is_refused() -> None:
    guard, sender = driving()
    sender.say(0.02)
    sender.number -= 1
    sender.say(0.04, Motion(0.2, 0.0))
    assert guard.told(at(0.04)).motion == FORWARD
    assert guard.counts["old"] == 1


@pytest.mark.parametrize("ahead", [0.06, 3600.0])
def test_a_clock_ahead_stops_and_is_told(ahead: float) -> None:
    guard, sender = driving()
    for k in range(1, 70):
        sender.say(0.02 * k, age=-ahead)
        guard.told(at(0.02 * k))
    assert latched(guard) == CLOCK
    assert guard.latch is not None
    assert f"{1e3 * ahead:.0f} ms ahead" in guard.latch.text
    assert "chrony" in guard.latch.text


def test_a_clock_that_is_known_to_be_behind_stops_though_its_commands_seem_young_enough() -> None:
    guard, sender = driving()
    guard.clock_s = -0.1
    sender.say(0.02, age=0.1)
    assert guard.told(at(0.02)) == (STANDSTILL, CLOCK)
    guard.clock_s = -0.01
    sender.say(0.04, age=0.01)
    assert guard.told(at(0.04)).motion == FORWARD


def test_a_second_sender_stops_the_robot_until_it_is_armed_and_is_named() -> None:
    guard, sender = driving()
    other = Sender(guard, "bb")
    other.say(0.01, Motion(0.2, 0.0))
    assert guard.told(at(0.01)) == (STANDSTILL, SECOND_SENDER)
    assert guard.latch is not None
    assert guard.latch.who == "session bb"
    assert "session aa" in guard.latch.text
    sender.say(0.02)
    assert guard.told(at(0.02)).motion == STANDSTILL
    guard.arm(at(0.03))
    sender.say(0.04)
    assert guard.told(at(0.04)).motion == FORWARD
    other.say(0.05)
    assert guard.told(at(0.05)).reason == SECOND_SENDER


def test_a_sender_without_a_session_stops_the_robot_too() -> None:
    guard, _ = driving()
    guard.hear(WantedDrive(FORWARD, at(0.01).host_ns), None, at(0.01))
    assert guard.told(at(0.01)).reason == SECOND_SENDER


def test_a_controller_that_was_restarted_is_taken_after_arming_only() -> None:
    guard, _ = driving()
    again = Sender(guard, "bb")
    again.say(0.5, STANDSTILL)
    assert latched(guard) == RESTART
    again.say(0.52)
    assert guard.told(at(0.52)).motion == STANDSTILL
    guard.arm(at(0.6))
    again.say(0.62)
    assert guard.told(at(0.62)).motion == FORWARD


def test_a_guard_that_was_restarted_while_somebody_drives_waits_to_be_armed() -> None:
    guard = RobotGuard(RULES)
    sender = Sender(guard)
    assert guard.told(at(0.0)) == (STANDSTILL, NO_COMMAND)
    sender.say(0.0)
    assert guard.told(at(0.0)) == (STANDSTILL, RESTART)
    guard.arm(at(0.01))
    sender.say(0.02)
    assert guard.told(at(0.02)).motion == FORWARD


def test_who_is_not_there_within_a_second_of_arming_has_to_begin_with_a_standstill() -> None:
    guard, _ = driving()
    guard.stop("enough", "session op")
    guard.arm(at(1.0))
    late = Sender(guard, "bb")
    late.say(2.1)
    assert latched(guard) == RESTART


def test_a_controller_of_a_standing_robot_may_be_replaced_once_it_is_gone() -> None:
    guard, sender = driving()
    sender.say(0.02, STANDSTILL)
    guard.told(at(0.02))
    guard.told(at(1.5))
    again = Sender(guard, "bb")
    again.say(2.0, STANDSTILL)
    again.say(2.02)
    assert guard.told(at(2.02)).motion == FORWARD


def test_a_stop_holds_until_arming_and_says_who_and_why() -> None:
    guard, sender = driving()
    guard.stop("cable loose", "session op")
    sender.say(0.02)
    assert guard.told(at(0.02)) == (STANDSTILL, STOPPED)
    assert guard.latch is not None
    assert guard.latch.text == "stopped by session op: cable loose"


def test_what_is_beyond_limits_is_clipped_and_what_is_no_number_is_a_standstill() -> None:
    guard, sender = driving()
    sender.say(0.02, Motion(5.0, -30.0))
    assert guard.told(at(0.02)).motion == Motion(0.22, -2.84)
    assert guard.counts["clipped"] == 1
    for k, odd in enumerate((math.nan, math.inf, -math.inf)):
        sender.say(0.04 + 0.04 * k, Motion(odd, 0.0))
        assert guard.told(at(0.04 + 0.04 * k)).motion == STANDSTILL
        sender.say(0.06 + 0.04 * k)
        assert guard.told(at(0.06 + 0.04 * k)).motion == FORWARD
    assert guard.counts["not_finite"] == 3


def test_rates_limit_and_never_zero_a_command_and_never_hold_up_a_stop() -> None:
    guard = RobotGuard(RULES._replace(v_rate=0.5, u_rate=2.0))
    sender = Sender(guard)
    sender.say(0.0, STANDSTILL)
    guard.told(at(0.0))
    before = STANDSTILL
    for k in range(1, 26):
        sender.say(0.02 * k, Motion(0.2, -0.8))
        now = guard.told(at(0.02 * k)).motion
        assert abs(now.v - before.v) <= 0.5 * 0.02 + 1e-12
        assert abs(now.u - before.u) <= 2.0 * 0.02 + 1e-12
        assert now != STANDSTILL
        before = now
    assert before == pytest.approx((0.2, -0.8))
    guard.stop("now", "anybody")
    assert guard.told(at(0.52)).motion == STANDSTILL


def test_the_fence_and_the_least_separation_are_held() -> None:
    rules = RULES._replace(body="burger", fence=(-1.0, -1.0, 1.0, 1.0), separation=0.2)
    guard, sender = driving(rules)
    guard.see([Spot("burger", 0.0, 0.0), Spot("other", 0.3, 0.0)])
    guard.see([Spot("other", 5.0, 5.0)])
    assert guard.latch is None
    guard.see([Spot("burger", 0.15, 0.0), Spot("other", 0.3, 0.0)])
    assert latched(guard) == SEPARATION
    guard.arm(at(0.1))
    guard.see([Spot("burger", 0.12, 0.0), Spot("other", 0.3, 0.0)])
    assert guard.latch is None
    guard.see([Spot("burger", 0.0, 0.0), Spot("other", 0.3, 0.0)])
    guard.see([Spot("burger", 0.0, -1.1), Spot("other", 0.3, 0.0)])
    assert latched(guard) == FENCE
    sender.say(0.2)
    assert guard.told(at(0.2)).motion == STANDSTILL


def test_a_driver_is_told_what_changes_and_again_what_does_not_and_nothing_where_nobody_drives() -> None:
    guard = RobotGuard(RULES)
    said = [guard.say(at(0.01 * k)) for k in range(200)]
    assert [each.motion for each in said if each] == [STANDSTILL] * len([each for each in said if each])
    assert 10 <= len([each for each in said[:100] if each]) <= 25
    assert not any(said[110:])
    sender = Sender(guard)
    sender.say(2.0, STANDSTILL)
    assert guard.say(at(2.0), heard=True) is not None
    sender.say(2.02)
    assert guard.say(at(2.02), heard=True) == (FORWARD, DRIVING)
    assert guard.say(at(2.03)) is None
    assert guard.say(at(2.09)) == (FORWARD, DRIVING)
    told = guard.say(at(2.18))
    assert told is not None
    assert told.motion == STANDSTILL


def test_who_tells_the_driver_past_the_guard_is_named_where_somebody_is_obeyed() -> None:
    guard = RobotGuard(RULES)
    guard.overhear(FORWARD, "session cc")
    assert guard.latch is None
    guard, sender = driving()
    guard.overhear(STANDSTILL, "session cc")
    assert guard.latch is None
    guard.overhear(None, "session cc")
    assert latched(guard) == SECOND_SENDER
    sender.say(0.02)
    assert guard.say(at(0.02), heard=True) == (STANDSTILL, SECOND_SENDER)


MOTIONS = st.builds(Motion, st.floats(), st.floats())
STEPS = st.one_of(
    st.tuples(st.just("say"), st.sampled_from("ab"), MOTIONS, st.floats(-0.2, 1.0)),
    st.tuples(st.just("nonsense")),
    st.tuples(st.just("stop")),
    st.tuples(st.just("arm")),
    st.tuples(st.just("see"), st.floats(-3.0, 3.0)),
)


@settings(max_examples=300)
@given(st.lists(st.tuples(st.floats(0.0, 0.4), st.floats(-0.1, 0.1), STEPS), max_size=40))
def test_whatever_comes_the_robot_drives_only_on_a_fresh_command_and_within_limits(
    steps: list[tuple[float, float, tuple[object, ...]]],
) -> None:
    rules = RULES._replace(body="burger", fence=(-1.0, -1.0, 1.0, 1.0), separation=0.2, v_rate=1.0)
    guard = RobotGuard(rules)
    senders = {name: Sender(guard, name) for name in "ab"}
    t = host_off = 0.0
    fresh_s = -math.inf
    for pause, clock, (kind, *values) in steps:
        t, host_off = t + pause, host_off + clock
        now = Now(at(t + host_off).host_ns, at(t).mono_s)
        before = guard.latch
        if kind == "say":
            name, motion, age = values
            senders[name].number += 1  # type: ignore[index]
            sender = senders[name]  # type: ignore[index]
            wanted = WantedDrive(motion, now.host_ns - round(age * 1e9))  # type: ignore[arg-type, operator]
            guard.hear(wanted, Origin(sender.session, 1, sender.number), now)
            if age <= rules.age_s:  # type: ignore[operator]
                fresh_s = t
        elif kind == "nonsense":
            guard.hear(None, None, now)
        elif kind == "stop":
            guard.stop("why", "who")
        elif kind == "arm":
            guard.arm(now)
        else:
            guard.see([Spot("burger", values[0], 0.0)])  # type: ignore[arg-type]
        told = guard.told(now)
        assert abs(told.motion.v) <= rules.v_max
        assert abs(told.motion.u) <= rules.u_max
        if told.motion != STANDSTILL:
            assert guard.latch is None
            assert t - fresh_s <= rules.age_s
        if before is not None and kind != "arm":
            assert told.motion == STANDSTILL
