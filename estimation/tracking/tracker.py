"""From measurements in any order to a belief with a status: gates, re-acquisition, coasting, rewind ring.

A track is a fold: each measurement into the point of the one before, in the order of capture times. A ring of
the last points lets a late measurement be folded in where it belongs, so that the result is what delivery in
order would have given.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

from estimation.filters.filter import Filter
from estimation.filters.gaussian import Gaussian, sd_heading_of, speed_of
from estimation.models.coordinated_turn import LeaderLimits
from estimation.models.measurement import Measurement
from estimation.tracking.follower_check import (
    BELIEVED,
    FLIPPED,
    FROZEN,
    SWAPPED,
    Checked,
    FollowerCheck,
    carried,
    check_from,
    checked,
)
from estimation.tracking.follower_check import GATED as LEADER_OFF
from estimation.tracking.leader_step import followed_leader
from estimation.tracking.reacquisition import joined, jumped, line_turn
from estimation.tracking.track_point import (
    DUPLICATE,
    GATED,
    LATE,
    RESTARTED,
    SAME_NS,
    USED,
    TrackPoint,
    begun,
    lasting,
    next_period,
    no_tentative,
    way_to,
)
from estimation.tracking.track_settings import TrackSettings
from formation.kernel import kernel
from formation.records import Rows, load, size, store
from formation.ring import Ring, place

_NS = 1e-9
_COASTS, _LOST = 2.5, 8.0  # typical intervals without a measurement: coasting, lost
_SLOWEST = 2.0  # [s] between measurements; what is slower is no track


class Status(IntEnum):
    """How far an estimate can be trusted; only TRACKING may move a robot.

    INITIALISING: speed and bearing of the leader are not yet known well enough. TRACKING: all well.
    COASTING: no measurement for a while. REJECTING: the newest measurement did not pass the gates.
    LOST: nothing usable for so long that the next measurement starts anew.
    """

    INITIALISING = 0
    TRACKING = 1
    COASTING = 2
    REJECTING = 3
    LOST = 4


INITIALISING = Status.INITIALISING.value
TRACKING = Status.TRACKING.value
COASTING = Status.COASTING.value
REJECTING = Status.REJECTING.value
LOST = Status.LOST.value


class Added(NamedTuple):
    """Ring with a measurement in it, and what became of this: verdict and cause."""

    ring: Ring
    verdict: int
    cause: int


@kernel
def is_settled(belief: Gaussian, before: bool, settings: TrackSettings, limits: LeaderLimits) -> bool:
    """Whether the leader's direction is known well enough, for a track that was settled before or not.

    The first few measurements may make a leader seem faster than any is, and its direction the better known
    by as much. What is above k_v therefore doesn't help to settle, unless the settings let it.
    """
    speed = speed_of(belief)
    if speed < 0.5 * limits.v_eps:
        return False
    sd_heading = sd_heading_of(belief)
    if before:
        return sd_heading < settings.unsettled_heading
    excess = max(1.0, speed / limits.k_v) if settings.capped_speed else 1.0
    return sd_heading * excess < settings.settled_heading


@kernel
def lost_after(point: TrackPoint, settings: TrackSettings) -> float:
    """Silence [s] after which a track is lost: what is told, or some of its own typical intervals."""
    return max(settings.lost_after, _LOST * point.period)


@kernel
def status_of(point: TrackPoint, now_ns: int, settings: TrackSettings) -> int:
    """Status of a track's newest point for one who looks at it at ``now_ns``."""
    silence = (now_ns - point.used_ns) * _NS
    if silence > lost_after(point, settings):
        return LOST
    if point.verdict == GATED:
        return REJECTING
    if silence > max(settings.coast_after, _COASTS * point.period):
        return COASTING
    return TRACKING if point.settled else INITIALISING


@kernel
def fold(
    points: Rows[TrackPoint],
    before: int,
    row: int,
    measurement: Measurement,
    settings: TrackSettings,
    estimator: Filter,
) -> None:
    """Fold one measurement, newer than the point in row ``before``, into that; its point goes into ``row``.

    It is used if the leader passes the gate and the frame its checks. If not, it joins the tentative track,
    which takes over when enough measurements agree and the jump is small against the distance: more than
    that no robot does, and it has time until the track is lost.
    """
    last, capture_ns = load(TrackPoint, points, before), measurement.capture_ns
    found = _checked(last, measurement, settings.gate, estimator)
    if (capture_ns - last.used_ns) * _NS > lost_after(last, settings):
        store(points, row, _found(points, before, measurement, found, settings, estimator))
        return
    # Nothing passes a negative gate: the belief is then the prediction.
    gate = settings.gate if found.cause == BELIEVED else -1.0
    dt = (capture_ns - last.measurement.capture_ns) * _NS
    way = way_to(last, measurement, found.cause == BELIEVED, dt)
    followed = followed_leader(last, measurement, way, gate, settings.notices_manoeuvres, estimator)
    stepped = followed.stepped
    point = TrackPoint(
        measurement,
        stepped.belief,
        USED,
        stepped.nis,
        capture_ns,
        is_settled(estimator.leader(stepped.belief, measurement), last.settled, settings, estimator.limits),
        no_tentative(stepped.belief),
        found.check,
        found.cause,
        lasting(last.jump, capture_ns, settings.jump_uncertain_for),
        estimator.noise,
        followed.manoeuvre,
        next_period(last.period, dt),
        way,
        dt,
    )
    # Stored where it is made: points that come together from several ways would be moved about.
    store(points, row, point)
    if not stepped.nis <= gate:
        store(points, row, _refused(points, before, row, settings, estimator))


