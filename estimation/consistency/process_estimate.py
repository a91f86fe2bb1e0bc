"""The leader's process noise, found: a bank of filters that differ by it, weighed by how well they predict.

Some filters share all but the density q_v that drives the speed, others all but q_u that drives the turn
rate, each in steps of a constant ratio from a leader that never changes to one that does as it likes. They
run beside the main filter on what this has believed, put together over a thirtieth of a second, since noise
is a slow thing to learn. The score of each is the logarithm of its likelihood, forgotten over half a minute.

Between members the score is that of a spectrum told wrongly (Whittle, 1953). White noise that is summed up
n / 2 times on its way to a position, twice for the speed and three times for the turn rate, has there a
density of q / w^n beside the even one of the sensor. By a q told as e^y times what it is the logarithm of the
likelihood falls short by K ((n - 1) exp(y / n) + exp(y / n - y)), least at y = 0. Three members around the
best one tell where that is.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.consistency.filter_bank import (
    LANES,
    MEMBERS,
    SPEED_LOWEST,
    SPEED_MEMBERS,
    SPEED_RATIO,
    TURN_LOWEST,
    TURN_MEMBERS,
    TURN_RATIO,
    Member,
    Trial,
    score_all,
)
from estimation.consistency.summed_way import mean_of_way, way_added
from estimation.filters.filter import Filter
from estimation.filters.gaussian import Gaussian
from estimation.models.coordinated_turn import FollowerMotion, ProcessNoise, Spread, mean_motion
from estimation.models.measurement import NO_MOTION, Measurement
from estimation.tracking.track_point import TrackPoint
from formation.kernel import kernel
from formation.records import Rows, load_across, store_across

FORGOTTEN = 30.0
"""Time [s] in which scores are forgotten."""

TURN_SHARE, SPEED_SHARE = 0.85, 0.65
"""Shares of the likeliest noise that are taken. For leaders that move as the filter's model says they make
errors larger than reported by a tenth; for those that steer smoothly and drive evenly what is reported is too
large by more.
"""

_TOLD_SD = math.log(10.0)  # what is told is known to a factor of ten
_SPEED_FALLING, _TURN_FALLING = 0.75, 0.25  # [1/s]: who drives calmly for a while need not be calm
# Neither is a multiple of a usual spacing of frames, so that a microsecond doesn't matter.
_INTERVAL_NS, _SETTLING_NS = 28_300_000, 1_003_000_000
_NS = 1e-9
_SAME = 1e-6  # [s]


class ProcessLearning(NamedTuple):
    """Whether process noise is learned, what is told of it, and the densities that bandwidths are shares of.

    ``speed`` [m^2/s^3]: k_v^2 per second, ``turn`` [rad^2/s^3]: k_u^2 per second.
    """

    on: bool
    told: ProcessNoise
    speed: float
    turn: float


class LearnedProcess(NamedTuple):
    """What has been learned, and what is being put together for the bank.

    speed, turn: ratios of q_v and q_u to what is told. settled_ns: since when the track is settled, 0 if it
    is not. begun: whether the bank runs. at_ns: time of its beliefs. ended_ns: capture of the last
    measurement in them; motion: of the follower then. together, later_ns, x, y: number of measurements put
    together since, the sum of their times after ``ended_ns``, and sums of positions. way_s, way:
    time [s] since ``ended_ns`` over which the follower's way is known, and the sums of its motion over that,
    its variances times time.
    """

    speed: float
    turn: float
    settled_ns: int
    begun: bool
    at_ns: int
    ended_ns: int
    motion: FollowerMotion
    together: int
    later_ns: int
    x: float
    y: float
    way_s: float = 0.0
    way: FollowerMotion = NO_MOTION


NOTHING_LEARNED = LearnedProcess(1.0, 1.0, 0, False, 0, 0, FollowerMotion(0.0, 0.0, 0.0, 0.0), 0, 0, 0.0, 0.0)


@kernel
def learned_noise(learned: LearnedProcess, rules: ProcessLearning) -> ProcessNoise:
    """Process noise to take."""
    told = rules.told
    return told._replace(q_v=told.q_v * learned.speed, q_u=told.q_u * learned.turn, q_across=told.q_v)


@kernel(inline=False)
def learn(
    learned: LearnedProcess, bank: Rows[Member], point: TrackPoint, rules: ProcessLearning, estimator: Filter
) -> LearnedProcess:
    """Learn from a measurement in its order that the main filter has used: the newest point of its track."""
    measurement, belief, settled = point.measurement, point.belief, point.settled
    now_ns = measurement.capture_ns
    if not learned.begun:
        return _waiting(learned, bank, measurement, belief, settled, rules)
    since_ns = now_ns - learned.ended_ns
    count, later_ns = learned.together + 1, learned.later_ns + since_ns
    x, y = learned.x + measurement.x, learned.y + measurement.y
    if not measurement.in_world:
        # Along the follower's axes, which turn, positions of different times have no mean.
        count, later_ns, x, y = 1, since_ns, measurement.x, measurement.y
    learned = _with_way(learned, point)
    learned = learned._replace(together=count, later_ns=later_ns, x=x, y=y)
    if since_ns < _INTERVAL_NS:
        return learned
    return _scored(learned, bank, measurement, belief, rules, estimator)


@kernel
def _with_way(learned: LearnedProcess, point: TrackPoint) -> LearnedProcess:
    """The same with the follower's way to a point added; in the world frame that makes no difference."""
    if point.measurement.in_world:
        return learned
    added = way_added(learned.way, point.way, point.way_s)
    return learned._replace(way_s=learned.way_s + point.way_s, way=added)


