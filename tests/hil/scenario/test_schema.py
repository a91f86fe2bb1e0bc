from __future__ import annotations

from typing import get_args

from estimation.estimators import ESTIMATORS
from hil.scenario.schema import OFFLINE_ESTIMATORS, EstimatorName


def test_a_scenario_can_ask_for_every_estimator_there_is_and_for_no_other() -> None:
    assert get_args(EstimatorName) == tuple(ESTIMATORS)
    assert not {*OFFLINE_ESTIMATORS} & ESTIMATORS.keys()
