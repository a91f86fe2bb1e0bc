"""One sender for each topic: the first one is listened to, and who else sends is named."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from formation.pose import STANDSTILL
from hil.scenario.files import load_scenario
from hil.wire import topics
from hil.wire.drive_message import drive_message
from hil.wire.events import TICK, Event, Origin
from hil.wire.messages import encode
from hil.wire.senders import GONE_NS, SenderWatch, single_topics

MS = 1_000_000


def sent(session: str, number: int = 1, topic: str = "a") -> Event:
    return Event(topic, b"x", Origin(session, 1, number))


def stamped(at_ns: int) -> Event:
    return Event("a", encode(drive_message(STANDSTILL, at_ns, "", stamped=True)))


def test_the_first_is_listened_to_and_a_second_named_while_it_sends() -> None:
    watch = SenderWatch({"a"})
    assert watch.admits(sent("aa"), 0)
    assert not watch.admits(sent("bb"), 10 * MS)
    assert watch.admits(sent("aa", 2), 20 * MS)
    (said,) = watch.second_senders(30 * MS)
    assert said == "session bb sends a as well as session aa, who is listened to"
    assert watch.refused == {"a": 1}
    assert watch.second_senders(10_000 * MS) == []


def test_who_comes_in_the_place_of_one_that_is_gone_is_listened_to() -> None:
    watch = SenderWatch({"a"})
    assert watch.admits(sent("aa"), 0)
    assert not watch.admits(sent("bb"), GONE_NS)
    assert watch.admits(sent("bb"), GONE_NS + 1)
    assert not watch.admits(sent("aa"), GONE_NS + 2)


def test_a_sender_without_a_session_is_one_beside_those_that_have_one() -> None:
    watch = SenderWatch({"a"})
    assert watch.admits(sent("aa"), 0)
    assert not watch.admits(Event("a", b"x"), 1)
    (said,) = watch.second_senders(2)
    assert said.startswith("somebody without a session sends a")


def test_two_senders_without_sessions_are_told_by_stamps_that_run_back_and_forth() -> None:
    one, mixed = SenderWatch({"a"}), SenderWatch({"a"})
    for k in range(100):
        now_ns, epoch_ns = k * 10 * MS, 10**18
        assert one.admits(stamped(epoch_ns + now_ns), now_ns)
        assert mixed.admits(stamped(epoch_ns + now_ns - (k % 2) * 30 * MS), now_ns)
    assert one.second_senders(1000 * MS) == []
    assert mixed.second_senders(1000 * MS) == [
        "stamps on a run back and forth, as of two senders without sessions"
    ]


@given(st.lists(st.tuples(st.sampled_from(["aa", "bb", "cc"]), st.integers(0, 2 * GONE_NS)), max_size=30))
def test_at_no_time_are_two_listened_to(arrivals: list[tuple[str, int]]) -> None:
    watch, now_ns = SenderWatch({"a"}), 0
    heard: list[tuple[str, int]] = []
    for number, (session, later_ns) in enumerate(arrivals):
        now_ns += later_ns
        if watch.admits(sent(session, number), now_ns):
            if heard and heard[-1][0] != session:
                assert now_ns - heard[-1][1] > GONE_NS
            heard.append((session, now_ns))
    assert not arrivals or heard[0][0] == arrivals[0][0]


def test_orders_reports_and_ticks_are_anybodys() -> None:
    single = single_topics(load_scenario("chain5-turtlebot3"))
    watch = SenderWatch(single)
    for topic in (topics.STOP, topics.ARM, topics.DIAGNOSTICS, "follower/side", "follower/cmd_vel"):
        assert topic not in single
        assert all(watch.admits(sent(session, topic=topic), 1) for session in ("aa", "bb"))
    assert watch.admits(TICK, 1)
    assert {topics.RIGID_BODIES, "leader/odom", "agent5/odom", "agent3/leader_estimate"} <= single
