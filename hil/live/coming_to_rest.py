"""Robots that were told to stand, and what their odometry says of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from formation.pose import Motion
from hil.nodes.at_rest import STILL_V, own_motion, stands
from hil.wire.events import Event
from hil.wire.lab_robots import LabRobot

_FRESH_S = 1.0
"""What odometry said longer ago [s] says nothing of now."""

_NAMED = 4
"""So many robots are told of one by one."""


class Rest(NamedTuple):
    """How a robot came to rest, by its odometry.

    ``own``: how it moves [m/s, rad/s], None where nothing is known. ``after_s``: since when it stands, from
    when it was told to [s]; None where it does not. ``silent``: its odometry has fallen silent.
    """

    name: str
    own: Motion | None = None
    after_s: float | None = None
    silent: bool = False

    @property
    def moves(self) -> bool:
        """Whether it was told to stand, and did not by its last word."""
        return self.own is not None and self.after_s is None

    def words(self) -> str:
        """The same in words, with what to do."""
        if self.own is None:
            return f"{self.name}: nothing heard of its odometry: look at the robot"
        v, u = abs(self.own.v), abs(self.own.u)
        if self.after_s is not None:
            return f"{self.name} stands (odometry {v:.3f} m/s, {u:.2f} rad/s after {self.after_s:.1f} s)"
        pace = f"moves at {v:.2f} m/s" if v >= STILL_V else f"turns at {u:.2f} rad/s"
        when = ", by the last that was heard of its odometry" if self.silent else ""
        return f"{self.name} was told to stand and still {pace}{when}"


class ComingToRest:
    """Hears odometry since robots were told to stand at ``told_at``, a time of a clock in seconds."""

    def __init__(self, robots: Sequence[LabRobot], told_at: float) -> None:
        self._names = {robot.odom: robot.name for robot in robots}
        self._told_at = told_at
        self._newest: dict[str, tuple[Motion, float]] = {}
        self._since: dict[str, float] = {}

    def hear(self, event: Event, now: float) -> None:
        """Take in a message; what is no odometry of these robots is left."""
        name = self._names.get(event.topic)
        own = own_motion(event.payload) if name is not None else None
        if name is None or own is None:
            return
        self._newest[name] = own, now
        if stands(own):
            self._since.setdefault(name, now)
        else:
            self._since.pop(name, None)

    def rest(self, now: float) -> tuple[Rest, ...]:
        """What is known of each robot."""
        return tuple(self._rest(name, now) for name in self._names.values())

    def _rest(self, name: str, now: float) -> Rest:
        own, at = self._newest.get(name, (None, now))
        since, silent = self._since.get(name), now - at > _FRESH_S
        if since is None:
            return Rest(name, own, None, silent)
        # Nobody who stood a while ago is said to stand.
        return Rest(name) if silent else Rest(name, own, since - self._told_at)


def rest_words(rests: Sequence[Rest]) -> str:
    """How robots came to rest, in words; of many that stand only the fastest and the last.

    >>> rest_words([Rest(f"r{k}", Motion(0.0, 0.0), 0.1 * k) for k in range(9)])
    'all 9 stand (odometry at most 0.000 m/s, 0.00 rad/s after at most 0.8 s)'
    """
    standing = [(each.own, each.after_s) for each in rests if each.own and each.after_s is not None]
    if len(standing) <= _NAMED:
        return ", ".join(each.words() for each in rests)
    v, u = max(abs(own.v) for own, _ in standing), max(abs(own.u) for own, _ in standing)
    last_s = max(after_s for _, after_s in standing)
    how_many = f"all {len(standing)}" if len(standing) == len(rests) else f"{len(standing)} of {len(rests)}"
    told = f"{how_many} stand (odometry at most {v:.3f} m/s, {u:.2f} rad/s after at most {last_s:.1f} s)"
    others = (each.words() for each in rests if each.after_s is None)
    return ", ".join((told, *others))
