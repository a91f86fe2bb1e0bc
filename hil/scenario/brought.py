"""What a scenario has from others: its law and its estimator, where they are references."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from msgspec import UnsetType

from controllers.own_law import OwnLaw
from hil.errors import UsageError
from hil.extensions import estimators, laws
from hil.extensions.reference import is_reference, settled
from hil.scenario.checked_toml import meant
from hil.scenario.schema import ESTIMATOR_NAMES, LAW_NAMES, Scenario


class _Place(NamedTuple):
    section: str
    key: str
    known: tuple[str, ...]
    group: str
    like: str


_LAW = _Place("controller", "law", LAW_NAMES, laws.GROUP, "file.py:function")
_ESTIMATOR = _Place("estimator", "kind", ESTIMATOR_NAMES, estimators.GROUP, "file.py:factory")


def settle_references(tree: dict[str, Any], folder: Path) -> None:
    """Put references that mean the same anywhere in the place of those in a tree of plain values.

    ``folder``: from where the paths of files count. Raises :class:`UsageError` for what can be none.
    """
    for place in (_LAW, _ESTIMATOR):
        section = tree.get(place.section)
        text = section.get(place.key) if isinstance(section, dict) else None
        if isinstance(section, dict) and isinstance(text, str) and text not in place.known:
            section[place.key] = settled(text, f"{place.section}.{place.key}", place.group, folder)


def settled_references(law: str | None, estimator: str | None) -> dict[str, str | None]:
    """The same for a law and an estimator that were given as options, by ``law`` and ``estimator``."""
    given = {"law": (_LAW, law), "estimator": (_ESTIMATOR, estimator)}
    return {
        noun: text if text is None or text in place.known else settled(text, f"--{noun}", place.group, Path())
        for noun, (place, text) in given.items()
    }


def refuse_unknown(scenario: Scenario, source: str) -> None:
    """Raise :class:`UsageError` for a law or an estimator that is neither known nor a reference."""
    for place, text in ((_LAW, scenario.controller.law), (_ESTIMATOR, scenario.estimator.kind)):
        if text not in place.known and not is_reference(text):
            raise UsageError(
                f"{source}: {place.section}.{place.key} is {text!r}: expected one of "
                f"{', '.join(map(repr, place.known))}, or {place.like}{meant(text, place.known)}"
            )
    if not is_reference(scenario.controller.law) and parameters_of(scenario):
        raise UsageError(
            f"{source}: controller.parameters are of a law of one's own, and {scenario.controller.law!r} "
            "takes none; leave them out"
        )


def parameters_of(scenario: Scenario) -> dict[str, float]:
    """Gains of a law of one's own besides the usual ones."""
    given = scenario.controller.parameters
    return {} if isinstance(given, UnsetType) else given


def law_of(scenario: Scenario) -> OwnLaw | None:
    """The scenario's own law, loaded and compiled; None for one that abreast has.

    Raises :class:`UsageError` if it cannot be had.
    """
    text = scenario.controller.law
    return laws.own_law(text, parameters_of(scenario)) if is_reference(text) else None
