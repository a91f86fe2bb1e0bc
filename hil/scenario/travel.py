"""A leader that drives backwards, seen as who is seen by positions sees it: by its direction of travel.

A unicycle that drives backwards at v < 0 under heading theta moves as one does that drives at -v under
theta + pi and turns as fast. So alpha1 is that of the direction of travel, and v1 = |v|.
"""

from __future__ import annotations

import math
from itertools import pairwise

from msgspec.structs import replace

from formation.wrapping import wrapped
from hil.errors import UsageError
from hil.scenario.schema import Scenario, TableProgram


def as_travelled(scenario: Scenario) -> Scenario:
    """A scenario whose leader drives forwards the way that it travels; as it is where it does so anyway.

    For the noise-free experiments. Raises :class:`UsageError` where the leader turns back: at a standstill
    there is no alpha1, and behind it another one, of which none of the propositions knows.
    """
    leader = scenario.leader
    program = leader.program
    if not isinstance(program, TableProgram) or min(program.v) >= 0.0:
        return scenario
    if max(program.v) > 0.0:
        raise UsageError(
            f"scenario {scenario.name}: leader.program.v turns back after t = {_turning(program):g} s, "
            "expected one sign throughout: alpha1 jumps by pi there, and the law is proved for v1 >= v_eps; "
            "abreast run drives such a leader"
        )
    x, y, theta = leader.pose
    travelled = replace(
        leader, pose=(x, y, wrapped(theta + math.pi)), program=replace(program, v=[abs(v) for v in program.v])
    )
    return replace(scenario, leader=travelled)


def _turning(program: TableProgram) -> float:
    """Time of the last row before the sign of the speed is another one."""
    moving = [(t, v) for t, v in zip(program.t, program.v, strict=False) if v != 0.0]
    return next(t for (t, v), (_, after) in pairwise(moving) if v * after < 0.0)
