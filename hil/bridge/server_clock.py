"""A server's clock against the host's, by echoes: what was asked at one host time and answered at another.

An answer was given somewhere between asking and hearing it, so its middle is right to half the round trip.
The quickest echo of every second counts, each by how quick it was. A line through these, its slope held near
zero by what clocks of computers are known to drift, is offset and drift: it needs no threshold, and a slow
network makes it slow to believe in a drift.
"""

from __future__ import annotations

from typing import NamedTuple

_S_NS = 1_000_000_000
_SPAN_S = 60
_LEAST_SD_NS = 10_000.0
_DRIFT_SD = 1e-4
_JUMP_NS = 2_000_000
_JUMP_ECHOES = 3


class Answered(NamedTuple):
    """An echo: host times [ns] of asking and hearing, and the server's clock [ns] in between."""

    sent_ns: int
    heard_ns: int
    server_ns: int

    @property
    def round_trip_ns(self) -> int:
        """How long the answer took."""
        return self.heard_ns - self.sent_ns

    @property
    def middle_ns(self) -> int:
        """Host time in the middle between asking and hearing."""
        return (self.sent_ns + self.heard_ns) // 2

    @property
    def offset_ns(self) -> int:
        """How far the host's clock is ahead, if both ways took as long."""
        return self.middle_ns - self.server_ns


class ServerClock:
    """Server times on the host's clock. Fold in every echo by :meth:`hear`.

    ``frequency``: ticks of the server's clock in a second. ``jumps``: how often the offset jumped, as where
    a server was started anew or a host's clock was set. Until the first echo nothing is known.
    """

    def __init__(self, frequency: int) -> None:
        self.frequency = frequency
        self.jumps = 0
        self.drift = 0.0
        self._quickest: dict[int, Answered] = {}
        self._suspects: list[Answered] = []
        self._offset_ns = 0
        self._at_ns = 0

    @property
    def known(self) -> bool:
        """Whether there was an echo."""
        return bool(self._quickest)

    @property
    def round_trip_ns(self) -> int:
        """The quickest round trip of the last minute, -1 before there was any."""
        return min((echo.round_trip_ns for echo in self._quickest.values()), default=-1)

    @property
    def offset_ns(self) -> int:
        """How far the host's clock is ahead of the server's, at the last echo."""
        return self._offset_ns

    def hear(self, sent_ns: int, heard_ns: int, ticks: int) -> bool:
        """Take in an echo; what was heard before it was asked is none. Returns whether it was one."""
        if heard_ns < sent_ns:
            return False
        echo = Answered(sent_ns, heard_ns, self.nanoseconds(ticks))
        if self._fits(echo):
            self._suspects.clear()
            self._keep(echo)
            self._fit()
            return True
        self._suspects.append(echo)
        if len(self._suspects) == _JUMP_ECHOES:
            self.jumps += 1
            self._quickest.clear()
            for suspect in self._suspects:
                self._keep(suspect)
            self._suspects.clear()
            self._fit()
        return True

    def nanoseconds(self, ticks: int) -> int:
        """Ticks of the server's clock in ns."""
        return ticks * _S_NS // self.frequency

    def host_ns(self, ticks: int) -> int:
        """Host time [ns] of a time by the server's clock; right to half a round trip once it is known."""
        server_ns = self.nanoseconds(ticks)
        since_ns = server_ns + self._offset_ns - self._at_ns
        return server_ns + self._offset_ns + round(self.drift * since_ns)

    def _fits(self, echo: Answered) -> bool:
        if not self.known:
            return True
        expected_ns = self._offset_ns + round(self.drift * (echo.middle_ns - self._at_ns))
        # Far off in host time the drift alone may have moved it.
        allowed_ns = _JUMP_NS + _DRIFT_SD * abs(echo.middle_ns - self._at_ns)
        # What is known so far is itself right to half a round trip only.
        allowed_ns += 0.5 * (echo.round_trip_ns + self.round_trip_ns)
        return abs(echo.offset_ns - expected_ns) <= allowed_ns

    def _keep(self, echo: Answered) -> None:
        second = echo.middle_ns // _S_NS
        before = self._quickest.get(second)
        if before is None or echo.round_trip_ns < before.round_trip_ns:
            self._quickest[second] = echo
        for old in [known for known in self._quickest if abs(second - known) > _SPAN_S]:
            del self._quickest[old]

    def _fit(self) -> None:
        """Weighted least squares of offset over time, with a slope that is likely small."""
        echoes = list(self._quickest.values())
        newest = max(echoes, key=lambda echo: echo.middle_ns)
        at_ns, base_ns = newest.middle_ns, newest.offset_ns
        total = along = moment = height = slope = 0.0
        for echo in echoes:
            sd = 0.25 * echo.round_trip_ns + _LEAST_SD_NS
            weight, x, y = 1.0 / (sd * sd), float(echo.middle_ns - at_ns), float(echo.offset_ns - base_ns)
            total += weight
            along += weight * x
            moment += weight * x * x
            height += weight * y
            slope += weight * x * y
        moment += 1.0 / (_DRIFT_SD * _DRIFT_SD)
        determinant = total * moment - along * along
        self.drift = (total * slope - along * height) / determinant
        self._offset_ns = base_ns + round((moment * height - along * slope) / determinant)
        self._at_ns = at_ns