@kernel(inline=False)
def _refused(
    points: Rows[TrackPoint], before: int, row: int, settings: TrackSettings, estimator: Filter
) -> TrackPoint:
    """Point of a measurement that was not used, or of the tentative track that takes over with it."""
    # Seldom called, it loads both by itself: handed over, all of them would be loaded each time.
    last, point = load(TrackPoint, points, before), load(TrackPoint, points, row)
    cause = LEADER_OFF if point.cause == BELIEVED else point.cause
    rejected = point._replace(verdict=GATED, used_ns=last.used_ns, cause=cause)
    if cause == FROZEN:
        return rejected
    tentative = joined(last.tentative, point.measurement, estimator, settings.gate)
    return _taken_over(rejected._replace(tentative=tentative), settings, estimator)


@kernel
def _checked(last: TrackPoint, measurement: Measurement, gate: float, estimator: Filter) -> Checked:
    """Check at the measurement, and what there is against its frame; nothing against a sighting."""
    check: FollowerCheck = last.check
    if check.known:
        dt = (measurement.capture_ns - last.measurement.capture_ns) * _NS
        check = carried(check, last.measurement.motion, measurement.motion, dt)
    if not measurement.framed:
        return Checked(check, BELIEVED)
    if not check.known:
        return Checked(check_from(measurement), BELIEVED)
    leader_moves = speed_of(last.belief) >= 0.5 * estimator.limits.v_eps
    return checked(check, measurement.seen, measurement.noise, gate, leader_moves)


@kernel(inline=False)
def _found(
    points: Rows[TrackPoint],
    before: int,
    measurement: Measurement,
    found: Checked,
    settings: TrackSettings,
    estimator: Filter,
) -> TrackPoint:
    """Start anew after a loss: with the tentative track if it is ripe, unless the frame is plainly wrong.

    Flipped headings, swapped bodies and frozen ones no real motion has. What was lost is not moved on, so
    that a body that stays frozen leads nowhere.
    """
    last = load(TrackPoint, points, before)
    if found.cause == FLIPPED or found.cause == SWAPPED or found.cause == FROZEN:
        return last._replace(
            measurement=measurement,
            verdict=GATED,
            nis=math.nan,
            settled=False,
            tentative=no_tentative(last.belief),
            check=found.check,
            cause=found.cause,
        )
    # One that was lost for being slow is to be given the time that it takes.
    apart = (measurement.capture_ns - last.measurement.capture_ns) * _NS
    anew = begun(measurement, estimator)._replace(period=min(_SLOWEST, next_period(last.period, apart)))
    tentative = joined(last.tentative, measurement, estimator, settings.gate)
    if tentative.frames < settings.reacquire_frames:
        return anew._replace(tentative=tentative)
    leader = estimator.leader(tentative.belief, measurement)
    settled = is_settled(leader, False, settings, estimator.limits)
    return anew._replace(belief=tentative.belief, settled=settled)


@kernel
def _taken_over(rejected: TrackPoint, settings: TrackSettings, estimator: Filter) -> TrackPoint:
    """Point of a tentative track that takes over, uncertain by its jump; the rejected one otherwise.

    It does not while it is not ripe, nor by a jump that would turn the line between the robots, and with it
    alpha1 and alpha2, by more than ``followed_turn``.
    """
    tentative, measurement = rejected.tentative, rejected.measurement
    if tentative.frames < settings.reacquire_frames:
        return rejected
    prior, leader_fits = rejected.belief, rejected.nis <= settings.gate
    jump = jumped(rejected.jump, measurement, prior, rejected.check, leader_fits)
    if line_turn(jump, measurement) > settings.followed_turn:
        return rejected
    belief = estimator.update(prior, measurement) if leader_fits else tentative.belief
    check = check_from(measurement) if measurement.framed else rejected.check
    leader = estimator.leader(belief, measurement)
    return rejected._replace(
        belief=belief,
        verdict=RESTARTED,
        used_ns=measurement.capture_ns,
        settled=is_settled(leader, leader_fits and rejected.settled, settings, estimator.limits),
        tentative=no_tentative(belief),
        check=check,
        cause=BELIEVED,
        jump=jump,
    )


