from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from estimation.bounds.sample_window import EMPTY_WINDOW, with_measurement


@given(st.lists(st.integers(0, 60), max_size=30), st.integers(1, 40))
def test_what_is_kept_does_not_depend_on_the_order_of_arrival(times: list[int], span_ns: int) -> None:
    window = EMPTY_WINDOW
    for at in times:
        window = with_measurement(window, at, (at, -at), span_ns)
    expected = [at for at in sorted(set(times)) if at >= max(times) - span_ns]
    assert window.capture_ns.tolist() == expected
    assert window.values.tolist() == [[at, -at] for at in expected]
    assert window.ends_at(max(times)) if times else not window.ends_at(0)


def test_of_two_with_one_capture_time_the_first_stays() -> None:
    window = with_measurement(with_measurement(EMPTY_WINDOW, 5, (1.0,), 10), 5, (2.0,), 10)
    assert window.values.tolist() == [[1.0]]
