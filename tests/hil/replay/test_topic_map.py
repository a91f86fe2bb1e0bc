from __future__ import annotations

from pathlib import Path

import pytest

from hil.errors import UsageError
from hil.replay.topic_map import load_topic_map

TOPICS = '[topics]\nrigid_bodies = "/frames"\nodometry = "/odom"\n'


def written(folder: Path, text: str) -> str:
    (folder / "lab.toml").write_text(text)
    return str(folder / "lab.toml")


def test_a_map_leads_to_a_scenario_over_its_base(tmp_path: Path) -> None:
    text = f"""{TOPICS}
[scenario]
base = "turtlebot3"
estimator = {{ sigma_position = 0.001 }}
leader = {{ name = "first", program = {{ kind = "constant", v = 0.1 }} }}
"""
    chart = load_topic_map(written(tmp_path, text), None, None, ["estimator.kind=ukf"])
    assert chart.scenario.name == "lab"
    assert chart.scenario.estimator.sigma_position == 0.001
    assert chart.scenario.estimator.kind == "ukf"
    assert chart.scenario.controller.mu_rho == 20.0
    assert (chart.leader, chart.follower) == ("first", "follower")
    assert chart.topics.odometry == "odom"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (TOPICS + "odom = 1", r"map lab: \[topics\] has an unknown key 'odom'; did you mean 'odometry'"),
        ('[topic]\nodometry = "o"', r"unknown key 'topic'; did you mean 'topics'|topics"),
        (
            '[topics]\nrigid_bodies = "/frames"\n[scenario.estimator]\nown_motion = "fused"',
            r"topics.odometry is missing, and estimator.own_motion is 'fused'",
        ),
        ('[topics]\nodometry = "/odom"', r"give rigid_bodies, or both of leader_pose and follower_pose"),
        ('[topics]\nodometry = "o"\nleader_pose = "l"', r"give rigid_bodies, or both"),
        (TOPICS + 'leader_pose = "l"', r"give either rigid_bodies or leader_pose and follower_pose"),
        (TOPICS + 'stamps = "receive"', r"topics.stamps is 'receive'"),
        (TOPICS + "pair_within_s = -1", r"topics.pair_within_s is -1: expected float >= 0"),
        (TOPICS + '[scenario]\nbase = "turtlebot4"', r"'turtlebot4': .* did you mean 'turtlebot3'"),
        (TOPICS + "[scenario.estimator]\nsigma = 1", r"map lab: scenario: \[estimator\] has an unknown key"),
        (
            TOPICS + "[columns]",
            r"map lab: maps the columns of a CSV recording; take it to: abreast import csv",
        ),
        ("[topics", r"map .*lab.toml: not readable as TOML"),
    ],
)
def test_a_mistake_in_a_map_is_one_line_that_helps(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=said) as caught:
        load_topic_map(written(tmp_path, text))
    assert "\n" not in str(caught.value)


def test_a_map_may_do_without_odometry(tmp_path: Path) -> None:
    chart = load_topic_map(written(tmp_path, '[topics]\nrigid_bodies = "/frames"'))
    assert chart.topics.odometry is None
    assert chart.scenario.estimator.own_motion == "auto"


def test_a_map_that_is_not_there_is_said_so() -> None:
    with pytest.raises(UsageError, match=r"map 'nowhere\.toml': no such name and no such file"):
        load_topic_map("nowhere.toml")
