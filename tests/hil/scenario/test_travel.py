"""A leader that drives backwards is one that faces the other way, and one that turns back is refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from formation.angles import wrap
from formation.shape import shape_of
from hil.errors import UsageError
from hil.scenario.files import load_scenario
from hil.scenario.parts import leader_program
from hil.scenario.schema import Scenario
from hil.scenario.start import start_poses
from hil.scenario.travel import as_travelled
from hil.simulate.pair_simulation import simulate

BACKWARDS = 'leader.program={kind="table", t=[0.0, 2.0, 9.0], v=[-0.05, -0.08, -0.07], u=[0.3, -0.2, 0.4]}'
FORWARDS = BACKWARDS.replace("-0.05, -0.08, -0.07", "0.05, 0.08, 0.07")
TURNING_BACK = 'leader.program={kind="table", t=[0, 3, 4, 5], v=[0.05, 0.08, 0, -0.07], u=[0, 0, 0, 0]}'


def pair(program: str, *, turned: bool) -> Scenario:
    scenario = load_scenario("turtlebot3", [program, "run.duration_s=8.0"])
    x, y, theta = scenario.leader.pose
    return load_scenario(
        "turtlebot3",
        [program, "run.duration_s=8.0", f"leader.pose=[{x}, {y}, {theta + turned * math.pi}]"],
    )


def test_a_leader_that_backs_up_moves_as_one_that_faces_the_other_way() -> None:
    backwards = pair(BACKWARDS, turned=True)
    assert as_travelled(pair(FORWARDS, turned=False)) == pair(FORWARDS, turned=False)
    travelled = as_travelled(backwards)
    assert travelled.leader.pose[2] == pytest.approx(pair(FORWARDS, turned=False).leader.pose[2])
    for t in np.linspace(0.0, 9.0, 19).tolist():
        back, ahead = leader_program(backwards)(t), leader_program(travelled)(t)
        assert (ahead.v, ahead.u) == (-back.v, back.u)
    seen = shape_of(*start_poses(travelled)).alpha1
    assert abs(wrap(seen - shape_of(*start_poses(backwards)).alpha1)) == pytest.approx(math.pi)


def test_the_noise_free_pair_is_the_same_either_way() -> None:
    there, back = (
        simulate(pair(program, turned=turned), None)
        for program, turned in ((FORWARDS, False), (BACKWARDS, True))
    )
    for name in ("rho", "alpha1", "v"):
        forwards, backwards = (np.asarray(getattr(run, name)) for run in (there, back))
        np.testing.assert_allclose(wrap(backwards - forwards), 0.0, atol=1e-9)
    assert np.all(np.asarray(back.v)[:, 0] > 0.0)


def test_a_leader_that_turns_back_is_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="turns back after t = 3 s, expected one sign") as refused:
        simulate(load_scenario("turtlebot3", [TURNING_BACK]), tmp_path)
    assert "\n" not in str(refused.value)
    assert not list(tmp_path.iterdir())
