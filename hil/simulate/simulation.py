"""What a noise-free experiment gives: the report on it, and where everybody was."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from formation.angles import FloatArray
from hil.log.report_json import known


@dataclass(frozen=True, slots=True, eq=False)
class Simulation:
    """A noise-free experiment with N agents at n times.

    ``report``: the JSON of ``abreast simulate``. ``t`` (n,) [s]. ``poses`` (n, N, 3): x, y [m], theta [rad]
    of every agent, the leader first. ``v``, ``u`` (n, N): their speeds [m/s] and turn rates [rad/s].
    ``rho`` [m], ``alpha1``, ``alpha2`` [rad]: the shape, (n,) of a pair and (n, N-1) of a chain, each agent
    with the one before it; None of a flock.

    >>> import abreast
    >>> found = abreast.simulate("fig2-independent", duration_s=12.0)
    >>> print(found.poses.shape, f"{found.rho[-1]:.4f} {found.as_dict()['final']['rho']:.4f}")
    (2401, 2, 3) 0.6888 0.6888
    """

    report: dict[str, object]
    t: FloatArray
    poses: FloatArray
    v: FloatArray
    u: FloatArray
    rho: FloatArray | None = None
    alpha1: FloatArray | None = None
    alpha2: FloatArray | None = None

    def as_dict(self) -> dict[str, Any]:
        """The JSON of ``abreast simulate``."""
        result: dict[str, Any] = known(self.report)
        return result
