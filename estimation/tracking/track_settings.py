"""When a track believes a measurement, and when its estimate."""

from __future__ import annotations

import math
from typing import NamedTuple


def gate_of(probability: float) -> float:
    """Gate that this share of good measurements passes: a chi-square quantile with two degrees of freedom.

    >>> round(gate_of(0.99), 2)
    9.21
    """
    return -2.0 * math.log1p(-probability)


class TrackSettings(NamedTuple):
    """When to believe a measurement and when to believe the estimate.

    gate: largest NIS of a measurement that is believed.
    reacquire_frames: rejected measurements that must agree with each other before they take over.
    coast_after, lost_after, window: [s]; a track of slow measurements has some of their intervals.
    jump_uncertain_for: how long [s] a jump stays uncertain.
    settled_heading, unsettled_heading: standard deviation of the leader's direction [rad] below which a track
    settles, and above which it no longer counts as settled.
    capped_speed: whether a leader that seems faster than k_v settles as one of k_v would.
    followed_turn: how far [rad] a jump may turn alpha1 and alpha2 for the track to follow it.
    notices_manoeuvres: whether a run of innovations raises the process noise.
    """

    gate: float = gate_of(0.9999)
    reacquire_frames: int = 5
    coast_after: float = 0.25
    lost_after: float = 1.0
    window: float = 0.2
    jump_uncertain_for: float = 2.0
    settled_heading: float = 0.35
    unsettled_heading: float = 0.6
    capped_speed: bool = True
    followed_turn: float = 0.25
    notices_manoeuvres: bool = False
