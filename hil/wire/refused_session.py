"""Why there is no session at an endpoint, found out by knocking there: Zenoh itself does not tell."""

from __future__ import annotations

import re
import socket
import ssl

from hil.wire.role_keys import RoleKeys

_KNOCK_S = 1.0
_PLACE = re.compile(r"(tcp|tls)/(.+):(\d+)")
_NOBODY = "is the router up, and is the endpoint right?"


def reason_for(endpoint: str, keys: RoleKeys | None) -> str:
    """What is wrong and what to do about it, in words, as far as knocking at an endpoint tells."""
    found = _PLACE.fullmatch(endpoint)
    if found is None:
        return _NOBODY
    protocol, host, port = found.group(1), found.group(2).strip("[]"), int(found.group(3))
    try:
        with socket.create_connection((host, port), timeout=_KNOCK_S) as knocking:
            if keys is None:
                hint = " if that router has keys" if protocol == "tcp" else ""
                return f"somebody is there, who lets nobody in like this: give --secure DIR{hint}"
            return _shown(knocking, host, keys)
    except OSError:
        return _NOBODY


def _shown(knocking: socket.socket, host: str, keys: RoleKeys) -> str:
    """What either side says to the other's certificate."""
    context = ssl.create_default_context(cafile=str(keys.authority))
    try:
        context.load_cert_chain(keys.certificate, keys.secret)
        with context.wrap_socket(knocking, server_hostname=host) as shown:
            # What the other side thinks of ours comes after the handshake.
            shown.recv(1)
    except ssl.SSLCertVerificationError as error:
        return f"the router's certificate is refused by {keys.folder} ({error.verify_message}): {_CURE}"
    except ssl.SSLError as error:
        alert = (error.reason or "handshake failed").lower().replace("_", " ")
        return f"the router refuses the {keys.role}'s certificate of {keys.folder} ({alert}): {_CURE}"
    except TimeoutError:
        pass
    return "its certificate and ours are accepted, and yet it opens no session: is it an abreast router?"


_CURE = (
    "use the keys that were made together with the router's, by abreast secure init with --host of where "
    "it is reached"
)
