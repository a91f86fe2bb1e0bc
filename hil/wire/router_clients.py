"""Who is connected to the lab's routers and shows no part in it: suspects for what nobody has signed."""

from __future__ import annotations

import json
import threading
from typing import Any

import zenoh

from hil.wire.key_layout import KeyLayout
from hil.wire.outlet import UNSIGNED
from hil.wire.ros_tokens import all_tokens, session_in

ROUTERS = "@/*/router"
"""Where routers tell who is connected to them, if they are let."""

_PATIENCE_S = 1.0
_MOST = 20


class RouterClients:
    """Sessions connected to routers, and those of them that show in the ROS graph, as asked for last.

    Answers come by Zenoh's threads; what is asked for is there a moment later.
    """

    def __init__(self, session: zenoh.Session, layout: KeyLayout) -> None:
        self._session, self._layout = session, layout
        self._clients: dict[str, str] = {}
        self._shown: set[str] = {str(session.zid())}
        self._answered = threading.Event()

    def ask(self) -> None:
        """Ask routers who is connected, and everybody who shows in the ROS graph to say so."""
        answers = zenoh.handlers.Callback(self._hear, indirect=False)
        tokens = zenoh.handlers.Callback(self._see, indirect=False)
        self._session.liveliness().get(all_tokens(self._layout), tokens, timeout=_PATIENCE_S)
        self._session.get(ROUTERS, answers, timeout=_PATIENCE_S)

    def wait(self, seconds: float) -> None:
        """Wait until a router has answered, at most so long."""
        self._answered.wait(seconds)

    def suspects(self) -> list[str]:
        """Ids and addresses of those who are connected and show no part."""
        clients = self._clients.copy()
        return [f"session {who} at {where}" for who, where in clients.items() if who not in self._shown]

    def _hear(self, reply: zenoh.Reply) -> None:
        if reply.ok is None:
            return
        try:
            told: Any = json.loads(reply.ok.payload.to_bytes())
            found = {
                str(each["peer"]): str(each["links"][0]["dst"]).partition("?")[0]
                for each in told["sessions"][:_MOST]
                if each["whatami"] == "client"
            }
        except (ValueError, KeyError, TypeError, IndexError):
            return
        self._clients |= found
        self._answered.set()

    def _see(self, reply: zenoh.Reply) -> None:
        if reply.ok is not None and (shown := session_in(self._layout, str(reply.ok.key_expr))):
            self._shown.add(shown)


def named_suspects(text: str, suspects: list[str]) -> str:
    """A text that tells of somebody who did not sign, with those who may have been it.

    >>> named_suspects("somebody without a session says stop", ["session 7f at tcp/192.0.2.9:4711"])
    'somebody without a session (perhaps session 7f at tcp/192.0.2.9:4711) says stop'
    """
    return text.replace(UNSIGNED, f"{UNSIGNED} (perhaps {' or '.join(suspects)})") if suspects else text
