"""What the follower's own motion is worth, found from sightings of a leader that drives evenly."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.consistency.filter_bank import LANES, Member
from estimation.consistency.slip_estimate import (
    BANK,
    FORGOTTEN,
    SLIP_AS_TOLD,
    SLIP_LOWEST,
    SLIP_MEMBERS,
    SLIP_RATIO,
    LearnedSlip,
    learn_slip,
    with_slip,
)
from estimation.filters.belief import Model
from estimation.filters.filter import Filter, Kind, filter_of
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, Measurement, measure_body
from estimation.tracking.track_point import GATED, USED, TrackPoint, begun
from formation.records import load, rows_of

LIMITS = LeaderLimits(v_eps=0.04, k_v=0.1, k_u=0.7)
TOLD = FollowerMotion(0.08, 0.3, 0.01, 0.06)
STEP_NS, ZERO_NS = 100_000_000, 1_000_000_000
SD_RANGE, SD_BEARING, RHO = 5e-3, 2e-3, 2.0
MOST = SLIP_LOWEST * SLIP_RATIO ** (SLIP_MEMBERS - 1)


def main_filter() -> Filter:
    return filter_of(Kind.EKF, Model(FrontEnd.BODY, LIMITS, ProcessNoise.by_rule(LIMITS, 0.03, 0.001)))


def sighted(generator: np.random.Generator, t_ns: int, rho: float, alpha2: float) -> Measurement:
    range_, bearing = rho + SD_RANGE * generator.normal(), alpha2 + SD_BEARING * generator.normal()
    return measure_body(t_ns, range_, bearing, SD_RANGE, SD_BEARING, TOLD)._replace(has_way=True, way=TOLD)


class Drive:
    """A follower that turns on, and whose turn rate is wrong by ``worth`` of what is told of it."""

    def __init__(self, worth: float, seed: int = 1) -> None:
        self.generator, self.worth = np.random.default_rng(seed), worth
        self.estimator, self.bank = main_filter(), rows_of(Member, BANK)
        self.leader, self.heading = np.array([RHO, 0.0]), 0.0
        self.place, self.t_ns = np.zeros(2), ZERO_NS
        first = sighted(self.generator, self.t_ns, RHO, 0.0)
        point = begun(first, self.estimator)
        known = point.belief._replace(vx=0.07, vy=0.0, vx_vx=1e-6, vy_vy=1e-6, u_u=1e-4)
        self.point = point._replace(belief=known, settled=True, verdict=USED)

    def step(self, learned: LearnedSlip) -> TrackPoint:
        """The next point of the track, which takes the deviations of the way as they are found."""
        dt = STEP_NS * 1e-9
        # White noise of the correlation time that the filter takes for granted.
        density = math.sqrt(2.0 * self.estimator.correlation / dt)
        turned = TOLD.u2 + self.worth * TOLD.sd_u2 * density * self.generator.normal()
        speed = TOLD.v2 + self.worth * TOLD.sd_v2 * density * self.generator.normal()
        middle = self.heading + 0.5 * turned * dt
        self.place = self.place + speed * dt * np.array([math.cos(middle), math.sin(middle)])
        self.heading, self.t_ns = self.heading + turned * dt, self.t_ns + STEP_NS
        self.leader = self.leader + np.array([0.07 * dt, 0.0])
        x, y = self.leader - self.place
        seen = sighted(self.generator, self.t_ns, math.hypot(x, y), math.atan2(y, x) - self.heading)
        way = with_slip(TOLD, learned)
        stepped = self.estimator.step(self.point.belief, dt, way, seen, math.inf)
        self.point = self.point._replace(measurement=seen, belief=stepped.belief, way=way, way_s=dt)
        return self.point

    def learn(self, steps: int, learned: LearnedSlip = SLIP_AS_TOLD) -> LearnedSlip:
        learned = learn_slip(learned, self.bank, self.point, SLIP_LOWEST, self.estimator)
        for _ in range(steps):
            learned = learn_slip(learned, self.bank, self.step(learned), SLIP_LOWEST, self.estimator)
        return learned


@pytest.mark.parametrize("worth", [0.2, 1.0, 2.0])
def test_the_deviation_that_odometry_has_is_found(worth: float) -> None:
    assert Drive(worth).learn(900).scale == pytest.approx(worth, rel=0.3)


def test_it_rises_at_once_and_falls_as_slowly_as_scores_are_forgotten() -> None:
    assert Drive(2.0).learn(60).scale > 1.4
    good = Drive(0.1).learn(60).scale
    assert good >= math.exp(-60 * STEP_NS * 1e-9 / FORGOTTEN) * (1.0 - 1e-12)
    assert good < 0.9


def test_it_stays_within_its_members() -> None:
    assert Drive(8.0).learn(300).scale <= MOST * (1.0 + 1e-12)
    assert Drive(0.0).learn(1500).scale >= SLIP_LOWEST


def test_rows_of_the_process_noise_are_left_alone() -> None:
    drive = Drive(1.0)
    drive.learn(30)
    untouched = load(Member, rows_of(Member, 1), 0)
    assert all(load(Member, drive.bank, k) == untouched for k in range(LANES))
    assert all(load(Member, drive.bank, k) != untouched for k in range(LANES, BANK))


def test_a_point_that_was_seen_before_tells_nothing_new() -> None:
    drive = Drive(1.0)
    learned = drive.learn(30)
    assert learn_slip(learned, drive.bank, drive.point, SLIP_LOWEST, drive.estimator) == learned


def test_members_start_anew_with_the_track_and_what_was_found_is_kept() -> None:
    drive = Drive(0.2)
    learned = drive.learn(300)
    lost = begun(drive.step(learned).measurement._replace(has_way=False), drive.estimator)
    after = learn_slip(learned, drive.bank, lost, SLIP_LOWEST, drive.estimator)
    assert (after.begun, after.scale) == (False, learned.scale)


def test_a_way_with_a_gap_is_not_scored() -> None:
    drive = Drive(1.0)
    learned = drive.learn(30)
    while learned.at_ns == drive.point.measurement.capture_ns or learned.way_s < 0.15:
        learned = learn_slip(learned, drive.bank, drive.step(learned), SLIP_LOWEST, drive.estimator)
    scores = [load(Member, drive.bank, k).score for k in range(LANES, BANK)]
    short = drive.step(learned)._replace(way_s=0.04)
    after = learn_slip(learned, drive.bank, short, SLIP_LOWEST, drive.estimator)
    assert not after.begun
    assert [load(Member, drive.bank, k).score for k in range(LANES, BANK)] == scores


def test_an_outlier_is_not_scored_and_refused_ones_in_a_row_are() -> None:
    drive = Drive(1.0)
    learned = drive.learn(30)
    while learned.way_s < 0.15:
        learned = learn_slip(learned, drive.bank, drive.step(learned), SLIP_LOWEST, drive.estimator)
    once = learn_slip(
        learned, drive.bank, drive.step(learned)._replace(verdict=GATED), SLIP_LOWEST, drive.estimator
    )
    assert (once.at_ns, once.scale) == (learned.at_ns, learned.scale)
    assert once.way_s == pytest.approx(learned.way_s + STEP_NS * 1e-9)
    twice = learn_slip(
        once, drive.bank, drive.step(once)._replace(verdict=GATED), SLIP_LOWEST, drive.estimator
    )
    assert twice.at_ns == drive.t_ns


def test_of_commands_only_what_is_worse_is_learned() -> None:
    drive, learned = Drive(0.2), SLIP_AS_TOLD
    for _ in range(300):
        learned = learn_slip(learned, drive.bank, drive.step(learned), 1.0, drive.estimator)
        assert learned.scale >= 1.0
