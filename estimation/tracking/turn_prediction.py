"""How the leader steers by the moment a command acts, out of estimates that come late, and its worth.

A filter that takes u1 for a random walk of diffusion q tracks a ramp of u1 with a lag of P / q, P being the
variance of u1 that it reports: for the position-fed filter of three integrations in a row, in the steady
state, P = 2 q / w0 and its response is the third-order Butterworth low-pass of corner w0, whose delay is
2 / w0. With the time T from the capture to when the command acts, the estimate is behind by

    D = P / q + T = V / q,    V = P + q T, the variance of the estimate held to that moment.

Held, it would cost a pair the phase of that delay. It is carried on instead by its slope times D, the slope
from a low-pass of time constant D / 2. For steering u1 of frequency w and variance S, holding leaves an error
of w D u1, of variance V = (w D)^2 S. Carrying on leaves ((w D)^2 / 2 + w D w D / 2) u1, the remainder of the
expansion and the lag of the slope: a variance E = V^2 / S.

The leader's heading suffers twice, from being estimated with a lag and from being turned on by a u1 that is
behind. On a ramp of slope u1' the same filter's heading is behind by 2 u1' / w0^2 = u1' (P / q)^2 / 2, and
turning it by u1 held over T leaves u1' (P / q) T + u1' T^2 / 2 more: together u1' D^2 / 2. Turned further by
that, with the slope as above, what is left is w^2 D^3 / 6 u1 of the expansion and w^2 D^3 / 4 u1 of the
slope's lag: 5/6 w D of the error before, in quadrature to it, or 25/36 V / S of its variance.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from formation.kernel import kernel

_NS = 1e-9
_LEFT_OF_HEADING = 25.0 / 36.0
_ERRORS_TOGETHER = 1.5


class TurnTrend(NamedTuple):
    """What was heard of the leader's turn rate: the newest estimate, its variance, and a low-pass of all.

    ``known``: whether any was; ``capture_ns`` of the newest; ``u1`` and ``slow`` in rad/s, ``variance`` in
    rad^2/s^2; ``diffusion`` [rad^2/s^3] that the newest goes by.
    """

    known: bool
    capture_ns: int
    u1: float
    variance: float
    slow: float
    diffusion: float


NO_TREND = TurnTrend(False, 0, 0.0, 0.0, 0.0, 0.0)

_WIDEST = 1e3  # times more or less than told is no diffusion of a leader


class TurnPrediction(NamedTuple):
    """What is known of the leader's steering: |u1| <= k_u [rad/s], and diffusion [rad^2/s^3] of u1.

    ``spread``: variance S [rad^2/s^2] of u1 before anything is seen. ``inferred``: whether the filter finds
    the diffusion by itself, so that ``diffusion`` is only what it began with. Made by :meth:`of`.
    """

    k_u: float
    diffusion: float
    spread: float
    inferred: bool

    @staticmethod
    def of(k_u: float, diffusion: float, inferred: bool = False) -> TurnPrediction:
        """Prediction with the spread of sinusoidal steering to the limit.

        Raises :class:`ValueError` unless both numbers are positive and finite.
        """
        for name, value in (("k_u", k_u), ("diffusion", diffusion)):
            if not (value > 0.0 and math.isfinite(value)):
                raise ValueError(f"{name} is {value}, expected a positive finite number")
        return TurnPrediction(k_u, diffusion, 0.5 * k_u * k_u, inferred)

    @kernel
    def seen_in(self, variance: float, with_alpha1: float) -> TurnPrediction:
        """The same with the diffusion that an estimate goes by.

        It follows from what the estimate reports: in the steady state the covariance of u1 and the leader's
        heading is 2 q / w0^2, so that over the variance of u1 it is 1 / w0, half of the lag P / q.
        ``with_alpha1``: covariance [rad^2/s] of u1 with alpha1, which falls as the heading grows.
        """
        if not self.inferred or not with_alpha1 < 0.0:
            return self
        least, most = self.diffusion / _WIDEST, self.diffusion * _WIDEST
        return self._replace(diffusion=max(least, min(most, -0.5 * variance * variance / with_alpha1)))

    @kernel
    def of_trend(self, trend: TurnTrend) -> TurnPrediction:
        """The same with the diffusion that a trend's newest estimate goes by."""
        return self._replace(diffusion=trend.diffusion)

    @kernel
    def heard(
        self, before: TurnTrend, capture_ns: int, u1: float, variance: float, ahead: float
    ) -> TurnTrend:
        """Trend with one more estimate in it; its capture lies ``ahead`` [s] before the command acts."""
        if not before.known:
            return TurnTrend(True, capture_ns, u1, variance, u1, self.diffusion)
        since = max(0, capture_ns - before.capture_ns) * _NS
        window = 0.5 * behind(self, variance, ahead)
        share = -math.expm1(-since / window) if window > 0.0 else 1.0
        slow = before.slow + share * (u1 - before.slow)
        return TurnTrend(True, capture_ns, u1, variance, slow, self.diffusion)

    @kernel
    def predicted(self, trend: TurnTrend) -> float:
        """Turn rate [rad/s] when the command acts, within the leader's limit.

        The slope is (u1 - slow) / (D / 2), so that the step by D comes to twice the difference.
        """
        return max(-self.k_u, min(self.k_u, trend.u1 + 2.0 * (trend.u1 - trend.slow)))

    @kernel
    def further(self, trend: TurnTrend, ahead: float) -> float:
        """Angle [rad] by which the leader will have turned further than its estimated u1, held, turns it.

        ``ahead`` [s] after the newest capture. With the slope as in :meth:`predicted` u1' D^2 / 2 comes to
        the difference times D. Taken is the share of the error's variance that this removes, 1 - 25/36 V / S:
        nothing where the expansion has ended, so that estimates that say little are predicted as they are.
        There is no cut at k_u: it would take noise off one side only and lean towards smaller turns.
        """
        share = max(0.0, 1.0 - _LEFT_OF_HEADING * held(self, trend.variance, ahead) / self.spread)
        return share * (trend.u1 - trend.slow) * behind(self, trend.variance, ahead)

    @kernel
    def weight(self, variance: float, ahead: float) -> float:
        """Share of the prediction to feed forward, in [0, 1]; the rest is left to the feedback.

        To feed forward w times the prediction leaves (1 - w)^2 S + w^2 E to the feedback if its error is
        independent of u1: least for w = S / (S + E), the combination of the prediction with the prior
        u1 = 0. Taken is 1 - E / S, the share of the prior variance that the prediction removes: the same to
        first order, never more, and zero from where the expansion behind E has long ended. The feedback of
        gain mu1 answers to the heading of :meth:`further`, whose error comes of the same slope and adds to
        that of u1, so that E counts (1 + mu1 D / 2)^2 times. Taken is 1.5 for all, its value for mu1 = 1.5
        per second and D = 0.3 s.
        """
        ratio = held(self, variance, ahead) / self.spread
        return max(0.0, 1.0 - _ERRORS_TOGETHER * ratio * ratio)


@kernel
def held(turn_prediction: TurnPrediction, variance: float, ahead: float) -> float:
    """Variance V [rad^2/s^2] of an estimate of u1 that is held for ``ahead`` [s].

    An inferred diffusion is that of the time P / q which the filter lags by. Steering is smooth, so that over
    a longer time D it moves on by the square of it: V = P (D / (P / q))^2 in the place of q D.
    """
    walked = variance + turn_prediction.diffusion * ahead
    if turn_prediction.inferred and variance > 0.0:
        return walked * walked / variance
    return walked


@kernel
def behind(turn_prediction: TurnPrediction, variance: float, ahead: float) -> float:
    """Time D [s] by which it is behind then."""
    return (variance + turn_prediction.diffusion * ahead) / turn_prediction.diffusion
