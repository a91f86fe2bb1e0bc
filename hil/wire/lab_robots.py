"""The robots of a lab by a scenario: what they are called, and where they are heard and told to drive."""

from __future__ import annotations

from dataclasses import dataclass

from formation.mount import NO_MOUNT, Mount
from hil.scenario.links import links_of
from hil.scenario.schema import Scenario
from hil.wire.source_topics import all_bodies
from hil.wire.topics import link_topics


@dataclass(frozen=True, slots=True)
class LabRobot:
    """A robot of a scenario: its name, body and topics, and where the body sits as far as is known.

    ``wanted``: where what it is to drive is sent, to its guard where it has one.
    """

    name: str
    body: str
    namespace: str
    odom: str
    cmd_vel: str
    wanted: str
    mount: Mount = NO_MOUNT


def robots_of(scenario: Scenario) -> tuple[LabRobot, ...]:
    """The robots of a scenario, the leader first."""
    links = links_of(scenario)
    pairs = [link_topics(link) for link in links]
    names = (scenario.leader.name, *(link.follower for link in links))
    wheels = (pairs[0].leader_odom, *(pair.odom for pair in pairs))
    drives = (pairs[0].leader_cmd_vel, *(pair.cmd_vel for pair in pairs))
    wanted = (pairs[0].leader_wanted, *(pair.wanted for pair in pairs))
    spaces = (pairs[0].leader, *(pair.follower for pair in pairs))
    mounts = (Mount(*scenario.leader.mount), *(Mount(*scenario.follower.mount) for _ in links))
    bodies = all_bodies(scenario)
    return tuple(map(LabRobot, names, bodies, spaces, wheels, drives, wanted, mounts))
