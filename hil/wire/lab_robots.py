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
    """A robot of a scenario: its name, body and topics, and where the body sits as far as is known."""

    name: str
    body: str
    odom: str
    cmd_vel: str
    mount: Mount = NO_MOUNT


def robots_of(scenario: Scenario) -> tuple[LabRobot, ...]:
    """The robots of a scenario, the leader first."""
    links = links_of(scenario)
    pairs = [link_topics(link) for link in links]
    names = (scenario.leader.name, *(link.follower for link in links))
    wheels = (pairs[0].leader_odom, *(pair.odom for pair in pairs))
    drives = (pairs[0].leader_cmd_vel, *(pair.cmd_vel for pair in pairs))
    mounts = (Mount(*scenario.leader.mount), *(Mount(*scenario.follower.mount) for _ in links))
    return tuple(map(LabRobot, names, all_bodies(scenario), wheels, drives, mounts))
