"""Topics of motion capture that comes in another form than ours, by ``[source]`` of a scenario.

Such a topic has ``source/`` in front of its name here, so that it is told from our ``rigid_bodies``, which
are then made of it by who hosts an estimator.
"""

from __future__ import annotations

from dataclasses import dataclass

from hil.errors import UsageError
from hil.scenario.links import links_of
from hil.scenario.schema import Scenario
from hil.wire.messages import typename_of
from hil.wire.pose_sources import MESSAGES, OF_ONE
from hil.wire.topics import RIGID_BODIES

BODY = "{body}"
MADE = "abreast/rigid_bodies"
"""Where our frames lie on the wire if the lab's own have that place."""

_USUAL = {
    "RigidBodies": "rigid_bodies",
    "NamedPoseArray": "poses",
    "PoseStamped": "vrpn_mocap/{body}/pose",
    "PoseWithCovarianceStamped": "{body}/pose",
    "Odometry": "{body}/mocap_odom",
    "TransformStamped": "vicon/{body}/{body}",
    "TFMessage": "tf",
}


@dataclass(frozen=True, slots=True)
class SourceTopic:
    """A topic of the source: its ``name`` on the wire, its type, and whose it is, empty for all bodies'."""

    name: str
    typename: str
    body: str = ""


def all_bodies(scenario: Scenario) -> tuple[str, ...]:
    """What the motion capture calls the robots, the leader first."""
    links = links_of(scenario)
    return (links[0].bodies[0], *(link.bodies[1] for link in links))


def lab_bodies(scenario: Scenario) -> tuple[str, ...]:
    """Those of them that the lab's motion capture can show: all but that of a robot that is emulated."""
    bodies, emulated = all_bodies(scenario), scenario.source.emulated
    left_out = {"leader": bodies[:1], "follower": bodies[1:2]}.get(emulated, ())
    return tuple(body for body in bodies if body not in left_out)


def converts(scenario: Scenario) -> bool:
    """Whether motion capture comes in another form than ours, or without a robot that is emulated."""
    given = scenario.source
    if given.emulated:
        return True
    return given.type != "RigidBodies" or given.stamp != "header" or given.up != "z" or given.scale != 1.0


def source_topics(scenario: Scenario) -> dict[str, SourceTopic]:
    """Topics of motion capture in another form than ours; none if it comes in ours.

    Raises :class:`UsageError` for a topic without ``{body}`` whose messages do not say whose they are.
    """
    if not converts(scenario):
        return {}
    given = scenario.source
    name = (given.topic or _USUAL[given.type]).strip("/")
    typename = typename_of(MESSAGES[given.type])
    if BODY not in name:
        if given.type in OF_ONE and given.type != "TransformStamped":
            raise UsageError(
                f"scenario {scenario.name}: source.topic {given.topic!r} is one for all bodies, and a "
                f"{given.type} does not say whose it is; expected {BODY} in the place of the body's name"
            )
        return {f"source/{name}": SourceTopic(name, typename)}
    if given.type not in OF_ONE:
        raise UsageError(
            f"scenario {scenario.name}: source.topic {given.topic!r} has {BODY}, and a {given.type} holds "
            "all bodies; expected one topic's name"
        )
    topics = {body: name.replace(BODY, body) for body in lab_bodies(scenario)}
    return {f"source/{topic}": SourceTopic(topic, typename, body) for body, topic in topics.items()}


def source_names(scenario: Scenario) -> dict[str, str]:
    """Names on the wire that the source has topics under, and our frames if they are made of them."""
    names = {topic: each.name for topic, each in source_topics(scenario).items()}
    if names:
        return {**names, RIGID_BODIES: MADE}
    given = scenario.source.topic.strip("/")
    return {RIGID_BODIES: given} if given else {}
