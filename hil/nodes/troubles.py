"""What a node's reports say of its troubles over time: inputs that were refused, and what was found."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from hil.nodes.findings import findings_in
from hil.nodes.reported_number import reported_number
from hil.wire.message_types import DiagnosticArray
from hil.wire.messages import to_ns

REFUSED = "refused."
"""What the keys of counts of refused inputs begin with."""


@dataclass(frozen=True, slots=True)
class Trouble:
    """As a report of ``at_ns`` had it: how many inputs were refused so far, by cause, and what was found."""

    at_ns: int
    refused: Mapping[str, int]
    found: frozenset[str]


def troubles_in(report: DiagnosticArray) -> dict[str, Trouble]:
    """Troubles of the nodes of a report, by their names."""
    at_ns, found = to_ns(report.header.stamp), findings_in(report)
    return {
        name: Trouble(
            at_ns,
            {
                entry.key.removeprefix(REFUSED): count
                for entry in status.values
                if entry.key.startswith(REFUSED) and (count := reported_number(entry.value)) is not None
            },
            frozenset(found[name]),
        )
        for status in report.status
        for name in [status.name.removeprefix("abreast/")]
    }


def troubles_of(reports: Iterable[DiagnosticArray], node: str) -> list[Trouble]:
    """Troubles of a node in the order of its reports."""
    return [told[node] for told in map(troubles_in, reports) if node in told]
