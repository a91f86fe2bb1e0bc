from __future__ import annotations

import json

import pytest

from hil.live.certificate_process import CertificateProcess
from hil.log.metadata import CERTIFICATE
from hil.log.report_json import known
from hil.scenario.certificate import certificate_json, certificate_of
from hil.scenario.files import load_scenario
from tests.hil.live.child_run import PATIENCE


@pytest.mark.slow
def test_the_certificate_comes_once_and_is_the_scenario_s_own() -> None:
    scenario = load_scenario("turtlebot3", ["leader.k_u=0.6"])
    process = CertificateProcess(scenario, niceness=0)
    try:
        found = process.result(timeout=PATIENCE)
        assert json.loads(found[CERTIFICATE]["json"]) == known(certificate_json(certificate_of(scenario)))
        assert process.result() == {}
    finally:
        process.close()


def test_whoever_cannot_wait_goes_without() -> None:
    process = CertificateProcess(load_scenario("turtlebot3"))
    assert process.result() == {}
    process.close()
    assert process.result(timeout=1.0) == {}
