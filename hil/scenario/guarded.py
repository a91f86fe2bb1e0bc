"""Whether the robots of a scenario have guards: in a lab they have, unless somebody says otherwise."""

from __future__ import annotations

from msgspec.structs import replace

from hil.scenario.schema import Scenario


def with_guards(scenario: Scenario, present: bool = True) -> Scenario:
    """The same scenario with guards between controllers and drivers, or without.

    >>> import abreast
    >>> with_guards(abreast.load_scenario("turtlebot3")).guard.present
    True
    """
    return replace(scenario, guard=replace(scenario.guard, present=present))
