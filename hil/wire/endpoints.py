"""Where a lab meets unless it is told otherwise: a router on this machine, without keys and with keys."""

from __future__ import annotations

DEFAULT_ENDPOINT, SECURE_ENDPOINT = "tcp/127.0.0.1:7447", "tls/127.0.0.1:7447"
