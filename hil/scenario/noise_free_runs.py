"""What a scenario does without noise: its pair or its chain, integrated.

Apart from ``hil.scenario.parts``, as no daemon needs the integrators behind it.
"""

from __future__ import annotations

import math

from controllers.chain import ChainTrajectory, simulate_chain
from controllers.laws import LAWS, ideal
from controllers.own_law import OwnLaw
from controllers.side_change_run import run_with_changes
from formation.angles import FloatArray
from formation.closed_loop import FollowerLaw, IntegrationError, Trajectory, simulate_pair
from formation.pose import Motion
from formation.shape import Shape
from hil.scenario.ordered_sides import ordered_sides
from hil.scenario.parts import knows_turn, law_gains, leader_program, limits, station_keeper
from hil.scenario.schema import Scenario
from hil.scenario.start import start_poses, start_shape


def follower_law(scenario: Scenario) -> FollowerLaw:
    """Law of the scenario with its gains and without limits, as the noise-free simulation takes it."""
    law, with_gains = LAWS.get(scenario.controller.law, ideal), law_gains(scenario)

    def follower(shape: Shape, v1: float, u1: float) -> Motion:
        motion, own = law(shape, v1, u1, with_gains), with_gains.own
        if own is not None and not math.isfinite(motion.v + motion.u):
            raise _by_law(own, None)
        return motion

    return follower


def _by_law(own: OwnLaw | None, error: IntegrationError | None) -> IntegrationError:
    """Error that names a law of one's own, if it is at fault."""
    if own is not None and (failure := own.failure()):
        return IntegrationError(f"law {own.name} failed: {failure}")
    return error or IntegrationError("the motion is not finite")


def noise_free_run(scenario: Scenario, times: FloatArray) -> Trajectory:
    """Trajectory of the pair without noise, delay and limits, at the given times [s] from its start.

    With orders to change sides it is the daemon's :class:`~controllers.station_keeper.StationKeeper` that
    drives, so orders are taken or refused, and changes wait, as in a run with robots; it keeps to the limits,
    and commands are held between steps.

    Raises :class:`~formation.closed_loop.IntegrationError` if the motion breaks down.
    """
    program, orders = leader_program(scenario), ordered_sides(scenario)
    if not orders:
        return simulate_pair(*start_poses(scenario), program, follower_law(scenario), times)
    return run_with_changes(*start_poses(scenario), program, station_keeper(scenario), orders, times)


def chain_run(scenario: Scenario, agents: int, times: FloatArray) -> ChainTrajectory:
    """Trajectory of a chain of agents within the limits, at the given times [s] from its start.

    The first two start where leader and follower do, each further one in the same shape to its predecessor.
    Raises :class:`~formation.closed_loop.IntegrationError` if the motion breaks down.
    """
    leader, _ = start_poses(scenario)
    with_gains = law_gains(scenario)
    try:
        return simulate_chain(
            leader,
            [start_shape(scenario)] * (agents - 1),
            leader_program(scenario),
            with_gains,
            limits(scenario),
            times,
            knows_turn=knows_turn(scenario),
        )
    except IntegrationError as error:
        raise _by_law(with_gains.own, error) from error
