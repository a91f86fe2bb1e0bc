"""What commands say of a law or an estimator of one's own, before anything is driven by it."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from controllers.own_law import OwnLaw
from hil.extensions.reference import is_reference, short
from hil.log.report_json import note
from hil.scenario.schema import Scenario


def remarks_on(laws: Iterable[OwnLaw | None]) -> Callable[[], None]:
    """What says on stderr that a law of one's own failed, once for every error; to be called now and then."""
    known = [law for law in laws if law is not None]
    said = dict.fromkeys((law.name for law in known), "")

    def remark() -> None:
        for law in known:
            if law.failures() and (failure := law.failure()) != said[law.name]:
                said[law.name] = failure
                note(f"law {law.name} failed, the robot is told to stand still: {failure}")

    return remark


def load_own_parts(scenario: Scenario, *, estimates: bool = True) -> None:
    """Load and compile a scenario's own law and estimator, and say which run interpreted.

    ``estimates``: whether there are any. Raises :class:`UsageError` for what cannot be had.
    """
    law, kind = scenario.controller.law, scenario.estimator.kind
    if is_reference(law):
        from hil.scenario.brought import law_of

        own = law_of(scenario)
        if own is not None and own.why_not_compiled:
            note(f"law {own.name} runs interpreted: {own.why_not_compiled}")
    if estimates and is_reference(kind):
        from hil.scenario.leader_model import leader_filter

        leader_filter(scenario)
        note(f"estimator {short(kind)} runs interpreted")
