"""What a robot's driver may be told, from what is heard on the wire: the guard's state and its decisions.

A command is obeyed while it is fresh by both of two clocks: that of its sender, which stamps it, and our own
monotonic one, which tells when the last one came. What may be somebody else's doing is latched: the robot
stands until it is armed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from controllers.limits import approached, is_beyond, limited
from formation.pose import STANDSTILL, Motion
from hil.wire.body_walk import Spot
from hil.wire.events import Origin

CLOCK_TOLERANCE_S = 0.05
"""How far [s] a sender's clock may be from ours."""

LOOK_S = 0.01
"""From one look at the clocks to the next [s]."""

REPEAT_S = 0.05
"""After so long [s] the driver is told again what it was told last."""

IDLE_S = 1.0
"""Whom nobody drives is told to stand for so long [s], and then nothing more."""

DRIVING = ""
NO_COMMAND, STANDS = "no command", "told to stand"
SILENT, LATE, CLOCK, NOT_FINITE = "silent", "late", "clock", "not finite"
STOPPED, SECOND_SENDER, RESTART = "stopped", "second sender", "restart"
FENCE, SEPARATION = "fence", "separation"

_NS = 1e-9
_SYNC = "set both clocks by chrony or PTP"


class GuardRules(NamedTuple):
    """What a guard goes by.

    ``age_s``: oldest command, and longest silence, that the robot drives on; ``latch_s``: silence after
    which it does so no more by itself. ``v_max`` [m/s], ``u_max`` [rad/s]: limits; ``v_rate`` [m/s^2],
    ``u_rate`` [rad/s^2]: of their change, infinite for none. ``body``: the robot's own in mocap frames.
    ``fence``: x_min, y_min, x_max, y_max [m] that it has to stay in, infinite for none; ``separation``:
    least distance [m] to any other body, 0 for none.
    """

    age_s: float
    latch_s: float
    v_max: float
    u_max: float
    v_rate: float = math.inf
    u_rate: float = math.inf
    body: str = ""
    fence: tuple[float, float, float, float] = (-math.inf, -math.inf, math.inf, math.inf)
    separation: float = 0.0

    @property
    def is_fenced(self) -> bool:
        """Whether it matters where bodies are."""
        return self.separation > 0.0 or any(math.isfinite(edge) for edge in self.fence)


class Now(NamedTuple):
    """A moment by the host's clock [ns since 1970] and by the monotonic one [s]."""

    host_ns: int
    mono_s: float


class WantedDrive(NamedTuple):
    """A command as it is heard: the motion, and when it was sent by its sender's clock [ns]."""

    motion: Motion
    sent_ns: int


class Told(NamedTuple):
    """What the driver is told, and why it is to stand, empty while it drives."""

    motion: Motion
    reason: str


class Latch(NamedTuple):
    """Why the robot stands until it is armed: a word, who did it, and all of it in words."""

    reason: str
    who: str
    text: str


_NOTHING = WantedDrive(STANDSTILL, 0)


