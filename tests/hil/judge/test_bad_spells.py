"""When a run was bad, and why: nothing of a good one is told, and all of a bad one where it was."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimation.tracking.tracker import Status
from hil.judge.bad_spells import bad_spells
from hil.judge.columns import columns_of
from hil.judge.replayed import ReplayChoice, replayed
from hil.judge.run_data import RunData, run_data_of_log
from hil.judge.spell_words import spell_lines
from hil.judge.summary import summarise
from hil.judge.summary_text import verdict_lines, warnings_of
from hil.lockstep.run import run_lockstep
from hil.log.reader import Log, read_log
from hil.nodes.troubles import Trouble
from hil.reports.spell_list import spell_list
from hil.scenario.files import load_scenario
from hil.wire.messages import to_ns, to_time
from tests.hil.conftest import FRAME_NS
from tests.reference_logs import path_of

FRAME_S = FRAME_NS * 1e-9


def spells_of(run_data: RunData) -> list[dict[str, Any]]:
    return bad_spells(run_data, columns_of(run_data))


def lapsing(run_data: RunData, rows: Sequence[int], status: Status = Status.LOST) -> RunData:
    estimates = list(run_data.estimates)
    for row in rows:
        estimates[row] = replace(estimates[row], status=int(status))
    return replace(run_data, estimates=estimates)


def off_in(run_data: RunData, rows: Sequence[int], off: float) -> RunData:
    """Estimates whose v1 is off by so much [m/s] in these rows, where they are sure of 1 mm/s."""
    estimates, covariance = list(run_data.estimates), 1e-6 * np.eye(5).reshape(25)
    for row in rows:
        estimates[row] = replace(estimates[row], v1=estimates[row].v1 + off, covariance=covariance)
    return replace(run_data, estimates=estimates)


@pytest.fixture(scope="module")
def dropout(tmp_path_factory: pytest.TempPathFactory) -> Log:
    """A lockstep run of 8 s in which the motion capture is silent for 2 s."""
    path = tmp_path_factory.mktemp("dropout") / "run.mcap"
    fault = 'mocap.faults=[{kind="dropout", at_s=4, duration_s=2}]'
    run_lockstep(load_scenario("turtlebot3", ["run.duration_s=8", "run.evaluate_from_s=3", fault]), path)
    return read_log(path)


def test_a_dropout_is_told_with_its_times_and_what_came_of_it(dropout: Log) -> None:
    (spell,) = summarise(run_data_of_log(dropout))["spells"]
    assert spell["from_s"] == pytest.approx(4.0, abs=0.02)
    assert spell["to_s"] == pytest.approx(6.05, abs=0.05)
    frames, status, stood = spell["causes"][:3]
    assert frames == "no frame for 2.0 s (240 lost)"
    assert status.startswith("coasting 4.29 to 5.04 s, lost 5.04 to 6.03 s")
    assert stood.startswith("told to stand 4.2 to 6.1 s (stale, lost")
    assert spell["frames_lost"] == 240
    assert spell["worst"]["alpha1"]["at_s"] == pytest.approx(6.25, abs=0.3)
    assert spell["worst"]["alpha1"]["error"] > 0.05


def test_what_a_spell_says_is_not_said_again_without_its_time(dropout: Log) -> None:
    summary = summarise(run_data_of_log(dropout))
    said = [
        each for each in warnings_of(summary) if "tracking" in each or "frames" in each or "stand" in each
    ]
    assert len(said) == 1
    assert said[0].startswith("4.0 to 6.1 s: no frame for 2.0 s (240 lost); coasting")
    assert "off while tracking by up to alpha1 " in said[0]


@pytest.mark.parametrize("name", ["plain-ekf", "sides-imm"])
def test_a_healthy_reference_log_has_none(name: str) -> None:
    assert summarise(run_data_of_log(read_log(path_of(name))))["spells"] == []


def test_a_healthy_run_with_single_frames_lost_has_none(tmp_path: Path, short_log: Log) -> None:
    assert summarise(run_data_of_log(short_log))["spells"] == []
    path = tmp_path / "run.mcap"
    run_lockstep(load_scenario("turtlebot3", ["run.duration_s=6", "run.evaluate_from_s=3"]), path)
    assert summarise(run_data_of_log(read_log(path)))["spells"] == []


def test_a_run_without_any_error_has_none(exact_run_data: RunData) -> None:
    assert spells_of(exact_run_data) == []
    assert spells_of(replace(exact_run_data, estimates=[], commands=[], truth=[])) == []


def test_estimates_are_laid_out_by_when_they_were_told(exact_run_data: RunData) -> None:
    estimates = list(exact_run_data.estimates)
    for row in range(120, 180):  # all of the last capture, told one after the other
        estimates[row] = replace(estimates[row], header=estimates[119].header, status=int(Status.LOST))
    (spell,) = spells_of(replace(exact_run_data, estimates=estimates))
    assert "lost 2.0 to 3.0 s" in spell["causes"]
    assert spell["untracked"] == 60


def test_a_single_refused_frame_is_no_spell_but_several_are(exact_run_data: RunData) -> None:
    assert spells_of(lapsing(exact_run_data, [120], Status.REJECTING)) == []
    (spell,) = spells_of(lapsing(exact_run_data, range(120, 130), Status.REJECTING))
    assert spell["causes"] == ["refusing frames 2.00 to 2.17 s"]
    assert spell["from_s"] == pytest.approx(120 * FRAME_S)
    assert spell["to_s"] == pytest.approx(130 * FRAME_S)


def test_what_is_near_is_one_spell_and_what_is_far_are_two(exact_run_data: RunData) -> None:
    near = [*range(90, 100), *range(120, 130)]
    (one,) = spells_of(lapsing(exact_run_data, near))
    assert one["causes"] == ["lost 2 times between 1.50 and 2.17 s, 0.33 s in all"]
    assert len(spells_of(lapsing(exact_run_data, [*range(90, 100), *range(150, 160)]))) == 2


def test_a_follower_that_waits_for_its_first_drive_is_not_in_a_spell(exact_run_data: RunData) -> None:
    waits = [
        replace(each, stop="no estimate" if number < 40 else "stale" if 60 <= number < 65 else "")
        for number, each in enumerate(exact_run_data.commands)
    ]
    (spell,) = spells_of(replace(exact_run_data, commands=waits))
    assert spell["causes"] == ["told to stand 1.03 to 1.11 s (stale)"]
    assert spell["stopped"] == 5


@pytest.mark.parametrize(
    ("off", "causes"),
    [
        (0.004, []),
        (0.006, ["v1 outside 5 sigma in 7 estimates"]),
        (0.06, ["v1 outside 5 sigma in 7 estimates", "v1 outside its bound in 7 estimates"]),
    ],
)
def test_errors_far_outside_are_told_with_their_time(
    exact_run_data: RunData, off: float, causes: list[str]
) -> None:
    found = spells_of(off_in(exact_run_data, range(150, 157), off))
    assert [cause for spell in found for cause in spell["causes"]] == causes
    for spell in found:
        assert spell["from_s"] == pytest.approx(150 * FRAME_S)
        assert spell["worst"]["v1"]["error"] == pytest.approx(off)
        assert spell["worst"]["v1"]["at_s"] == pytest.approx(153 * FRAME_S, abs=4 * FRAME_S)


def test_a_single_error_is_a_spell_only_outside_its_bound(exact_run_data: RunData) -> None:
    assert spells_of(off_in(exact_run_data, [150], 0.006)) == []
    (spell,) = spells_of(off_in(exact_run_data, [150], 0.06))
    assert spell["causes"] == ["v1 outside 5 sigma in 1 estimate", "v1 outside its bound in 1 estimate"]


def test_only_what_is_to_be_judged_is_looked_at(exact_run_data: RunData) -> None:
    lost = lapsing(exact_run_data, [*range(90, 100), *range(180, 190)])
    zero_ns = exact_run_data.zero_ns
    (spell,) = spells_of(replace(lost, evaluate_from_ns=zero_ns + 2_500_000_000))
    assert spell["from_s"] == pytest.approx(180 * FRAME_S)
    (spell,) = spells_of(replace(lost, evaluate_to_ns=zero_ns + 2_500_000_000))
    assert spell["to_s"] == pytest.approx(100 * FRAME_S)


def test_a_window_is_told_and_what_is_not_of_it(dropout: Log) -> None:
    run_data = run_data_of_log(dropout)
    zero_ns = run_data.zero_ns
    summary = summarise(
        replace(run_data, evaluate_from_ns=zero_ns + 7 * 10**9, evaluate_to_ns=zero_ns + 8 * 10**9)
    )
    assert summary["window"] == {"from_s": 7.0, "to_s": 8.0}
    assert summary["spells"] == []
    assert "window" not in summarise(run_data)
    judged = [text for name, text, _ in verdict_lines(summary) if name == "judged"]
    assert judged[0].startswith("from 7 to 8 s only: estimates")
    assert any("of the frames of the whole run never reached" in each for each in warnings_of(summary))
    assert any("of the commands of the whole run the robot was told" in each for each in warnings_of(summary))


def test_frames_that_are_refused_are_told_by_their_cause(tmp_path: Path) -> None:
    fault = 'mocap.faults=[{kind="freeze", at_s=3, duration_s=1}]'
    path = tmp_path / "run.mcap"
    run_lockstep(load_scenario("turtlebot3", ["run.duration_s=6", "run.evaluate_from_s=2", fault]), path)
    (spell,) = summarise(run_data_of_log(read_log(path)))["spells"]
    assert spell["causes"][0].startswith("refusing frames 3.03 to 4.00 s, lost 4.00 to 4.03 s")
    assert any(cause.startswith("inputs refused: frozen 12") for cause in spell["causes"])
    choice = ReplayChoice(verify=True)
    assert replayed(read_log(path), choice).summary["spells"] == [spell]
    other = replayed(read_log(path), ReplayChoice(estimator="ukf")).summary["spells"]
    assert not any("inputs refused" in cause for each in other for cause in each["causes"])


def troubled(run_data: RunData, reports: Sequence[tuple[float, dict[str, int], set[str]]]) -> RunData:
    zero_ns = run_data.zero_ns
    told = [
        Trouble(zero_ns + round(at_s * 1e9), refused, frozenset(found)) for at_s, refused, found in reports
    ]
    return replace(run_data, troubles=told)


def test_odometry_that_is_wrong_for_a_while_is_a_spell_but_not_for_good(exact_run_data: RunData) -> None:
    wrong = {"odometry_contradicts"}
    while_s, for_good = (1.5, 2.0), (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5)
    (spell,) = spells_of(troubled(exact_run_data, [(at_s, {}, wrong) for at_s in while_s]))
    assert spell["causes"] == ["odometry contradicts 1.5 to 2.5 s"]
    lasting = troubled(exact_run_data, [(at_s, {}, wrong) for at_s in for_good])
    assert spells_of(lasting) == []
    (joined,) = spells_of(lapsing(lasting, range(120, 130)))
    assert joined["causes"] == ["lost 2.00 to 2.17 s", "odometry contradicts 0.5 to 4.0 s"]


def test_what_was_refused_outside_of_a_spell_is_none_of_its_causes(exact_run_data: RunData) -> None:
    counts = [(1.0, {"gated": 4}), (1.9, {"gated": 5, "unknown_body": 9}), (2.5, {"gated": 5, "swapped": 7})]
    reports = [(at_s, refused, set[str]()) for at_s, refused in counts]
    (spell,) = spells_of(lapsing(troubled(exact_run_data, reports), range(120, 130)))
    assert spell["causes"] == ["lost 2.00 to 2.17 s", "inputs refused: swapped 7"]


def test_a_spell_without_any_estimate_that_could_be_judged_is_told(exact_run_data: RunData) -> None:
    bare = replace(lapsing(exact_run_data, range(120, 180)), truth=[])
    summary = summarise(bare)
    assert "worst" not in summary["spells"][0]
    assert [each for each in warnings_of(summary) if each.startswith("2.0 to 3.0 s: lost 2.0 to 3.0 s")]
    assert "2.0 to 3.0 s" in spell_list(summary)


def test_the_longest_are_told_and_how_many_more_there_are(exact_run_data: RunData) -> None:
    lengths = {20: 7, 60: 12, 110: 8, 160: 9, 210: 10}
    rows = [row for first, count in lengths.items() for row in range(first, first + count)]
    said = [*spell_lines(summarise(lapsing(exact_run_data, rows)))]
    assert [line[:4] for line in said] == ["1.00", "3.50", "2.67", "and "]
    assert said[3] == "and 2 more bad spells, shorter ones, in the report"


def test_when_the_largest_error_was_is_told(exact_run_data: RunData) -> None:
    estimates = list(exact_run_data.estimates)
    estimates[150] = replace(estimates[150], v1=estimates[150].v1 - 0.003)
    estimation = summarise(replace(exact_run_data, estimates=estimates))["estimation"]
    assert estimation["max"]["v1"] == pytest.approx(0.003)
    assert estimation["max_at_s"]["v1"] == pytest.approx(150 * FRAME_S)


def test_what_was_told_late_keeps_its_order(exact_run_data: RunData) -> None:
    late = [
        replace(each, computed=to_time(to_ns(each.header.stamp) + (40_000_000 if row % 2 else 0)))
        for row, each in enumerate(exact_run_data.estimates)
    ]
    told_ns = columns_of(replace(exact_run_data, estimates=late)).estimates.told_ns
    assert (told_ns[1:] >= told_ns[:-1]).all()
