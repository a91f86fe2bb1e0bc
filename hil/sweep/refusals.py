"""What a sweep cannot fly, by name, and why."""

from __future__ import annotations

from hil.errors import UsageError
from hil.scenario.schema import Scenario


def refuse_unsweepable(scenario: Scenario) -> None:
    """Raise :class:`UsageError` for what lockstep runs can do and the loop of a sweep cannot.

    What the nodes keep in plain Python beside the loop: what is found out of a clock, and of odometry's delay
    and scale, and what is certain of an estimate.
    """
    given, jump = scenario.estimator, scenario.mocap.clock_jump_s
    refusals = (
        ("estimator.clock", given.clock, given.clock == "trusted", "'trusted'", "clocks are fitted"),
        ("mocap.clock_jump_s", jump, jump == 0.0, "0", "jumps are found"),
        ("estimator.align_odometry", given.align_odometry, not given.align_odometry, "false", "it is done"),
        ("estimator.certify", given.certify, not given.certify, "false", "it is done"),
    )
    for key, value, is_right, expected, why in refusals:
        if not is_right:
            raise UsageError(
                f"scenario {scenario.name}: {key} is {value!r}, but a sweep takes {expected}, as {why} in "
                "plain Python; set it so, or use abreast run --lockstep"
            )
