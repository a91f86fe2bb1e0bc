from __future__ import annotations

import pytest

from estimation.consistency.noise_estimate import NOISE_AS_TOLD, NOISE_GIVEN, NoiseEstimate, NoiseLearning
from estimation.models.measurement import PoseNoise
from hil.nodes.noise_report import is_refuted, noise_findings, noise_report, scale_in, scale_of

LEARNING = NoiseLearning(True, PoseNoise(3e-4, 3.5e-3), 0.04)


def found(position: float, heading: float = 1.0) -> NoiseEstimate:
    return NOISE_AS_TOLD._replace(scale=NOISE_AS_TOLD.scale._replace(position=position, heading=heading))


def test_given_noise_is_not_reported() -> None:
    assert noise_report(found(5.0), NOISE_GIVEN) == {}
    assert noise_findings(found(5.0), NOISE_GIVEN) == {}
    assert scale_of(found(5.0), NOISE_GIVEN) is None


@pytest.mark.parametrize("scale", [0.1234567, 1.0, 7.7777])
def test_a_report_says_the_scale_as_the_judge_reads_it(scale: float) -> None:
    report = noise_report(found(scale), LEARNING)
    assert scale_in({key: str(value) for key, value in report.items()}) == scale_of(found(scale), LEARNING)
    assert float(str(report["noise.sigma_position"])) == pytest.approx(scale * 3e-4, rel=0.01)


def test_a_scale_that_is_none_is_not_taken_for_one() -> None:
    assert scale_in({}) is None
    assert scale_in({"noise.scale": "much"}) is None


def test_the_finding_names_what_exceeds_and_what_was_expected() -> None:
    assert noise_findings(found(1.3, 1.3), LEARNING) == {}
    (place,) = noise_findings(found(3.0), LEARNING).values()
    assert "0.9 mm" in place
    assert "expected 0.3 by estimator.sigma_position" in place
    assert "heading" not in place
    (both,) = noise_findings(found(3.0, 2.0), LEARNING).values()
    assert "7 mrad, expected 3.5 by estimator.sigma_heading" in both


@pytest.mark.parametrize(("scale", "refuted"), [(None, False), (1.3, False), (1.301, True)])
def test_from_where_on_it_is_refuted(scale: float | None, refuted: bool) -> None:
    assert is_refuted(scale) == refuted
