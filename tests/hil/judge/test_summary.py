from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from estimation.tracking.tracker import Status
from hil.judge.run_data import RunData, run_data_of_log
from hil.judge.summary import percentile, summarise
from hil.log.metadata import recorded_certificate
from hil.log.reader import Log
from hil.log.report_json import as_json
from hil.scenario.schema import FormationSection
from hil.wire.messages import to_ns, to_time

QUANTITIES = {"rho_dot", "alpha2_dot", "v1", "alpha1", "u1"}
BOUNDS = {
    "v1",
    "alpha1",
    "h",
    "v1_extended",
    "alpha1_extended",
    "h_extended",
    "paper_alpha1",
    "paper_h",
}
NAN = math.nan


@pytest.fixture(scope="module")
def judged(short_log: Log) -> dict[str, Any]:
    return summarise(run_data_of_log(short_log))


def without_truth(run_data: RunData) -> RunData:
    """As another lab's recording: nobody knows the truth, nothing drove the robots."""
    return replace(
        run_data, certificate=None, truth=[], commands=[], motion_since_ns=None, frames=None, refused={}
    )


def test_a_run_has_all_the_keys_of_the_contract(judged: dict[str, Any]) -> None:
    parts = {key: set(value) for key, value in judged.items() if isinstance(value, dict)}
    parts.pop("rejected", None)  # absent where all was well
    assert parts == {
        "frames": {"published", "received", "used", "lost", "late", "rejected"},
        "estimation": {
            *("evaluated_from_s", "samples", "untracked", "settle_s", "nis_mean"),
            *("rmse", "max", "max_at_s", "efficiency", "coverage_3sigma", "nees", "nees_limits"),
        },
        "bounds": {
            *("M_rho", "M_alpha2", "v_eps", "checked", "violations", "tightness"),
            *("input_errors_hold", "assumed", "published", "largest_errors_seen"),
        },
        "certificate": parts["certificate"],
        "formation": {
            *("rho_final", "alpha1_final", "alpha2_final", "rho_min", "rho_max"),
            *("equilibrium_deviation_rms", "orbit_deviation_rms"),
        },
        "latency_ms": {"capture_to_command"},
        "clock": {"offset_ms", "jitter_ms", "jumps"},
        "commands": {"sent", "saturated", "stopped"},
        "log": {"path", "messages", "bytes"},
        "noise": {"scale"},
        "cycles": {"count", "late", "limit_ms", "longest_ms"},
    }
    assert set(judged) - set(parts) - {"rejected"} == {
        "scenario",
        "seed",
        "mode",
        "estimator",
        "law",
        "duration_s",
        "findings",
        "spells",
    }
    for name in ("rmse", "max", "efficiency", "coverage_3sigma", "nees", "nees_limits"):
        assert set(judged["estimation"][name]) == QUANTITIES
    assert set(judged["bounds"]["violations"]) == BOUNDS
    assert set(judged["formation"]["orbit_deviation_rms"]) == {"rho", "alpha1"}
    assert set(judged["formation"]["equilibrium_deviation_rms"]) == {"rho", "alpha1"}
    assert set(judged["latency_ms"]["capture_to_command"]) == {"p50", "p99", "max"}
    assert set(judged["clock"]["jitter_ms"]) == {"p50", "p99", "max"}
    assert as_json(judged)


def test_a_short_run_is_as_good_as_it_should_be(judged: dict[str, Any]) -> None:
    estimation, bounds = judged["estimation"], judged["bounds"]
    assert judged["duration_s"] == pytest.approx(6.0)
    assert estimation["evaluated_from_s"] == pytest.approx(3.0)
    assert 320 < estimation["samples"] <= 361
    assert estimation["settle_s"] < 0.5
    assert 1.5 < estimation["nis_mean"] < 2.3
    assert 0.0005 < estimation["rmse"]["v1"] < 0.004
    assert 0.005 < estimation["rmse"]["alpha1"] < math.radians(3.0)
    # The leader drives evenly, which is found out: its speed is known far better than a random leader's.
    assert all(0.1 < share < 1.3 for share in estimation["efficiency"].values())
    assert all(share > 0.98 for share in estimation["coverage_3sigma"].values())
    assert bounds["checked"] == estimation["samples"]
    assert [bounds["violations"][name] for name in BOUNDS if name.endswith("_extended")] == [0, 0, 0]
    assert bounds["M_rho"] == estimation["max"]["rho_dot"]
    assert bounds["M_alpha2"] == estimation["max"]["alpha2_dot"]
    assert judged["formation"]["orbit_deviation_rms"]["rho"] < 0.03
    assert judged["latency_ms"]["capture_to_command"]["p50"] == pytest.approx(30.0, abs=0.1)
    frames = judged["frames"]
    assert frames["published"] - frames["received"] == frames["lost"] > 0


