"""What kinds of value a key of a schema takes: sections, or one of a few words."""

from __future__ import annotations

from typing import Any, Literal, TypeGuard, get_args, get_origin

import msgspec


def is_section(kind: object) -> TypeGuard[type[msgspec.Struct]]:
    """Whether a type is that of a section."""
    return isinstance(kind, type) and issubclass(kind, msgspec.Struct)


def literals(kind: Any) -> list[object]:
    """Values of a Literal, or of the Literals in a union."""
    if get_origin(kind) is Literal:
        return list(get_args(kind))
    return [value for option in get_args(kind) for value in literals(option)]
