"""Who may see the page and who may give orders by it: by the names that a request gives, and a token."""

from __future__ import annotations

import hmac
import ipaddress
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field
from urllib.parse import urlsplit

SHORTEST_TOKEN = 16


@dataclass(slots=True)
class Admission:
    """``token``: what orders and everything that is shown need. ``names``: what this machine is called.

    ``open``: whether the token is handed to whoever opens the page, on a loopback address; elsewhere it
    comes with the address that is printed. ``refused``: how many requests were, by cause.
    """

    token: str
    names: Collection[str] = ()
    open: bool = False
    refused: Counter[str] = field(default_factory=Counter)

    def admits_host(self, host: str) -> bool:
        """Whether a request was meant for us: by an IP address, or by a name that is ours.

        A page of others whose name was made to lead here comes with its own name.
        """
        return self._noted("host", _name_in(host, self.names))

    def admits_origin(self, origin: str | None, host: str) -> bool:
        """Whether a request comes from a page of ours, and not from one of others in the same browser."""
        return self._noted("origin", origin is not None and _is_origin(origin, host))

    def admits_token(self, token: str) -> bool:
        """Whether the token is ours, compared in a time that tells nothing of it."""
        return self._noted("token", hmac.compare_digest(token.encode(errors="replace"), self.token.encode()))

    def refuse(self, cause: str) -> None:
        """Count a request that was refused for another reason."""
        self.refused[cause] += 1

    def _noted(self, cause: str, admitted: bool) -> bool:
        if not admitted:
            self.refused[cause] += 1
        return admitted


def _name_in(host: str, names: Collection[str]) -> bool:
    try:
        name = urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return False
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return name == "localhost" or name in {each.lower() for each in names}
    return True


def _is_origin(origin: str, host: str) -> bool:
    try:
        parts = urlsplit(origin)
    except ValueError:
        return False
    return parts.scheme in ("http", "https") and parts.netloc.lower() == host.lower()
