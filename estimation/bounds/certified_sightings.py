"""What range, bearing and odometry make certain of a leader, sighting by sighting as they come.

Seen from the follower as it stands now, the leader was, a time T ago, at c + R p: the sighting p of then,
turned and moved by the follower's own motion since. With a sighting within e of the truth, odometry within
M_v2 and M_u2, and |v2| up to v, that place errs by no more than e + rho M_u2 T + M_v2 T + v M_u2 T^2 / 2: the
turn is wrong by up to M_u2 T, which moves the sighting by as much times rho, and what was driven at a time s
ago is wrong by M_v2 and points v M_u2 s aside. So the leader's velocity is certain within

    2 e / T + M_v2 + rho M_u2 + (A + v M_u2) T / 2,

at best 2 sqrt(e (A + v M_u2)) + M_v2 + rho M_u2: unlike positions in the world, better sightings alone do not
bring it down to nothing.

Rests on the assumptions that every sighting that was believed is within its bounds, that odometry, taken as
linear between its samples and held after the last, is within its own on the mean over the window, that
capture times and stamps are right, and on the leader's limits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from estimation.bounds.certified import Certain, Failed, Interval, certain_alpha1, certain_motion, window_ns
from estimation.bounds.guarantees import guaranteed_rate, guaranteed_window
from estimation.bounds.sample_window import SampleWindow, with_measurement
from estimation.own_motion.odometry_history import History
from formation.angles import FloatArray, wrap

LONGEST_WINDOW = 1.5
"""Sightings older than this [s] are not looked at; odometry is to be remembered for longer."""
_LONGEST_HELD = 0.1
_NS = 1e-9


@dataclass(frozen=True, slots=True)
class SightingErrors:
    """Bounds of errors: range [m], bearing [rad], and the follower's speed [m/s] and turn rate [rad/s]."""

    E_rho: float
    E_alpha2: float
    M_v2: float
    M_u2: float

    def place(self, rho: FloatArray) -> FloatArray:
        """Bound of the error [m] of a place seen at a measured range rho [m]."""
        return np.sqrt(self.E_rho**2 + rho * (rho + self.E_rho) * self.E_alpha2**2)


def velocity_error(errors: SightingErrors, A: float, rho: float, v2: float) -> float:
    """Least guaranteed error [m/s] of the leader's velocity at a distance rho [m] and |v2| [m/s]."""
    place = float(errors.place(np.asarray(rho)))
    return float(guaranteed_rate(place, A + v2 * errors.M_u2)) + errors.M_v2 + rho * errors.M_u2


class SightingCertifier:
    """Turns sightings into what they make certain. Holds no state of its own between calls.

    ``A``: bound of the leader's acceleration [m/s^2]. ``speeds``: its least and largest speed [m/s]. ``rho``:
    usual distance [m], ``v2``: the follower's largest speed [m/s], ``step``: usual time from one sighting to
    the next [s]; these three say how far back to look, and nothing certain rests on them. ``delay``: how long
    the motion comes after its signal [s].
    """

    def __init__(
        self,
        errors: SightingErrors,
        A: float,
        speeds: tuple[float, float],
        rho: float,
        v2: float,
        step: float,
        delay: float = 0.0,
    ) -> None:
        self.errors = errors
        self.A = A
        self.speeds = speeds
        best = float(guaranteed_window(errors.place(np.asarray(rho)), A + v2 * errors.M_u2))
        self._window_ns = min(window_ns(best, step), round(LONGEST_WINDOW / _NS))
        self._delay_ns = round(delay / _NS)

    def add(self, known: SampleWindow, capture_ns: int, rho: float, alpha2: float) -> SampleWindow:
        """What is known with one sighting more: range [m] and bearing [rad]."""
        return with_measurement(known, capture_ns, (rho, alpha2), self._window_ns)

    def certain(self, known: SampleWindow, odometry: History, capture_ns: int) -> Certain | Failed:
        """What is certain at a capture time, which must be that of the newest sighting."""
        if not known.ends_at(capture_ns):
            return Failed.UNSEEN
        if not odometry:
            return Failed.GAP
        heard = np.array([sample.stamp_ns for sample in odometry]) + self._delay_ns
        if (capture_ns - heard[-1]) * _NS > _LONGEST_HELD:
            return Failed.GAP
        covered = known.capture_ns >= heard[0]
        if not covered[-1]:
            return Failed.GAP
        back = (capture_ns - known.capture_ns[covered]) * _NS
        rho, alpha2 = known.values[covered].T
        driven = _driven(odometry, (capture_ns - heard) * _NS, back)
        c, s = np.cos(alpha2 + driven.turn), np.sin(alpha2 + driven.turn)
        places = np.column_stack((driven.x + rho * c, driven.y + rho * s))
        e, past = self.errors.place(rho), back[:-1]
        by_turn = self.errors.M_u2 * past
        blur = e[:-1] + e[-1] + self.errors.M_v2 * past + by_turn * (rho[:-1] + 0.5 * driven.fastest * past)
        motion = certain_motion(past, places[-1] - places[:-1], blur, self.A, self.speeds)
        if isinstance(motion, Failed):
            return motion
        line = Interval(wrap(float(alpha2[-1]) + math.pi), min(self.errors.E_alpha2, math.pi))
        return Certain(motion.speed, certain_alpha1(motion.direction, line), len(back))


@dataclass(frozen=True, slots=True, eq=False)
class _Driven:
    """Where the follower was at past moments, (n,), seen from where it is: place [m] and heading [rad].

    ``fastest``: largest |v2| [m/s] since the first of them.
    """

    x: FloatArray
    y: FloatArray
    turn: FloatArray
    fastest: float


def _driven(odometry: History, sampled: FloatArray, back: FloatArray) -> _Driven:
    """Dead reckoning; ``sampled``, ``back``: how long ago [s] the samples and the asked moments are."""
    moments = np.unique(np.concatenate((-sampled, -back)))
    moments = moments[(moments >= -back[0]) & (moments <= -back[-1])]
    v = np.interp(moments, -sampled, np.array([sample.v2 for sample in odometry]))
    u = np.interp(moments, -sampled, np.array([sample.u2 for sample in odometry]))
    dt = np.diff(moments)
    heading = _summed(0.5 * (u[1:] + u[:-1]) * dt)
    halfway = heading[:-1] + 0.125 * (3.0 * u[:-1] + u[1:]) * dt - heading[-1]
    heading -= heading[-1]
    # Simpson's rule: with the mean heading alone, a turn rate that changes shows in what is certain.
    half = 2.0 * (v[1:] + v[:-1])
    ahead, aside = v * np.cos(heading), v * np.sin(heading)
    x = _summed((ahead[1:] + half * np.cos(halfway) + ahead[:-1]) * dt / 6.0)
    y = _summed((aside[1:] + half * np.sin(halfway) + aside[:-1]) * dt / 6.0)
    rows = np.searchsorted(moments, -back)
    return _Driven(x[rows] - x[-1], y[rows] - y[-1], heading[rows], float(np.max(np.abs(v))))


def _summed(steps: FloatArray) -> FloatArray:
    return np.concatenate(([0.0], np.cumsum(steps)))
