"""What the follower's own motion is worth, found: filters that differ by its deviations, weighed by that.

Slip and lag are told as a share of v2 and u2. Good wheels are better than that, worn ones on a smooth floor
worse, and the leader as seen from on board shows it: sightings scatter across the line of sight by what the
follower does not know of its own turning. Some filters share all but the deviations of the follower's way, in
steps of a constant ratio, and predict over some tenths of a second: errors of wheels last about that long,
and look harmless from one sample to the next. The score of each is the logarithm of its likelihood, forgotten
over half a minute; the scale that is taken is the mean of their logarithms, weighed by likelihood and by what
is told. It rises at once, and falls as slowly as scores are forgotten: wheels that have not slipped for a
while may yet.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.consistency.filter_bank import LANES, Member
from estimation.consistency.summed_way import mean_of_way, way_added
from estimation.filters.ekf import informed
from estimation.filters.filter import EKF, Filter
from estimation.filters.gaussian import Gaussian, nis_of
from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import NO_MOTION
from estimation.tracking.track_point import GATED, USED, TrackPoint
from formation.kernel import kernel
from formation.records import Rows, load, store

SLIP_MEMBERS, SLIP_RATIO, SLIP_LOWEST = 6, 10.0 ** (1.0 / 3.0), 0.1
"""Filters, ratio between their deviations, and the lowest over what is told: a tenth to five times that."""

BANK = LANES + SLIP_MEMBERS
"""Rows of a bank with room for these behind those for the process noise."""

FORGOTTEN = 30.0
"""Time [s] in which scores are forgotten."""

_TOLD_SD = math.log(3.0)  # what is told is known to a factor of three
_INTERVAL_NS = 290_000_000  # between two scores; sightings at 3 Hz count each
_LARGEST_NIS = 400.0  # a member further off starts again from the main filter
_NS = 1e-9
_SAME = 1e-6  # [s]


class LearnedSlip(NamedTuple):
    """What has been found, and the way that the members have still to go.

    scale: deviations of the follower's motion over those told. begun: whether the members run. at_ns: time
    of their beliefs. seen_ns: capture of the newest point looked at. way_s, way: time [s] since ``at_ns``
    over which the way is known, and the sums of its motion over that, its variances times time. gated:
    whether that newest point was not believed.
    """

    scale: float
    begun: bool
    at_ns: int
    seen_ns: int
    way_s: float
    way: FollowerMotion
    gated: bool


SLIP_AS_TOLD = LearnedSlip(1.0, False, 0, 0, 0.0, NO_MOTION, gated=False)


@kernel
def with_slip(motion: FollowerMotion, learned: LearnedSlip) -> FollowerMotion:
    """Motion of the follower with the deviations that were found."""
    return motion._replace(sd_v2=learned.scale * motion.sd_v2, sd_u2=learned.scale * motion.sd_u2)


@kernel(inline=False)
def learn_slip(
    learned: LearnedSlip, bank: Rows[Member], point: TrackPoint, least: float, estimator: Filter
) -> LearnedSlip:
    """Learn from a point of a track to which the follower's way is known for good; ``least``: its scale."""
    now_ns = point.measurement.capture_ns
    if now_ns <= learned.seen_ns:
        return learned
    learned = learned._replace(seen_ns=now_ns)
    # One that alone was not believed is an outlier; one after the other, and the way there may be to blame.
    outlier = point.verdict == GATED and not learned.gated
    learned = learned._replace(gated=point.verdict == GATED)
    if not point.measurement.has_way or not (point.settled or learned.begun):
        return learned._replace(begun=False)
    if not learned.begun:
        if point.verdict != USED:
            return learned
        for k in range(LANES, BANK):
            # Scores of zero where there are none yet: rows begin with that.
            store(bank, k, load(Member, bank, k)._replace(belief=point.belief))
        nowhere = FollowerMotion(0.0, 0.0, 0.0, 0.0)
        return learned._replace(begun=True, at_ns=now_ns, way_s=0.0, way=nowhere)
    added = way_added(learned.way, point.way, point.way_s)
    learned = learned._replace(way_s=learned.way_s + point.way_s, way=added)
    if now_ns - learned.at_ns < _INTERVAL_NS or outlier:
        return learned
    if abs(learned.way_s - (now_ns - learned.at_ns) * _NS) > _SAME:
        # Something came late in between, so that part of the way is missing.
        return learned._replace(begun=False)
    scored = _scored(learned, bank, point, estimator)
    return scored._replace(scale=max(least, scored.scale))


@kernel
def _scored(learned: LearnedSlip, bank: Rows[Member], point: TrackPoint, estimator: Filter) -> LearnedSlip:
    """Score every member by a measurement, and take the mean of those that are likely then."""
    dt = learned.way_s
    kept, off = math.exp(-dt / FORGOTTEN), SLIP_LOWEST / learned.scale
    # The sums are of deviations as they were taken, which had a scale already.
    mean = mean_of_way(learned.way, dt)
    highest = -math.inf
    one = estimator._replace(kind=EKF, noise=point.noise)
    for k in range(LANES, BANK):
        motion = mean._replace(sd_v2=off * mean.sd_v2, sd_u2=off * mean.sd_u2)
        prior = one.predict(load(Member, bank, k).belief, dt, motion)
        highest = max(highest, _score(bank, k, kept, prior, point))
        off = off * SLIP_RATIO
    total, sum_, apart = 0.0, 0.0, math.log(SLIP_LOWEST)
    for k in range(LANES, BANK):
        told = apart / _TOLD_SD
        weight = math.exp(load(Member, bank, k).score - highest) / (1.0 + 0.5 * told * told)
        total, sum_ = total + weight, sum_ + weight * apart
        apart = apart + math.log(SLIP_RATIO)
    nowhere = FollowerMotion(0.0, 0.0, 0.0, 0.0)
    return learned._replace(
        scale=max(math.exp(sum_ / total), learned.scale * kept),
        at_ns=point.measurement.capture_ns,
        way_s=0.0,
        way=nowhere,
    )


@kernel(inline=False)
def _score(bank: Rows[Member], k: int, kept: float, prior: Gaussian, point: TrackPoint) -> float:
    """Score a member by a measurement that it has been moved on to, and let it take it in."""
    seen = point.measurement
    nis, spread = nis_of(prior, seen.x, seen.y, seen.spread), seen.spread
    a, b, c = prior.x_x + spread.xx, prior.x_y + spread.xy, prior.y_y + spread.yy
    member = load(Member, bank, k)
    score = kept * member.score - 0.5 * (min(nis, _LARGEST_NIS) + math.log(a * c - b * b))
    if nis <= _LARGEST_NIS:
        store(bank, k, member._replace(belief=informed(prior, seen.x, seen.y, spread), score=score))
    else:
        store(bank, k, member._replace(belief=point.belief, score=score))
    return score
