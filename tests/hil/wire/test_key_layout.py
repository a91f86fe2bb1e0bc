from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.scenario.files import load_scenario
from hil.wire.key_layout import dds_type, layout_of, ros_type
from hil.wire.topics import RIGID_BODIES

NAMES = st.from_regex(r"[A-Za-z][A-Za-z0-9_]*", fullmatch=True)


def test_a_topic_is_its_own_key_unless_the_lab_has_another_name_for_it() -> None:
    plain = layout_of(load_scenario("turtlebot3"))
    assert (plain.key("follower/odom"), plain.heard("follower/odom")) == ("follower/odom", "follower/odom")
    lab = load_scenario(
        "turtlebot3",
        [
            "wire.prefix=lab7/east",
            'wire.topics={"follower/odom"="/tb3_1/wheel/odom"}',
            "source.topic=/optitrack/rigid_bodies",
        ],
    )
    keys = [layout_of(lab).key(topic) for topic in ("follower/odom", RIGID_BODIES, "follower/cmd_vel")]
    assert keys == [
        "lab7/east/tb3_1/wheel/odom",
        "lab7/east/optitrack/rigid_bodies",
        "lab7/east/follower/cmd_vel",
    ]


def test_rmw_zenoh_has_domain_type_and_hash_in_its_keys() -> None:
    lab = ["wire.layout=rmw_zenoh", "wire.domain=7", 'wire.topics={"follower/odom"="/tb3_1/odom"}']
    layout = layout_of(load_scenario("turtlebot3", lab))
    known = "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"
    assert layout.key("follower/odom") == f"7/tb3_1/odom/nav_msgs::msg::dds_::Odometry_/{known}"
    assert layout.heard("follower/odom") == "7/tb3_1/odom/nav_msgs::msg::dds_::Odometry_/*"
    humble = layout_of(load_scenario("turtlebot3", [*lab, "wire.distro=humble", "wire.prefix=lab"]))
    assert (
        humble.key("follower/odom") == "lab/7/tb3_1/odom/nav_msgs::msg::dds_::Odometry_/TypeHashNotSupported"
    )


@given(package=NAMES, name=NAMES)
def test_a_type_is_found_by_what_it_is_called_in_dds(package: str, name: str) -> None:
    typename = f"{package}/msg/{name}"
    assert ros_type(dds_type(typename)) == typename


@pytest.mark.parametrize("name", ["", "a::b", "nav_msgs::msg::dds_::Odometry", "::::::"])
def test_what_is_no_name_in_dds_stays_as_it_is(name: str) -> None:
    assert ros_type(name) == name
