"""Who may say and hear what on a lab's wire: roles, and Zenoh's access control made of them by topic.

What is not allowed here is refused by the router. Nobody may delete, or publish by
a wildcard, or ask for anything but the time and who is connected.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from hil.scenario.links import links_of
from hil.scenario.ordered_sides import ordered_sides
from hil.scenario.schema import Scenario
from hil.wire.clock_query import CLOCKS
from hil.wire.key_layout import KeyLayout, layout_of
from hil.wire.roles import GUARD, Role
from hil.wire.ros_tokens import all_tokens, node_tokens, topic_tokens
from hil.wire.router_clients import ROUTERS
from hil.wire.source_topics import source_topics
from hil.wire.topics import ARM, DIAGNOSTICS, ONLY_IN_LOGS, RIGID_BODIES, STOP, link_topics, types_of

_REPORTS = frozenset({DIAGNOSTICS})
_CLOCK = f"{CLOCKS}/*"


@dataclass(frozen=True, slots=True)
class Access:
    """The topics that a role may publish, and those that it may hear."""

    says: frozenset[str]
    hears: frozenset[str]


@dataclass(frozen=True, slots=True)
class LabTopics:
    """Topics of a lab by what they are for.

    ``wanted``: what is wanted of robots, and goes to their guards; the same as ``driven`` without guards.
    ``leads``: of the ``wanted``, the leader's. ``played``: what an emulated lab says besides.
    """

    captured: frozenset[str]
    wheels: frozenset[str]
    estimates: frozenset[str]
    decisions: frozenset[str]
    driven: frozenset[str]
    wanted: frozenset[str]
    leads: frozenset[str]
    orders: frozenset[str]
    played: frozenset[str]

    @staticmethod
    def of(scenario: Scenario) -> LabTopics:
        """Topics of the leader and all followers of a scenario."""
        pairs = [link_topics(link) for link in links_of(scenario)]
        first, guarded = pairs[0], scenario.guard.present
        wheels = (each for pair in pairs for each in (pair.odom, pair.sighting))
        # An emulator plays the operator as well.
        ordered = [pair.side for pair in pairs] if ordered_sides(scenario) else []
        return LabTopics(
            captured=frozenset(source_topics(scenario)) or frozenset({RIGID_BODIES}),
            wheels=frozenset({first.leader_odom, *wheels}),
            estimates=frozenset(each for pair in pairs for each in (pair.estimate, pair.certified)),
            decisions=frozenset(pair.command for pair in pairs),
            driven=frozenset({first.leader_cmd_vel, *(pair.cmd_vel for pair in pairs)}),
            wanted=frozenset({first.leader_wanted, *(pair.wanted for pair in pairs)}),
            leads=frozenset({first.leader_wanted}),
            orders=frozenset({STOP, *([ARM] if guarded else []), *(pair.side for pair in pairs)}),
            played=frozenset({*(pair.truth for pair in pairs), *ordered}),
        )


def access_of(scenario: Scenario) -> dict[Role, Access]:
    """What each role may say and hear in the lab of a scenario; the router itself is nobody's client.

    Where guards stand before the robots, these alone tell them what to drive, but for emulated robots, which
    have their guards in them. Else whoever drives a robot tells it.
    """
    lab = LabTopics.of(scenario)
    # Frames of motion capture that comes in another form are made ours by who hosts an estimator.
    made = frozenset({RIGID_BODIES}) - lab.captured
    estimator = lab.estimates | made | _REPORTS
    controller = lab.decisions | (lab.wanted - lab.leads) | _REPORTS
    outside = lab.captured | lab.wheels | _REPORTS
    says: dict[Role, frozenset[str]] = {
        "estimator": estimator,
        "controller": controller,
        "follower": estimator | controller,
        "leader": lab.leads | _REPORTS,
        "recorder": _REPORTS,
        "guard": (lab.driven if scenario.guard.present else frozenset[str]()) | lab.orders | _REPORTS,
        "mocap": lab.captured | _REPORTS,
        "robot": lab.wheels,
        "bridge": outside,
        "emulator": outside | made | lab.played | _told_by_emulator(scenario, lab),
        "operator": lab.wanted | lab.orders | _REPORTS,
        "viewer": frozenset(),
    }
    everything = frozenset({*types_of(scenario), *source_topics(scenario)}) - {*ONLY_IN_LOGS}
    narrow: dict[Role, frozenset[str]] = {"mocap": frozenset(), "robot": lab.driven | {STOP}}
    return {role: Access(said, narrow.get(role, everything)) for role, said in says.items()}


def access_control(scenario: Scenario) -> dict[str, Any]:
    """The same as ``access_control`` of a router's Zenoh configuration: sessions by their common names."""
    layout = layout_of(scenario)
    lab = LabTopics.of(scenario)
    rules: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    given = access_of(scenario)
    for role, access in given.items():
        own = [each for each in _rules(layout, role, access, lab.wanted) if each["key_exprs"]]
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


def keys_said(scenario: Scenario, role: Role) -> tuple[str, ...]:
    """Key expressions that a role may publish on, in order."""
    access = access_of(scenario).get(role)
    return _keys(layout_of(scenario), access.says) if access else ()


def _rules(layout: KeyLayout, role: Role, access: Access, driving: frozenset[str]) -> list[dict[str, Any]]:
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
        *(_client_rules(role) if access.says else []),
        *_clock_rules(role, answers=bool(access.says & driving)),
    ]


def _client_rules(role: Role) -> list[dict[str, Any]]:
    """Whoever takes part may ask the router who is connected."""
    return [
        _rule(f"{role} asks who is connected", ("query",), "ingress", [ROUTERS]),
        _rule(f"{role} is told who is connected", ("reply", "declare_queryable"), "egress", [ROUTERS]),
    ]


def _clock_rules(role: Role, *, answers: bool) -> list[dict[str, Any]]:
    """Guards ask those who send commands for their hosts' time: only these may answer."""
    asks = [
        _rule(f"{role} asks for the time", ("query",), "ingress", [_CLOCK]),
        _rule(f"{role} is told the time", ("reply", "declare_queryable"), "egress", [_CLOCK]),
    ]
    return [*(asks if role == GUARD else []), *(_answers(role) if answers else [])]


def _answers(role: Role) -> list[dict[str, Any]]:
    return [
        _rule(f"{role} is asked for the time", ("query",), "egress", [_CLOCK]),
        _rule(f"{role} tells the time", ("reply", "declare_queryable"), "ingress", [_CLOCK]),
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


def _told_by_emulator(scenario: Scenario, lab: LabTopics) -> frozenset[str]:
    """What an emulated leader drives by itself, and what guards in emulated followers let through."""
    first = link_topics(links_of(scenario)[0])
    return lab.driven if scenario.guard.present else frozenset({first.leader_cmd_vel})
