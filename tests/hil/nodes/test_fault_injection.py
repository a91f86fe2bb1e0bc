"""The benchmark of faults in small: what no fault may do to an estimate that calls itself good."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import pytest

from hil.nodes.estimator import EstimatorNode
from hil.scenario.files import load_scenario

FOLDER = Path(__file__).resolve().parents[3] / "benchmarks"


def _load() -> Any:
    spec = importlib.util.spec_from_file_location("fault_injection", FOLDER / "faults.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # where dataclasses look for their module
    spec.loader.exec_module(module)
    return module


BENCHMARK = _load()
# The emulated wheels do not slip. Where they may, a track takes up to a second longer to be sure again.
SURE_WHEELS = ["estimator.slip_v2=0.0", "estimator.slip_u2=0.0"]
NODES = {
    front_end: EstimatorNode(load_scenario("turtlebot3", [f"estimator.front_end={front_end}", *SURE_WHEELS]))
    for front_end in ("world", "body")
}


@pytest.mark.slow
@pytest.mark.parametrize(("front_end", "count"), [("world", 12), ("body", 3)])
@pytest.mark.parametrize("fault", list(BENCHMARK.FAULTS))
def test_no_wrong_estimate_is_marked_as_good_and_none_is_locked_out(
    fault: str, front_end: str, count: int
) -> None:
    score = BENCHMARK.injected(fault, count, 2, NODES[front_end], settling=0.4, after=0.6)
    assert score.tracking > 30 * count
    assert score.beyond_sigma == 0
    assert score.beyond_bound == 0
    assert max(score.back) <= 0.5
