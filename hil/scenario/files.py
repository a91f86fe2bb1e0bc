"""Reading scenarios: by name or path, with overrides, each mistake answered by one line that helps."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import msgspec
import tomli_w

from hil.errors import UsageError
from hil.scenario.brought import refuse_unknown, settle_references
from hil.scenario.checked_toml import checked, locate, read_toml, shipped_names
from hil.scenario.links import refuse_chain
from hil.scenario.schema import OFFLINE_ESTIMATORS, Scenario

_FOLDER = "scenarios"
_DEFAULT_BASE = "turtlebot3"


def scenario_names() -> list[str]:
    """Names of the scenarios that abreast ships, sorted."""
    return shipped_names(_FOLDER)


def load_scenario(name_or_path: str, overrides: Iterable[str] = ()) -> Scenario:
    """Read a scenario by its shipped name or from a TOML file, then apply ``section.key=value`` overrides.

    Raises :class:`UsageError` for an unknown name, unreadable TOML, an unknown key (naming the nearest known
    one), a wrong type, or a value out of range.
    """
    path = locate("scenario", _FOLDER, name_or_path)
    tree = read_toml(path, "scenario")
    # A file's name may be none that UTF-8 can write.
    tree.setdefault("name", path.stem.encode(errors="replace").decode())
    settle_references(tree, path.parent)
    return build_scenario(tree, overrides, source=f"scenario {path.stem}")


def build_scenario(
    tree: Mapping[str, Any], overrides: Iterable[str] = (), source: str = "scenario"
) -> Scenario:
    """Check a tree of plain values (as TOML gives) and turn it into a :class:`Scenario`."""
    merged = msgspec.to_builtins(tree)
    for override in overrides:
        _apply(merged, override)
    settle_references(merged, Path.cwd())
    scenario = checked(merged, Scenario, source)
    refuse_unknown(scenario, source)
    return scenario


def refuse_unrunnable(scenario: Scenario) -> None:
    """Raise :class:`UsageError` if the scenario can be simulated or replayed only, not driven.

    That is one with an estimator that needs to know the future, or a flock of agents. Raises it too as
    :func:`refuse_two_corrections`.
    """
    kind = scenario.estimator.kind
    refuse_two_corrections(scenario)
    if kind in OFFLINE_ESTIMATORS:
        raise UsageError(
            f"estimator.kind is {kind!r}: it needs a whole log; run with another one, then "
            f"abreast replay LOG --estimator {kind}"
        )
    if not isinstance(scenario.flock, msgspec.UnsetType):
        raise UsageError(
            f"scenario {scenario.name}: it has a [flock] of {scenario.flock.agents} agents, expected a pair; "
            f"abreast simulate {scenario.name} runs the flock"
        )
    if scenario.formation.change_sides_at_s:
        refuse_chain(scenario, "formation.change_sides_at_s is for a pair: leave it out")


def refuse_two_corrections(scenario: Scenario) -> None:
    """Raise :class:`UsageError` if stamps that are mapped to host time anyway are to be shifted too."""
    given = scenario.estimator
    if given.clock == "estimated" and given.stamp_offset_s != 0.0:
        raise UsageError(
            f"estimator.stamp_offset_s is {given.stamp_offset_s:g}: it corrects clock 'trusted' only; with "
            "clock 'estimated' set it to 0 and give estimator.transport_latency_s"
        )


def merged_scenario(part: Mapping[str, Any], name: str, source: str) -> Scenario:
    """Scenario from its ``base`` (a scenario's name or path) with the other keys of ``part`` put over it.

    The result is called ``name`` unless the part names itself. Raises :class:`UsageError` as
    :func:`load_scenario` does, beginning with ``source``.
    """
    given = dict(part)
    base = given.pop("base", _DEFAULT_BASE)
    if not isinstance(base, str):
        raise UsageError(f"{source}: base is {base!r}, expected the name of a scenario or a path to one")
    tree = msgspec.to_builtins(load_scenario(base))
    merged = build_scenario(_overlaid(tree, {"name": name, "description": "", **given}), source=source)
    refuse_chain(merged, "a recording is of two robots; give base = the name of another scenario")
    return merged


def scenario_text(scenario: Scenario) -> str:
    """Render the scenario, defaults included, as TOML that :func:`load_scenario` reads back unchanged."""
    return tomli_w.dumps(msgspec.to_builtins(scenario))


def with_overrides(scenario: Scenario, overrides: Iterable[str]) -> Scenario:
    """Return the scenario with ``section.key=value`` overrides applied and checked."""
    return build_scenario(msgspec.to_builtins(scenario), overrides, source=f"scenario {scenario.name}")


def _overlaid(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Tree with the upper one's values where it has any; a section with a ``kind`` replaces the lower's."""
    result = dict(below)
    for key, value in above.items():
        under = result.get(key)
        if isinstance(value, Mapping) and isinstance(under, Mapping) and "kind" not in value:
            result[key] = _overlaid(under, value)
        else:
            result[key] = value
    return result


def _apply(tree: dict[str, Any], override: str) -> None:
    key, equals, text = override.partition("=")
    steps = [step.strip() for step in key.split(".")]
    if not equals or not all(steps):
        raise UsageError(f"--set {override!r}: expected section.key=value, for example mocap.loss=0.05")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        value = text.strip()
    node: Any = tree
    for step in steps[:-1]:
        node = node.setdefault(step, {})
        if not isinstance(node, dict):
            raise UsageError(f"--set {override!r}: {step!r} is a value and has no keys below it")
    node[steps[-1]] = value
