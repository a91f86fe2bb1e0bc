from __future__ import annotations

from hil.live_page.seen_frames import OLDEST_S, SeenFrames


def test_an_order_counts_by_a_frame_of_just_now_only() -> None:
    frames = SeenFrames()
    number = frames.next(10.0)
    assert frames.refusal(number, 10.0 + 0.9 * OLDEST_S) == ""
    assert "came late" in frames.refusal(number, 10.0 + 1.1 * OLDEST_S)


def test_an_order_by_a_frame_that_was_never_sent_is_refused() -> None:
    frames = SeenFrames()
    assert frames.refusal(0, 0.0)
    number = frames.next(10.0)
    assert frames.refusal(0, 10.0)
    assert frames.refusal(number + 1, 10.0)


def test_an_order_from_before_a_stop_is_refused_and_one_by_a_frame_after_it_is_not() -> None:
    frames = SeenFrames()
    before = frames.next(10.0)
    frames.note_stop()
    assert "a stop was given since" in frames.refusal(before, 10.0)
    assert frames.refusal(frames.next(10.05), 10.1) == ""


def test_a_page_that_is_begun_anew_takes_no_frame_of_the_one_before() -> None:
    frames, anew = SeenFrames(), SeenFrames()
    number = frames.next(10.0)
    anew.next(10.0)
    assert anew.refusal(number, 10.0)
