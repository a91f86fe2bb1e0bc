"""From a scenario's plain values to the objects of ``formation`` and ``controllers`` that they stand for.

A value that the schema lets through but that makes no sense (a table whose times run backwards, two robots in
one place) is answered here, with a :class:`~hil.errors.UsageError` that names the scenario.
"""

from __future__ import annotations

from controllers.chain import ChainTrajectory, simulate_chain
from controllers.feedforward import Foresight
from controllers.laws import LAWS, Gains
from controllers.limits import Limits
from controllers.side_change_run import run_with_changes
from estimation.motion import LeaderLimits, ProcessNoise
from formation.angles import FloatArray
from formation.closed_loop import FollowerLaw, Trajectory, simulate_pair
from formation.leader import Constant, Impulse, LeaderProgram, Sinusoid, Table
from formation.pose import Motion
from formation.shape import Shape
from formation.spacing import Spacing
from formation.station import Side, Station
from hil.errors import UsageError
from hil.scenario.schema import ConstantProgram, ImpulseProgram, Scenario, SinusoidProgram
from hil.scenario.start import start_poses, start_shape


def leader_program(scenario: Scenario) -> LeaderProgram:
    """Program that the leader drives."""
    given = scenario.leader.program
    try:
        if isinstance(given, ConstantProgram):
            return Constant(given.v, given.u)
        if isinstance(given, SinusoidProgram):
            return Sinusoid(given.v, given.u_mean, given.u_amplitude, given.omega)
        if isinstance(given, ImpulseProgram):
            return Impulse(given.v, given.u_amplitude, given.t_centre, given.t_width)
        return Table(given.t, given.v, given.u)
    except ValueError as error:
        raise UsageError(f"scenario {scenario.name}: leader.program: {error}; correct the table") from None


def gains(scenario: Scenario) -> Gains:
    """Gains of the follower's law, its spacing functions included."""
    given = scenario.controller
    spacing = Spacing(scenario.formation.rho_0, given.mu_rho)
    return Gains(given.mu1, given.mu2, spacing, station(scenario), given.tilt)


def station(scenario: Scenario) -> Station:
    """Where the follower is to be, seen from either robot."""
    return Station(Side(scenario.formation.side), scenario.formation.bearing)


def limits(scenario: Scenario) -> Limits:
    """Limits that the controller keeps to."""
    return Limits(scenario.controller.v_max, scenario.controller.u_max)


def foresight(scenario: Scenario) -> Foresight:
    """What is known of the leader's steering; its diffusion is that of the estimator's own model."""
    leader, given = scenario.leader, scenario.estimator
    limits = LeaderLimits(leader.v_eps, leader.k_v, leader.k_u)
    noise = ProcessNoise.by_rule(limits, given.turn_bandwidth, given.speed_bandwidth)
    return Foresight(leader.k_u, noise.q_u)


def follower_law(scenario: Scenario) -> FollowerLaw:
    """Law of the scenario with its gains and without limits, as the noise-free simulation takes it."""
    law, with_gains = LAWS[scenario.controller.law], gains(scenario)

    def follower(shape: Shape, v1: float, u1: float) -> Motion:
        return law(shape, v1, u1, with_gains)

    return follower


def noise_free_run(scenario: Scenario, times: FloatArray) -> Trajectory:
    """Trajectory of the pair without noise, delay and limits, at the given times [s] from its start.

    With changes of side it keeps to the limits, and commands are held between steps.

    Raises :class:`~formation.closed_loop.IntegrationError` if the motion breaks down.
    """
    program, changes = leader_program(scenario), scenario.formation.change_sides_at_s
    if not changes:
        return simulate_pair(*start_poses(scenario), program, follower_law(scenario), times)
    return run_with_changes(
        *start_poses(scenario),
        program,
        LAWS[scenario.controller.law],
        gains(scenario),
        limits(scenario),
        changes,
        times,
        knows_turn=scenario.controller.law != "independent",
    )


def chain_run(scenario: Scenario, agents: int, times: FloatArray) -> ChainTrajectory:
    """Trajectory of a chain of agents within the limits, at the given times [s] from its start.

    The first two start where leader and follower do, each further one in the same shape to its predecessor.
    Raises :class:`~formation.closed_loop.IntegrationError` if the motion breaks down.
    """
    leader, _ = start_poses(scenario)
    return simulate_chain(
        leader,
        [start_shape(scenario)] * (agents - 1),
        leader_program(scenario),
        gains(scenario),
        limits(scenario),
        times,
        knows_turn=scenario.controller.law != "independent",
    )
