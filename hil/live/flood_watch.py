"""What a daemon says of topics on which more comes than it takes in."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from hil.nodes.findings import named_findings
from hil.nodes.node import Outgoing, diagnostics, is_due, named_counts, outgoing
from hil.wire import topics
from hil.wire.intake import Intake

_PERIOD_NS = 500_000_000


class FloodWatch:
    """Reports the finding ``flood`` of an intake, as ``DAEMON_intake``, while there is one and once after."""

    def __init__(self, daemon: str, intake: Intake, hear: Callable[[bytes], None] = lambda _: None) -> None:
        self._node, self._intake, self._hear = f"{daemon}_intake", intake, hear
        self._flooded = False
        self._due_ns = 0

    def reports(self, now_ns: int, clock_ns: int) -> Iterator[Outgoing]:
        """What there is to say, when it is due. ``clock_ns``: the time of the intake's clock."""
        if not is_due(self._due_ns, _PERIOD_NS, now_ns):
            return
        self._due_ns = now_ns + _PERIOD_NS
        text = "; ".join(self._intake.floods(clock_ns).values())
        if text or self._flooded:
            values = named_counts("refused", self._intake.refused())
            values |= named_findings({"flood": text} if text else {})
            said = outgoing(topics.DIAGNOSTICS, diagnostics(self._node, now_ns, text, values), now_ns)
            self._hear(said.payload)
            yield said
        self._flooded = bool(text)
