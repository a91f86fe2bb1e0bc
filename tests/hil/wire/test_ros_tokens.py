"""Tokens of the ROS graph: what is written is what is read, in both layouts, and Zenoh takes it for a key."""

from __future__ import annotations

import zenoh
from hypothesis import given
from hypothesis import strategies as st

from hil.scenario.files import load_scenario
from hil.wire.key_layout import KeyLayout, layout_of
from hil.wire.ros_tokens import (
    Endpoint,
    all_tokens,
    endpoint_in,
    endpoint_token,
    node_token,
    node_tokens,
    topic_tokens,
)

TOPIC = "follower/cmd_vel"
LAYOUTS = [
    layout_of(
        load_scenario("turtlebot3", [f"wire.layout={kind}", f"wire.prefix={prefix}", f"wire.distro={distro}"])
    )
    for kind in ("ros2dds", "rmw_zenoh")
    for prefix in ("", "lab/east")
    for distro in ("humble", "jazzy")
]


def endpoint(layout: KeyLayout, session: str, topic: str, *, publishes: bool) -> Endpoint:
    node = "abreast_controller" if layout.kind == "rmw_zenoh" else ""
    return Endpoint(session, publishes, layout.within(layout.name(topic)), layout.types[topic], node)


@given(
    layout=st.sampled_from(LAYOUTS),
    session=st.from_regex(r"[0-9a-f]{8,32}", fullmatch=True),
    topic=st.sampled_from(sorted(LAYOUTS[0].types)),
    publishes=st.booleans(),
    number=st.integers(0, 99),
)
def test_what_is_written_is_what_is_read(
    layout: KeyLayout, session: str, topic: str, publishes: bool, number: int
) -> None:
    written = endpoint(layout, session, topic, publishes=publishes)
    token = endpoint_token(layout, number, topic, written)
    assert endpoint_in(layout, token) == written
    assert zenoh.KeyExpr(all_tokens(layout)).includes(zenoh.KeyExpr(token))
    assert str(zenoh.KeyExpr.autocanonize(token)) == token
    for other in layout.types:
        for says in (True, False):
            pattern = zenoh.KeyExpr(topic_tokens(layout, other, publishes=says))
            assert pattern.includes(zenoh.KeyExpr(token)) == ((other, says) == (topic, publishes))
    node = zenoh.KeyExpr(node_tokens(layout))
    assert node.includes(zenoh.KeyExpr(node_token(layout, session, "abreast_controller")))
    assert not node.intersects(zenoh.KeyExpr(token))


def test_a_robots_own_tokens_of_rmw_zenoh_are_those_of_its_topics() -> None:
    """As the design of rmw_zenoh has them: with an enclave and a namespace of the node."""
    layout = layout_of(load_scenario("turtlebot3", ["wire.layout=rmw_zenoh", "wire.domain=30"]))
    hashed = "RIHS01_" + 64 * "0"
    token = zenoh.KeyExpr(
        f"@ros2_lv/30/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MP/%/%follower/diff_drive/%follower%odom/"
        f"nav_msgs::msg::dds_::Odometry_/{hashed}/::,10:,:,:,,"
    )
    assert zenoh.KeyExpr(topic_tokens(layout, "follower/odom", publishes=True)).includes(token)
    assert not zenoh.KeyExpr(topic_tokens(layout, "leader/odom", publishes=True)).includes(token)


def test_a_bridge_reads_type_and_quality_in_its_own_way() -> None:
    """By the bridge's source: slashes are §, then keyless, reliability, durability, history, user data."""
    layout = layout_of(load_scenario("turtlebot3", ["wire.prefix=lab"]))
    token = endpoint_token(layout, 3, TOPIC, endpoint(layout, "ab12", TOPIC, publishes=True))
    place, quality = token.rsplit("/", 1)
    assert place == "@/ab12/@ros2_lv/MP/lab§follower§cmd_vel/geometry_msgs§msg§TwistStamped"
    assert quality == f":1:0:0,10:typehash={layout.type_hash(TOPIC)};"
    assert node_token(layout, "ab12", "x") == "@/ab12/@ros2_lv"


def test_others_tokens_are_no_endpoints_of_topics() -> None:
    for layout in LAYOUTS:
        for token in (
            "",
            node_token(layout, "ab12", "abreast_run"),
            "@/ab12/@ros2_lv/SS/a§b/std_srvs§srv§Empty",
            "@ros2_lv/0/ab12/0/4/SS/%/%/n/%a/std_srvs::srv::dds_::Empty_/RIHS01_ab/::,10:,:,:,,",
            "@ros2_lv/0/ab12/0/4/MP/%/%/n",
        ):
            assert endpoint_in(layout, token) is None
