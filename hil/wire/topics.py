"""Topics of a scenario: their names on the wire (a ROS topic without its leading slash) and their types."""

from __future__ import annotations

from dataclasses import dataclass

from hil.scenario.links import Link, links_of, namespaces_of
from hil.scenario.schema import Scenario
from hil.wire.message_types import (
    CertifiedEstimate,
    Command,
    DiagnosticArray,
    LeaderEstimate,
    Malformed,
    Odometry,
    RangeBearing,
    RigidBodies,
    String,
    Truth,
    Twist,
    TwistStamped,
)
from hil.wire.messages import typename_of

RIGID_BODIES = "rigid_bodies"
TRUTH = "truth"
DIAGNOSTICS = "diagnostics"
STOP = "stop"
ARM = "arm"
"""Lets robots be driven again that their guards hold: the name of one, empty for all."""
WANTED = "cmd_vel_wanted"
MALFORMED = "malformed"
LOG = "abreast/log"
"""What a log says of itself, again and again; :mod:`hil.log.description`."""

ONLY_IN_LOGS = (MALFORMED, LOG)
"""Topics that are no part of what robots and daemons say: whoever records writes them."""


def within(namespace: str, name: str) -> str:
    """A name in a namespace, which may be empty."""
    return f"{namespace}/{name}" if namespace else name


@dataclass(frozen=True, slots=True)
class Topics:
    """The topics of a leader and a follower in namespaces of theirs, empty for none.

    ``stamped``: whether drivers take stamped commands. ``truth``: where the emulator tells their true state.
    ``guarded``: whether robots have guards, which take what is wanted of them and alone tell their drivers.
    """

    leader: str
    follower: str
    stamped: bool
    truth: str = TRUTH
    guarded: bool = False

    @property
    def leader_odom(self) -> str:
        """Wheel odometry of the leader; the follower does not read it."""
        return within(self.leader, "odom")

    @property
    def leader_cmd_vel(self) -> str:
        """What the leader is told to drive; read by the law ``ideal`` only, which needs its turn rate."""
        return within(self.leader, "cmd_vel")

    @property
    def odom(self) -> str:
        """Wheel odometry of the follower."""
        return within(self.follower, "odom")

    @property
    def cmd_vel(self) -> str:
        """What the follower is told to drive."""
        return within(self.follower, "cmd_vel")

    @property
    def leader_wanted(self) -> str:
        """Where whoever drives the leader sends: to its guard, without one to its driver."""
        return within(self.leader, WANTED) if self.guarded else self.leader_cmd_vel

    @property
    def wanted(self) -> str:
        """Where the follower's controller sends: to its guard, without one to its driver."""
        return within(self.follower, WANTED) if self.guarded else self.cmd_vel

    @property
    def wanted_stamped(self) -> bool:
        """Whether what is wanted is stamped; for guards always."""
        return self.guarded or self.stamped

    @property
    def sighting(self) -> str:
        """Range and bearing of the leader from a sensor on the follower."""
        return within(self.follower, "leader_sighting")

    @property
    def estimate(self) -> str:
        """What the follower believes of the leader."""
        return within(self.follower, "leader_estimate")

    @property
    def certified(self) -> str:
        """The same with guaranteed error radii, where ``estimator.certify`` asks for them."""
        return within(self.follower, "certified")

    @property
    def command(self) -> str:
        """The controller's decision with its reasons."""
        return within(self.follower, "command")

    @property
    def side(self) -> str:
        """Orders to the follower: the side of its leader that it is to drive on, left or right."""
        return within(self.follower, "side")

    @property
    def types(self) -> dict[str, str]:
        """Type name of every topic."""
        drive = TwistStamped if self.stamped else Twist
        wanted = TwistStamped if self.wanted_stamped else Twist
        return {
            RIGID_BODIES: typename_of(RigidBodies),
            self.leader_odom: typename_of(Odometry),
            self.odom: typename_of(Odometry),
            self.leader_cmd_vel: typename_of(drive),
            self.cmd_vel: typename_of(drive),
            **dict.fromkeys((self.leader_wanted, self.wanted), typename_of(wanted)),
            self.sighting: typename_of(RangeBearing),
            self.estimate: typename_of(LeaderEstimate),
            self.certified: typename_of(CertifiedEstimate),
            self.command: typename_of(Command),
            self.side: typename_of(String),
            self.truth: typename_of(Truth),
            DIAGNOSTICS: typename_of(DiagnosticArray),
            STOP: typename_of(String),
            **({ARM: typename_of(String)} if self.guarded else {}),
            MALFORMED: typename_of(Malformed),
            LOG: typename_of(String),
        }


def topics_of(scenario: Scenario) -> Topics:
    """Topics of a scenario's leader and follower, of a chain the first two agents."""
    return link_topics(Link(scenario))


def link_topics(link: Link) -> Topics:
    """Topics of a follower and its predecessor. In a chain the truth has the follower's name too."""
    scenario = link.scenario
    stamped = scenario.controller.command_type == "TwistStamped"
    leader, follower = namespaces_of(scenario)
    truth = within(follower, TRUTH) if link.in_chain else TRUTH
    return Topics(leader, follower, stamped, truth, scenario.guard.present)


def urgent_topics(scenario: Scenario) -> tuple[str, ...]:
    """Topics that go ahead of all others: what robots are told and wanted to drive, stop and arming."""
    pairs = [link_topics(link) for link in links_of(scenario)]
    first = (pairs[0].leader_cmd_vel, pairs[0].leader_wanted)
    return (*first, *(pair.cmd_vel for pair in pairs), *(pair.wanted for pair in pairs), STOP, ARM)


def types_of(scenario: Scenario) -> dict[str, str]:
    """Type name of every topic of a scenario, those of all pairs of a chain."""
    return {
        topic: typename for link in links_of(scenario) for topic, typename in link_topics(link).types.items()
    }
