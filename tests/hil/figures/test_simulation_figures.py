from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from formation.angles import wrap
from formation.closed_loop import Trajectory
from hil.figures.simulation_figures import (
    MOMENTS,
    draw_bearings,
    draw_experiment,
    draw_simulation,
    draw_speed,
    draw_tracks,
    draw_turn_rate,
)
from hil.scenario.files import load_scenario
from hil.scenario.noise_free_runs import noise_free_run
from hil.scenario.schema import Scenario


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario("turtlebot3")


@pytest.fixture(scope="module")
def trajectory(scenario: Scenario) -> Trajectory:
    return noise_free_run(scenario, np.linspace(0.0, 10.0, 201))


@pytest.fixture
def axes() -> Axes:
    figure = Figure()
    FigureCanvasAgg(figure)
    return figure.add_subplot()


def test_robots_fade_in_along_their_tracks(axes: Axes, trajectory: Trajectory) -> None:
    draw_tracks(axes, trajectory, 0.2)
    bodies = [patch for patch in axes.patches if isinstance(patch, Circle)]
    opacity = [float(body.get_alpha() or 0.0) for body in bodies]
    assert len(bodies) == 2 * MOMENTS
    assert opacity == sorted(opacity)
    assert opacity[0] < 0.5 < opacity[-1] == 1.0
    assert bodies[0].center == pytest.approx(trajectory.leader[0, :2])
    assert bodies[-1].center == pytest.approx(trajectory.follower[-1, :2])


def heights(axes: Axes) -> list[list[float]]:
    return [np.asarray(line.get_ydata(), dtype=float).tolist() for line in axes.lines]


def test_a_bearing_that_passes_pi_draws_no_line_across(
    axes: Axes, scenario: Scenario, trajectory: Trajectory
) -> None:
    turning = wrap(trajectory.t)
    assert float(np.min(np.diff(turning))) < -math.pi
    draw_bearings(axes, scenario, dataclasses.replace(trajectory, alpha1=turning))
    for line in heights(axes):
        steps = np.diff(line)
        assert not np.any(np.abs(steps[np.isfinite(steps)]) > math.pi)


def test_limits_show_where_they_matter(axes: Axes, scenario: Scenario, trajectory: Trajectory) -> None:
    draw_speed(axes, scenario, trajectory)
    assert [0.22, 0.22] in heights(axes)
    assert [-0.22, -0.22] not in heights(axes)
    draw_turn_rate(axes, scenario, trajectory)
    assert [math.degrees(-2.84)] * 2 in heights(axes)


@pytest.mark.slow
def test_pictures_repeat_to_the_byte(tmp_path: Path, scenario: Scenario, trajectory: Trajectory) -> None:
    for name in ("a", "b"):
        draw_simulation(scenario, trajectory, None, tmp_path / f"{name}.simulation.png")
        draw_experiment(scenario, trajectory, tmp_path / f"{name}.experiment.png")
    for kind in ("simulation", "experiment"):
        first, second = (tmp_path / f"{name}.{kind}.png" for name in ("a", "b"))
        assert first.read_bytes() == second.read_bytes()
        assert first.stat().st_size > 20_000
