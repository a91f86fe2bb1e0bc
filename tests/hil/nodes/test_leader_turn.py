"""What feeding the estimated turn rate forward comes to in the closed loop."""

from __future__ import annotations

from benchmarks.feedforward import distances_mm


def test_with_good_motion_capture_the_pair_strays_half_as_far() -> None:
    found = distances_mm((0.03, 0.2, 0.3), seeds=2)
    assert 1.0 < found["feedforward"] < 0.4 * found["independent"]
    assert 1.0 < found["faded"] < 0.4 * found["independent"]


def test_what_noise_spoils_is_faded_out() -> None:
    found = distances_mm((0.3, 1.0, 5.0), seeds=2)
    assert found["feedforward"] > 2.0 * found["independent"]
    assert found["faded"] < 1.02 * found["independent"]


def test_between_both_the_fade_is_better_than_either() -> None:
    found = distances_mm((0.03, 1.0, 2.0), seeds=2)
    assert found["faded"] < 0.95 * min(found["independent"], found["feedforward"])