# The rewind ring


@kernel
def point_at(points: Rows[TrackPoint], ring: Ring, k: int) -> TrackPoint:
    """The ring's k-th point, the oldest being the 0th."""
    return load(TrackPoint, points, place(ring, points, k))


@kernel
def newest(points: Rows[TrackPoint], ring: Ring) -> TrackPoint:
    """The ring's newest point."""
    return load(TrackPoint, points, place(ring, points, ring.length - 1))


@kernel
def capture_at(points: Rows[TrackPoint], ring: Ring, k: int) -> int:
    """Capture time of the ring's k-th point."""
    return point_at(points, ring, k).measurement.capture_ns


@kernel
def place_of(points: Rows[TrackPoint], ring: Ring, capture_ns: int) -> int:
    """Number of the points captured before a time."""
    k = ring.length
    while k > 0 and capture_at(points, ring, k - 1) >= capture_ns:
        k -= 1
    return k


@kernel
def add(
    points: Rows[TrackPoint], ring: Ring, measurement: Measurement, settings: TrackSettings, estimator: Filter
) -> Added:
    """Fold a measurement in at its place in time; tell what became of it.

    A measurement of a capture that the track has is a DUPLICATE, one from before the window or before the
    track began is LATE: both leave the track as it is. The verdict of one folded in late is that at its own
    place. Points that come too close together for the whole window to fit push the oldest out.
    """
    n = ring.length
    if n == 0 or measurement.capture_ns < capture_at(points, ring, n - 1) + SAME_NS:
        return _inserted(points, ring, measurement, settings, estimator)
    before = place(ring, points, n - 1)
    if n == size(points):
        ring, n = Ring(place(ring, points, 1), n - 1), n - 1
    row = place(ring, points, n)
    fold(points, before, row, measurement, settings, estimator)
    point = load(TrackPoint, points, row)
    return Added(trimmed(points, Ring(ring.first, n + 1), settings), point.verdict, point.cause)


@kernel(inline=False)
def _inserted(
    points: Rows[TrackPoint], ring: Ring, measurement: Measurement, settings: TrackSettings, estimator: Filter
) -> Added:
    """Fold in a measurement that is the first, or hardly newer than the newest."""
    n, capture_ns = ring.length, measurement.capture_ns
    if n == 0:
        store(points, place(ring, points, 0), begun(measurement, estimator))
        return Added(Ring(ring.first, 1), RESTARTED, BELIEVED)
    k = place_of(points, ring, capture_ns)
    for at in range(max(0, k - 1), min(n, k + 1)):
        if abs(capture_at(points, ring, at) - capture_ns) < SAME_NS:
            return Added(ring, DUPLICATE, BELIEVED)
    full = n == size(points)
    if k < (2 if full else 1) or capture_ns < capture_at(points, ring, n - 1) - window_ns(settings):
        return Added(ring, LATE, BELIEVED)
    if full:
        ring, n, k = Ring(place(ring, points, 1), n - 1), n - 1, k - 1
    for after in range(n, k, -1):
        store(points, place(ring, points, after), point_at(points, ring, after - 1))
    here = point_at(points, ring, k)
    store(points, place(ring, points, k), here._replace(measurement=measurement, noise=estimator.noise))
    ring = Ring(ring.first, n + 1)
    reprocessed(points, ring, k, settings, estimator)
    here = point_at(points, ring, k)
    return Added(trimmed(points, ring, settings), here.verdict, here.cause)


@kernel
def window_ns(settings: TrackSettings) -> int:
    """How far back the ring reaches."""
    return math.floor(settings.window / _NS + 0.5)


@kernel
def trimmed(points: Rows[TrackPoint], ring: Ring, settings: TrackSettings) -> Ring:
    """Ring of the points in the window and the one before, which anything in the window can follow."""
    oldest_ns = capture_at(points, ring, ring.length - 1) - window_ns(settings)
    first = 0
    while capture_at(points, ring, first) < oldest_ns:
        first += 1
    if first <= 1:
        return ring
    return Ring(place(ring, points, first - 1), ring.length - first + 1)


@kernel(inline=False)
def reprocessed(
    points: Rows[TrackPoint], ring: Ring, k: int, settings: TrackSettings, estimator: Filter
) -> int:
    """Fold the points from the k-th on anew, whose measurements have changed in place; tell how many.

    The oldest point keeps its belief: what that rests on is gone.
    """
    first = max(k, 1)
    for at in range(first, ring.length):
        # By the noise that it had: what has been learned since is not for it.
        before, row, old = place(ring, points, at - 1), place(ring, points, at), point_at(points, ring, at)
        fold(points, before, row, old.measurement, settings, estimator.driven_by(old.noise))
    return ring.length - first
