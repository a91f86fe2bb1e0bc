"""What systemd is told of a daemon that it started: that it is ready, alive, and how it is."""

from __future__ import annotations

import os
import socket


def sd_notify(state: str) -> bool:
    """Send a state such as ``READY=1``; False where nobody asked for it, or nobody hears."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address.startswith(("/", "@")):
        return False
    # A name that begins with @ stands for one in the abstract namespace.
    place = "\0" + address[1:] if address[0] == "@" else address
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as mouth:
            mouth.sendto(state.encode(), place)
    except OSError:
        return False
    return True
