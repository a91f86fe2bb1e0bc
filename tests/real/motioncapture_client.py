"""Reads frames of a NatNet server with PyPI's motioncapture, and prints what came as one JSON object."""

from __future__ import annotations

import json
import sys
from typing import Any

import motioncapture


def read(command_port: str, count: int) -> dict[str, Any]:
    told = {"hostname": "127.0.0.1", "interface_ip": "127.0.0.1", "port_command": command_port}
    source = motioncapture.connect("optitrack", told)
    frames = []
    for _ in range(count):
        source.waitForNextFrame()
        frames.append({name: body.position.tolist() for name, body in source.rigidBodies.items()})
    return {"frames": frames}


if __name__ == "__main__":
    # It speaks on stdout itself.
    sys.stdout.write(json.dumps(read(sys.argv[1], int(sys.argv[2]))))
