"""What is exported: estimates of the log or made anew, and of a damaged log what is whole."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from hil.judge.replayed import ReplayChoice
from hil.log.metadata import scenario_of
from hil.log.reader import DamagedLogError, Log
from hil.log.unpacked import salvaged
from hil.scenario.links import Link, link_of, links_of
from hil.wire import message_types as msg
from hil.wire.messages import typename_of
from hil.wire.topics import link_topics

T = TypeVar("T")


def of_what_is_whole(log: Log, export: Callable[[Log], T]) -> T:
    """What an export of a log gives; if it turns out to be damaged, that of what is whole of it."""
    try:
        return export(log)
    except DamagedLogError:
        if log.damage or log.source is not None:
            raise
    return export(salvaged(log.path))


def recorded_links(log: Log, choice: ReplayChoice) -> Sequence[Link]:
    """Followers whose estimates the log has as they are wanted, none if they are to be made anew."""
    own = scenario_of(log)
    if own is None or choice.chart or choice.estimator or choice.leader or choice.overrides:
        return ()
    links = links_of(own) if choice.follower is None else (link_of(own, choice.follower),)
    made = [log.topics.get(link_topics(link).estimate) == typename_of(msg.LeaderEstimate) for link in links]
    return links if any(made) else ()
