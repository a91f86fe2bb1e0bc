from __future__ import annotations

import pytest

from hil.errors import UsageError
from hil.scenario.files import load_scenario
from hil.wire.key_layout import layout_of
from hil.wire.source_topics import SourceTopic, all_bodies, converts, source_topics
from hil.wire.topics import RIGID_BODIES

NAMED = ["leader.body=1", "follower.body=2"]


def test_frames_that_come_as_ours_need_no_other_topic() -> None:
    plain = load_scenario("turtlebot3")
    assert (converts(plain), source_topics(plain)) == (False, {})


@pytest.mark.parametrize("change", ["up=y", "scale=0.001", "stamp=receive", "type=TFMessage"])
def test_frames_are_made_where_anything_differs(change: str) -> None:
    scenario = load_scenario("turtlebot3", [f"source.{change}"])
    (topic,) = source_topics(scenario)
    keys = [layout_of(scenario).key(each) for each in (topic, RIGID_BODIES)]
    assert keys == [topic.removeprefix("source/"), "abreast/rigid_bodies"]


def test_a_topic_for_each_body_has_its_name_in_it() -> None:
    scenario = load_scenario(
        "turtlebot3",
        [*NAMED, "source.type=PoseStamped", "source.topic=/mocap/{body}/pose", "wire.prefix=lab"],
    )
    pose = "geometry_msgs/msg/PoseStamped"
    assert source_topics(scenario) == {
        "source/mocap/1/pose": SourceTopic("mocap/1/pose", pose, "1"),
        "source/mocap/2/pose": SourceTopic("mocap/2/pose", pose, "2"),
    }
    assert layout_of(scenario).key("source/mocap/2/pose") == "lab/mocap/2/pose"


def test_all_robots_of_a_chain_have_bodies() -> None:
    scenario = load_scenario("turtlebot3", [*NAMED, "chain.agents=4"])
    assert all_bodies(scenario) == ("1", "2", "agent3", "agent4")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (["source.type=PoseStamped", "source.topic=pose"], "PoseStamped does not say whose it is"),
        (["source.type=NamedPoseArray", "source.topic={body}/poses"], "NamedPoseArray holds all bodies"),
    ],
)
def test_a_topic_that_cannot_be_is_refused(changes: list[str], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        source_topics(load_scenario("turtlebot3", changes))
