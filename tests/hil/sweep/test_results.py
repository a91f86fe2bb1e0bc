from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pyarrow import parquet

from hil.errors import UsageError
from hil.judge.run_data import run_data_of_log
from hil.judge.summary import summarise
from hil.lockstep.run import run_lockstep
from hil.log.reader import read_log
from hil.sweep.kept_runs import keep_run, worst_runs
from hil.sweep.results import fly_sweep, write_results
from hil.sweep.spec import Sweep, run_seed
from hil.sweep.work import Piece, Store, pieces_of
from hil.sweep.workers import fly_here, fly_on_cluster

GRID = """
runs = 4
duration_s = 8.0
estimators = ["ekf", "ukf", "difference"]

[grid]
sigma_position = [0.0003, 0.002]
sigma_heading = [0.0035, 0.02]
latency_s = [0.03]
loss = [0.0, 0.1]
"""
ROUGH = """
runs = 1
duration_s = 5.0
estimators = ["ekf", "difference"]
set = ["controller.max_age_s=0.4"]

[grid]
sigma_position = [0.002]
sigma_heading = [0.0035]
latency_s = [0.05]
loss = [0.1]
"""
LONG = """
runs = 40
duration_s = 10.0

[grid]
sigma_position = [0.0003, 0.0005, 0.001, 0.002, 0.003, 0.005]
sigma_heading = [0.0035]
"""
HOLD = ("v1", "alpha1", "h", "v1_extended", "alpha1_extended", "h_extended")


def flown(sweep: Sweep, folder: Path, **options: Any) -> dict[str, Any]:
    result = fly_sweep(sweep, folder, progress=lambda done: None, **options)
    write_results(sweep, result, folder)
    return result


def test_a_cell_of_one_run_has_the_figures_of_its_lockstep_run(
    make_sweep: Callable[..., Sweep], tmp_path: Path
) -> None:
    sweep = make_sweep(ROUGH)
    for cell, found in zip(sweep.cells(), flown(sweep, tmp_path)["cells"], strict=True):
        log = tmp_path / f"{cell.index}.mcap"
        run_lockstep(sweep.scenario_of(cell, run_seed(sweep.spec.seed, 0)), log)
        wanted = summarise(run_data_of_log(read_log(log)))
        estimation, bounds = wanted["estimation"], wanted["bounds"]
        assert found["samples"] == estimation["samples"]
        for name in ("rmse", "coverage_3sigma", "efficiency", "nees"):
            assert found[name] == pytest.approx(estimation[name], rel=1e-6)
        assert found["nis_mean"] == pytest.approx(estimation["nis_mean"], rel=1e-9)
        assert found["bounds"]["violations"] == bounds["violations"]
        assert found["bounds"]["tightness"] == pytest.approx(bounds["tightness"], rel=1e-6)
        formation = wanted["formation"]
        assert found["formation"]["rho_max"] == pytest.approx(formation["rho_max"], rel=1e-9)
        assert found["formation"]["deviation"] == pytest.approx(formation["orbit_deviation_rms"], rel=1e-3)
        off_station = formation["equilibrium_deviation_rms"]
        assert found["formation"]["equilibrium_deviation"] == pytest.approx(off_station, rel=1e-3)


def test_every_sound_and_extended_bound_holds_over_a_grid_of_noise(
    make_sweep: Callable[..., Sweep], tmp_path: Path
) -> None:
    cells = flown(make_sweep(GRID), tmp_path)["cells"]
    assert len(cells) == 24
    for cell in cells:
        assert cell["samples"] + cell["untracked"] > 1700
        assert {name: cell["bounds"]["violations"][name] for name in HOLD} == dict.fromkeys(HOLD, 0)
        if cell["estimator"] != "difference":
            assert cell["diverged"] == 0
            assert cell["samples"] > 1700
            assert 1.7 < cell["nis_mean"] < 2.2
            assert min(cell["coverage_3sigma"].values()) > 0.99
            for low, high in cell.get("nees_limits", {}).values():
                assert low < 1.0 < high


def test_an_interrupted_sweep_goes_on_and_ends_the_same(
    make_sweep: Callable[..., Sweep], tmp_path: Path
) -> None:
    sweep = make_sweep()
    whole = flown(sweep, tmp_path / "whole")
    cut, pieces = tmp_path / "cut", list(pieces_of(sweep))
    store = Store(cut, sweep)
    for piece, tallies in fly_here(sweep, pieces[1:2], 1):
        store.save(piece, tallies)
    (cut / "parts" / pieces[0].name).write_bytes(b"half a file")
    again = flown(sweep, cut)
    assert again["cells"] == whole["cells"]
    assert again["run_seconds"] == (len(pieces) - 1) * 3 * 5.0
    assert json.loads((cut / "results.json").read_text())["cells"] == whole["cells"]
    table = parquet.read_table(cut / "results.parquet").to_pylist()
    assert [row["rmse.v1"] for row in table] == [cell["rmse"]["v1"] for cell in whole["cells"]]
    with pytest.raises(UsageError, match="another sweep"):
        flown(make_sweep(seed=5), cut)


