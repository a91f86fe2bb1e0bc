"""By whom and why a run was stopped before its time, as its supervisor leaves it in the log."""

from __future__ import annotations

from collections.abc import Mapping

from hil.nodes.findings import Findings

SUPERVISOR = "run"
"""What a run's supervisor is called among the nodes."""

_NAME, _BETWEEN = "stopped_by", ": "


def stop_finding(who: str, reason: str) -> Findings:
    """The finding that somebody stopped a run.

    >>> stop_finding("session 7f", "cable loose")
    {'stopped_by': 'session 7f: cable loose'}
    """
    return {_NAME: f"{who.replace(_BETWEEN, ' ')}{_BETWEEN}{reason}"}


def stopped_by(found: Mapping[str, Findings]) -> dict[str, str] | None:
    """Who stopped a run and why, of what nodes found by their names; None where it ran to its end.

    >>> stopped_by({"run": stop_finding("session 7f", "late: 3 s")})
    {'who': 'session 7f', 'reason': 'late: 3 s'}
    """
    text = found.get(SUPERVISOR, {}).get(_NAME)
    if text is None:
        return None
    who, _, reason = text.partition(_BETWEEN)
    return {"who": who, "reason": reason}