@kernel
def _way_of(learned: LearnedProcess, measurement: Measurement, dt: float) -> FollowerMotion:
    """Mean motion since the members' time: by the whole way where that is known, else by its ends."""
    if measurement.in_world or abs(learned.way_s - dt) > _SAME:
        return mean_motion(learned.motion, measurement.motion)
    return mean_of_way(learned.way, learned.way_s)


@kernel
def restarted(learned: LearnedProcess) -> LearnedProcess:
    """What is kept when the track has started anew: all that was learned, but the bank must start again."""
    return learned._replace(begun=False, settled_ns=0)


@kernel
def unlearned(learned: LearnedProcess, bank: Rows[Member], rules: ProcessLearning) -> LearnedProcess:
    """What is kept when all was weighed against a wrong noise: what was found, in the place of what is told.

    A bank that runs begins at once with the main filter's belief, which knows of the noise.
    """
    _score_as_found(bank, learned.turn * rules.told.q_u / rules.turn, rules.told.q_u / rules.turn, True)
    _score_as_found(bank, learned.speed * rules.told.q_v / rules.speed, rules.told.q_v / rules.speed, False)
    return learned._replace(begun=False)


@kernel
def _score_as_found(bank: Rows[Member], found: float, told: float, turn: bool) -> None:
    """Scores by which a found bandwidth is as likely as the told one was, and as uncertain."""
    first, count, tried, ratio = TURN_MEMBERS, SPEED_MEMBERS, SPEED_LOWEST, SPEED_RATIO
    if turn:
        first, count, tried, ratio = 0, TURN_MEMBERS, TURN_LOWEST, TURN_RATIO
    for k in range(first, first + count):
        score = _prior(math.log(tried / found)) - _prior(math.log(tried / told))
        store_across(bank, LANES, k, load_across(Member, bank, LANES, k)._replace(score=score))
        tried = tried * ratio


@kernel
def _waiting(
    learned: LearnedProcess,
    bank: Rows[Member],
    measurement: Measurement,
    belief: Gaussian,
    settled: bool,
    rules: ProcessLearning,
) -> LearnedProcess:
    """Start the bank from the main filter's belief once its track has been settled for a while.

    Before that errors are those of the linearisation, for which no process noise is to blame.
    """
    now_ns = measurement.capture_ns
    if not settled:
        return learned._replace(settled_ns=0)
    if learned.settled_ns == 0:
        return learned._replace(settled_ns=now_ns)
    if now_ns - learned.settled_ns < _SETTLING_NS:
        return learned
    _begin(bank, belief, rules)
    return _emptied(learned._replace(begun=True, at_ns=now_ns), measurement)


@kernel(inline=False)
def _begin(bank: Rows[Member], belief: Gaussian, rules: ProcessLearning) -> None:
    """Start all members from a belief."""
    turn, speed = _range_of(rules, True), _range_of(rules, False)
    for k in range(LANES):
        prior = 0.0
        if k < TURN_MEMBERS:
            prior = _prior(turn.lowest + turn.step * k)
        elif k < MEMBERS:
            prior = _prior(speed.lowest + speed.step * (k - TURN_MEMBERS))
        # Scores of zero where there are none yet: rows begin with that.
        member = load_across(Member, bank, LANES, k)
        store_across(bank, LANES, k, member._replace(belief=belief, prior=prior))


@kernel
def _emptied(learned: LearnedProcess, measurement: Measurement) -> LearnedProcess:
    """The same with nothing put together since a measurement."""
    return learned._replace(
        ended_ns=measurement.capture_ns,
        motion=measurement.motion,
        together=0,
        later_ns=0,
        x=0.0,
        y=0.0,
        way_s=0.0,
        way=FollowerMotion(0.0, 0.0, 0.0, 0.0),
    )


