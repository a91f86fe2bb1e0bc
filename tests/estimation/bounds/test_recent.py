from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from estimation.bounds.recent import NOTHING_RECENT, with_recent


@given(st.lists(st.integers(0, 60), max_size=30), st.integers(1, 40))
def test_what_is_kept_does_not_depend_on_the_order_of_arrival(times: list[int], span_ns: int) -> None:
    recent = NOTHING_RECENT
    for at in times:
        recent = with_recent(recent, at, (at, -at), span_ns)
    expected = [at for at in sorted(set(times)) if at >= max(times) - span_ns]
    assert recent.capture_ns.tolist() == expected
    assert recent.values.tolist() == [[at, -at] for at in expected]
    assert recent.ends_at(max(times)) if times else not recent.ends_at(0)


def test_of_two_with_one_capture_time_the_first_stays() -> None:
    recent = with_recent(with_recent(NOTHING_RECENT, 5, (1.0,), 10), 5, (2.0,), 10)
    assert recent.values.tolist() == [[1.0]]
