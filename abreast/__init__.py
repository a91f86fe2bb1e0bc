"""Estimate a leader's motion, keep abreast of it, and judge how well that went: all of it from Python.

Arrays in and out, in SI units and radians. Nothing here looks at a clock or opens a socket unless it is asked
to, and nothing is loaded before it is used.
"""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING, Any

from abreast._hidden import refuse_hidden

if TYPE_CHECKING:
    from abreast._analyses import SweepResult, bounds, calibrate, gains, simulate, sweep
    from abreast._estimates import Estimates
    from abreast._estimation import estimate
    from abreast._lockstep import run_lockstep
    from abreast._logs import export, read_log, replay
    from abreast._runs import Run
    from abreast._scenarios import load_scenario, scenarios
    from controllers.own_law import Gains, Leader, Shape
    from estimation.bounds.certificate import Certificate
    from estimation.filters.estimator import Estimator
    from formation.pose import Motion
    from hil import __version__
    from hil.errors import CheckFailedError, UsageError
    from hil.exports.table_export import TableExport
    from hil.log.reader import Log
    from hil.replay.lab_calibration import Calibration
    from hil.scenario.schema import Scenario
    from hil.simulate.gain_proposal import GainProposal
    from hil.simulate.simulation import Simulation

__all__ = [
    "Calibration",
    "Certificate",
    "CheckFailedError",
    "Estimates",
    "Estimator",
    "GainProposal",
    "Gains",
    "Leader",
    "Log",
    "Motion",
    "Run",
    "Scenario",
    "Shape",
    "Simulation",
    "SweepResult",
    "TableExport",
    "UsageError",
    "__version__",
    "bounds",
    "calibrate",
    "estimate",
    "export",
    "gains",
    "load_scenario",
    "read_log",
    "replay",
    "run_lockstep",
    "scenarios",
    "simulate",
    "sweep",
]

_HOMES = {
    "Calibration": "hil.replay.lab_calibration",
    "Certificate": "estimation.bounds.certificate",
    "CheckFailedError": "hil.errors",
    "Estimates": "abreast._estimates",
    "Estimator": "estimation.filters.estimator",
    "GainProposal": "hil.simulate.gain_proposal",
    "Gains": "controllers.own_law",
    "Leader": "controllers.own_law",
    "Log": "hil.log.reader",
    "Motion": "formation.pose",
    "Run": "abreast._runs",
    "Scenario": "hil.scenario.schema",
    "Shape": "controllers.own_law",
    "Simulation": "hil.simulate.simulation",
    "SweepResult": "abreast._analyses",
    "TableExport": "hil.exports.table_export",
    "UsageError": "hil.errors",
    "__version__": "hil",
    "bounds": "abreast._analyses",
    "calibrate": "abreast._analyses",
    "estimate": "abreast._estimation",
    "export": "abreast._logs",
    "gains": "abreast._analyses",
    "load_scenario": "abreast._scenarios",
    "read_log": "abreast._logs",
    "replay": "abreast._logs",
    "run_lockstep": "abreast._lockstep",
    "scenarios": "abreast._scenarios",
    "simulate": "abreast._analyses",
    "sweep": "abreast._analyses",
}
"""Where each name is defined."""

_OF_COMMAND = ("-m", "abreast")
"""First argument while ``python -m`` looks for its module, and the console script's name: these tell what is
hidden by themselves, in one line."""

if sys.argv[:1] and sys.argv[0].rpartition("/")[2] not in _OF_COMMAND:
    refuse_hidden()


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    refuse_hidden()
    found = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
