"""The layout of rmw_zenoh against a client of others, and our type hashes against those of ROS."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire.key_layout import layout_of
from hil.wire.messages import encode, rihs01
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint
from hil.wire.topics import types_of
from tests.real.ros_lab import HERE, ROOT, Peer, peer

pytestmark = pytest.mark.slow

DOMAIN = 7
SETTINGS = ["wire.layout=rmw_zenoh", f"wire.domain={DOMAIN}", "controller.command_type=Twist"]


def share_of(python: Path) -> Path:
    """Where the ROS packages of the peers keep their types."""
    return python.parent.parent / "share"


@contextmanager
def talking(python: Path) -> Iterator[tuple[Wire, Peer]]:
    """A wire of ours and a node of theirs at one router."""
    with reserved_endpoint() as endpoint:
        session = open_session(Endpoints(listen=endpoint))
        wire = Wire(session, layout=layout_of(load_scenario("turtlebot3", SETTINGS)), node="controller")
        command = [str(HERE / "sdk_peer.py"), endpoint.rpartition(":")[2], str(DOMAIN), str(share_of(python))]
        try:
            with peer("SDK", command, python) as theirs:
                theirs.wait_for("ready")
                yield wire, theirs
        finally:
            wire.close()
            close_session(session)


def heard_by(theirs: Peer, key: str) -> list[Any]:
    lines = [json.loads(line) for line in theirs.lines if line.startswith("{")]
    return [line[key] for line in lines if key in line]


def test_messages_go_both_ways(peers: Path) -> None:
    with talking(peers) as (wire, theirs):
        wire.subscribe(["follower/side"])
        drive = msg.Twist(
            linear=msg.Vector3(x=0.125, y=0.0, z=0.0), angular=msg.Vector3(x=0.0, y=0.0, z=-0.5)
        )
        until, sides = time.monotonic() + 20.0, list[bytes]()
        while time.monotonic() < until and not (sides and heard_by(theirs, "stop") and heard_by(theirs, "v")):
            wire.publish("stop", encode(msg.String(data="by us")))
            wire.publish("follower/cmd_vel", encode(drive))
            theirs.say("left")
            while (event := wire.inbox.take(0.1)) is not None:
                sides.append(event.payload)
        assert sides
        assert set(sides) == {encode(msg.String(data="left"))}
        assert set(heard_by(theirs, "stop")) == {"by us"}
        assert (set(heard_by(theirs, "v")), set(heard_by(theirs, "u"))) == ({0.125}, {-0.5})


def test_all_that_we_publish_and_hear_shows_in_their_graph(peers: Path) -> None:
    with talking(peers) as (wire, theirs):
        wire.subscribe(["follower/odom"])
        wire.publish("follower/command", b"")
        theirs.say("graph")
        theirs.wait_for("endpoints")
        topics = dict(heard_by(theirs, "topics")[0])
        assert topics["/follower/odom"] == ["nav_msgs/msg/Odometry"]
        assert topics["/follower/command"] == ["abreast_msgs/msg/Command"]
        ours = [
            each for each in heard_by(theirs, "endpoints")[0] if each["node_name"] == "abreast_controller"
        ]
        assert {(each["kind"], each["qualified_name"]) for each in ours} == {
            ("MS", "/follower/odom"),
            ("MP", "/follower/command"),
        }
        assert {each["type_hash"] for each in ours} == {
            rihs01("nav_msgs/msg/Odometry"),
            rihs01("abreast_msgs/msg/Command"),
        }
        assert {each["depth"] for each in ours} == {10}


def test_hashes_of_types_are_those_of_ros(peers: Path) -> None:
    told: dict[str, str] = {}
    for path in sorted(share_of(peers).glob("*/msg/*.json")):
        hashes = json.loads(path.read_text(encoding="utf-8"))["type_hashes"]
        told |= {each["type_name"]: each["hash_string"] for each in hashes}
    scenario = load_scenario("turtlebot3")
    ours = set(types_of(scenario).values()) | {
        f"geometry_msgs/msg/{name}"
        for name in ("Twist", "PoseStamped", "PoseWithCovarianceStamped", "TransformStamped")
    }
    known = sorted(ours & told.keys())
    assert len(known) >= 8
    assert {typename: rihs01(typename) for typename in known} == {
        typename: told[typename] for typename in known
    }


def test_ros_reads_every_message_of_our_package(peers: Path) -> None:
    package = ROOT / "ros" / "abreast_msgs" / "msg"
    read = (
        "import sys; from rosidl_adapter.parser import parse_message_file\n"
        "for path in sys.argv[1:]: print(len(parse_message_file('abreast_msgs', path).fields))"
    )
    paths = sorted(map(str, package.glob("*.msg")))
    done = subprocess.run([str(peers), "-c", read, *paths], capture_output=True, text=True, check=True)
    store = get_typestore(Stores.ROS2_JAZZY)
    for path in map(Path, paths):
        store.register(get_types_from_msg(path.read_text(encoding="utf-8"), f"abreast_msgs/msg/{path.stem}"))
    ours = [len(store.fielddefs[f"abreast_msgs/msg/{Path(path).stem}"][1]) for path in paths]
    assert [int(line) for line in done.stdout.split()] == ours
    assert ours
