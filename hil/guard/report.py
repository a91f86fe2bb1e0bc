"""What a guard says of itself twice a second, as the values of a node's diagnostics."""

from __future__ import annotations

from hil.guard.robot_guard import CLOCK, LATE, NO_COMMAND, SECOND_SENDER, STOPPED, Now, RobotGuard
from hil.wire.finding_keys import PREFIX

REPORT_NS = 500_000_000
"""From one report to the next [ns]."""

GUARDS = "guard/"
"""What the names of guards begin with among the nodes."""

_FINDINGS = {CLOCK: "clock", SECOND_SENDER: "second_sender"}
"""Names of findings by what a guard latches for, where these are known by another name."""


def node_of(robot: str) -> str:
    """What the guard of a robot is called among the nodes."""
    return f"{GUARDS}{robot}"


def problem_of(guard: RobotGuard, now: Now) -> str:
    """Why the robot is not driven, in one line; empty where it is, or where nothing is wanted of it yet."""
    if guard.latch is not None:
        return f"latched ({guard.latch.reason}): {guard.latch.text}; arm it to go on"
    reason = guard.told(now).reason
    if reason == CLOCK:
        return guard.clock_text()
    if reason == LATE:
        return f"commands come more than {guard.rules.age_s:g} s after they were sent"
    return ""


def values_of(guard: RobotGuard, now: Now) -> dict[str, object]:
    """State, sender and counts, and findings."""
    told = guard.told(now)
    values: dict[str, object] = {
        "v": f"{told.motion.v:.4f}",
        "u": f"{told.motion.u:.4f}",
        "reason": told.reason,
        "sender": guard.sender.session if guard.sender is not None else "",
        "latched": guard.latch.reason if guard.latch is not None else "",
        "latched_by": guard.latch.who if guard.latch is not None else "",
    }
    if guard.sender is not None and told.reason != NO_COMMAND:
        values["silence_ms"] = f"{1e3 * min(guard.silence_s(now), 1e6):.0f}"
    values["command_gaps"] = guard.gaps
    values |= {f"commands.{cause}": count for cause, count in guard.counts.items()}
    return values | {f"{PREFIX}{name}": text for name, text in _findings(guard).items()}


def _findings(guard: RobotGuard) -> dict[str, str]:
    found = {}
    if guard.gaps:
        count = "once" if guard.gaps == 1 else f"{guard.gaps} times"
        found["command_gaps"] = (
            f"fresh commands failed to come {count}, for {guard.longest_gap_s:.2f} s at most; "
            f"expected one every {guard.rules.age_s:g} s at least"
        )
    # A stop is an order, and nothing that is wrong.
    if guard.latch is not None and guard.latch.reason != STOPPED:
        found[_FINDINGS.get(guard.latch.reason, "guard_latched")] = guard.latch.text
    return found
