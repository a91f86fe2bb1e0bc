"""Who may say and hear what on a lab's wire: roles, and Zenoh's access control made of them by topic.

What is not allowed here is refused by the router. Nobody may delete, ask or
answer queries, or publish by a wildcard.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

from hil.scenario.links import links_of
from hil.scenario.ordered_sides import ordered_sides
from hil.scenario.schema import Scenario
from hil.wire.key_layout import KeyLayout, layout_of
from hil.wire.message_types import String
from hil.wire.messages import typename_of
from hil.wire.ros_tokens import all_tokens, node_tokens, topic_tokens
from hil.wire.source_topics import source_topics
from hil.wire.topics import DIAGNOSTICS, ONLY_IN_LOGS, RIGID_BODIES, STOP, link_topics, types_of

Role = Literal[
    "router", "estimator", "controller", "follower", "leader", "recorder", "guard", "mocap", "robot",
    "bridge", "emulator", "operator", "viewer",
]  # fmt: skip
"""What a session is on the wire; ``bridge``: robots and motion capture in one, as of a bridge to ROS 2."""

ROLES: tuple[Role, ...] = get_args(Role)
ROUTER: Role = "router"
OPERATOR: Role = "operator"
VIEWER: Role = "viewer"

ARM = "arm"
_WANTED = "_wanted"


@dataclass(frozen=True, slots=True)
class Access:
    """The topics that a role may publish, and those that it may hear."""

    says: frozenset[str]
    hears: frozenset[str]


@dataclass(frozen=True, slots=True)
class LabTopics:
    """Topics of a lab by what they are for.

    ``wanted``: what robots would be told if their guards let it through; the same as ``driven`` where there
    are no guards. ``leads``: of the ``wanted``, the leader's.
    """

    captured: frozenset[str]
    wheels: frozenset[str]
    estimates: frozenset[str]
    decisions: frozenset[str]
    driven: frozenset[str]
    wanted: frozenset[str]
    leads: frozenset[str]
    orders: frozenset[str]

    @staticmethod
    def of(scenario: Scenario, *, guarded: bool) -> LabTopics:
        """Topics of the leader and all followers of a scenario."""
        pairs = [link_topics(link) for link in links_of(scenario)]
        driven = frozenset({pairs[0].leader_cmd_vel, *(pair.cmd_vel for pair in pairs)})
        wanted, leads = driven, frozenset({pairs[0].leader_cmd_vel})
        if guarded:
            wanted, leads = _wanted(driven), _wanted(leads)
        return LabTopics(
            captured=frozenset(source_topics(scenario)) or frozenset({RIGID_BODIES}),
            wheels=frozenset(
                {pairs[0].leader_odom, *(each for pair in pairs for each in (pair.odom, pair.sighting))}
            ),
            estimates=frozenset(each for pair in pairs for each in (pair.estimate, pair.certified)),
            decisions=frozenset(pair.command for pair in pairs),
            driven=driven,
            wanted=wanted,
            leads=leads,
            orders=frozenset({STOP, ARM, *(pair.side for pair in pairs)}),
        )


def access_of(scenario: Scenario, *, guarded: bool) -> dict[Role, Access]:
    """What each role may say and hear in the lab of a scenario; the router itself is nobody's client.

    ``guarded``: guards stand before the robots, so that they alone tell these what to drive. Else whoever
    drives a robot tells it.
    """
    lab = LabTopics.of(scenario, guarded=guarded)
    reports = frozenset({DIAGNOSTICS})
    # Frames of motion capture that comes in another form are made ours by who hosts an estimator.
    made = frozenset({RIGID_BODIES}) - lab.captured
    estimator = lab.estimates | made | reports
    controller = lab.decisions | (lab.wanted - lab.leads) | reports
    outside = lab.captured | lab.wheels | reports
    emulates = frozenset(pair.truth for pair in map(link_topics, links_of(scenario)))
    if ordered_sides(scenario):
        # It plays the operator as well.
        emulates |= frozenset(pair.side for pair in map(link_topics, links_of(scenario)))
    says: dict[Role, frozenset[str]] = {
        "estimator": estimator,
        "controller": controller,
        "follower": estimator | controller,
        "leader": lab.leads | reports,
        "recorder": reports,
        "guard": (lab.driven if guarded else frozenset[str]()) | lab.orders | reports,
        "mocap": lab.captured | reports,
        "robot": lab.wheels,
        "bridge": outside,
        # An emulated leader drives itself, and tells what.
        "emulator": outside | made | emulates | {link_topics(links_of(scenario)[0]).leader_cmd_vel},
        "operator": lab.wanted | lab.orders,
        "viewer": frozenset(),
    }
    everything = _everything(scenario, lab)
    narrow: dict[Role, frozenset[str]] = {"mocap": frozenset(), "robot": lab.driven | {STOP}}
    return {role: Access(said, narrow.get(role, everything)) for role, said in says.items()}


def access_layout(scenario: Scenario) -> KeyLayout:
    """Layout of a scenario's topics, those before guards and those of orders to them included."""
    layout, types = layout_of(scenario), types_of(scenario)
    lab = LabTopics.of(scenario, guarded=True)
    more = {f"{topic}{_WANTED}": types[topic] for topic in lab.driven} | {ARM: typename_of(String)}
    return replace(layout, types=more | dict(layout.types))