@kernel
def _scored(
    learned: LearnedProcess,
    bank: Rows[Member],
    measurement: Measurement,
    belief: Gaussian,
    rules: ProcessLearning,
    estimator: Filter,
) -> LearnedProcess:
    """Score every member by what was put together, and take the noise that is likeliest then."""
    many = 1.0 * learned.together
    x, y, due_ns = learned.x / many, learned.y / many, learned.ended_ns + learned.later_ns // learned.together
    given = measurement.spread
    spread = Spread(given.xx / many, given.xy / many, given.yy / many)
    dt = (due_ns - learned.at_ns) * _NS
    motion = _way_of(learned, measurement, dt)
    kept, found = math.exp(-dt / FORGOTTEN), learned_noise(learned, rules)
    _noise_by_members(bank, found, rules)
    score_all(bank, Trial(found, dt, kept, x, y, spread), motion, belief, estimator)
    speed = _taken(bank, rules, learned.speed, dt, False)
    turn = _taken(bank, rules, learned.turn, dt, True)
    return _emptied(learned._replace(speed=speed, turn=turn, at_ns=due_ns), measurement)


@kernel
def _noise_by_members(bank: Rows[Member], found: ProcessNoise, rules: ProcessLearning) -> None:
    """Give every member its noise: what is found, with one density in the place of that."""
    tried_turn, tried_speed = rules.turn * TURN_LOWEST, rules.speed * SPEED_LOWEST
    for k in range(LANES):
        q_v, q_u = found.q_v, found.q_u
        if k < TURN_MEMBERS:
            q_u = tried_turn
            tried_turn = tried_turn * TURN_RATIO
        elif k < MEMBERS:
            q_v = tried_speed
            tried_speed = tried_speed * SPEED_RATIO
        store_across(bank, LANES, k, load_across(Member, bank, LANES, k)._replace(q_v=q_v, q_u=q_u))


class Range(NamedTuple):
    """Where the bandwidths of members lie: logarithms of the lowest to the told one, and of their ratio.

    order: power of the frequency by which this noise falls in positions.
    """

    first: int
    members: int
    lowest: float
    step: float
    order: float


@kernel
def _range_of(rules: ProcessLearning, turn: bool) -> Range:
    """Range of the members that differ by the turn rate's noise, or by the speed's."""
    if turn:
        told = rules.told.q_u / rules.turn
        return Range(0, TURN_MEMBERS, math.log(TURN_LOWEST / told), math.log(TURN_RATIO), 6.0)
    told = rules.told.q_v / rules.speed
    return Range(TURN_MEMBERS, SPEED_MEMBERS, math.log(SPEED_LOWEST / told), math.log(SPEED_RATIO), 4.0)


@kernel
def _taken(bank: Rows[Member], rules: ProcessLearning, before: float, dt: float, turn: bool) -> float:
    """Ratio to the told bandwidth to go on with: the likeliest, but no faster down than leaders may calm."""
    falling = _TURN_FALLING if turn else _SPEED_FALLING
    first, count, lowest, step, order = _range_of(rules, turn)
    best, highest = 0, _posterior(bank, first)
    for k in range(1, count):
        here = _posterior(bank, first + k)
        if here > highest:
            best, highest = k, here
    peak = lowest + step * best
    inside = 0 < best < count - 1
    if inside:
        below = highest - _posterior(bank, first + best - 1)
        above = highest - _posterior(bank, first + best + 1)
        peak += vertex(below, above, step, order)
    total, mean = 0.0, 0.0
    for k in range(count):
        off = lowest + step * k
        weight = math.exp(_posterior(bank, first + k) - highest)
        # Around the peak members stand too far apart to tell where it is by their weights alone.
        near = inside and best - 1 <= k <= best + 1
        total += weight
        mean += weight * (peak if near else off)
    share = TURN_SHARE if turn else SPEED_SHARE
    return max(share * math.exp(mean / total), before * math.exp(-falling * dt))


@kernel
def _posterior(bank: Rows[Member], k: int) -> float:
    """Score of a member with what is told."""
    member = load_across(Member, bank, LANES, k)
    return member.score + member.prior


@kernel
def _prior(off: float) -> float:
    """Logarithm of how likely noise is whose logarithm is off by this much from the told one."""
    apart = off / _TOLD_SD
    return -math.log(1.0 + 0.5 * apart * apart)


@kernel
def vertex(below: float, above: float, step: float, order: float) -> float:
    """Where the score is highest, off the middle of three members, the others being lower by these.

    With w = exp(-y) of the middle one, what either falls short by is linear in w, and so is their ratio.
    """
    few, many = step / order, step * (order - 1.0) / order
    scale = above * (math.exp(many) - 1.0) + below * (1.0 - math.exp(-many))
    if scale <= 0.0:
        return 0.0
    return math.log((order - 1.0) * (below * (math.exp(few) - 1.0) + above * (1.0 - math.exp(-few))) / scale)