def test_exact_estimates_have_no_error(exact_run_data: RunData) -> None:
    summary = summarise(exact_run_data)
    assert all(value < 1e-9 for value in summary["estimation"]["rmse"].values())
    assert set(summary["estimation"]["coverage_3sigma"].values()) == {1.0}
    assert summary["estimation"]["settle_s"] == 0.0
    assert summary["estimation"]["nis_mean"] == 2.0
    assert set(summary["bounds"]["violations"].values()) == {0}
    assert summary["formation"]["rho_final"] == pytest.approx(0.2)
    assert summary["formation"]["alpha1_final"] == pytest.approx(-0.5 * math.pi)
    assert summary["formation"]["equilibrium_deviation_rms"] == pytest.approx({"rho": 0.0, "alpha1": 0.0})


def test_the_equilibrium_is_that_of_the_station(exact_run_data: RunData) -> None:
    given = exact_run_data.scenario
    elsewhere = structs.replace(given, formation=FormationSection(rho_0=0.17, bearing=1.2))
    found = summarise(replace(exact_run_data, scenario=elsewhere))["formation"]
    off = {"rho": 0.03, "alpha1": 0.5 * math.pi - 1.2}
    assert found["equilibrium_deviation_rms"] == pytest.approx(off)


def test_latency_is_from_capture_to_the_first_command_on_it(exact_run_data: RunData) -> None:
    commands = [
        replace(each, capture=to_time(to_ns(each.header.stamp) - 1_000_000 * number), fresh=number % 2 == 1)
        for number, each in enumerate(exact_run_data.commands)
    ]
    waits = np.arange(1.0, 239.0, 2.0)  # the last command comes after the end of the run
    found = summarise(replace(exact_run_data, commands=commands))["latency_ms"]["capture_to_command"]
    assert found["p50"] == pytest.approx(np.percentile(waits, 50))
    assert found["p99"] == pytest.approx(np.percentile(waits, 99))
    assert found["max"] == 237.0


