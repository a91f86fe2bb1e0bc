"""What commands say of a law or an estimator of one's own, before anything is driven by it."""

from __future__ import annotations

import click

from hil.extensions.reference import is_reference, short
from hil.scenario.schema import Scenario


def load_own_parts(scenario: Scenario, *, estimates: bool = True) -> None:
    """Load and compile a scenario's own law and estimator, and say which run interpreted.

    ``estimates``: whether there are any. Raises :class:`UsageError` for what cannot be had.
    """
    law, kind = scenario.controller.law, scenario.estimator.kind
    if is_reference(law):
        from hil.scenario.brought import law_of

        own = law_of(scenario)
        if own is not None and own.why_not_compiled:
            click.echo(f"law {own.name} runs interpreted: {own.why_not_compiled}", err=True)
    if estimates and is_reference(kind):
        from hil.scenario.leader_model import leader_filter

        leader_filter(scenario)
        click.echo(f"estimator {short(kind)} runs interpreted", err=True)
