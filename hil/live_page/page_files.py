"""The files of the page as they are shipped, and the headers that they are sent with."""

from __future__ import annotations

import functools
from importlib.resources import files

_TYPES = {"html": "text/html", "css": "text/css", "js": "text/javascript"}
START = "page.html"


@functools.cache
def page_files() -> dict[str, tuple[str, bytes]]:
    """Type and content of each file by its name."""
    return {
        each.name: (f"{_TYPES[each.name.rpartition('.')[2]]}; charset=utf-8", each.read_bytes())
        for each in files("hil.live_page").iterdir()
        if each.name.rpartition(".")[2] in _TYPES
    }


def headers(host: str) -> dict[str, str]:
    """Headers of everything that is sent to a browser that came to ``host``.

    Nothing of others is loaded, run or asked for, and no other page may hold this one.
    """
    policy = {
        "default-src": "'none'",
        "script-src": "'self'",
        "style-src": "'self'",
        "img-src": "data:",
        # Older browsers do not take a websocket for a part of 'self'.
        "connect-src": f"'self' ws://{host}",
        "base-uri": "'none'",
        "form-action": "'none'",
        "frame-ancestors": "'none'",
    }
    return {
        "Content-Security-Policy": "; ".join(f"{name} {value}" for name, value in policy.items()),
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Cross-Origin-Opener-Policy": "same-origin",
        "Cache-Control": "no-store",
    }
