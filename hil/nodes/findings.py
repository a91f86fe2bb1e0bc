"""Findings: what a node sees to be wrong with what it gets, by a name that tells what to do about it.

A node puts each into its diagnostics, for as long as it holds, and everybody else takes it from there: the
terminal of a daemon, the verdict on a run, its report.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from hil.wire.finding_keys import PREFIX
from hil.wire.message_types import DiagnosticArray

Findings = Mapping[str, str]
"""What was seen, and what was expected, in one line, by the finding's name."""

ADVICE = {
    "odometry_silent": "see that the robot publishes odometry on the topic that the scenario names",
    "odometry_contradicts": "check the odometry's scale, signs and topic, and whether the wheels slip",
    "odometry_not_finite": "look at the driver that publishes it: what is no number is not used",
    "odometry_late": "check the clock of the robot and its link, or set estimator.align_odometry = true",
    "odometry_reset": "find out what restarted the robot's base; its pose counts from a new origin now",
    "frame_yaw": "set the mount to what abreast calibrate prints, or turn the body to the front",
    "frame_pivot": "set the mount to what abreast calibrate prints, or its pivot between the wheels",
    "axes": "set which way is up in what brings the poses: z is to point up",
    "unit": "have positions sent in metres, or scale them in what brings them",
    "clock": 'set the clocks of all machines by PTP or chrony, or estimator.clock = "estimated"',
    "frames_of_reference": "have both bodies sent in one frame of reference",
    "bodies": "give the bodies the names that leader.body and follower.body say",
    "noise": "set the sigmas to what abreast calibrate prints: bounds and certificates rest on what is told",
    "nees": (
        "deviations are not what errors are: set the sigmas and the leader's limits to what is true; wrong "
        'odometry shows so as well, which estimator.own_motion = "auto" judges'
    ),
    "leader_limits": "set the leader's limits to what it does: estimates, bounds and certificate rest on it",
    "cusp": "the leader stood or turned back: give the estimator a moment of travel before relying on alpha1",
    "second_sender": "end all but one of those who send on this topic",
    "guard_latched": "see what it says; abreast arm lets the robot be driven again",
    "flood": "find out who sends so much there, and end or slow it",
    "command_gaps": "look for what holds the controller or its link up",
    "deaf_robot": "see that the robot listens to the topic and the type of its commands",
    "command_type": "set controller.command_type to what the robot listens to",
    "log_damaged": "abreast recover keeps what is whole",
    "disk": "make room where the log is written, and leave its folder where it is",
    "stopped_by": "ask whoever sent the stop; start the controller again to go on",
}
"""What to do, by the name of what was found."""

_BY_ODOMETRY = (
    "{} was found as well, and deviations rest on odometry: mend that first, and the sigmas or the leader's "
    "limits only if this is left"
)
_OTHERWISE = "look at what says so in the diagnostics"


def advice_on(name: str) -> str:
    """What to do about a finding."""
    return ADVICE.get(name, _OTHERWISE)


def named_findings(findings: Findings) -> dict[str, object]:
    """Findings as values of a diagnostics message."""
    return {f"{PREFIX}{name}": text for name, text in findings.items()}


def findings_in(report: DiagnosticArray) -> dict[str, dict[str, str]]:
    """Findings of a report by the nodes' names; a node that has none is there all the same."""
    return {
        status.name.removeprefix("abreast/"): {
            entry.key.removeprefix(PREFIX): entry.value
            for entry in status.values
            if entry.key.startswith(PREFIX) and entry.key != PREFIX
        }
        for status in report.status
    }


def all_found(reports: Iterable[Mapping[str, Findings]]) -> dict[str, dict[str, str]]:
    """All that was ever found, by the nodes' names, each in the words in which it was said last."""
    found: dict[str, dict[str, str]] = {}
    for report in reports:
        for node, findings in report.items():
            found.setdefault(node, {}).update(findings)
    return found


def findings_json(findings: Findings) -> list[dict[str, Any]]:
    """Findings as results have them, each with what to do about it."""
    return [
        {"name": name, "text": text, "advice": _advice_beside(name, findings)}
        for name, text in findings.items()
    ]


def _advice_beside(name: str, others: Iterable[str]) -> str:
    """What to do about a finding where others were found, of which one may be the cause of it."""
    wrong = [other for other in others if other.startswith("odometry_")]
    if name == "nees" and wrong:
        return _BY_ODOMETRY.format(" and ".join(wrong))
    return advice_on(name)


def finding_line(finding: Mapping[str, str]) -> str:
    """A finding of a result in one line."""
    return f"{finding['name']}: {finding['text']}; {finding['advice']}"
