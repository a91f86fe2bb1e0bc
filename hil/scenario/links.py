"""A chain as its links: each follower with its predecessor, as a pair of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, TypeVar

import msgspec
from msgspec.structs import replace

from hil.errors import UsageError
from hil.scenario.schema import ChainSection, FollowerSection, LeaderSection, Scenario
from hil.scenario.section import PoseTriple
from hil.scenario.start import chain_poses

G = TypeVar("G")
R = TypeVar("R", LeaderSection, FollowerSection)

HOSTED = {
    "estimator": ("estimator",),
    "controller": ("controller",),
    "follower": ("estimator", "controller"),
}
"""The nodes that a daemon hosts for every follower, where it does."""

STARTERS = ("emulator", "leader")
"""The daemons that let the leader set off, and so wait for all others."""


@dataclass(frozen=True, slots=True)
class Link:
    """One follower and the robot that it follows.

    ``scenario``: the two as a pair: their names, start poses, and what is known of the predecessor; the
    leader's program in it drives the first agent only. ``others``: names of the further robots of the
    chain, ``other_bodies``: of theirs in the motion capture. ``in_chain`` whether there is one, ``first``
    whether the predecessor is the chain's leader.
    """

    scenario: Scenario
    others: frozenset[str] = frozenset()
    other_bodies: frozenset[str] = frozenset()
    in_chain: bool = False
    first: bool = True

    @property
    def leader(self) -> str:
        """Name of the predecessor."""
        return self.scenario.leader.name

    @property
    def follower(self) -> str:
        """Name of the follower."""
        return self.scenario.follower.name

    @property
    def bodies(self) -> tuple[str, str]:
        """What the motion capture calls predecessor and follower."""
        return bodies_of(self.scenario)

    def node_name(self, node: str) -> str:
        """What this follower's estimator or controller is called, in a chain such as estimator/agent3."""
        return f"{node}/{self.follower}" if self.in_chain else node


def bodies_of(scenario: Scenario) -> tuple[str, str]:
    """What the motion capture calls leader and follower, of a chain the first two agents."""
    leader, follower = scenario.leader, scenario.follower
    return str(_told(leader.body, leader.name)), str(_told(follower.body, follower.name))


def namespaces_of(scenario: Scenario) -> tuple[str, str]:
    """Namespaces of the topics of leader and follower, of a chain the first two agents; empty for none."""
    leader, follower = scenario.leader, scenario.follower
    return _told(leader.namespace, leader.name), _told(follower.namespace, follower.name)


def chain_of(scenario: Scenario) -> ChainSection | None:
    """The chain of a scenario, None for a pair."""
    return None if isinstance(scenario.chain, msgspec.UnsetType) else scenario.chain


def links_of(scenario: Scenario) -> tuple[Link, ...]:
    """Links of a scenario from the leader on; a pair is a single one.

    Raises :class:`UsageError` for names that are too few, too many, or stand for two robots.
    """
    called, chain = called_of(scenario), chain_of(scenario)
    if chain is None:
        return (Link(scenario),)
    names, bodies, namespaces = called
    poses = [(pose.x, pose.y, pose.theta) for pose in chain_poses(scenario, chain.agents)]
    k_v, k_u = chain_limits(scenario, chain)
    links: list[Link] = []
    agents = zip(names, bodies, namespaces, poses, strict=True)
    for place, (ahead, own) in enumerate(pairwise(agents)):
        leader = _as_agent(scenario.leader, *ahead)
        pair = replace(
            scenario,
            name=f"{scenario.name}/{own[0]}",
            leader=replace(leader, k_v=k_v, k_u=k_u, mount=scenario.follower.mount) if place else leader,
            follower=_as_agent(scenario.follower, *own),
            chain=msgspec.UNSET,
        )
        others = frozenset(names) - {ahead[0], own[0]}
        other_bodies = frozenset(bodies) - {ahead[1], own[1]}
        links.append(Link(pair, others, other_bodies, in_chain=True, first=not place))
    return tuple(links)


class Called(NamedTuple):
    """What the robots are called, the leader first: their names, bodies and namespaces."""

    names: tuple[str, ...]
    bodies: tuple[str, ...]
    namespaces: tuple[str, ...]


def called_of(scenario: Scenario) -> Called:
    """What the robots of a scenario are called.

    Raises :class:`UsageError` for names that are too few, too many, or stand for two robots.
    """
    bodies, namespaces, chain = bodies_of(scenario), namespaces_of(scenario), chain_of(scenario)
    if chain is None:
        names: tuple[str, ...] = (scenario.leader.name, scenario.follower.name)
        _differ(scenario, names, "leader.name and follower.name")
        _differ(scenario, bodies, "leader.body and follower.body")
        _differ(scenario, namespaces, "leader.namespace and follower.namespace")
        return Called(names, bodies, namespaces)
    names = _names(scenario, chain)
    return Called(
        names,
        _further(scenario, chain, "bodies", chain.bodies, bodies, names),
        _further(scenario, chain, "namespaces", chain.namespaces, namespaces, names),
    )


