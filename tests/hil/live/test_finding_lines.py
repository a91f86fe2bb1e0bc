"""A terminal says once that something is found, and once that it is no more."""

from __future__ import annotations

from collections.abc import Mapping

from hil.live.finding_lines import FindingLines, ProblemLines, WaitingLines
from hil.nodes.findings import advice_on, named_findings
from hil.nodes.node import diagnostics
from hil.wire.messages import encode

SILENT = {"odometry_silent": "no odometry for 1.2 s"}


def report(node: str, findings: Mapping[str, str]) -> bytes:
    return encode(diagnostics(node, 0, "", {"status": "tracking", **named_findings(findings)}))


def test_a_finding_is_said_when_it_begins_and_when_it_ends() -> None:
    said: list[str] = []
    lines = FindingLines(said.append)
    lines.hear(report("estimator", {}))
    assert said == []
    lines.hear(report("estimator", SILENT))
    lines.hear(report("estimator", {"odometry_silent": "no odometry for 1.7 s"}))
    begun = f"estimator finds odometry_silent: no odometry for 1.2 s; {advice_on('odometry_silent')}"
    assert said == [begun]
    lines.hear(report("controller", {}))
    assert said == [begun]
    lines.hear(report("estimator", {}))
    assert said == [begun, "estimator finds odometry_silent no more"]
    lines.hear(report("estimator", SILENT))
    assert said[2:] == [begun]


def test_what_cannot_be_read_is_passed_over() -> None:
    said: list[str] = []
    lines = FindingLines(said.append)
    lines.hear(b"finding.")
    assert said == []


def told(node: str, problem: str) -> bytes:
    return encode(diagnostics(node, 0, problem, {}))


def test_what_a_node_waits_for_is_said_when_it_lasts_when_it_changes_and_when_it_is_over() -> None:
    said: list[str] = []
    lines = ProblemLines(said.append)
    lines.hear(told("estimator", "waiting for mocap"))
    lines.hear(told("estimator", ""))
    lines.hear(told("estimator", ""))
    assert said == []
    for problem in ("no body 'a'", "no body 'a'", "no body 'b'", "no body 'b'", "no body 'b'", "", ""):
        lines.hear(told("estimator", problem))
        lines.hear(told("controller", ""))
    assert said == ["estimator: no body 'a'", "estimator: no body 'b'", "estimator waits no more"]


def test_figures_with_a_unit_are_not_said_anew() -> None:
    said: list[str] = []
    lines = ProblemLines(said.append)
    for seconds in range(5):
        lines.hear(told("leader", f"sets off in {seconds} s"))
        lines.hear(told("estimator", f"heading is +{seconds}.1 deg (sd 0.{seconds}) off"))
    lines.hear(b"?")
    assert said == ["leader: sets off in 1 s", "estimator: heading is +1.1 deg (sd 0.1) off"]


def test_what_a_start_waits_for_is_said_once_however_many_seconds_are_left() -> None:
    said: list[str] = []
    lines = WaitingLines(said.append)
    for waits in ("waiting for a command", "waiting for a command", "sets off in 2.5 s", "sets off in 2.0 s"):
        lines.hear(waits)
    assert said == ["waiting for a command", "sets off in 2.5 s"]
