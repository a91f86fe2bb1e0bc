from __future__ import annotations

import itertools

import pytest

from formation.pose import Pose
from formation.shape import shape_of
from hil.errors import UsageError
from hil.scenario.files import load_scenario, merged_scenario
from hil.scenario.links import Link, link_of, links_of, namespaces_of, node_names
from hil.wire.topics import link_topics

CHAIN = ["chain.agents=4", 'chain.names=["anna", "otto"]']


def test_a_pair_is_one_link_of_itself() -> None:
    scenario = load_scenario("turtlebot3")
    assert links_of(scenario) == (Link(scenario),)
    assert node_names("estimator", links_of(scenario)) == ("estimator",)


def test_everybody_follows_the_one_before_and_knows_of_the_others_by_name_only() -> None:
    links = links_of(load_scenario("turtlebot3", CHAIN))
    assert [(link.leader, link.follower) for link in links] == [
        ("leader", "follower"),
        ("follower", "anna"),
        ("anna", "otto"),
    ]
    assert [sorted(link.others) for link in links] == [
        ["anna", "otto"],
        ["leader", "otto"],
        ["follower", "leader"],
    ]
    assert [link.first for link in links] == [True, False, False]
    shapes = [
        shape_of(Pose(*link.scenario.leader.pose), Pose(*link.scenario.follower.pose)) for link in links
    ]
    for shape in shapes[1:]:
        assert (shape.rho, shape.alpha1, shape.alpha2) == pytest.approx(
            (shapes[0].rho, shapes[0].alpha1, shapes[0].alpha2), abs=1e-12
        )
    for before, after in itertools.pairwise(links):
        assert before.scenario.follower.pose == after.scenario.leader.pose


def test_every_follower_has_nodes_of_its_own_but_there_is_one_emulator() -> None:
    links = links_of(load_scenario("turtlebot3", CHAIN))
    assert node_names("controller", links) == ("controller/follower", "controller/anna", "controller/otto")
    assert node_names("emulator", links) == ("emulator",)


def test_a_predecessor_may_drive_faster_than_the_leader() -> None:
    def limits(*given: str) -> list[tuple[float, float]]:
        links = links_of(load_scenario("turtlebot3", [*CHAIN, *given]))
        return [(link.scenario.leader.k_v, link.scenario.leader.k_u) for link in links]

    assert limits() == [(0.1, 0.7), (0.22, 2.84), (0.22, 2.84)]
    assert limits("robot.v_max=0.2", "chain.k_u=1.0") == [(0.1, 0.7), (0.2, 1.0), (0.2, 1.0)]


def test_agents_without_names_are_numbered() -> None:
    names = [link.follower for link in links_of(load_scenario("turtlebot3", ["chain.agents=5"]))]
    assert names == ["follower", "agent3", "agent4", "agent5"]


def test_mistakes_are_named() -> None:
    with pytest.raises(UsageError, match=r"chain\.names has 1, expected 2"):
        links_of(load_scenario("turtlebot3", ["chain.agents=4", 'chain.names=["anna"]']))
    with pytest.raises(UsageError, match="'leader' stands for two robots"):
        links_of(load_scenario("turtlebot3", ["chain.agents=3", 'chain.names=["leader"]']))
    with pytest.raises(UsageError, match=r"'ann'.*one of: follower, anna, otto"):
        link_of(load_scenario("turtlebot3", CHAIN), "ann")
    with pytest.raises(UsageError, match=r"\[chain\] of 5 agents, expected a pair; a recording is of two"):
        merged_scenario({"base": "chain5"}, "mine", "map mine")


def test_bodies_and_namespaces_are_the_names_unless_a_lab_has_others() -> None:
    (plain,) = links_of(load_scenario("turtlebot3"))
    assert (plain.bodies, namespaces_of(plain.scenario)) == (("leader", "follower"),) * 2
    lab = ["leader.body=1", "follower.body=burger two", "leader.namespace=", "follower.namespace=tb3/b"]
    (named,) = links_of(load_scenario("turtlebot3", lab))
    assert (named.bodies, namespaces_of(named.scenario)) == (("1", "burger two"), ("", "tb3/b"))
    pair = link_topics(named)
    assert (pair.leader_cmd_vel, pair.odom, named.follower) == ("cmd_vel", "tb3/b/odom", "follower")


def test_every_agent_of_a_chain_has_a_body_and_a_namespace() -> None:
    given = ["chain.agents=4", 'chain.bodies=["3","4"]', 'chain.namespaces=["c","d"]', "follower.body=2"]
    links = links_of(load_scenario("turtlebot3", given))
    assert [link.bodies for link in links] == [("leader", "2"), ("2", "3"), ("3", "4")]
    assert [sorted(link.other_bodies) for link in links] == [["3", "4"], ["4", "leader"], ["2", "leader"]]
    assert [link_topics(link).odom for link in links] == ["follower/odom", "c/odom", "d/odom"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["leader.body=1", "follower.body=1"], "'1' stands for two robots.*leader.body and follower.body"),
        (["leader.namespace=", "follower.namespace="], "'' stands for two robots.*namespace"),
        (["chain.agents=3", "follower.body=agent3"], "'agent3' stands for two robots.*chain.bodies"),
        (["chain.agents=3", 'chain.namespaces=["a","b"]'], "chain.namespaces has 2, expected 1"),
    ],
)
def test_one_name_is_one_robot(given: list[str], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        links_of(load_scenario("turtlebot3", given))
