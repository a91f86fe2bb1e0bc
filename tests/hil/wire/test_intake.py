"""What is let in of what comes: all that is sane, of each sender, and no more."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.scenario.files import load_scenario
from hil.wire.events import Event, Origin
from hil.wire.intake import MOST_HZ, Intake, intake_of

S = 1_000_000_000
ROBOT, STRANGER = Origin("robot", 1, 0), Origin("stranger", 1, 0)


def taken(intake: Intake, rate_hz: float, seconds: float, origin: Origin | None, size: int = 700) -> int:
    """How much gets through of what a sender sends at a rate."""
    event = Event("odom", bytes(size), origin)
    return sum(intake.takes(event, round(k / rate_hz * S)) for k in range(round(rate_hz * seconds)))


@pytest.mark.parametrize("origin", [None, ROBOT], ids=["nameless", "named"])
@pytest.mark.parametrize("rate_hz", [1.0, 20.0, 360.0, MOST_HZ])
def test_all_that_comes_at_a_sane_rate_is_let_in(origin: Origin | None, rate_hz: float) -> None:
    intake = Intake()
    assert taken(intake, rate_hz, 5.0, origin) == round(5.0 * rate_hz)
    assert not intake.floods(5 * S)
    assert not intake.refused()


def test_of_a_flood_no_more_is_let_in_than_is_sane_and_it_is_named_with_its_rate() -> None:
    intake = Intake()
    let_in = taken(intake, 10_000.0, 10.0, STRANGER)
    assert let_in == pytest.approx(10.5 * MOST_HZ, abs=2)
    (text,) = intake.floods(10 * S).values()
    assert text.startswith("10000 messages a second on odom, ")
    assert intake.refused() == {"odom": 100_000 - let_in}
    assert not intake.floods(11 * S)


def test_who_sends_at_a_sane_rate_loses_nothing_to_one_who_floods_the_topic() -> None:
    intake = Intake()
    stranger, robot = Event("odom", b"", STRANGER), Event("odom", b"", ROBOT)
    for k in range(50_000):
        intake.takes(stranger, k * S // 10_000)
        if k % 500 == 0:
            assert intake.takes(robot, k * S // 10_000)


def test_large_messages_count_by_their_size() -> None:
    sent, size = 2_000, 1 << 20
    let_in = taken(Intake(), 200.0, 10.0, STRANGER, size)
    assert 0 < let_in * size <= 11.0 * MOST_HZ * 32_768 < sent * size


def test_a_message_larger_than_all_that_may_come_at_once_gets_through_when_it_comes_alone() -> None:
    intake = Intake()
    huge = Event("odom", bytes(1 << 25), STRANGER)
    assert [intake.takes(huge, at * S) for at in (0, 0, 10, 20)] == [True, False, True, True]


def test_a_sender_under_ever_new_names_gets_no_more_than_a_few() -> None:
    intake = Intake()
    let_in = sum(
        intake.takes(Event("odom", b"", Origin(f"{k}", 1, 0)), k * S // 10_000) for k in range(10**5)
    )
    assert let_in <= 10.5 * MOST_HZ + 100


@given(st.lists(st.tuples(st.integers(0, 10**10), st.integers(0, 10**5)), max_size=60))
def test_no_more_than_a_burst_and_the_rate_gets_through_in_any_order_of_arrival(
    given: list[tuple[int, int]],
) -> None:
    intake, begin, end = Intake(), 10**10, 0
    let_in = 0.0
    for at_ns, size in given:
        let_in += intake.takes(Event("odom", bytes(size), ROBOT), at_ns) * max(1.0, size / 32_768)
        begin, end = min(begin, at_ns), max(end, at_ns)
    assert let_in <= 0.5 * MOST_HZ + max(0, end - begin) * 1e-9 * MOST_HZ + 1e-6


def test_where_the_poses_of_all_robots_share_a_topic_each_may_have_its_rate() -> None:
    settings = ["source.type=TFMessage"]
    scenario = load_scenario("chain5-turtlebot3", settings)
    assert set(intake_of(scenario).rates.values()) == {5 * MOST_HZ}
    assert not intake_of(load_scenario("turtlebot3")).rates


def test_senders_that_have_gone_leave_room_for_others_of_their_own_name() -> None:
    intake = Intake()
    for k in range(8):
        taken(intake, 10_000.0, 0.1, Origin(f"restarted {k}", 1, 0))
    robot, nameless = Event("odom", b"", ROBOT), Event("odom")
    assert intake.takes(robot, 3 * S)
    assert not all(intake.takes(nameless, 3 * S) for _ in range(1_000))
    assert intake.takes(robot, 3 * S)
