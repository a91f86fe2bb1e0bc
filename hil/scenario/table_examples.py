"""Examples of keys that hold lists of tables, for those who have not written one yet."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from typing import Any, get_args, get_origin

import msgspec

from hil.scenario.kinds_of_key import is_section, literals

_ALIKE = 0.85
_ANY_KIND = ("kind", "at_s", "duration_s")


def example_of(key: str, table: type[msgspec.Struct], kind: str = "") -> str:
    """How ``--set`` gives a key one such table, of a ``kind`` if that is wanted; empty without an example."""
    given = _example(table)
    if given is None:
        return ""
    told = given
    if kind and kind != given["kind"]:
        # What else stands in the example is that kind's alone.
        told = {name: value for name, value in given.items() if name in _ANY_KIND} | {"kind": kind}
    return f"--set '{key}=[{{{', '.join(f'{name}={_written(value)}' for name, value in told.items())}}}]'"


def kind_meant(word: str, schema: type[msgspec.Struct]) -> str:
    """Whose kind an unknown key is that was meant as one, with an example; empty where it is nobody's."""
    for key, table in _listed(schema, ""):
        kinds = [
            str(each)
            for field in msgspec.structs.fields(table)
            if field.name == "kind"
            for each in literals(field.type)
        ]
        if near := difflib.get_close_matches(word, kinds, n=1, cutoff=_ALIKE):
            return f"{near[0]!r} is a kind of {key}: give {example_of(key, table, near[0])}"
    return ""


def _listed(section: type[msgspec.Struct], above: str) -> Iterator[tuple[str, type[msgspec.Struct]]]:
    """Keys of lists of tables that have an example, with what such a table is."""
    for field in msgspec.structs.fields(section):
        for each in filter(is_section, (field.type, *get_args(field.type))):
            if get_origin(field.type) is tuple and _example(each) is not None:
                yield f"{above}{field.name}", each
            else:
                yield from _listed(each, f"{above}{field.name}.")


def _example(table: type[msgspec.Struct]) -> Mapping[str, Any] | None:
    example: Mapping[str, Any] | None = getattr(table, "EXAMPLE", None)
    return example


def _written(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"
