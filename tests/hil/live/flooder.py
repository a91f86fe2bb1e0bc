"""Somebody who floods a topic: ``python -m tests.hil.live.flooder ENDPOINT TOPIC RATE_HZ``.

Says again whatever it hears there of others, odometry as of now, so that all of it is valid. Prints how
many it has sent, every second, and goes on until it is killed.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

from hil.wire.message_types import Odometry
from hil.wire.messages import decode_as, encode, header
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints, open_session


def main(endpoint: str, topic: str, rate_hz: float) -> None:
    """Flood until killed."""
    wire = Wire(open_session(Endpoints(connect=endpoint), patience=60.0))
    wire.subscribe([topic], ours=False)
    heard, sent, since, told = None, 0, 0.0, 0.0
    while True:
        event = wire.inbox.take(0.0 if heard else 1.0)
        if event is not None:
            since, sent = (since, sent) if heard else (time.monotonic(), 0)
            heard = event.payload
        if heard is None:
            continue
        now = time.monotonic()
        while sent < (now - since) * rate_hz:
            wire.publish(topic, _as_of_now(topic, heard))
            sent += 1
        if now - told > 1.0:
            told = now
            sys.stdout.write(f"{sent}\n")
            sys.stdout.flush()
        time.sleep(0.001)


def _as_of_now(topic: str, payload: bytes) -> bytes:
    if not topic.endswith("odom"):
        return payload
    told = decode_as(payload, Odometry)
    return encode(replace(told, header=header(time.time_ns(), told.header.frame_id)))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], float(sys.argv[3]))