@dataclass(slots=True, eq=False)
class RobotGuard:
    """A robot's guard; it changes in place, and time comes in with every call.

    ``sender``: whose commands are obeyed, None before one is. ``counts``: what was refused or changed, by
    cause; ``gaps``: how often fresh commands failed to come while it drove. ``clock_s``: by how much the
    sender's clock is ahead of ours, where that is known otherwise than by its stamps.
    """

    rules: GuardRules
    sender: Origin | None = None
    latch: Latch | None = None
    counts: dict[str, int] = field(default_factory=dict)
    gaps: int = 0
    longest_gap_s: float = 0.0
    clock_s: float | None = None
    _wanted: WantedDrive = _NOTHING
    _came_s: float = -math.inf
    _told: Motion = STANDSTILL
    _told_s: float = -math.inf
    _lapse: str = SILENT
    _ahead_s: float = 0.0
    _in_gap: bool = False
    _said: Motion | None = None
    _said_s: float = -math.inf
    _idle_since_s: float = -math.inf
    _armed_until_s: float = -math.inf
    _excused: bool = False

    def hear(self, wanted: WantedDrive | None, origin: Origin | None, now: Now) -> None:
        """Take in a command, None for a payload that is none; ``origin`` None where none is told."""
        self._lapse_of(now)
        if wanted is None:
            self._count("malformed")
        elif origin is None:
            self._refuse_sender("a sender without a session", now)
        elif self.sender is None:
            self._take_on(wanted, origin, now)
        elif origin.sender != self.sender.sender:
            self._refuse_sender(f"session {origin.session}", now)
        elif not origin.is_after(self.sender):
            self._count("old")
        else:
            self._follow(wanted, origin, now)

    def stop(self, reason: str, who: str) -> None:
        """Somebody stops everybody."""
        self._hold(Latch(STOPPED, who, f"stopped by {who}: {reason}"))

    def overhear(self, motion: Motion | None, who: str) -> None:
        """Take in a command that somebody else gives the driver.

        While the robot has a sender nobody may, but to make it stand; else somebody drives it by hand.
        """
        if motion is None or motion != STANDSTILL:
            self._count("past_the_guard")
            if self.sender is None:
                return
            self._hold(Latch(SECOND_SENDER, who, f"{who} tells the driver what to do, past the guard"))
            # What the driver was told last is not what we told it.
            self._said = None

    def arm(self, now: Now) -> None:
        """Let the robot be driven again, by whoever sends within ``latch_s``, even if that drives already."""
        self.latch, self.sender, self._armed_until_s = None, None, now.mono_s + self.rules.latch_s
        self._wanted, self._came_s = _NOTHING, -math.inf
        self._in_gap = False
        self._excused = True

    def see(self, spots: Sequence[Spot]) -> None:
        """Take in where bodies are: outside its fence, or too near to another, the robot stands.

        Where it was armed there, it may leave; then both hold again.
        """
        rules = self.rules
        own = next((spot for spot in spots if spot.body == rules.body), None)
        if own is None:
            return
        near = [
            (math.dist((own.x, own.y), (spot.x, spot.y)), spot.body)
            for spot in spots
            if spot.body != own.body and rules.separation > 0.0
        ]
        x_min, y_min, x_max, y_max = rules.fence
        inside = x_min <= own.x <= x_max and y_min <= own.y <= y_max
        apart, other = min(near, default=(math.inf, ""))
        if inside and apart >= rules.separation:
            self._excused = False
        elif self._excused:
            return
        elif not inside:
            where = f"at ({own.x:.2f}, {own.y:.2f}) m, expected within {rules.fence}"
            self._hold(Latch(FENCE, rules.body, f"the robot is outside its fence: {where}"))
        else:
            how = f"{apart:.3f} m from {other!r}, expected {rules.separation:g} m at least"
            self._hold(Latch(SEPARATION, other, f"the robot is {how}"))

    def told(self, now: Now) -> Told:
        """What the driver is to be told now: called at least every few hundredths of a second."""
        reason = self._lapse_of(now)
        if reason:
            self._told, self._told_s = STANDSTILL, now.mono_s
            return Told(STANDSTILL, reason)
        rules, wanted = self.rules, self._wanted.motion
        span_s = min(max(0.0, now.mono_s - self._told_s), rules.age_s)
        within = limited(wanted, rules.v_max, rules.u_max)
        motion = (
            approached(within, self._told, rules.v_rate * span_s, rules.u_rate * span_s)
            if (math.isfinite(rules.v_rate) or math.isfinite(rules.u_rate))
            else within
        )
        self._told, self._told_s = motion, now.mono_s
        return Told(motion, STANDS if wanted == STANDSTILL and motion == STANDSTILL else DRIVING)

    def say(self, now: Now, *, heard: bool = False) -> Told | None:
        """What to tell the driver now, None where it knows; ``heard``: a command has just come.

        To be asked after every command and every :data:`LOOK_S`.
        """
        told = self.told(now)
        if told.reason != NO_COMMAND or self._said is None:
            self._idle_since_s = now.mono_s
        elif now.mono_s - self._idle_since_s > IDLE_S:
            # Nobody is obeyed: somebody may drive the robot by hand.
            return None
        if not heard and told.motion == self._said and now.mono_s - self._said_s < REPEAT_S:
            return None
        self._said, self._said_s = told.motion, now.mono_s
        return told

    def silence_s(self, now: Now) -> float:
        """How long no fresh command has come."""
        return now.mono_s - self._came_s

    def _take_on(self, wanted: WantedDrive, origin: Origin, now: Now) -> None:
        """Take a first sender: one that was armed, or that begins with a standstill as ours do."""
        if self.latch is not None:
            return
        if now.mono_s > self._armed_until_s and wanted.motion != STANDSTILL:
            who = f"session {origin.session}"
            self._hold(Latch(RESTART, who, f"{who} was driving already when the guard began to listen"))
            return
        self.sender = origin
        self._follow(wanted, origin, now)

    def _follow(self, wanted: WantedDrive, origin: Origin, now: Now) -> None:
        self.sender = origin
        age_s = (now.host_ns - wanted.sent_ns) * _NS
        if not self._clock_is_right(age_s):
            self._lapse, self._ahead_s = CLOCK, -age_s
            self._count("clock")
            return
        if age_s > self.rules.age_s:
            self._lapse = LATE
            self._count("late")
            return
        self._lapse = SILENT
        motion = wanted.motion
        if not (math.isfinite(motion.v) and math.isfinite(motion.u)):
            self._count("not_finite")
            wanted = wanted._replace(motion=STANDSTILL)
        elif is_beyond(motion, self.rules.v_max, self.rules.u_max):
            self._count("clipped")
        self._count("taken")
        if self._in_gap:
            self.longest_gap_s = max(self.longest_gap_s, now.mono_s - self._came_s)
            self._in_gap = False
        self._wanted, self._came_s = wanted, now.mono_s

    def _clock_is_right(self, age_s: float) -> bool:
        if age_s < -CLOCK_TOLERANCE_S:
            return False
        return self.clock_s is None or abs(self.clock_s) <= CLOCK_TOLERANCE_S

    def _lapse_of(self, now: Now) -> str:
        """Why the robot is to stand, empty for nothing; what lasts too long is latched."""
        if self.latch is not None:
            return self.latch.reason
        if self.sender is None:
            return NO_COMMAND
        silence_s, age_s = self.silence_s(now), (now.host_ns - self._wanted.sent_ns) * _NS
        if max(silence_s, age_s) <= self.rules.age_s and self._clock_is_right(age_s):
            return DRIVING
        if silence_s <= self.rules.age_s and not self._clock_is_right(age_s):
            self._lapse, self._ahead_s = CLOCK, -age_s
        if not self._in_gap and self._wanted.motion != STANDSTILL:
            self._in_gap = True
            self.gaps += 1
        if silence_s > self.rules.latch_s:
            self._give_up(silence_s)
        return self.latch.reason if self.latch is not None else self._lapse

    def _give_up(self, silence_s: float) -> None:
        """Nothing usable came of the sender for too long: one that drove has to be armed."""
        who = f"session {self.sender.session}" if self.sender is not None else "nobody"
        if self._wanted.motion == STANDSTILL or not math.isfinite(silence_s):
            if self._lapse == SILENT:
                self.sender = None
            return
        texts = {
            SILENT: f"{who} has said nothing for {silence_s:.2f} s",
            LATE: f"for {silence_s:.2f} s all commands of {who} were older than {self.rules.age_s:g} s",
            CLOCK: f"{self.clock_text()} for {silence_s:.2f} s",
        }
        self._hold(Latch(self._lapse, who, texts[self._lapse]))

    def clock_text(self) -> str:
        """How the sender's clock is off, and what to do."""
        ahead_s = self.clock_s if self.clock_s is not None else self._ahead_s
        way = "ahead of" if ahead_s > 0.0 else "behind"
        return f"the sender's clock is {abs(ahead_s) * 1e3:.0f} ms {way} the robot's ({_SYNC})"

    def _refuse_sender(self, who: str, now: Now) -> None:
        """Another than the one who is obeyed: in his place, or beside him, he is not to drive the robot."""
        self._count("foreign")
        if self.latch is not None:
            return
        if self.sender is None:
            self._hold(Latch(SECOND_SENDER, who, f"{who} sends commands; expected one with a session"))
            return
        own = f"session {self.sender.session}"
        if self.silence_s(now) <= self.rules.age_s:
            self._hold(Latch(SECOND_SENDER, who, f"{who} sends commands as well as {own}"))
        else:
            self._hold(Latch(RESTART, who, f"{who} sends commands in the place of {own}, which fell silent"))

    def _hold(self, latch: Latch) -> None:
        """The first reason is the one to tell."""
        if self.latch is None:
            self.latch = latch

    def _count(self, cause: str) -> None:
        self.counts[cause] = self.counts.get(cause, 0) + 1
