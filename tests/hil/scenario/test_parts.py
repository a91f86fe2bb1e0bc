from __future__ import annotations

import math

import pytest

from controllers.laws import Gains
from controllers.limits import Limits
from formation.leader import Constant, Impulse, LeaderProgram, Sinusoid, Table
from formation.spacing import Spacing
from hil.errors import UsageError
from hil.scenario import parts as scenario_parts
from hil.scenario.files import load_scenario


def test_parts_of_the_robots_experiment_are_the_papers() -> None:
    scenario = load_scenario("turtlebot3")
    assert scenario_parts.gains(scenario) == Gains(1.5, 2.0, Spacing(0.2, 20.0))
    assert scenario_parts.limits(scenario) == Limits(0.22, 2.84)
    assert scenario_parts.leader_program(scenario) == Sinusoid(0.08, 0.2, 0.5, 0.5 * math.pi)


@pytest.mark.parametrize(
    ("text", "program"),
    [
        ('{kind = "constant", v = 0.1}', Constant(0.1, 0.0)),
        (
            '{kind = "impulse", v = 0.5, u_amplitude = 1.0, t_centre = 5.0, t_width = 1.0}',
            Impulse(0.5, 1.0, 5.0, 1.0),
        ),
        ('{kind = "table", t = [0.0, 1.0], v = [0.1, 0.2], u = [0, 1]}', Table([0, 1], [0.1, 0.2], [0, 1])),
    ],
)
def test_every_kind_of_program_is_built(text: str, program: LeaderProgram) -> None:
    scenario = load_scenario("turtlebot3", [f"leader.program={text}"])
    assert scenario_parts.leader_program(scenario) == program


def test_a_table_that_runs_backwards_is_named() -> None:
    table = '{kind = "table", t = [1.0, 0.5], v = [0.1, 0.1], u = [0.0, 0.0]}'
    scenario = load_scenario("turtlebot3", [f"leader.program={table}"])
    with pytest.raises(UsageError, match=r"turtlebot3: leader\.program: .*t\[1\] = 0\.5 after 1\.0"):
        scenario_parts.leader_program(scenario)
