"""Reading scenarios: by name or path, with overrides, each mistake answered by one line that helps."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec
import tomli_w

from hil.errors import UsageError
from hil.scenario.brought import refuse_unknown, settle_references
from hil.scenario.checked_toml import checked, locate, read_toml, shipped_names
from hil.scenario.links import refuse_chain, refuse_contradictions
from hil.scenario.schema import OFFLINE_ESTIMATORS, Scenario

_FOLDER = "scenarios"
_DEFAULT_BASE = "turtlebot3"


def scenario_names() -> list[str]:
    """Names of the scenarios that abreast ships, sorted."""
    return shipped_names(_FOLDER)


Overrides = Iterable[str] | Mapping[str, Any]
"""What is to be different: texts ``section.key=value``, or values by ``section.key``.

A table in the place of a value is laid over the one that is there, unless it is of a ``kind``.
"""


def load_scenario(name_or_path: str, overrides: Overrides = ()) -> Scenario:
    """Read a scenario by its shipped name or from a TOML file, then apply ``section.key=value`` overrides.

    A file with a ``base``, the name of a scenario or a path to one from where the file is, says only what
    differs from that. Raises :class:`UsageError` for an unknown name, unreadable TOML, an unknown key (naming
    the nearest known one), a wrong type, or a value out of range.
    """
    path = locate("scenario", _FOLDER, name_or_path)
    tree = _with_base(path, ())
    # A file's name may be none that UTF-8 can write.
    tree.setdefault("name", path.stem.encode(errors="replace").decode())
    return build_scenario(tree, overrides, source=f"scenario {path.stem}")


def _with_base(path: Path, above: tuple[Path, ...]) -> dict[str, Any]:
    """Tree of a scenario's file, laid over that of its base if it has one."""
    tree = read_toml(path, "scenario")
    settle_references(tree, path.parent)
    if "base" not in tree:
        return tree
    source = f"scenario {path.stem}"
    base = _base_name(tree.pop("base"), source)
    beside = path.parent / base
    below = beside if beside.is_file() else locate("scenario", _FOLDER, base)
    if below.resolve() in above:
        raise UsageError(f"{source}: base = {base!r} leads back to itself; expected another scenario")
    under = _with_base(below, (*above, path.resolve()))
    return _overlaid({key: each for key, each in under.items() if key not in ("name", "description")}, tree)


def _base_name(base: object, source: str) -> str:
    if not isinstance(base, str):
        raise UsageError(f"{source}: base is {base!r}, expected the name of a scenario or a path to one")
    return base


def build_scenario(tree: Mapping[str, Any], *overrides: Overrides, source: str = "scenario") -> Scenario:
    """Check a tree of plain values (as TOML gives) and turn it into a :class:`Scenario`."""
    merged = msgspec.to_builtins(tree)
    for some in overrides:
        if isinstance(some, Mapping):
            for key, value in some.items():
                node, last = _place(merged, key, f"override {key!r}")
                node.update(_overlaid(node, {last: _plain(value)}))
        else:
            for override in some:
                _apply(merged, override)
    settle_references(merged, Path.cwd())
    scenario = checked(merged, Scenario, source)
    refuse_unknown(scenario, source)
    refuse_contradictions(scenario)
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
    base = _base_name(given.pop("base", _DEFAULT_BASE), source)
    tree = msgspec.to_builtins(load_scenario(base))
    merged = build_scenario(_overlaid(tree, {"name": name, "description": "", **given}), source=source)
    refuse_chain(merged, "a recording is of two robots; give base = the name of another scenario")
    return merged


def scenario_text(scenario: Scenario) -> str:
    """Render the scenario, defaults included, as TOML that :func:`load_scenario` reads back unchanged."""
    return tomli_w.dumps(msgspec.to_builtins(scenario))


def changes_from_shipped(scenario: Scenario) -> dict[str, str] | None:
    """What makes this scenario of the one that is shipped under its name: keys with their values as TOML.

    None where there is no such scenario, or one with keys that this one lacks.
    """
    if scenario.name not in scenario_names():
        return None
    shipped = dict(_leaves(msgspec.to_builtins(load_scenario(scenario.name))))
    own = dict(_leaves(msgspec.to_builtins(scenario)))
    if not shipped.keys() <= own.keys():
        return None
    return {key: _toml(value) for key, value in own.items() if key not in shipped or shipped[key] != value}


def with_overrides(scenario: Scenario, *overrides: Overrides) -> Scenario:
    """Return the scenario with ``section.key=value`` overrides applied, in their order, and checked."""
    return build_scenario(msgspec.to_builtins(scenario), *overrides, source=f"scenario {scenario.name}")


def _overlaid(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Tree with the upper one's values where it has any; what is of another ``kind`` replaces the lower's.

    An estimator's kind is one of its keys: the others are the same for all.
    """
    result = dict(below)
    for key, value in above.items():
        under = result.get(key)
        if (
            isinstance(value, Mapping)
            and isinstance(under, Mapping)
            and ("kind" not in value or key == "estimator")
        ):
            result[key] = _overlaid(under, value)
        else:
            result[key] = value
    return result


def _apply(tree: dict[str, Any], override: str) -> None:
    key, equals, text = override.partition("=")
    if not equals:
        raise UsageError(f"--set {override!r}: expected section.key=value, for example mocap.loss=0.05")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        value = text.strip()
    node, last = _place(tree, key, f"--set {override!r}")
    node[last] = value


def override_texts(overrides: Overrides) -> tuple[str, ...]:
    """Overrides as the texts ``section.key=value`` that ``--set`` takes."""
    if not isinstance(overrides, Mapping):
        return tuple(overrides)
    return tuple(f"{key}={_toml(value)}" for key, value in _leaves(_plain(overrides)))


def _leaves(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _toml(value: Any) -> str:
    return " ".join(tomli_w.dumps({"value": value}).partition("=")[2].split())


def _place(tree: dict[str, Any], key: str, source: str) -> tuple[dict[str, Any], str]:
    """The table that a key stands in, made if it is not there, and the key's last part."""
    steps = [step.strip() for step in key.split(".")]
    if not all(steps):
        raise UsageError(f"{source}: expected section.key=value, for example mocap.loss=0.05")
    node: Any = tree
    for step in steps[:-1]:
        node = node.setdefault(step, {})
        if not isinstance(node, dict):
            raise UsageError(f"{source}: {step!r} is a value and has no keys below it")
    return node, steps[-1]


def _plain(value: Any) -> Any:
    """A value as TOML would give it: numbers and arrays of numpy as Python's."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value.tolist() if hasattr(value, "tolist") else value
