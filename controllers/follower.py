"""One command from one estimate: the law at the follower's station, its limits, the guard, whole steps."""

from __future__ import annotations

import math
from typing import NamedTuple

from controllers.guard import DRIVING, Standing, StopReason, decide, reason_of
from controllers.resolution import Steps, rounded
from controllers.station_keeper import KeeperSettings, Kept, StationState, keep
from formation.kernel import kernel
from formation.line import Line
from formation.pose import Motion


class FollowerSettings(NamedTuple):
    """Law and limits, the steps of the robot's link, and the largest age [s] that a command may rest on."""

    keeper: KeeperSettings
    steps: Steps
    max_age: float


class FollowerState(NamedTuple):
    """What a follower remembers from one command to the next: its station, and the rounding remainder."""

    station: StationState
    remainder: Motion


class Outlook(NamedTuple):
    """What the follower will face when its command acts.

    The line to the leader; the leader's motion as seen; its turn rate u1 [rad/s] as the law is to take it.
    ``sound``: whether these are numbers to go by; if not, they are not looked at.
    """

    line: Line
    leader: Motion
    u1: float
    sound: bool


class Command(NamedTuple):
    """A command: what is sent [m/s, rad/s], what the law asked for (NaN if it wasn't), and why.

    ``saturated``: the limits changed it. ``reason``: code as in :class:`controllers.guard.Decision`.
    """

    v: float
    u: float
    v_wanted: float
    u_wanted: float
    saturated: bool
    reason: int

    @property
    def stop(self) -> StopReason | None:
        """Why it is zero, None while driving."""
        return reason_of(self.reason)


class Commanded(NamedTuple):
    """State after a command, and the command."""

    state: FollowerState
    command: Command


@kernel
def command(
    state: FollowerState, settings: FollowerSettings, outlook: Outlook, standing: Standing, elapsed: float
) -> Commanded:
    """Command for the next ``elapsed`` [s] > 0, a standstill with its reason if it may not be driven."""
    law = settings.keeper.law
    kept = Kept(state.station, Motion(math.nan, math.nan))
    if outlook.sound:
        kept = keep(state.station, settings.keeper, outlook.line, outlook.leader, outlook.u1, elapsed)
    decision = decide(kept.wanted, standing, settings.max_age, law.v_max, law.u_max)
    wanted = decision.wanted
    if decision.reason != DRIVING:
        stood = FollowerState(state.station._replace(interrupted=True), Motion(0.0, 0.0))
        return Commanded(stood, Command(0.0, 0.0, wanted.v, wanted.u, False, decision.reason))
    steps = rounded(decision.sent, state.remainder, settings.steps, law.v_max, law.u_max)
    sent = steps.sent
    driven = Command(sent.v, sent.u, wanted.v, wanted.u, decision.saturated, DRIVING)
    return Commanded(FollowerState(kept.state, steps.remainder), driven)
