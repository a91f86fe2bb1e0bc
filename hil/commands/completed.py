"""What the shell is told of values: scenarios, laws, estimators, keys of ``--set``, maps.

A parameter is known by its name, so that every command that has it has this too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import click
from click.shell_completion import CompletionItem

Complete = Callable[[str], list[CompletionItem]]


class CompletedText(click.types.StringParamType):
    """A text, with what there is to say of it to the shell."""

    def __init__(self, complete: Complete) -> None:
        self._complete = complete

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """What the text may be that begins so."""
        return self._complete(incomplete)


def complete_by_name(command: click.Command) -> None:
    """Let the shell be told of the parameters of a command whose names tell what they take."""
    for param in command.params:
        if type(param.type) is click.types.StringParamType and param.name in _KNOWN:
            param.type = CompletedText(_KNOWN[param.name])


def _items(names: Iterable[str], incomplete: str) -> list[CompletionItem]:
    return [CompletionItem(name) for name in names if name.startswith(incomplete)]


def _or_files(names: Iterable[str], incomplete: str) -> list[CompletionItem]:
    """Names that begin so; where there are none, files."""
    return _items(names, incomplete) or [CompletionItem(incomplete, type="file")]


def _shipped(folder: str) -> Complete:
    def complete(incomplete: str) -> list[CompletionItem]:
        from hil.scenario.checked_toml import shipped_names

        here = sorted(each.name for each in Path().glob("*.toml"))
        return _or_files([*shipped_names(folder), *here], incomplete)

    return complete


def _laws(incomplete: str) -> list[CompletionItem]:
    from hil.scenario.schema import LAW_NAMES

    return _or_files(LAW_NAMES, incomplete)


def _estimators(incomplete: str) -> list[CompletionItem]:
    from hil.scenario.schema import ESTIMATOR_NAMES

    return _or_files(ESTIMATOR_NAMES, incomplete)


def _listed_estimators(incomplete: str) -> list[CompletionItem]:
    from hil.scenario.schema import ESTIMATOR_NAMES

    before = incomplete[: incomplete.rfind(",") + 1]
    return _items((f"{before}{name}" for name in ESTIMATOR_NAMES), incomplete)


def _settings(incomplete: str) -> list[CompletionItem]:
    """Sections, then their keys, then values where there are only so many: no more than one can look at."""
    from hil.scenario.keys import settable_keys

    keys = settable_keys()
    key, equals, _ = incomplete.partition("=")
    if equals:
        return _items((f"{key}={value}" for value in keys.get(key, ())), incomplete)
    if "." not in key:
        return _items(dict.fromkeys(each[: each.find(".") + 1] or f"{each}=" for each in keys), key)
    return _items((f"{each}=" for each in keys), key)


_KNOWN: dict[str, Complete] = {
    "scenario": _shipped("scenarios"),
    "spec": _shipped("sweeps"),
    "chart": _shipped("maps"),
    "law": _laws,
    "estimator": _estimators,
    "estimators": _listed_estimators,
    "overrides": _settings,
}
