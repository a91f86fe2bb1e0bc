"""Which estimator and law made a run, and whether a law of one's own failed in it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from controllers.guard import StopReason
from hil.extensions.reference import is_reference, short
from hil.log.own_sources import digest_of
from hil.log.reader import Log
from hil.nodes.node import LAW_FAILURE
from hil.scenario.schema import Scenario

_FAILED = f"decided.{StopReason.NOT_FINITE.value}"


def law_facts(log: Log, controller: Mapping[str, str]) -> dict[str, Any]:
    """What is to be said of a log's own law besides its name, by its controller's last diagnostics."""
    facts: dict[str, Any] = {"digest": digest_of(log, "law")}
    if LAW_FAILURE in controller:
        facts |= {"failed": int(controller.get(_FAILED, "0")), "failure": controller[LAW_FAILURE]}
    return facts


def law_json(scenario: Scenario, facts: Mapping[str, Any]) -> str | dict[str, Any]:
    """The law as summaries have it: a name; of one's own ``name``, ``digest``, and how it failed, if it did.

    ``failed``: commands that were a standstill for that. ``failure``: the error, the last one.
    """
    law = scenario.controller.law
    return {"name": short(law), **facts} if is_reference(law) else law


def law_name(law: str | Mapping[str, Any]) -> str:
    """Name of the law of a summary."""
    return law if isinstance(law, str) else str(law["name"])


def made_by(summary: Mapping[str, Any]) -> list[str]:
    """Estimator and law of a summary, in words."""
    law = [f"{law_name(summary['law'])} law"] if "law" in summary else []
    return [str(summary["estimator"]), *law]


def law_failure(summary: Mapping[str, Any]) -> str:
    """That a law of one's own failed, and why; empty if none did."""
    law = summary.get("law", "")
    if isinstance(law, str) or not law.get("failed"):
        return ""
    return f"law {law['name']} failed in {law['failed']} commands, the robot stood still: {law['failure']}"
