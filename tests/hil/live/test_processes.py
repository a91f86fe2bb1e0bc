from __future__ import annotations

import pytest

from hil.live.run import DAEMONS, FOLLOWERS_PER_ESTIMATOR, processes_of
from hil.scenario.files import load_scenario
from hil.scenario.links import links_of


@pytest.mark.parametrize("agents", [2, 3, 5])
def test_a_pair_and_a_short_chain_have_one_process_for_each_daemon(agents: int) -> None:
    links = links_of(load_scenario("chain5-turtlebot3", [f"chain.agents={agents}"]))
    assert list(processes_of(links)) == [(daemon, daemon, ()) for daemon in DAEMONS]


@pytest.mark.parametrize("agents", [6, 8, 10, 18, 31])
def test_in_a_long_chain_every_follower_has_one_estimator_and_none_has_too_many(agents: int) -> None:
    links = links_of(load_scenario("chain5-turtlebot3", [f"chain.agents={agents}"]))
    processes = list(processes_of(links))
    assert len({name for name, _, _ in processes}) == len(processes)
    shares = [followers for _, daemon, followers in processes if daemon == "estimator"]
    assert [follower for share in shares for follower in share] == [link.follower for link in links]
    assert all(1 <= len(share) <= FOLLOWERS_PER_ESTIMATOR for share in shares)
