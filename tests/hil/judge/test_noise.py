from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from hil.judge.noise import certain, refuted, supported
from hil.judge.run_data import RunData
from hil.judge.summary import summarise
from hil.judge.summary_text import warnings_of

GUARANTEED = {"formation": {"rho_min": 0.15, "rho_max": 0.27, "assumes": ["|u1| <= k_u"]}}


@pytest.mark.parametrize("scale", [None, 0.2, 1.0, 1.3])
def test_what_the_noise_bears_out_stays_guaranteed(scale: float | None) -> None:
    certified = {"certified": 3, "failed": {"gap": 1}, "v1": {"median": 0.1}, "alpha1": {"median": 0.2}}
    assert supported(GUARANTEED, refuted(scale, {})) == GUARANTEED
    assert certain(certified, scale) == certified


def test_of_refuted_noise_nothing_is_called_guaranteed() -> None:
    found = supported(GUARANTEED, refuted(2.1, {}))
    assert found.keys() == GUARANTEED.keys()
    assert found["formation"].keys() == {"why", "assumes"}
    assert "2.1 times" in found["formation"]["why"]
    certified = {"certified": 3, "failed": {"gap": 1, "noise": 2}, "v1": {"median": 0.1}, "alpha1": {}}
    none = certain(certified, 2.1)
    assert none == {"certified": 0, "failed": {"gap": 1, "noise": 5}, "v1": {}, "alpha1": {}}
    assert certain({}, 2.1) == {}


def test_of_a_leader_beyond_its_limits_nothing_is_called_guaranteed(exact_run_data: RunData) -> None:
    told = {"estimator": {"leader_limits": "it drives at 0.5 m/s, expected up to leader.k_v = 0.1"}}
    assert refuted(None, {"estimator": {"cusp": "turned back"}}) is None
    summary = summarise(replace(exact_run_data, found=told))
    for claim in summary["certificate"].values():
        assert set(claim) == {"why", "assumes"}
        assert "beyond its limits: it drives at 0.5 m/s" in claim["why"]
    (finding,) = [each for each in summary["findings"] if each["name"] == "leader_limits"]
    assert "set the leader's limits" in finding["advice"]


def test_a_verdict_says_the_scale_and_withdraws_the_certificate(exact_run_data: RunData) -> None:
    def judged(scale: float | None) -> dict[str, Any]:
        return summarise(replace(exact_run_data, noise_scale=scale))

    assert "noise" not in judged(None)
    fine, noisy = judged(1.0), judged(4.0)
    assert (fine["noise"], noisy["noise"]) == ({"scale": 1.0}, {"scale": 4.0})
    assert "rho_min" in fine["certificate"]["formation"]
    for claim in noisy["certificate"].values():
        assert set(claim) == {"why", "assumes"}
    assert noisy["estimation"] == fine["estimation"]
    said = [line for line in warnings_of(noisy) if "4 times" in line]
    assert len(said) == 1
    assert not [line for line in warnings_of(fine) if "sigma_position" in line]
