from __future__ import annotations

import pytest

from hil.nodes.node import counted, diagnostics, is_due, named_counts, no_counts, outgoing
from hil.wire import message_types as msg
from hil.wire.messages import decode_as, to_ns


@pytest.mark.parametrize(
    ("now_ns", "due"), [(999, False), (900, False), (899, True), (0, True), (1000, True), (5000, True)]
)
def test_what_is_due_is_so_from_its_time_on_and_when_the_clock_was_set_back(now_ns: int, due: bool) -> None:
    assert is_due(1000, 100, now_ns) is due


def test_counts_grow_by_one_and_leave_those_before_alone() -> None:
    before = counted(counted(no_counts(), "late"), "late")
    after = counted(before, "lost")
    assert (before, after) == ({"late": 2}, {"late": 2, "lost": 1})
    assert named_counts("refused", after) == {"refused.late": 2, "refused.lost": 1}
    assert no_counts() == {}


@pytest.mark.parametrize(("problem", "level", "message"), [("", 0, "ok"), ("no mocap", 1, "no mocap")])
def test_a_report_warns_where_there_is_a_problem(problem: str, level: int, message: str) -> None:
    report = diagnostics("estimator", 5_000_000_007, problem, {"status": "lost", "taken": 3})
    sent = outgoing("diagnostics", report, 42)
    assert (sent.topic, sent.typename, sent.stamp_ns) == ("diagnostics", report.__msgtype__, 42)
    read = decode_as(sent.payload, msg.DiagnosticArray)
    (status,) = read.status
    assert to_ns(read.header.stamp) == 5_000_000_007
    assert (status.level, status.message, status.name) == (level, message, "abreast/estimator")
    assert [(each.key, each.value) for each in status.values] == [("status", "lost"), ("taken", "3")]
