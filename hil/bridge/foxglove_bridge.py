"""The wire served to Foxglove and Lichtblick over their WebSocket protocol, with transforms and a scene."""

from __future__ import annotations

import importlib
import logging
import time
from collections.abc import Iterable
from typing import Any

from hil.errors import AbreastError
from hil.extras import needs_extra
from hil.nodes.node import Outgoing
from hil.scenario.schema import Scenario
from hil.scene.lab_scene import TYPES, LabScene
from hil.wire.events import OVERSIZED, Event
from hil.wire.messages import definition
from hil.wire.pubsub import Wire
from hil.wire.topics import ONLY_IN_LOGS, types_of

PORT = 8765
"""Where viewers look first."""

_AT_MOST = 2000


class FoxgloveBridge:
    """Serves what it hears to whoever looks; nobody can send anything through it.

    What nobody looks at costs next to nothing. ``address``, ``port`` (0: any that is free): where it serves;
    ``url`` is what viewers connect to. Raises :class:`UsageError` without the extra ``foxglove``, and
    :class:`AbreastError` where it cannot serve.
    """

    def __init__(self, wire: Wire, scenario: Scenario, address: str, port: int) -> None:
        sdk = _sdk()
        types = {name: kind for name, kind in types_of(scenario).items() if name not in ONLY_IN_LOGS}
        # Its channels are closed where nobody holds it.
        self._context = context = sdk.Context()
        self._channels = {name: _channel(sdk, context, f"/{name}", kind) for name, kind in types.items()}
        self._shown = {name: _channel(sdk, context, name, kind) for name, kind in TYPES.items()}
        self._wire, self._scene = wire, LabScene(scenario)
        self._server = _served(sdk, context, scenario.name, address, port)
        self.url = f"ws://{address}:{self._server.port}"
        wire.subscribe(types, shown=False)

    def wait(self, timeout: float) -> None:
        """Pass on what has come, after at most ``timeout`` [s] without anything."""
        event = self._wire.inbox.take(timeout)
        for _ in range(_AT_MOST):
            if event is None:
                return
            self._pass_on(event)
            event = self._wire.inbox.take(0.0)

    def take(self, now_ns: int) -> Iterable[Outgoing]:
        """Nothing to publish: it only listens."""
        return ()

    def end(self, now_ns: int) -> Iterable[Outgoing]:
        """Nothing either."""
        return ()

    def close(self) -> None:
        """Serve nobody any more."""
        self._server.stop()

    def _pass_on(self, event: Event) -> None:
        channel = self._channels.get(event.topic)
        if channel is None or event.payload == OVERSIZED:
            return
        now_ns = time.time_ns()
        channel.log(event.payload, log_time=now_ns)
        if any(each.has_sinks() for each in self._shown.values()):
            for told in self._scene.hear(event.topic, event.payload, now_ns):
                self._shown[told.topic].log(told.payload, log_time=now_ns)


def _sdk() -> Any:
    # That a viewer went away is nothing to tell; what keeps us from serving is raised.
    logging.getLogger("foxglove").setLevel(logging.CRITICAL)
    try:
        return importlib.import_module("foxglove")
    except ModuleNotFoundError as error:
        raise needs_extra("bridge foxglove", error) from None


def _channel(sdk: Any, context: Any, topic: str, typename: str) -> Any:
    schema = sdk.Schema(name=typename, encoding="ros2msg", data=definition(typename).encode())
    return sdk.Channel(topic, schema=schema, message_encoding="cdr", context=context)


def _served(sdk: Any, context: Any, name: str, address: str, port: int) -> Any:
    try:
        return sdk.start_server(name=f"abreast {name}", host=address, port=port, context=context)
    except Exception as error:
        raise AbreastError(
            f"bridge foxglove: cannot serve at {address}:{port} ({error}); give another --port or --address"
        ) from None
