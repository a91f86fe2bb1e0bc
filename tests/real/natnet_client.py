"""Reads a NatNet server for some seconds with PyPI's natnet, and prints what came as one JSON object."""

from __future__ import annotations

import json
import sys
import time
from typing import Any

from natnet import NatNetClient


def read(command_port: int, seconds: float) -> dict[str, Any]:
    frames: list[Any] = []
    models: list[Any] = []
    client = NatNetClient("127.0.0.1", "127.0.0.1", use_multicast=False, command_port=command_port)
    client.on_data_frame_received_event.handlers.append(frames.append)
    client.on_data_description_received_event.handlers.append(models.append)
    with client:
        version = str(client.protocol_version)
        client.request_modeldef()
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            client.update_sync()
            time.sleep(0.002)
    return {
        "version": version,
        "names": {body.id_num: body.name for body in models[0].rigid_bodies},
        "numbers": [frame.prefix.frame_number for frame in frames],
        "stamps": [frame.suffix.stamp_camera_mid_exposure for frame in frames],
        "tracked": all(body.tracking_valid for frame in frames for body in frame.rigid_bodies),
        "positions": [{body.id_num: body.pos for body in frame.rigid_bodies} for frame in frames],
        "markers": [len(frame.labeled_markers) for frame in frames],
    }


if __name__ == "__main__":
    sys.stdout.write(json.dumps(read(int(sys.argv[1]), float(sys.argv[2]))))
