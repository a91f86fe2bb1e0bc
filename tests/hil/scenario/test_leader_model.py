from __future__ import annotations

import pytest

from hil.errors import UsageError
from hil.replay.smoothing import ListeningEstimator
from hil.scenario.files import load_scenario
from hil.scenario.leader_model import leader_filter

BODY = ("estimator.front_end=body", "estimator.bias_states=true")


@pytest.mark.parametrize(
    ("settings", "kind"),
    [
        (("estimator.kind=ukf", *BODY), "'ukf' on the body"),
        (("estimator.bias_states=true",), "'ekf' on the world"),
    ],
)
def test_filters_without_states_for_offsets_are_refused(settings: tuple[str, ...], kind: str) -> None:
    with pytest.raises(UsageError, match=f"estimator.bias_states: kind {kind} front end has none"):
        leader_filter(load_scenario("turtlebot3", settings))


def test_the_smoother_has_no_such_states() -> None:
    scenario = load_scenario("turtlebot3", ("estimator.kind=smoother", *BODY))
    with pytest.raises(UsageError, match="kind 'smoother' on the body front end has none"):
        ListeningEstimator(scenario)
