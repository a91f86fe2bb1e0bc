from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from controllers.laws import LAWS
from formation.angles import wrap
from formation.closed_loop import Trajectory, simulate_pair
from formation.pose import Motion
from formation.shape import Shape
from formation.station import Side
from hil.judge.noise_free_orbit import noise_free_orbit
from hil.judge.run_data import Span
from hil.judge.side_orders import Order
from hil.judge.true_states import TrueStates
from hil.scenario.files import load_scenario
from hil.scenario.noise_free_runs import noise_free_run
from hil.scenario.parts import gains, leader_program, limits
from hil.scenario.start import start_poses

T0 = 1_700_000_000_000_000_000


def truth_and_span(run: Trajectory) -> tuple[TrueStates, Span]:
    """The truth of a run as an emulator would have told it."""
    stamps = T0 + np.round(run.t * 1e9).astype(np.int64)
    shape = (run.rho, run.alpha1, run.alpha2, run.rho * np.nan, run.rho * np.nan)
    truth = TrueStates(stamps, run.leader, run.follower, run.v1, run.u1, run.v2, run.u2, *shape)
    return truth, Span(T0, int(stamps[-1]))


@pytest.mark.parametrize("name", ["turtlebot3", "fig2-independent"])
def test_agrees_with_the_accurate_simulation_where_no_limit_is_met(name: str) -> None:
    scenario = load_scenario(name, ["controller.v_max=9.0", "controller.u_max=9.0"])
    run = noise_free_run(scenario, np.linspace(0.0, 8.0, 961))
    orbit = noise_free_orbit(scenario, *truth_and_span(run))
    assert orbit is not None
    rho, alpha1, alpha2 = orbit.at(truth_and_span(run)[0].capture_ns)
    assert np.max(np.abs(rho - run.rho)) < 2e-4 * run.rho.max()
    assert np.max(np.abs(np.sin(alpha1 - run.alpha1))) < 1e-3
    assert np.max(np.abs(np.sin(alpha2 - run.alpha2))) < 1e-3


def test_a_change_waits_for_the_leader_as_in_the_simulation() -> None:
    table = "t = [0.0, 4.0, 5.0], v = [0.5, 0.5, 0.5], u = [0.5, 0.5, 0.1]"
    scenario = load_scenario(
        "changing-sides",
        [
            *("formation.change_sides_at_s=[2.0]", "leader.k_u=0.6", "leader.k_v=0.8"),
            f'leader.program={{kind = "table", {table}}}',
        ],
    )
    run = noise_free_run(scenario, np.linspace(0.0, 15.0, 1501))
    behind = np.cos(run.alpha1) < -0.9
    assert run.t[behind][0] > 4.5
    assert math.sin(run.alpha1[-1]) > 0.9
    given = Order(T0 + 2_000_000_000, Side.LEFT)
    orbit = noise_free_orbit(scenario, *truth_and_span(run), [given])
    assert orbit is not None
    rho, alpha1, alpha2 = orbit.at(truth_and_span(run)[0].capture_ns)
    assert np.max(np.abs(rho - run.rho)) < 0.02 * scenario.formation.rho_0
    assert np.max(np.abs(np.sin(alpha1 - run.alpha1))) < 0.05
    assert np.max(np.abs(np.sin(alpha2 - run.alpha2))) < 0.05


def test_keeps_to_the_limits_of_the_controller() -> None:
    """The law is told of the limits, and so steers by the speed that they let through."""
    scenario = load_scenario("turtlebot3", ["controller.v_max=0.15", "controller.u_max=0.5"])
    law, with_gains, within = LAWS[scenario.controller.law], gains(scenario), limits(scenario)

    def limited(shape: Shape, v1: float, u1: float) -> Motion:
        return within.apply(law(shape, v1, u1, with_gains, within))[0]

    times = np.linspace(0.0, 6.0, 721)
    run = simulate_pair(*start_poses(scenario), leader_program(scenario), limited, times)
    assert np.mean(run.v2 == 0.15) > 0.2
    orbit = noise_free_orbit(scenario, *truth_and_span(run))
    assert orbit is not None
    rho, alpha1, alpha2 = orbit.at(truth_and_span(run)[0].capture_ns)
    assert np.max(np.abs(rho - run.rho)) < 2e-4
    assert np.max(np.abs(alpha1 - run.alpha1)) < 1e-3
    assert np.max(np.abs(alpha2 - run.alpha2)) < 1e-3


def test_nothing_to_go_by_gives_no_orbit() -> None:
    scenario = load_scenario("turtlebot3")
    truth, span = truth_and_span(noise_free_run(scenario, np.linspace(0.0, 1.0, 61)))
    unknown = replace(truth, v1=np.full(61, math.nan))
    assert noise_free_orbit(scenario, unknown, span) is None
    assert noise_free_orbit(scenario, truth, Span(0, 1)) is None


def test_a_leader_that_backs_up_has_an_orbit_and_one_that_turns_back_has_none() -> None:
    scenario = load_scenario("turtlebot3")
    run = noise_free_run(scenario, np.linspace(0.0, 6.0, 361))
    truth, span = truth_and_span(run)
    standing, v1, leader = np.arange(361) < 3, truth.v1.copy(), truth.leader.copy()
    v1[standing] = 0.0
    there = noise_free_orbit(scenario, replace(truth, v1=v1), span)
    # One that stands is told of by its heading, until it backs up.
    leader[standing, 2] += math.pi
    alpha1 = np.where(standing, truth.alpha1 - math.pi, truth.alpha1)
    back = noise_free_orbit(scenario, replace(truth, v1=v1, leader=leader, alpha1=alpha1), span)
    assert there is not None
    assert back is not None
    np.testing.assert_allclose(back.rho, there.rho, rtol=1e-12)
    np.testing.assert_allclose(wrap(back.alpha1 - there.alpha1), 0.0, atol=1e-12)
    leader = truth.leader.copy()
    leader[200:, 2] += math.pi
    assert noise_free_orbit(scenario, replace(truth, leader=leader), span) is None
