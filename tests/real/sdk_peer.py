"""A node of rmw_zenoh by the client `zenoh-ros2-sdk`, in a process of its own.

`sdk_peer.py PORT DOMAIN SHARE`, SHARE being where the ROS packages keep their types. It says in lines of JSON
what it hears on /stop and /follower/cmd_vel (a Twist). On a line of standard input it publishes that on
/follower/side, or for `graph` says which topics the ROS graph has, and their endpoints.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from zenoh_ros2_sdk import ROS2Publisher, ROS2Subscriber
from zenoh_ros2_sdk.discovery import _query_liveliness, get_topic_names_and_types
from zenoh_ros2_sdk.qos import QosProfile
from zenoh_ros2_sdk.session import ZenohSession

VECTOR, TWIST = "float64 x\nfloat64 y\nfloat64 z\n", "Vector3 linear\nVector3 angular\n"


def say(**told: Any) -> None:
    # In one piece: callbacks of several threads say something.
    sys.stdout.write(json.dumps(told) + "\n")
    sys.stdout.flush()


def hash_of(share: str, typename: str) -> str:
    """What the ROS packages say that the hash of a type is."""
    told = json.loads((Path(share) / f"{typename}.json").read_text(encoding="utf-8"))
    return str(next(each["hash_string"] for each in told["type_hashes"] if each["type_name"] == typename))


def main() -> None:
    port, domain, share = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    at = {"domain_id": domain, "router_port": port}
    session = ZenohSession.get_instance(router_port=port)
    session.register_message_type(VECTOR, "geometry_msgs/msg/Vector3")
    stops = ROS2Subscriber(
        "/stop", "std_msgs/msg/String", lambda got: say(stop=got.data), msg_definition="string data\n", **at
    )
    drives = ROS2Subscriber(
        "/follower/cmd_vel",
        "geometry_msgs/msg/Twist",
        lambda got: say(v=got.linear.x, u=got.angular.z),
        msg_definition=TWIST,
        type_hash=hash_of(share, "geometry_msgs/msg/Twist"),
        **at,
    )
    side = ROS2Publisher("/follower/side", "std_msgs/msg/String", msg_definition="string data\n", **at)
    say(ready=True, string_hash=side.type_hash)
    for line in sys.stdin:
        if line.strip() != "graph":
            side.publish(data=line.strip())
            continue
        found = [each for kind in ("MP", "MS") for each in _query_liveliness(session, domain, kind, 2.0)]
        for each in found:
            each["depth"] = QosProfile.decode(each["qos"]).history_depth
        say(topics=get_topic_names_and_types(domain, router_port=port, timeout=2.0), endpoints=found)
    for each in (stops, drives, side):
        each.close()


if __name__ == "__main__":
    main()
