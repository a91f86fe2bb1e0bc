from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from hil.live_page.browser_pace import BrowserPace


def test_a_browser_that_keeps_up_is_sent_every_frame() -> None:
    pace = BrowserPace()
    for k in range(100):
        assert pace.may_send()
        pace.send(k, 0.05 * k)
        pace.see(k, 0.05 * k + 0.02)
    assert abs(pace.link_s - 0.02) < 1e-9


@given(st.lists(st.integers(0, 50), max_size=60))
def test_never_more_than_three_frames_are_on_their_way(seen: list[int]) -> None:
    pace, newest, sent = BrowserPace(), 0, 0
    for k, number in enumerate(seen):
        while pace.may_send():
            sent += 1
            pace.send(sent, float(k))
        newest = max(newest, min(number, sent))
        assert sent - newest <= 3 or not pace.may_send()
        pace.see(number, float(k))
        assert sent <= newest + 3


def test_who_sees_nothing_for_long_is_gone_and_who_was_sent_nothing_is_not() -> None:
    pace = BrowserPace()
    assert not pace.is_gone(1e9)
    pace.send(1, 0.0)
    assert not pace.is_gone(9.0)
    assert pace.is_gone(11.0)
