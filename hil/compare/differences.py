"""Conditions in which groups differ, by the keys of the scenario."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from hil.compare.group import Group

Differences = dict[str, tuple[tuple[str, ...], ...]]
"""Values of each group by key."""

_LAW = ("law", "parameters", "mu1", "mu2", "mu_rho", "tilt", "v_max", "u_max")


def differences_of(groups: Sequence[Group]) -> Differences:
    """Conditions whose values are not the same in all groups; empty values for a group that knows none."""
    facts = [group.facts() for group in groups]
    keys = dict.fromkeys(key for each in facts for key in each)
    values = {key: tuple(each.get(key, ()) for each in facts) for key in keys}
    return {key: each for key, each in values.items() if len(set(map(frozenset, each))) > 1}


def are_of_the_law(keys: Iterable[str]) -> bool:
    """Whether some of these keys say how the follower drives: each has a noise-free run of its own then."""
    return any(key.startswith(tuple(f"controller.{name}" for name in _LAW)) for key in keys)


def are_of_the_estimator(keys: Iterable[str]) -> bool:
    """Whether some of these keys say how the leader is estimated."""
    return any(key.startswith("estimator.") for key in keys)
