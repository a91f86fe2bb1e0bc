"""Numbers of frames: missed, late, repeated, begun anew."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from hil.bridge.seen_frame import FrameNumbers, SeenBody


@given(st.permutations(range(40)), st.sets(st.integers(0, 39)), st.integers(0, 10**6))
def test_in_any_order_each_comes_once_and_what_is_missing_is_missed(
    order: list[int], lost: set[int], first: int
) -> None:
    numbers = FrameNumbers()
    came = [number for number in order if number not in lost]
    assert all(numbers.hear(first + number) for number in came)
    assert not any(numbers.hear(first + number) for number in came)
    assert (numbers.came, numbers.repeated) == (len(came), len(came))
    if came:
        # Those before the first that came are not known of, unless they come late.
        assert numbers.missed == max(came) - came[0] + 1 - len(came)


def test_a_count_that_begins_anew_misses_nothing() -> None:
    numbers = FrameNumbers()
    assert [numbers.hear(number) for number in (50_000, 50_001, 3, 4, 50_001, 50_003)] == [True] * 6
    assert (numbers.missed, numbers.late, numbers.repeated) == (1, 0, 0)


def test_a_body_is_placed_where_it_was_seen_at_a_number() -> None:
    seen = SeenBody("leader", "1", (1.0, 2.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    assert seen.placed
    assert seen.turned
    assert not seen._replace(tracked=False).placed
    assert not seen._replace(position=(1.0, float("nan"), 0.0)).placed
    assert not seen._replace(orientation=(0.0, 0.0, float("inf"), 1.0)).turned