def access_control(scenario: Scenario, *, guarded: bool) -> dict[str, Any]:
    """The same as ``access_control`` of a router's Zenoh configuration: sessions by their common names."""
    layout = access_layout(scenario)
    rules: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    given = access_of(scenario, guarded=guarded)
    for role, access in given.items():
        own = [each for each in _rules(layout, role, access) if each["key_exprs"]]
        rules += own
        policies.append({"rules": [each["id"] for each in own], "subjects": [role]})
    subjects = [{"id": role, "cert_common_names": [role]} for role in given]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def keys_said(scenario: Scenario, role: Role, *, guarded: bool) -> tuple[str, ...]:
    """Key expressions that a role may publish on, in order."""
    access = access_of(scenario, guarded=guarded).get(role)
    return _keys(access_layout(scenario), access.says) if access else ()


def _rules(layout: KeyLayout, role: Role, access: Access) -> list[dict[str, Any]]:
    """Rules of a role. What it says, others are told of, and what others hear, it is told of."""
    said, heard = _keys(layout, access.says), _keys(layout, access.hears)
    tokens: list[str] = []
    # Who only looks on does not show: it would pass for a robot that listens.
    if access.says:
        tokens.append(node_tokens(layout))
        tokens += [topic_tokens(layout, topic, publishes=True) for topic in sorted(access.says)]
        tokens += [topic_tokens(layout, topic, publishes=False) for topic in sorted(access.hears)]
    seen = [all_tokens(layout)]
    return [
        _rule(f"{role} says", ("put",), "ingress", said),
        _rule(f"{role} is listened to", ("declare_subscriber",), "egress", said),
        _rule(f"{role} listens", ("declare_subscriber",), "ingress", heard),
        _rule(f"{role} hears", ("put",), "egress", heard),
        _rule(f"{role} shows itself", ("liveliness_token",), "ingress", tokens),
        _rule(f"{role} looks around", ("declare_liveliness_subscriber", "liveliness_query"), "ingress", seen),
        _rule(f"{role} sees", ("liveliness_token",), "egress", seen),
    ]


def _rule(name: str, messages: Sequence[str], flow: str, keys: Sequence[str]) -> dict[str, Any]:
    return {
        "id": name,
        "messages": list(messages),
        "flows": [flow],
        "permission": "allow",
        "key_exprs": list(keys),
    }


def _keys(layout: KeyLayout, topics: Iterable[str]) -> tuple[str, ...]:
    return tuple(layout.heard(topic) for topic in sorted(topics))


def _wanted(driven: Iterable[str]) -> frozenset[str]:
    return frozenset(f"{topic}{_WANTED}" for topic in driven)


def _everything(scenario: Scenario, lab: LabTopics) -> frozenset[str]:
    spoken = {*types_of(scenario), *source_topics(scenario)} - {*ONLY_IN_LOGS}
    return frozenset(spoken) | lab.wanted | lab.orders
