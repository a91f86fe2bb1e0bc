"""What a daemon says of topics on which more than one sends."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from hil.nodes.findings import named_findings
from hil.nodes.node import Outgoing, diagnostics, is_due, named_counts, outgoing
from hil.wire import topics
from hil.wire.outlet import UNSIGNED
from hil.wire.router_clients import RouterClients, named_suspects
from hil.wire.senders import SenderWatch

_PERIOD_NS = 500_000_000


class SenderReports:
    """Reports the finding ``second_sender`` as ``DAEMON_senders``, while there is one and once after.

    ``clients``: who may have sent what nobody signed.
    """

    def __init__(
        self,
        daemon: str,
        watch: SenderWatch,
        clients: RouterClients,
        hear: Callable[[bytes], None] = lambda _: None,
    ) -> None:
        self._node, self._watch, self._hear = f"{daemon}_senders", watch, hear
        self._clients = clients
        self._spoke = False
        self._due_ns = 0

    def reports(self, now_ns: int, clock_ns: int) -> Iterator[Outgoing]:
        """What there is to say, when it is due. ``clock_ns``: the time of the watch's clock."""
        if not is_due(self._due_ns, _PERIOD_NS, now_ns):
            return
        self._due_ns = now_ns + _PERIOD_NS
        text = "; ".join(self._watch.second_senders(clock_ns))
        if UNSIGNED in text:
            text = named_suspects(text, self._clients.suspects())
            self._clients.ask()
        if text or self._spoke:
            values = named_counts("refused", self._watch.refused)
            values |= named_findings({"second_sender": text} if text else {})
            said = outgoing(topics.DIAGNOSTICS, diagnostics(self._node, now_ns, text, values), now_ns)
            self._hear(said.payload)
            yield said
        self._spoke = bool(text)
