"""Laws of one's own, by reference."""

from __future__ import annotations

import functools
import inspect
import math
from collections.abc import Callable
from typing import Any

from controllers.own_law import GIVEN, Leader, OwnLaw, Shape, gains_type
from hil.errors import UsageError
from hil.extensions.reference import found, loaded, short

GROUP = "abreast.laws"
"""Entry points by which packages bring laws."""
NOUN = "controller.law"
_ARGUMENTS = ("shape", "leader", "gains")


class _Same:
    """A function that is known by being the same object: what can be called need not have a hash."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.function is other.function

    def __hash__(self) -> int:
        return id(self.function)


@functools.lru_cache(maxsize=64)
def _law_of(same: _Same, text: str, parameters: tuple[str, ...]) -> OwnLaw:
    _refuse_other_arguments(same.function, text)
    try:
        law = OwnLaw(same.function, short(text), dict.fromkeys(parameters, 0.0))
    except ValueError as error:
        raise UsageError(f"controller.parameters: {error}") from None
    _refuse_lacking_gains(same.function, text, parameters)
    return law


def _refuse_other_arguments(function: Callable[..., Any], text: str) -> None:
    try:
        inspect.signature(function).bind(*_ARGUMENTS)
    except ValueError:  # something that does not tell what it takes
        pass
    except TypeError as error:
        raise UsageError(
            f"{NOUN} {text}: cannot be called with {', '.join(_ARGUMENTS)} ({error}); give it these three"
        ) from None


def _refuse_lacking_gains(function: Callable[..., Any], text: str, parameters: tuple[str, ...]) -> None:
    """Ask it once for a usual shape: a gain that is not there is never there, whatever is driven."""
    gains = gains_type(parameters)(*[1.0] * (len(GIVEN) + len(parameters)))
    try:
        function(Shape(1.0, -0.5 * math.pi, 0.5 * math.pi), Leader(0.1, 0.0), gains)
    except AttributeError as error:
        if error.obj is gains:
            given = ", ".join((*GIVEN, *parameters))
            raise UsageError(
                f"{NOUN} {short(text)}: asks for gains.{error.name}, and the gains are {given}; give it by "
                f"--set controller.parameters.{error.name}=NUMBER"
            ) from None
    except Exception:
        # What it may raise for one shape is told when it is driven by: another it may know.
        pass


def own_law(text: str, parameters: dict[str, float]) -> OwnLaw:
    """Law of a settled reference with its parameters; it is loaded, and compiled, once.

    Raises :class:`UsageError` as :func:`hil.extensions.reference.found` and
    :func:`~hil.extensions.reference.loaded`, for a function that takes other arguments or asks for a gain
    that is not given, and for a parameter that cannot be one.
    """
    function = loaded(found(text, NOUN))
    return _law_of(_Same(function), text, tuple(parameters)).with_parameters(parameters)
