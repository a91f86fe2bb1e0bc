"""The wire as a daemon sees it: an inbox of payloads in order of arrival, and a way to publish."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import zenoh

from hil.errors import UsageError
from hil.scenario.schema import Scenario
from hil.wire.clock_query import tell_time
from hil.wire.events import OVERSIZED, TICK, Event
from hil.wire.intake import Intake, intake_of
from hil.wire.key_layout import OURS, KeyLayout, layout_of
from hil.wire.mailbox import Mailbox
from hil.wire.outlet import Outlet, gid_of, origin_of
from hil.wire.ros_tokens import Endpoint, all_tokens, endpoint_in, endpoint_token, node_token
from hil.wire.router_clients import RouterClients
from hil.wire.session import Endpoints, allowed_keys, close_session, open_session
from hil.wire.topics import ARM, STOP, urgent_topics
from hil.wire.undeclare import undeclare

INBOX_LIMIT, INBOX_BYTES = 100_000, 1 << 28
"""Payloads kept waiting at most; more than this is dropped and counted, so that memory stays bounded."""
LARGEST_PAYLOAD_BYTES = 4 << 20
"""A larger one is not taken: no message of a lab is a thousandth of that."""


@dataclass(slots=True)
class Inbox:
    """Payloads in order of arrival. ``dropped``: how many found it full.

    ``intake``: what lets them in; without it all that there is room for. ``put_bytes``, ``taken_bytes``: of
    payloads that ever came in and went out.
    """

    waiting: Mailbox[Event] = field(default_factory=Mailbox)
    dropped: int = 0
    intake: Intake | None = None
    put_bytes: int = 0
    taken_bytes: int = 0
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def put(self, event: Event) -> None:
        """Append an event; called from Zenoh's threads."""
        with self._lock:
            if self.intake is not None and not self.intake.takes(event, time.monotonic_ns()):
                return
            waiting = self.put_bytes - self.taken_bytes + len(event.payload)
            if len(self.waiting) >= INBOX_LIMIT or waiting > INBOX_BYTES:
                self.dropped += 1
                return
            self.put_bytes += len(event.payload)
            self.waiting.put(event)

    def take(self, timeout: float) -> Event | None:
        """Next event, or None after ``timeout`` [s] without one. Called by one thread."""
        event = self.waiting.take(timeout)
        if event is not None:
            self.taken_bytes += len(event.payload)
        return event


