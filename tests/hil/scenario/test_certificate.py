from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from hil.command_line import main
from hil.log.metadata import certificate_metadata, recorded_certificate
from hil.log.reader import read_log
from hil.log.report_json import known
from hil.log.writer import LogWriter
from hil.scenario.certificate import assumptions_of, certificate_json, certificate_lines, certificate_of
from hil.scenario.files import load_scenario, scenario_names

CONTRACT = {
    "rates": {"M_rho", "M_alpha2"},
    "estimates": {"M_v1", "M_alpha1"},
    "h": {"paper", "sound"},
    "alpha2_ultimate": {"value"},
    "formation": {"rho_min", "rho_max", "alpha1_min", "alpha1_max"},
    "k_u_star": {"lower", "upper"},
}


def printed(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[str, str]:
    with pytest.raises(SystemExit) as ended:
        main(["bounds", *arguments])
    assert ended.value.code == 0
    captured = capsys.readouterr()
    return captured.out, captured.err


def test_json_has_the_keys_of_the_contract_and_what_each_rests_on(capsys: pytest.CaptureFixture[str]) -> None:
    out, err = printed(capsys, "turtlebot3", "--json")
    found = json.loads(out)
    assert not err
    for name, keys in CONTRACT.items():
        assert keys <= set(found[name]), name
        assert all(isinstance(assumption, str) for assumption in found[name]["assumes"])
    assert found["formation"]["rho_min"] == pytest.approx(0.157, abs=1e-3)
    assert found["formation"]["rho_max"] == pytest.approx(0.267, abs=1e-3)


def test_people_read_what_is_guaranteed_and_what_is_not(capsys: pytest.CaptureFixture[str]) -> None:
    out, err = printed(capsys, "turtlebot3", "--set", "leader.k_u=1.7")
    text = " ".join(out.split())
    assert not err
    assert "nothing is guaranteed: a constant turn of 1.7 rad/s" in text
    assert "assuming [1] noise: positions within 5 sigma = 1.5 mm (motion capture)" in text


@pytest.mark.parametrize("name", scenario_names())
def test_every_shipped_pair_has_a_certificate_that_travels_in_metadata(name: str, tmp_path: Path) -> None:
    certificate = certificate_json(certificate_of(load_scenario(name)))
    assert set(CONTRACT) <= set(certificate)
    with LogWriter(tmp_path / "with.mcap", certificate_metadata(certificate)) as log:
        log.flush()
    with LogWriter(tmp_path / "without.mcap", {}) as log:
        log.flush()
    assert recorded_certificate(read_log(tmp_path / "with.mcap")) == known(certificate)
    assert recorded_certificate(read_log(tmp_path / "without.mcap")) is None


def test_assumptions_come_from_what_the_lab_knows() -> None:
    noisy = load_scenario("turtlebot3", ["mocap.sigma_position=0.001"])
    assert assumptions_of(noisy).eps == pytest.approx(0.005)
    lidar = load_scenario("turtlebot3", ["estimator.front_end=body", "estimator.sigma_bearing=0.1"])
    assert assumptions_of(lidar).eps == pytest.approx(5.0 * 0.1 * 0.2)
    recorded = assumptions_of(load_scenario("turtlebot3"), driven=False)
    assert (recorded.speeds.lowest, recorded.speeds.highest) == (0.04, 0.1)
    standing = load_scenario("turtlebot3", ["leader.program={kind='constant', v=0.0}"])
    assert assumptions_of(standing).speeds == recorded.speeds


def test_the_left_mirrors_the_right_and_other_formations_are_not_certified() -> None:
    right = certificate_of(load_scenario("turtlebot3")).formation.figures
    left = certificate_of(load_scenario("turtlebot3", ("formation.side=left",))).formation.figures
    assert (left["rho_min"], left["rho_max"]) == (right["rho_min"], right["rho_max"])
    assert (left["alpha1_min"], left["alpha1_max"]) == (-right["alpha1_max"], -right["alpha1_min"])
    for other in ("formation.bearing=1.2", "controller.tilt=0.5"):
        certificate = certificate_of(load_scenario("turtlebot3", (other,)))
        for claim in (certificate.formation, certificate.formation_with_errors, certificate.k_u_star):
            assert not claim.figures
            assert other.split("=")[0] in (claim.why or "")


def test_what_is_printed_is_rounded_to_the_safe_side() -> None:
    """A lower bound down, an upper one up, and neither by more than its last digit."""
    certificate = certificate_of(load_scenario("turtlebot3"))
    lines = {name.strip(): text for name, text, _ in certificate_lines(certificate)}
    told = {
        "formation": ("rho_min", "rho_max", "alpha1_min", "alpha1_max"),
        "with wrong estimates": ("rho_min", "rho_max", "alpha1_min", "alpha1_max"),
        "k_u* of Prop. 3": ("lower", "upper"),
    }
    claims = (certificate.formation, certificate.formation_with_errors, certificate.k_u_star)
    for (name, figures), claim in zip(told.items(), claims, strict=True):
        printed_ = [float(number) for number in re.findall(r"-?\d+\.\d{4}", lines[name])]
        for number, figure in zip(printed_, figures, strict=True):
            outwards = number - claim.figures[figure]
            if figure in ("rho_min", "alpha1_min", "lower"):
                outwards = -outwards
            assert 0.0 <= outwards < 1e-4, (name, figure)


def test_what_the_filter_that_flies_may_err_is_told_where_it_is_known() -> None:
    found = certificate_of(load_scenario("turtlebot3")).estimates
    assert found.figures["M_v1"] < found.figures["M_v1_filter"] < 0.06
    for other in ("estimator.kind=ukf", "estimator.front_end=body"):
        assert "M_v1_filter" not in certificate_of(load_scenario("turtlebot3", (other,))).estimates.figures