def test_a_sweep_that_was_killed_while_it_marked_its_folder_goes_on(
    make_sweep: Callable[..., Sweep], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sweep = make_sweep()
    Store(tmp_path, sweep)

    def killed(path: Path, _text: str) -> int:
        path.open("w").close()
        raise KeyboardInterrupt

    for folder in (tmp_path, tmp_path / "new"):
        with monkeypatch.context() as patched, suppress(KeyboardInterrupt):
            patched.setattr(Path, "write_text", killed)
            Store(folder, sweep)
        Store(folder, sweep)
        with pytest.raises(UsageError, match="another sweep"):
            Store(folder, make_sweep(seed=5))


@pytest.mark.slow
def test_two_workers_give_the_bits_of_one(make_sweep: Callable[..., Sweep], tmp_path: Path) -> None:
    sweep = make_sweep()
    one, two = flown(sweep, tmp_path / "one"), flown(sweep, tmp_path / "two", workers=2)
    assert one["cells"] == two["cells"]


PATIENCE = 150.0


def scheduler_address(scheduler: subprocess.Popen[bytes], file: Path) -> str:
    """Where a scheduler listens; it writes its file in no hurry, so the file may be there half written."""
    give_up = time.monotonic() + PATIENCE
    while scheduler.poll() is None and time.monotonic() < give_up:
        with suppress(OSError, ValueError):
            return str(json.loads(file.read_text())["address"])
        time.sleep(0.05)
    raise AssertionError("the scheduler did not come up")


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Address of a Dask scheduler on this machine, and the processes of its two workers."""
    file = tmp_path / "scheduler.json"
    processes: list[subprocess.Popen[bytes]] = []

    def start(kind: str, *options: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", "--no-dashboard", *options]
        with (tmp_path / f"{kind}{len(processes)}.log").open("wb") as log:
            processes.append(subprocess.Popen(command, stdout=log, stderr=log, cwd=tmp_path))
        return processes[-1]

    try:
        here = ["--host", "127.0.0.1"]
        scheduler = start("scheduler", *here, "--port", "0", "--scheduler-file", str(file))
        address = scheduler_address(scheduler, file)
        alone = ["--no-nanny", "--nthreads", "1", "--memory-limit", "0", "--local-directory", str(tmp_path)]
        yield address, [start("worker", address, *here, *alone) for _ in range(2)]
    finally:
        for process in reversed(processes):
            process.kill()
            process.wait()


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_loses_nothing(
    make_sweep: Callable[..., Sweep], cluster: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    address, workers = cluster
    sweep = make_sweep(LONG)
    pieces = list(pieces_of(sweep))
    found: dict[Piece, NDArray[np.void]] = {}
    for piece, tallies in fly_on_cluster(sweep, pieces, address):
        if not found:
            workers[0].kill()
        found[piece] = tallies
    for piece, tallies in fly_here(sweep, pieces, 1):
        np.testing.assert_array_equal(found[piece], tallies)
    assert len(found) == len(pieces)


def test_a_scheduler_that_is_not_there_is_a_usage_error(make_sweep: Callable[..., Sweep]) -> None:
    sweep = make_sweep()
    with pytest.raises(UsageError, match="not reachable"):
        list(fly_on_cluster(sweep, list(pieces_of(sweep)), "nonsense://127.0.0.1:1"))


def test_without_dask_the_error_says_what_to_install(
    make_sweep: Callable[..., Sweep], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    sweep = make_sweep()
    with pytest.raises(UsageError, match=r"abreast\[cluster\]"):
        list(fly_on_cluster(sweep, list(pieces_of(sweep)), "tcp://127.0.0.1:1"))


@pytest.mark.slow
def test_the_worst_run_is_kept_and_linked_from_the_report(
    make_sweep: Callable[..., Sweep], tmp_path: Path
) -> None:
    sweep, folder = make_sweep(), tmp_path / "out"
    result = flown(sweep, folder)
    (cell, run), *others = worst_runs(result)
    assert [result["cells"][number]["estimator"] for number, _ in ((cell, run), *others)] == [
        "ekf",
        "difference",
    ]
    tightness = result["cells"][cell]["bounds"]["tightness"]
    kept = keep_run(sweep, folder, cell, run)
    summary = json.loads((kept / "summary.json").read_text())
    nearest = {name: each for name, each in tightness.items() if name.endswith("_extended")}
    name = max(nearest, key=lambda each: nearest[each])
    assert summary["bounds"]["tightness"][name] == pytest.approx(tightness[name], rel=1e-6)
    write_results(sweep, result, folder)
    assert f"{kept.name}/report.html" in (folder / "report.html").read_text()
    assert json.loads((folder / "results.json").read_text())["cells"][cell]["kept"] == {str(run): kept.name}
