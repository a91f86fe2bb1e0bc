"""Whether a scenario asks for certified estimates, which stand beside all else and change nothing of it."""

from __future__ import annotations

from msgspec.structs import replace

from hil.scenario.schema import Scenario

CERTIFY = "estimator.certify=true"
"""Override that asks for certified estimates."""


def same_steps(a: Scenario, b: Scenario) -> bool:
    """Whether two scenarios make the same estimates and commands: they differ in ``certify`` at most."""
    return a == replace(b, estimator=replace(b.estimator, certify=a.estimator.certify))
