from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from hil.scenario.files import load_scenario
from hil.scenario.noise_free_runs import noise_free_run


def test_noise_free_run_starts_at_the_start_poses() -> None:
    run = noise_free_run(load_scenario("turtlebot3"), np.linspace(0.0, 1.0, 3))
    assert run.leader[0].tolist() == [0.287, 0.005, 1.553]
    assert run.follower[0].tolist() == pytest.approx([0.767, 0.685, -1.574], abs=1e-12)


def test_daemons_load_no_integrators() -> None:
    script = (
        "import sys, hil.emulator.node, hil.nodes.controller, hil.nodes.estimator\n"
        "heavy = {'scipy.integrate', 'controllers.chain', 'hil.scenario.noise_free_runs'}\n"
        "sys.exit(', '.join(heavy & set(sys.modules)) or 0)"
    )
    subprocess.run([sys.executable, "-c", script], check=True)
