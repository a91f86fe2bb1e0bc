"""All keys that ``--set`` takes, as ``section.key``, with the values of those that have only so many."""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_args, get_origin

import msgspec

from hil.scenario.kinds_of_key import is_section, literals
from hil.scenario.schema import ESTIMATOR_NAMES, LAW_NAMES, Scenario

_OF_NAMES = {"estimator.kind": ESTIMATOR_NAMES, "controller.law": LAW_NAMES}


def settable_keys() -> dict[str, tuple[str, ...]]:
    """Keys in the order of the schema; each with its values, none where any number or text will do."""
    return dict(_keys(Scenario, ""))


def _keys(section: type[msgspec.Struct], above: str) -> Iterator[tuple[str, tuple[str, ...]]]:
    for field in msgspec.structs.fields(section):
        name = f"{above}{field.name}"
        listed = get_origin(field.type) is tuple
        below = [] if listed else [each for each in (field.type, *get_args(field.type)) if is_section(each)]
        for kind in below:
            if tag := kind.__struct_config__.tag_field:
                yield f"{name}.{tag}", tuple(str(each.__struct_config__.tag) for each in below)
            yield from _keys(kind, f"{name}.")
        if not below:
            yield name, _OF_NAMES.get(name) or _values(field.type)


def _values(kind: object) -> tuple[str, ...]:
    return ("true", "false") if kind is bool else tuple(filter(None, map(str, literals(kind))))
