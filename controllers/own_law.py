"""A law of one's own: what it gets, what it gives, and how the loop asks it.

It is a plain function ``law(shape, leader, gains) -> (v2, u2)``, called for the shape in which its command
will act, and written for a follower on the right of its leader: for one on the left it is asked with the
mirror image, and its turn rate is mirrored. It may not have a memory: whoever replays a log, or flies a sweep
in several processes, asks it anew.

    v2, u2 = law(Shape(0.5, -1.5, 1.5), Leader(0.15, 0.0), gains)
"""

from __future__ import annotations

import copy
import keyword
import math
from collections import namedtuple
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any, NamedTuple

from formation.address import Address, called
from formation.first_class import FirstClass
from formation.kernel import kernel
from formation.line import Line
from formation.pose import Motion

GIVEN = ("mu1", "mu2", "mu_rho", "rho_0", "bearing", "v_max", "u_max")
"""Gains that every law gets, in their order: as the scenario has them; the limits are infinite for none."""


class SeenShape(NamedTuple):
    """Distance rho [m], bearings alpha1, alpha2 [rad], and the cosines and sines of both.

    The last are what the loop goes by: the shipped laws take them as they are, so that a law of one's own
    that does so gives their very bits.
    """

    rho: float
    alpha1: float
    alpha2: float
    cos1: float
    sin1: float
    cos2: float
    sin2: float


class Shape(SeenShape):
    """The same from distance [m] and bearings [rad] alone, to try a law by hand.

    >>> import abreast, math
    >>> shape = abreast.Shape(0.5, -0.5 * math.pi, 0.5 * math.pi)
    >>> shape.rho, shape.sin1, shape.sin2
    (0.5, -1.0, 1.0)
    """

    __slots__ = ()

    def __new__(cls, rho: float, alpha1: float, alpha2: float) -> Shape:
        """Shape of a distance [m] and two bearings [rad]."""
        pairs = math.cos(alpha1), math.sin(alpha1), math.cos(alpha2), math.sin(alpha2)
        return tuple.__new__(cls, (rho, alpha1, alpha2, *pairs))


class Leader(NamedTuple):
    """The leader's speed v1 [m/s] and turn rate u1 [rad/s], nan where the estimator has none.

    >>> import abreast
    >>> abreast.Leader(v1=0.08, u1=0.7).v1
    0.08
    """

    v1: float
    u1: float


class Gains(SimpleNamespace):
    """What a law of one's own goes by, to try it by hand: the scenario's gains, and its own parameters.

    ``mu1``, ``mu2`` [rad/s], ``mu_rho`` [1/m], ``rho_0`` [m], ``bearing`` [rad], and the limits ``v_max``
    [m/s], ``u_max`` [rad/s], infinite for none.

    >>> import abreast, math
    >>> def turning_back(shape, leader, gains):
    ...     return leader.v1, gains.mu2 * shape.cos2 + gains.k
    >>> gains = abreast.Gains(mu1=1.5, mu2=1.5, mu_rho=20.0, rho_0=0.2, k=0.1)
    >>> v2, u2 = turning_back(abreast.Shape(0.2, -1.5, math.pi), abreast.Leader(0.08, 0.0), gains)
    >>> round(v2, 3), round(u2, 3)
    (0.08, -1.4)
    """

    def __init__(
        self,
        *,
        mu1: float,
        mu2: float,
        mu_rho: float,
        rho_0: float,
        bearing: float = 0.5 * math.pi,
        v_max: float = math.inf,
        u_max: float = math.inf,
        **parameters: float,
    ) -> None:
        usual = (mu1, mu2, mu_rho, rho_0, bearing, v_max, u_max)
        super().__init__(**dict(zip(GIVEN, usual, strict=True)), **parameters)


class Asked(NamedTuple):
    """Shape and leader in one row."""

    rho: float
    alpha1: float
    alpha2: float
    cos1: float
    sin1: float
    cos2: float
    sin2: float
    v1: float
    u1: float


class OwnLaw:
    """A law of one's own with its parameters, ready for the loop.

    ``name``: what to call it. ``parameters``: further gains by name. Raises :class:`ValueError` for a
    parameter whose name is that of a gain, or cannot be a name.
    """

    def __init__(
        self, function: Callable[..., Any], name: str, parameters: Mapping[str, float] | None = None
    ) -> None:
        given = dict(parameters or {})
        for parameter in given:
            if parameter in GIVEN or not is_name(parameter):
                raise ValueError(
                    f"parameter {parameter!r} of law {name}: expected a name of its own, such as k; "
                    f"taken are {', '.join(GIVEN)}"
                )
        self.name = name
        self._names = tuple(given)
        self._parameters = tuple(map(float, given.values()))
        self._called = FirstClass(function, (SeenShape, Leader), gains_type(tuple(given)))

    def with_parameters(self, parameters: Mapping[str, float]) -> OwnLaw:
        """The same law, compiled code and counts shared, with other values of its parameters."""
        other = copy.copy(self)
        other._parameters = tuple(float(parameters[name]) for name in self._names)
        return other

    @property
    def why_not_compiled(self) -> str:
        """Why it runs interpreted; empty if it is compiled."""
        return self._called.why_not

    def at(self, *gains: float) -> Address:
        """Where the loop finds it with these gains, in the order of :data:`GIVEN`."""
        return self._called.at(*gains, *self._parameters)

    def failures(self) -> int:
        """How often it raised, or gave no two finite numbers."""
        return self._called.failures()

    def failure(self) -> str:
        """What went wrong the last time, empty if nothing ever did."""
        return self._called.failure()


def is_name(text: str) -> bool:
    """Whether a parameter may be called so."""
    return text.isidentifier() and not keyword.iskeyword(text) and not text.startswith("_")


def gains_type(parameters: tuple[str, ...]) -> type[Any]:
    """Type of the gains of a law with these parameters."""
    return namedtuple("Gains", (*GIVEN, *parameters))


@kernel
def asked_law(at: Address, sign: float, line: Line, v1: float, u1: float) -> Motion:
    """Wanted motion by a law of one's own; NaN if it gives none. ``sign``: of the follower's side."""
    alpha1, alpha2 = math.atan2(line.sin1, line.cos1), math.atan2(line.sin2, line.cos2)
    v, u = called(
        at,
        Asked(
            line.rho,
            sign * alpha1,
            sign * alpha2,
            line.cos1,
            sign * line.sin1,
            line.cos2,
            sign * line.sin2,
            v1,
            sign * u1,
        ),
    )
    return Motion(v, sign * u)
