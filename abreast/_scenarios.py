"""Scenarios, as the command line finds them."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import Any

from hil.extensions.reference import brought
from hil.scenario import files
from hil.scenario.schema import Scenario

Own = str | Callable[..., Any]
"""A law or an estimator: its name, ``file.py:name`` or ``package.module:name``, or a function at hand."""

ScenarioLike = Scenario | str | os.PathLike[str]
"""A scenario, or the name of a shipped one, or a path to a TOML file."""


def scenarios() -> list[str]:
    """Names of the scenarios that abreast ships, sorted.

    >>> import abreast
    >>> "turtlebot3" in abreast.scenarios()
    True
    """
    return files.scenario_names()


def load_scenario(name_or_path: str | os.PathLike[str], overrides: files.Overrides = ()) -> Scenario:
    """Read a scenario by its shipped name or from a TOML file, with some of its keys changed.

    ``overrides``: values by ``section.key``, or the texts that ``--set`` takes. All is in SI units and
    radians. Raises :class:`UsageError` for an unknown name or key, a wrong type, or a value out of range.

    >>> import abreast
    >>> scenario = abreast.load_scenario("turtlebot3", {"mocap.loss": 0.05, "run.duration_s": 10.0})
    >>> scenario.mocap.loss, scenario.controller.law
    (0.05, 'independent')
    """
    return files.load_scenario(os.fspath(name_or_path), overrides)


def scenario_of(given: ScenarioLike, changes: Mapping[str, Any] | None = None) -> Scenario:
    """The scenario that is meant, with those changes that are not None."""
    changed = {key: value for key, value in (changes or {}).items() if value is not None}
    if isinstance(given, Scenario):
        return files.with_overrides(given, changed) if changed else given
    return load_scenario(given, changed)


def text_of(given: Own | None) -> str | None:
    """A law or an estimator as scenarios name it."""
    return brought(given) if callable(given) else given