class Wire:
    """Subscriptions into one inbox, and publishers that are declared when first used.

    ``urgent``: topics that go ahead of all others; ``layout``: the keys of topics. ``node``: the name under
    which all this shows in the ROS graph; without one it does not. ``allowed``: the keys on which it may
    publish, None for all.
    """

    def __init__(
        self,
        session: zenoh.Session,
        urgent: Iterable[str] = (),
        layout: KeyLayout = OURS,
        node: str = "",
        allowed: frozenset[str] | None = None,
    ) -> None:
        self.inbox = Inbox()
        self._session = session
        self._urgent, self._layout, self._allowed = frozenset(urgent), layout, allowed
        self._outlets: dict[str, Outlet] = {}
        self._subscribers: list[zenoh.Subscriber[None]] = []
        self._tokens: list[zenoh.LivelinessToken] = []
        self._graph: dict[str, Endpoint] = {}
        self._lock = threading.Lock()
        self._node = f"abreast_{node}" if node else ""
        if node:
            self._show(node_token(layout, str(session.zid()), self._node))

    def subscribe(self, topics: Iterable[str], *, shown: bool = True, ours: bool = True) -> None:
        """Let the payloads of the topics into the inbox. ``shown``: in the ROS graph; ``ours``: our own too.

        Zenoh's own thread puts them there, not one for each topic, so that they lie in the order in which
        they came, over all topics. The callback must do nothing else: Zenoh itself would wait for it.
        """
        origin = zenoh.Locality.ANY if ours else zenoh.Locality.REMOTE
        for topic in topics:

            def keep(sample: zenoh.Sample, topic: str = topic) -> None:
                sized = len(sample.payload) <= LARGEST_PAYLOAD_BYTES
                self.inbox.put(
                    Event(topic, sample.payload.to_bytes() if sized else OVERSIZED, origin_of(sample))
                )

            direct = zenoh.handlers.Callback(keep, indirect=False)
            key = self._layout.heard(topic)
            self._subscribers.append(self._session.declare_subscriber(key, direct, allowed_origin=origin))
            if shown:
                self._show_endpoint(topic, publishes=False)

    def publish(self, topic: str, payload: bytes) -> None:
        """Send a payload; urgent topics go ahead of all others.

        A subscriber that cannot follow loses messages rather than holding up everybody else, but for a stop,
        which must arrive. Raises :class:`UsageError` for a topic that is not ours to publish.
        """
        outlet = self._outlets.get(topic)
        if outlet is None:
            outlet = self._declare(topic)
        outlet.put(payload)

    def may_publish(self, topic: str) -> bool:
        """Whether our keys let us publish a topic: a router drops what they don't, and tells nobody."""
        return self._allowed is None or self._layout.heard(topic) in self._allowed

    def watch_graph(self) -> None:
        """Begin to take down who publishes and who hears what, by everybody's tokens."""

        def note(sample: zenoh.Sample) -> None:
            token = str(sample.key_expr)
            if sample.kind == zenoh.SampleKind.DELETE:
                self._graph.pop(token, None)
            elif (endpoint := endpoint_in(self._layout, token)) is not None:
                self._graph[token] = endpoint

        direct = zenoh.handlers.Callback(note, indirect=False)
        watching = self._session.liveliness().declare_subscriber(
            all_tokens(self._layout), direct, history=True
        )
        self._subscribers.append(watching)

    def shown_names(self) -> tuple[str, ...]:
        """Common names of the certificates that the other ends of our links show, of each that shows one."""
        shown = (link.auth_identifier for link in self._session.info.links())
        return tuple(name for name in shown if name)

    def graph(self) -> tuple[Endpoint, ...]:
        """Publishers and subscriptions of everybody, as far as they show in the ROS graph."""
        return tuple(self._graph.copy().values())

    def clients(self) -> RouterClients:
        """Who is connected to the lab's routers, for who asks."""
        return RouterClients(self._session, self._layout)

    def wake(self) -> None:
        """Make a waiting :meth:`Inbox.take` return at once."""
        self.inbox.waiting.put(TICK)

    def close(self) -> None:
        """Take back all declarations; needed before the session is closed."""
        undeclare(*self._tokens)
        undeclare(*self._subscribers)
        undeclare(*(outlet.publisher for outlet in self._outlets.values()))
        self._tokens.clear()
        self._subscribers.clear()
        self._outlets.clear()

    def _declare(self, topic: str) -> Outlet:
        if not self.may_publish(topic):
            raise UsageError(
                f"{self._layout.key(topic)}: our keys do not let us publish there; docs/security.md says who "
                "may; were they made for this scenario, with guards where there are some?"
            )
        with self._lock:
            if (declared := self._outlets.get(topic)) is not None:
                return declared
            return self._declared(topic)

    def _declared(self, topic: str) -> Outlet:
        urgent = topic in self._urgent
        must_arrive = topic in (STOP, ARM)
        congestion = zenoh.CongestionControl.BLOCK if must_arrive else zenoh.CongestionControl.DROP
        key = self._layout.key(topic)
        publisher = self._session.declare_publisher(
            key,
            encoding=zenoh.Encoding.APPLICATION_CDR,
            # Alone in its packet; what many robots are told at once shares one, which halves what it costs.
            express=must_arrive,
            priority=zenoh.Priority.REAL_TIME if urgent else zenoh.Priority.DATA,
            congestion_control=congestion,
        )
        token = self._show_endpoint(topic, publishes=True)
        told = token or f"{self._session.zid()}/{key}"
        outlet = Outlet(publisher, gid_of(told) if self._layout.kind == "rmw_zenoh" else b"")
        self._outlets[topic] = outlet
        return outlet

    def _show_endpoint(self, topic: str, *, publishes: bool) -> str:
        """Show a publisher or a subscription in the ROS graph; its token, empty if it does not show."""
        layout, kind = self._layout, self._layout.types.get(topic)
        if kind is None or not self._node:
            return ""
        session, key = str(self._session.zid()), layout.within(layout.name(topic))
        endpoint = Endpoint(session, publishes, key, kind, self._node)
        token = endpoint_token(layout, len(self._tokens), topic, endpoint)
        self._show(token)
        return token

    def _show(self, token: str) -> None:
        self._tokens.append(self._session.liveliness().declare_token(token))


@contextmanager
def joined(
    endpoints: Endpoints,
    scenario: Scenario,
    node: str = "",
    patience: float = 10.0,
    give_up: Callable[[], bool] = lambda: False,
) -> Iterator[Wire]:
    """The wire of a scenario's lab for as long as the block lasts. ``node``: what the ROS graph shows of us.

    No more is taken in than any sane lab sends.
    The rest is as of :func:`hil.wire.session.open_session`, and so is what it raises.
    """
    allowed = allowed_keys(endpoints)
    session = open_session(endpoints, patience, give_up)
    wire = Wire(session, urgent_topics(scenario), layout_of(scenario), node, allowed)
    clock = tell_time(session)
    wire.inbox.intake = intake_of(scenario)
    try:
        yield wire
    finally:
        undeclare(clock)
        wire.close()
        close_session(session)