def chain_limits(scenario: Scenario, chain: ChainSection) -> tuple[float, float]:
    """Largest speed and hardest turn of a chain's followers as somebody's predecessor."""
    control, robot = scenario.controller, scenario.robot
    k_v = min(control.v_max, robot.v_max) if isinstance(chain.k_v, msgspec.UnsetType) else chain.k_v
    k_u = min(control.u_max, robot.u_max) if isinstance(chain.k_u, msgspec.UnsetType) else chain.k_u
    return k_v, k_u


def refuse_contradictions(scenario: Scenario) -> None:
    """Raise :class:`UsageError` for a name of two robots, and for ranges that hold nothing."""
    called_of(scenario)
    _refuse_odd_lab(scenario)
    chain, least = chain_of(scenario), scenario.leader.v_eps
    limits = [("leader.k_v", scenario.leader.k_v)]
    if chain is not None and chain.agents > 2:
        limits.append(("the largest speed of the chain's followers", chain_limits(scenario, chain)[0]))
    for what, most in limits:
        if least > most:
            raise UsageError(
                f"scenario {scenario.name}: leader.v_eps is {least:g}, expected at most {what}, {most:g}"
            )


def _refuse_odd_lab(scenario: Scenario) -> None:
    fence, kept = scenario.guard.fence, scenario.recorder
    if not isinstance(fence, msgspec.UnsetType) and not (fence[0] < fence[2] and fence[1] < fence[3]):
        raise UsageError(
            f"scenario {scenario.name}: guard.fence is {list(fence)}, expected x_min, y_min, x_max, y_max, "
            "each below its max"
        )
    for key, value, least in (("rotate_mb", kept.rotate_mb, 0.1), ("rotate_s", kept.rotate_s, 1.0)):
        if 0.0 < value < least:
            raise UsageError(
                f"scenario {scenario.name}: recorder.{key} is {value:g}, expected 0 for never, or at least "
                f"{least:g}"
            )


def link_of(scenario: Scenario, follower: str) -> Link:
    """Link of a follower by its name; :class:`UsageError` if there is none of that name."""
    links = links_of(scenario)
    for link in links:
        if link.follower == follower:
            return link
    known = ", ".join(link.follower for link in links)
    raise UsageError(
        f"--follower {follower!r}: scenario {scenario.name} has none of that name; one of: {known}"
    )


def node_names(daemon: str, links: Sequence[Link]) -> tuple[str, ...]:
    """Names under which the nodes of a daemon report."""
    hosted = HOSTED.get(daemon)
    return tuple(link.node_name(node) for node in hosted for link in links) if hosted else (daemon,)


def refuse_chain(scenario: Scenario, instead: str) -> None:
    """Raise :class:`UsageError` if the scenario has a chain; ``instead``: what to do."""
    chain = chain_of(scenario)
    if chain is not None:
        raise UsageError(
            f"scenario {scenario.name}: it has a [chain] of {chain.agents} agents, expected a pair; {instead}"
        )


def _names(scenario: Scenario, chain: ChainSection) -> tuple[str, ...]:
    further = chain.names or tuple(f"agent{number}" for number in range(3, chain.agents + 1))
    if len(further) != chain.agents - 2:
        raise UsageError(
            f"scenario {scenario.name}: chain.names has {len(further)}, expected {chain.agents - 2}: one for "
            f"each of the {chain.agents} agents from the third on"
        )
    names = (scenario.leader.name, scenario.follower.name, *further)
    _differ(scenario, names, "leader.name, follower.name and chain.names")
    return names


def _further(
    scenario: Scenario,
    chain: ChainSection,
    key: str,
    given: tuple[str | int, ...],
    first: tuple[str, str],
    names: tuple[str, ...],
) -> tuple[str, ...]:
    """What the agents are called elsewhere; by their names from the third on, unless told otherwise."""
    if given and len(given) != chain.agents - 2:
        raise UsageError(
            f"scenario {scenario.name}: chain.{key} has {len(given)}, expected {chain.agents - 2}: one for "
            f"each of the {chain.agents} agents from the third on"
        )
    called = (*first, *map(str, given or names[2:]))
    _differ(scenario, called, f"chain.{key} and those of leader and follower")
    return called


def _differ(scenario: Scenario, called: Sequence[str], keys: str) -> None:
    twice = next((each for place, each in enumerate(called) if each in called[:place]), None)
    if twice is not None:
        raise UsageError(
            f"scenario {scenario.name}: {twice!r} stands for two robots, expected names that differ; "
            f"set {keys}"
        )


def _told(given: G | msgspec.UnsetType, name: str) -> G | str:
    return name if isinstance(given, msgspec.UnsetType) else given


def _as_agent(role: R, name: str, body: str, namespace: str, pose: PoseTriple) -> R:
    return replace(role, name=name, body=body, namespace=namespace, pose=pose)
