from __future__ import annotations

from dataclasses import replace

import pytest

from hil.errors import UsageError
from hil.judge.certified import judge_certified
from hil.judge.evidence import evidence_of_log
from hil.log.reader import Log
from hil.scenario.files import with_overrides


def test_no_error_of_a_run_exceeds_its_certified_radius(short_log: Log) -> None:
    found = judge_certified(short_log, evidence_of_log(short_log))
    assert found["certified"] > 100
    assert found["contradicted"] == 0
    for name, worst in (("v1", 0.06), ("alpha1", 1.0)):
        assert found[name]["violations"] == 0
        assert 0.0 < found[name]["tightness"] <= 1.0
        assert found[name]["median"] <= found[name]["largest"] < worst


def test_an_estimate_that_is_far_off_has_a_radius_that_reaches_the_truth(short_log: Log) -> None:
    """The certificate holds whatever the filter does."""
    evidence = evidence_of_log(short_log)
    wild = [replace(each, v1=each.v1 + 0.5, alpha1=each.alpha1 + 1.0) for each in evidence.estimates]
    found = judge_certified(short_log, replace(evidence, estimates=wild))
    assert found["v1"]["violations"] == found["alpha1"]["violations"] == 0
    assert found["v1"]["tightness"] > 0.9
    assert found["v1"]["median"] > 0.45


def test_too_small_a_noise_bound_is_found_out(short_log: Log) -> None:
    evidence = evidence_of_log(short_log)
    tight = ["mocap.sigma_position=1e-5", "estimator.sigma_position=1e-5"]
    found = judge_certified(short_log, replace(evidence, scenario=with_overrides(evidence.scenario, tight)))
    assert found["contradicted"] > 100


def test_the_body_front_end_has_no_positions_to_certify_with(short_log: Log) -> None:
    evidence = evidence_of_log(short_log)
    body = with_overrides(evidence.scenario, ["estimator.front_end=body"])
    with pytest.raises(UsageError, match="front_end"):
        judge_certified(short_log, replace(evidence, scenario=body))
