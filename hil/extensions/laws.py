"""Laws of one's own, by reference."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from controllers.own_law import OwnLaw
from hil.errors import UsageError
from hil.extensions.reference import found, loaded, short

GROUP = "abreast.laws"
"""Entry points by which packages bring laws."""
NOUN = "controller.law"


@functools.lru_cache(maxsize=64)
def _law_of(function: Callable[..., Any], text: str, parameters: tuple[str, ...]) -> OwnLaw:
    try:
        return OwnLaw(function, short(text), dict.fromkeys(parameters, 0.0))
    except ValueError as error:
        raise UsageError(f"controller.parameters: {error}") from None


def own_law(text: str, parameters: dict[str, float]) -> OwnLaw:
    """Law of a settled reference with its parameters; it is loaded, and compiled, once.

    Raises :class:`UsageError` as :func:`hil.extensions.reference.found` and
    :func:`~hil.extensions.reference.loaded`, and for a parameter that cannot be one.
    """
    function = loaded(found(text, NOUN))
    return _law_of(function, text, tuple(parameters)).with_parameters(parameters)
