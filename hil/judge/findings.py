"""What was found to be wrong in a run: what its nodes reported, of one follower's and of nobody's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hil.nodes.findings import Findings, all_found, findings_json
from hil.scenario.links import Link

_NODES = ("estimator", "controller")


def of_follower(found: Mapping[str, Findings], link: Link) -> dict[str, Findings]:
    """Findings by the nodes' names without those of other followers of a chain."""
    others = link.others | {link.leader}
    return {node: each for node, each in found.items() if node.partition("/")[2] not in others}


def found_again(
    logged: Mapping[str, Findings] | None, again: Mapping[str, Findings], link: Link, *, same: bool
) -> dict[str, Findings]:
    """Findings of a log with those of its replay.

    ``same``: whether the replay repeats what was live, which then counts too: live nodes reported at more
    moments than a replay is looked at.
    """
    replayed = {link.node_name(node) for node in _NODES}
    kept = {node: each for node, each in (logged or {}).items() if same or node not in replayed}
    return dict(all_found([again, kept]))


def findings_list(
    found: Mapping[str, Findings] | None, judged: Findings | None
) -> list[dict[str, Any]] | None:
    """The ``findings`` of a summary, one of a name, None where nobody could have told.

    ``judged``: what the judge finds itself, None where it cannot.
    """
    if found is None and judged is None:
        return None
    merged = {name: text for findings in (found or {}).values() for name, text in findings.items()}
    return findings_json({**merged, **(judged or {})})
