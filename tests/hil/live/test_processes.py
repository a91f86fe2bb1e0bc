from __future__ import annotations

import pytest

from hil.live.crew import APART, FOLLOWERS_PER_PROCESS, TOGETHER, processes_of
from hil.scenario.files import load_scenario
from hil.scenario.links import Link, links_of


def links_of_chain(agents: int) -> tuple[Link, ...]:
    return links_of(load_scenario("chain5-turtlebot3", [f"chain.agents={agents}"]))


@pytest.mark.parametrize("daemons", [TOGETHER, APART])
@pytest.mark.parametrize("agents", [2, 3, 5])
def test_a_pair_and_a_short_chain_have_one_process_for_each_daemon(
    agents: int, daemons: tuple[str, ...]
) -> None:
    named = list(processes_of(links_of_chain(agents), daemons))
    assert named == [(daemon, daemon, ()) for daemon in daemons]


@pytest.mark.parametrize(("shared", "daemons"), [("estimator", APART), ("follower", TOGETHER)])
@pytest.mark.parametrize("over", [2, 4, 6, 14, 27])
def test_in_a_long_chain_every_follower_has_one_process_and_none_has_too_many(
    over: int, shared: str, daemons: tuple[str, ...]
) -> None:
    most = FOLLOWERS_PER_PROCESS[shared]
    links = links_of_chain(most + over)
    processes = list(processes_of(links, daemons))
    assert len({name for name, _, _ in processes}) == len(processes)
    shares = [followers for _, daemon, followers in processes if daemon == shared]
    assert [follower for share in shares for follower in share] == [link.follower for link in links]
    assert len(shares) > 1
    assert all(1 <= len(share) <= most for share in shares)
