from __future__ import annotations

from hil.scenario.files import load_scenario
from hil.wire.key_layout import OURS, layout_of
from hil.wire.topics import RIGID_BODIES


def test_a_topic_is_its_own_key_unless_the_lab_has_another_name_for_it() -> None:
    plain = layout_of(load_scenario("turtlebot3"))
    assert (plain, plain.key("follower/odom")) == (OURS, "follower/odom")
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
