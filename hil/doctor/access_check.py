"""Check of who may do what on the wire: keys, or a lab that is open to whoever reaches its router."""

from __future__ import annotations

import re
import socket
from collections.abc import Sequence

from hil.doctor.check import Check
from hil.wire.role_keys import RoleKeys
from hil.wire.session import Endpoints, session_config
from hil.wire.session_config import connects_to, listens_at

_EXPECTED = "keys of a lab (--secure), or a router that only this machine reaches"
_PLACE = re.compile(r"[a-z]+/(.+):(\d+)(?:[?#].*)?")
_LOOPBACK = re.compile(r"127\.[0-9.]+|localhost|\[?::1\]?")
_KNOCK_S = 0.5
_ELSEWHERE = ("192.0.2.1", 9)
"""An address to which nothing is sent: it only tells by which of ours one would go there."""


def access_of_lab(endpoints: Endpoints, shown: Sequence[str]) -> Check:
    """Who may do what, by our endpoints and the names that the other ends' certificates ``shown``."""
    config = session_config(endpoints)
    places = [*connects_to(config), *listens_at(config)]
    reached = next((found for place in places if (found := reached_by_others(place))), "")
    return access_check(places, endpoints.keys, shown, reached)


def access_check(places: Sequence[str], keys: RoleKeys | None, shown: Sequence[str], reached: str) -> Check:
    """The same by what is known: endpoints, keys, and where others reach the router, empty for nowhere.

    An open lab is no failure, as it may be in a network of its own; that it is open is said with what to do.
    """
    encrypted = all(place.startswith(("tls/", "quic/")) for place in places)
    if keys is not None:
        whom = ", ".join(shown) or "somebody without a name"
        return Check("access", True, f"by keys: we are {keys.role}, at the other end is {whom}", _EXPECTED)
    if encrypted:
        return Check("access", True, f"encrypted by a configuration of your own: {places[0]}", _EXPECTED)
    if not reached:
        return Check("access", True, "open, to this machine only", _EXPECTED)
    seen = f"open: whoever reaches {reached} may drive and stop all robots"
    advice = "fine in a network of its own; else abreast secure init DIR, and --secure DIR for all"
    return Check("access", True, seen, _EXPECTED, advice)


def reached_by_others(endpoint: str) -> str:
    """Where other machines reach the router at an endpoint, empty if they do not.

    One that we reach by loopback may listen on all interfaces, which shows by knocking at another one.
    """
    found = _PLACE.fullmatch(endpoint)
    if found is None:
        return ""
    host, port = found.group(1), int(found.group(2))
    if not _LOOPBACK.fullmatch(host):
        return endpoint
    own = _own_address()
    if not own or _LOOPBACK.fullmatch(own):
        return ""
    try:
        socket.create_connection((own, port), timeout=_KNOCK_S).close()
    except OSError:
        return ""
    return f"{endpoint.partition('/')[0]}/{own}:{port}"


def _own_address() -> str:
    """Our address in a network, empty without one."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(_ELSEWHERE)
        except OSError:
            return ""
        address: str = probe.getsockname()[0]
        return address
