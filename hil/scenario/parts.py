"""From a scenario's plain values to the objects of the pure packages that they stand for.

A value that the schema lets through but that makes no sense (a table whose times run backwards, two robots in
one place) is answered here, with a :class:`~hil.errors.UsageError` that names the scenario.
"""

from __future__ import annotations

from dataclasses import replace

from controllers.laws import Gains
from controllers.limits import Limits
from controllers.side_change import gentle
from controllers.station_keeper import StationKeeper
from estimation.tracking.turn_prediction import TurnPrediction
from formation.leader import Constant, Impulse, LeaderProgram, Sinusoid, Table
from formation.spacing import Spacing
from formation.station import Side, Station
from hil.errors import UsageError
from hil.scenario.brought import law_of
from hil.scenario.leader_model import finds_process_noise, process_noise
from hil.scenario.schema import ConstantProgram, ImpulseProgram, Scenario, SinusoidProgram


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


def law_gains(scenario: Scenario) -> Gains:
    """The same with the scenario's own law, if it has one.

    Raises :class:`UsageError` if that cannot be had.
    """
    return replace(gains(scenario), own=law_of(scenario))


def station(scenario: Scenario) -> Station:
    """Where the follower is to be, seen from either robot."""
    return Station(Side(scenario.formation.side), scenario.formation.bearing)


def limits(scenario: Scenario) -> Limits:
    """Limits that the controller keeps to."""
    return Limits(scenario.controller.v_max, scenario.controller.u_max)


def knows_turn(scenario: Scenario) -> bool:
    """Whether the scenario's law is told the leader's turn rate."""
    return scenario.controller.law != "independent"


def may_change_sides(scenario: Scenario) -> bool:
    """Whether the leader, at its fastest, turns gently enough for the follower to be led round it."""
    return gentle(scenario.leader.k_v, scenario.leader.k_u, gains(scenario))


def station_keeper(scenario: Scenario) -> StationKeeper:
    """The scenario's law at the follower's station, whichever side that comes to be on."""
    return StationKeeper(
        law_gains(scenario),
        limits(scenario),
        knows_turn=knows_turn(scenario),
        may_change=may_change_sides(scenario),
    )


def turn_prediction(scenario: Scenario) -> TurnPrediction:
    """What is known of the leader's steering; its diffusion is that of the estimator's own model."""
    found = finds_process_noise(scenario)
    return TurnPrediction.of(scenario.leader.k_u, process_noise(scenario).q_u, inferred=found)
