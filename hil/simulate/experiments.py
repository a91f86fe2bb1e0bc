"""The noise-free experiment that a scenario stands for, with a pair, a chain or a flock."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from hil.errors import UsageError
from hil.scenario.schema import Scenario
from hil.simulate.simulation import Simulation

if TYPE_CHECKING:
    from hil.figures.paper_figures import Kind


def experiment(
    scenario: Scenario, out: Path | None = None, *, stability: bool = False, figures: Kind | None = None
) -> Simulation:
    """Run it; with ``out``, pictures and CSV go there. ``stability``: check the propositions too.

    ``figures``: single figures for a paper as well, below ``out``.

    Raises :class:`UsageError` for what a chain or a flock cannot do, and
    :class:`~hil.errors.CheckFailedError` if the motion breaks down.
    """
    chain, flock = scenario.chain, scenario.flock
    if not isinstance(chain, msgspec.UnsetType):
        _refuse_what_is_for_a_pair(scenario, "chain", stability=stability)
        if not isinstance(flock, msgspec.UnsetType):
            raise UsageError(
                f"scenario {scenario.name}: it has a [chain] and a [flock]; leave one of them out"
            )
        from hil.simulate.chain_simulation import simulate_chain_of

        return simulate_chain_of(scenario, chain.agents, out, figures)
    if not isinstance(flock, msgspec.UnsetType):
        _refuse_what_is_for_a_pair(scenario, "flock", stability=stability)
        from hil.simulate.flock_simulation import simulate_flock_of

        return simulate_flock_of(scenario, flock, out, figures)
    from hil.simulate.pair_simulation import simulate

    return simulate(scenario, out, stability=stability, figures=figures)


def _refuse_what_is_for_a_pair(scenario: Scenario, section: str, *, stability: bool) -> None:
    asked = {"--stability": stability, "formation.change_sides_at_s": scenario.formation.change_sides_at_s}
    for name, given in asked.items():
        if given:
            raise UsageError(f"{name} is for a pair, and {scenario.name} has a [{section}]; leave it out")
