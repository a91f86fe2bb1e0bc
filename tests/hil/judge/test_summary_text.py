from __future__ import annotations

import copy
import io
from dataclasses import replace
from typing import Any

import pytest
from rich.console import Console

from hil.judge.run_data import RunData
from hil.judge.summary import summarise
from hil.judge.summary_text import print_summary, warnings_of
from hil.scenario.files import with_overrides


@pytest.fixture
def summary(exact_run_data: RunData) -> dict[str, Any]:
    found = copy.deepcopy(summarise(exact_run_data))
    del found["rejected"]
    return found


def printed(summary: dict[str, Any]) -> str:
    text = io.StringIO()
    print_summary(summary, Console(file=text, width=80))
    return text.getvalue()


def test_a_good_run_is_told_without_warnings(summary: dict[str, Any]) -> None:
    assert warnings_of(summary) == []
    text = printed(summary)
    assert "turtlebot3, lockstep, 4.0 s (ekf, independent law, seed 1)" in text
    told = " ".join(text.split())
    assert "v1 within 50.0 mm/s, alpha1 within 29 deg (medians), violated nowhere in 180 samples" in told
    assert "by the largest errors seen: extended ones violated nowhere in 180 samples" in told
    assert "capture to command 30.0 ms" in text
    assert "!" not in text


CERTIFIED: dict[str, Any] = {
    "certified": 170,
    "v1": {"median": 0.0194, "largest": 0.02, "violations": 0, "tightness": 0.2},
    "alpha1": {"median": 0.29, "largest": 0.4, "violations": 0, "tightness": 0.25},
}


def test_orders_that_are_refused_are_told(exact_run_data: RunData) -> None:
    ordered = with_overrides(exact_run_data.scenario, ["formation.change_sides_at_s=[1.0]"])
    summary = summarise(replace(exact_run_data, scenario=ordered))
    assert [warning for warning in warnings_of(summary) if "unsafe_side_change" in warning]


def test_certified_radii_are_told(summary: dict[str, Any]) -> None:
    said = " ".join(printed(summary | {"certified": CERTIFIED}).split())
    assert "v1 within 19 mm/s, alpha1 within 16.6 deg (medians), violated nowhere in 170 samples" in said
    broken = CERTIFIED | {"v1": {"median": 0.0194, "violations": 3, "tightness": 1.2}}
    assert "violated 3 times in 170 samples" in " ".join(printed(summary | {"certified": broken}).split())


@pytest.mark.parametrize(
    ("part", "change", "said"),
    [
        ("certified", CERTIFIED | {"failed": {"gap": 4, "noise": 6}}, "10 of 180 estimates could not be"),
        ("estimation", {"samples": 0}, "nothing to judge"),
        ("estimation", {"untracked": 20}, "20 of 200 estimates"),
        ("estimation", {"coverage_3sigma": {"v1": 0.9}}, "too sure of v1: only 90.0%"),
        ("estimation", {"nis_mean": 9.0}, "noisier than the scenario says (mean NIS 9"),
        ("estimation", {"nis_mean": 0.1}, "quieter than the scenario says"),
        ("bounds", {"violations": {"v1": 5, "v1_extended": 3}}, "v1_extended does not hold in 3 samples"),
        ("frames", {"lost": 24, "published": 240}, "10.0% of the frames never reached"),
        ("commands", {"saturated": 200, "sent": 240}, "83% of the commands were at a limit"),
        (
            "commands",
            {"stopped": 24, "sent": 240},
            "in 10% of the commands the robot was told to stand still after its first drive",
        ),
        ("formation", {"orbit_deviation_rms": {"rho": 0.3}}, "the distance is 0.3 m RMS off"),
        ("rejected", {"not_finite": 3, "gated": 1}, "inputs refused: gated 1, not finite 3"),
        ("rejected", {"gated": 6}, "inputs refused: gated 6"),
    ],
)
def test_what_deserves_a_second_look_is_said(
    summary: dict[str, Any], part: str, change: dict[str, Any], said: str
) -> None:
    summary[part] = summary.get(part, {}) | change
    (warning,) = warnings_of(summary)
    assert said in warning
    assert f"! {warning}" in printed(summary)


def test_frames_gated_while_the_leader_brakes_are_no_news(summary: dict[str, Any]) -> None:
    assert warnings_of(summary | {"rejected": {"gated": 4}}) == []


def test_a_replay_tells_its_parity(summary: dict[str, Any]) -> None:
    summary["parity"] = {
        "estimates": {"compared": 100, "mismatched": 0},
        "commands": {"compared": 50, "mismatched": 2},
    }
    assert "150 messages compared, 2 differ" in printed(summary)


def test_a_recording_without_truth_has_little_to_tell(exact_run_data: RunData) -> None:
    bare = RunData(exact_run_data.scenario, "replay", [])
    text = printed(summarise(bare))
    assert "turtlebot3, replay, 0.0 s (ekf)" in text
    assert "nothing to judge" in text
