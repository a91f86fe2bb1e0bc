"""What motion capture makes certain of a leader, frame by frame as they come.

Rests on the assumptions that every position that was believed, of either robot, errs by no more than eps,
that its capture time is right, and that the leader keeps to its speeds and accelerates by no more than A.
Leaving out a frame makes the result weaker, never wrong.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.bounds.certified import Certain, Failed, Interval, certain_alpha1, certain_motion, window_ns
from estimation.bounds.guarantees import guaranteed_window
from estimation.bounds.sample_window import SampleWindow, with_measurement
from formation.angles import FloatArray

_NS = 1e-9


class PositionCertifier:
    """Turns frames into what they make certain. Holds no state of its own between calls.

    ``eps``: bound of the error of each position [m]. ``A``: of the leader's acceleration [m/s^2]. ``speeds``:
    its least and largest speed [m/s]. ``step``: time from one frame to the next [s].
    """

    def __init__(self, eps: float, A: float, speeds: tuple[float, float], step: float) -> None:
        self.eps = eps
        self.A = A
        self.speeds = speeds
        self._window_ns = window_ns(float(guaranteed_window(eps, A)), step)

    def add(
        self, known: SampleWindow, capture_ns: int, leader: tuple[float, float], follower: tuple[float, float]
    ) -> SampleWindow:
        """What is known with one frame more: positions (x, y) [m] of both robots."""
        return with_measurement(known, capture_ns, (*leader, *follower), self._window_ns)

    def certain(self, known: SampleWindow, capture_ns: int) -> Certain | Failed:
        """What is certain at a capture time, which must be that of the newest frame."""
        if not known.ends_at(capture_ns):
            return Failed.UNSEEN
        back: FloatArray = np.multiply(capture_ns - known.capture_ns[:-1], _NS)
        places = known.values[:, :2]
        moved = places[-1] - places[:-1]
        motion = certain_motion(back, moved, np.full(len(back), 2.0 * self.eps), self.A, self.speeds)
        if isinstance(motion, Failed):
            return motion
        return Certain(
            motion.speed, certain_alpha1(motion.direction, self._line(known)), len(known.capture_ns)
        )

    def _line(self, known: SampleWindow) -> Interval:
        """Direction [rad] of the line from the leader to the follower."""
        leader_x, leader_y, follower_x, follower_y = known.values[-1].tolist()
        x, y = follower_x - leader_x, follower_y - leader_y
        rho, blur = math.hypot(x, y), 2.0 * self.eps
        return Interval(math.atan2(y, x), math.asin(blur / rho) if blur < rho else math.pi)