def test_a_capture_estimated_anew_for_a_late_frame_is_no_longer_on_its_way(exact_run_data: RunData) -> None:
    """The second of two commands on one capture came of a frame from before it: the first had its way."""
    begun_ns = to_ns(exact_run_data.commands[0].header.stamp)
    commands = [
        replace(each, capture=to_time(begun_ns + 20_000_000 * (number // 2) - 5_000_000), fresh=True,
                header=replace(each.header, stamp=to_time(begun_ns + 10_000_000 * number)))
        for number, each in enumerate(exact_run_data.commands[:100])
    ]  # fmt: skip
    found = summarise(replace(exact_run_data, commands=commands))["latency_ms"]["capture_to_command"]
    assert found == pytest.approx({"p50": 5.0, "p99": 5.0, "max": 5.0})


def test_commands_after_the_stop_do_not_count(exact_run_data: RunData) -> None:
    middle = to_ns(exact_run_data.commands[100].header.stamp)
    commands = [
        replace(each, saturated=number < 30, stop="stale" if 10 <= number < 15 else "")
        for number, each in enumerate(exact_run_data.commands)
    ]
    found = summarise(replace(exact_run_data, commands=commands, stopped_ns=middle))
    assert found["commands"] == {"sent": 100, "saturated": 30, "stopped": 5}


@pytest.mark.parametrize(
    ("waits", "stops", "counted"),
    [
        (range(40), (), 0),
        (range(40), range(60, 65), 5),
        (range(1000), (), 100),
    ],
)
def test_a_robot_stands_still_only_once_it_was_driven_or_if_it_never_was(
    exact_run_data: RunData, waits: Sequence[int], stops: Sequence[int], counted: int
) -> None:
    middle = to_ns(exact_run_data.commands[100].header.stamp)
    commands = [
        replace(each, stop="no estimate" if number in waits else "stale" if number in stops else "")
        for number, each in enumerate(exact_run_data.commands)
    ]
    found = summarise(replace(exact_run_data, commands=commands, stopped_ns=middle))
    assert found["commands"]["stopped"] == counted


def test_frames_add_up(exact_run_data: RunData) -> None:
    assert exact_run_data.frames is not None
    frames = replace(exact_run_data.frames, published=250)
    refused = {"gated": 1, "not_finite": 3, "unknown_body": 241}
    found = summarise(replace(exact_run_data, frames=frames, refused=refused))
    assert found["rejected"] == refused
    assert found["frames"] == {
        "published": 250,
        "received": 241,
        "used": 240,
        "lost": 9,
        "late": 0,
        "rejected": 4,
    }


def test_what_nobody_knows_is_absent(exact_run_data: RunData) -> None:
    summary = summarise(without_truth(exact_run_data))
    assert set(summary) == {
        *("scenario", "mode", "estimator", "duration_s", "frames", "estimation", "bounds", "log"),
        *("certificate", "spells"),
    }
    assert set(summary["estimation"]) == {
        *("evaluated_from_s", "samples", "untracked", "settle_s", "nis_mean")
    }
    assert set(summary["bounds"]) == {"M_rho", "M_alpha2", "v_eps", "checked", "published"}
    assert set(summary["bounds"]["published"]) == {"median", "says_something"}
    assert summary["bounds"]["checked"] == 0
    assert set(summary["frames"]) == {"received", "used", "late", "rejected"}


def test_a_recording_that_knows_poses_only_is_judged_on_what_follows_from_them(
    exact_run_data: RunData,
) -> None:
    poses = [replace(each, v1=NAN, u1=NAN, v2=NAN, u2=NAN) for each in exact_run_data.truth]
    summary = summarise(replace(exact_run_data, truth=poses, motion_since_ns=None))
    assert set(summary["estimation"]["rmse"]) == {"alpha1"}
    assert "efficiency" not in summary["estimation"]
    assert summary["bounds"]["checked"] == 0
    assert "orbit_deviation_rms" not in summary["formation"]
    assert summary["formation"]["rho_max"] == pytest.approx(0.2)


def test_only_what_says_tracking_is_judged(exact_run_data: RunData) -> None:
    wild = [
        replace(each, status=int(Status.COASTING), v1=9.0) if 100 <= number < 110 else each
        for number, each in enumerate(exact_run_data.estimates)
    ]
    late = [replace(each, status=int(Status.INITIALISING)) for each in wild[:30]]
    found = summarise(replace(exact_run_data, estimates=late + wild[30:]))["estimation"]
    assert found["untracked"] == 10
    assert found["max"]["v1"] < 1e-9
    assert found["settle_s"] == pytest.approx(0.5, abs=1e-6)


def test_no_estimates_at_all_still_give_a_summary(exact_run_data: RunData) -> None:
    summary = summarise(replace(exact_run_data, estimates=[]))
    assert summary["estimation"] == {"evaluated_from_s": pytest.approx(1.0), "samples": 0, "untracked": 0}
    assert summary["bounds"]["checked"] == 0
    assert summarise(replace(without_truth(exact_run_data), estimates=[]))["duration_s"] == 0.0


def test_judging_needs_no_pictures() -> None:
    code = "import sys, hil.judge.summary; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_run_carries_its_certificate_as_its_log_does(judged: dict[str, Any], short_log: Log) -> None:
    assert judged["certificate"] == recorded_certificate(short_log)
    found = judged["certificate"]["formation"]
    assert found["rho_min"] < found["rho_max"]


def test_a_recorded_leader_is_certified_by_its_limits_alone(exact_run_data: RunData) -> None:
    found = summarise(without_truth(exact_run_data))["certificate"]
    assert "v1 anywhere between 0.04 and 0.1 m/s" in found["formation"]["assumes"]
    assert "constant speed" in found["k_u_star"]["why"]


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=40), st.sampled_from([0.0, 50.0, 99.0, 100.0]))
def test_percentiles_are_those_of_numpy_to_the_bit(values: list[float], q: float) -> None:
    assert percentile(np.array(values), q) == np.percentile(values, q)
