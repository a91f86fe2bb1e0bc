"""Motive as it stands beside real robots: their poses, from wherever they are told, served by NatNet.

``python tests/real/motive.py CONFIG``, where CONFIG is JSON:

    {"poses_at": 27470, "data_port": 27471, "duration_s": 60, "bodies": ["leader", "follower"],
     "mounts": [[0.02, 0, 0], [0.01, 0, 0.06]], "sigma_position": 0.0003, "sigma_heading": 0.0035}

It hears the true poses of the robots by UDP, as tests/real/rclpy_robots.py sends them, and serves the bodies
that sit on them so, Z up and in metres, at the command port of a Motive that nobody has changed.
"""

from __future__ import annotations

import json
import math
import random
import select
import socket
import struct
import sys
import time
from collections.abc import Iterator

from formation.mount import Mount, body_pose
from formation.pose import Pose
from hil.bridge.datagram_sockets import arrivals, open_socket, send
from hil.bridge.natnet_frame import Body
from hil.bridge.natnet_packets import COMMAND_PORT, VERSIONS, ServerInfo
from hil.bridge.natnet_service import FREQUENCY, NatNetService

_HEIGHT, _MARKER_ERROR = 0.14, 0.0002


def poses_in(data: bytes) -> Iterator[Pose]:
    """Poses of the robots, behind the time of their capture."""
    numbers = struct.unpack(f"<{len(data) // 8}d", data)[1:]
    for k in range(0, len(numbers), 3):
        yield Pose(*numbers[k : k + 3])


def main() -> None:
    given = json.loads(sys.argv[1])
    begun_ns = time.time_ns()
    info = ServerInfo("Motive", "3.1.0.0", VERSIONS[-1], FREQUENCY, given["data_port"])
    service = NatNetService(info, given["bodies"], 120.0, lambda at_ns: at_ns - begun_ns)
    mounts = [Mount(*mount) for mount in given["mounts"]]
    position, heading = given["sigma_position"], given["sigma_heading"]
    drawn, number = random.Random(1), 0
    served = open_socket("127.0.0.1", COMMAND_PORT)
    told = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    told.bind(("127.0.0.1", given["poses_at"]))
    print("ready", flush=True)
    while time.time_ns() < begun_ns + given["duration_s"] * 10**9:
        ready, _, _ = select.select([served, told], [], [], 0.5)
        for data, sender, at_ns in arrivals(served):
            if answer := service.hear(data, sender, at_ns):
                send(served, answer, sender)
        if told not in ready:
            continue
        data = told.recv(1500)
        captured_ns = int(struct.unpack_from("<d", data)[0] * 1e9) - begun_ns
        number += 1
        bodies = []
        for k, (robot, mount) in enumerate(zip(poses_in(data), mounts, strict=True), start=1):
            pose = body_pose(robot, mount)
            theta = pose.theta + drawn.gauss(0.0, heading)
            place = (pose.x + drawn.gauss(0.0, position), pose.y + drawn.gauss(0.0, position), _HEIGHT)
            turn = (0.0, 0.0, math.sin(theta / 2), math.cos(theta / 2))
            bodies.append(Body(k, place, turn, _MARKER_ERROR, tracked=True))
        for packet, address in service.frame(number, bodies, max(0, captured_ns), time.time_ns()):
            send(served, packet, address)


if __name__ == "__main__":
    main()
