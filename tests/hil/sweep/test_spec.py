from __future__ import annotations

from collections.abc import Callable

import pytest

from hil.errors import UsageError
from hil.sweep.spec import Sweep, load_sweep, run_seed
from tests.hil.sweep.conftest import SMALL


def test_the_shipped_sweep_covers_what_a_lab_can_meet() -> None:
    sweep = load_sweep("default")
    grid, cells = sweep.spec.grid, sweep.cells()
    assert len(cells) >= 100
    assert sweep.spec.runs >= 100
    assert (min(grid.sigma_position), max(grid.sigma_position)) == (1e-4, 5e-3)
    assert max(grid.latency_s) == 0.2
    assert max(grid.loss) == 0.2
    assert {cell.estimator for cell in cells} == {"ekf", "ukf", "difference"}
    assert [cell.index for cell in cells] == list(range(len(cells)))


def test_the_estimator_of_a_cell_knows_its_noise(make_sweep: Callable[..., Sweep]) -> None:
    sweep = make_sweep()
    cell = sweep.cells()[-1]
    scenario = sweep.scenario_of(cell, seed=5)
    assert scenario.mocap.sigma_position == scenario.estimator.sigma_position == 0.002
    assert scenario.estimator.kind == "difference"
    assert (scenario.run.seed, scenario.run.duration_s) == (5, 5.0)


def test_seeds_of_runs_depend_on_sweep_and_number_only() -> None:
    seeds = {run_seed(seed, run) for seed in (0, 1, 2**62) for run in range(500)}
    assert len(seeds) == 1500
    assert max(seeds) <= 2**62
    assert run_seed(1, 7) == run_seed(1, 7)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (SMALL + "[grids]\n", "unknown key"),
        (SMALL.replace("loss = [0.1]", "loss = [1.5]"), "loss"),
        (SMALL.replace("[0.0003, 0.002]", "[]"), "sigma_position"),
        (SMALL.replace('"difference"', '"kalman"'), "kalman"),
        (SMALL.replace("max_age_s=0.4", "max_edge_s=0.4"), "max_age_s"),
        (SMALL.replace("controller.max_age_s=0.4", "mocap.clock_jump_s=0.2"), "clock_jump_s"),
        (SMALL.replace("controller.max_age_s=0.4", "estimator.align_odometry=true"), "align_odometry"),
        (SMALL.replace("duration_s = 5.0", "duration_s = 1e9"), "duration_s is 1000000000.0"),
    ],
)
def test_a_mistake_is_answered_by_one_line(make_sweep: Callable[..., Sweep], text: str, message: str) -> None:
    with pytest.raises(UsageError, match=message) as caught:
        make_sweep(text)
    assert "\n" not in str(caught.value)


def test_sweeps_differ_by_their_digests(
    make_sweep: Callable[..., Sweep], monkeypatch: pytest.MonkeyPatch
) -> None:
    digest = make_sweep().digest()
    assert digest == make_sweep().digest()
    assert digest != make_sweep(seed=9).digest()
    # Another version may calculate otherwise: its runs are not gone on with.
    monkeypatch.setattr("hil.sweep.spec.__version__", "0.0.9")
    assert digest != make_sweep().digest()


def test_overrides_are_those_of_all_cells() -> None:
    sweep = load_sweep("default", ["mocap.jitter_s=0.004"], runs=1)
    for cell in sweep.cells()[:3]:
        scenario = sweep.scenario_of(cell)
        assert scenario.mocap.jitter_s == 0.004
        assert scenario.run.duration_s == sweep.spec.duration_s
    with pytest.raises(UsageError, match=r"estimator\.certify is True, but a sweep takes false"):
        load_sweep("default", ["estimator.certify=true"])
