"""An estimator of one's own fails in its own name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from estimation.filters.belief import Model
from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import Measurement
from hil.errors import CheckFailedError, UsageError
from hil.extensions.estimators import own_estimator
from hil.scenario.files import load_scenario
from hil.scenario.leader_model import leader_model

MODEL: Model = leader_model(load_scenario("turtlebot3"))
STILL = FollowerMotion(0.0, 0.0, 0.005, 0.03)
SEEN = Measurement.at(0, np.zeros(2), 1e-6 * np.eye(2), STILL)

FILE = """
from estimation.filters.kalman import ExtendedFilter

class Raising(ExtendedFilter):
    def predict(self, belief, dt, follower):
        return {}["nothing"]

class Odd(ExtendedFilter):
    def step(self, belief, dt, follower, measurement, gate):
        return None

class Endless(ExtendedFilter):
    def update(self, belief, measurement):
        return belief._replace(mean=belief.mean * float("nan"))

class Plain(ExtendedFilter):
    def start(self, measurement):
        return measurement

class Leaving(ExtendedFilter):
    def predict(self, belief, dt, follower):
        raise SystemExit("done")

class Short(ExtendedFilter):
    def update(self, belief, measurement):
        return belief._replace(mean=belief.mean[:4])

class Wordy(ExtendedFilter):
    def update(self, belief, measurement):
        return belief._replace(covariance="small")

class InPlace(ExtendedFilter):
    def predict(self, belief, dt, follower):
        belief.mean[0] += dt
        return belief

class Lists(ExtendedFilter):
    def start(self, measurement):
        self.kept = super().start(measurement)
        return self.kept._replace(mean=self.kept.mean.tolist())

def wrong(model):
    raise ValueError("no such model")

def number(model):
    return 3
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "estimators_to_test.py"
    path.write_text(FILE)
    return path


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("Raising", "predict raised KeyError: 'nothing'"),
        ("Leaving", "predict raised SystemExit: done"),
        ("Short", r"its mean has shape \(4,\), expected \(5,\)"),
        ("Wordy", "its covariance is 'small', expected numbers"),
        ("InPlace", "predict raised ValueError: assignment destination is read-only"),
        ("Endless", r"its belief is not finite: mean \[nan"),
    ],
)
def test_what_it_raises_and_what_is_no_belief_bear_its_name(file: Path, name: str, why: str) -> None:
    estimator = own_estimator(f"{file}:{name}", MODEL)
    belief = estimator.start(SEEN)
    with pytest.raises(CheckFailedError, match=f"estimator estimators_to_test.py:{name} failed: {why}"):
        estimator.update(estimator.predict(belief, 0.01, STILL), SEEN)


def test_a_belief_is_kept_as_it_was_given(file: Path) -> None:
    estimator = own_estimator(f"{file}:Lists", MODEL)
    belief = estimator.start(SEEN)
    inner = estimator._estimator  # type: ignore[attr-defined]
    was = belief.covariance.copy()
    inner.kept.covariance[0, 0] = 7.0
    assert np.array_equal(belief.covariance, was)
    assert isinstance(belief.mean, np.ndarray)


def test_a_step_that_is_none_bears_its_name(file: Path) -> None:
    estimator = own_estimator(f"{file}:Odd", MODEL)
    with pytest.raises(CheckFailedError, match="Odd failed: step gave None, expected a belief and a NIS"):
        estimator.step(estimator.start(SEEN), 0.01, STILL, SEEN, 9.0)


def test_what_is_no_belief_at_the_start_bears_its_name(file: Path) -> None:
    with pytest.raises(CheckFailedError, match="Plain failed: it gave Measurement, expected a Belief"):
        own_estimator(f"{file}:Plain", MODEL).start(SEEN)


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("wrong", "its factory failed .ValueError: no such model."),
        ("number", "its factory gave int, which lacks start, predict, update, step; derive it from"),
        ("none", "none is nothing there"),
    ],
)
def test_a_factory_that_makes_none_is_named(file: Path, name: str, why: str) -> None:
    with pytest.raises(UsageError, match=why):
        own_estimator(f"{file}:{name}", MODEL)
