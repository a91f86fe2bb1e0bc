"""What the estimator finds of the leader that nobody told it."""

from __future__ import annotations

from estimation.tracking.travel_watch import TOLD_FOR_NS, TravelWatch
from hil.nodes.findings import Findings


def leader_findings(watch: TravelWatch, now_ns: int) -> Findings:
    """That the leader has turned back of late."""
    if not watch.turned_ns or abs(now_ns - watch.turned_ns) > TOLD_FOR_NS:
        return {}
    text = (
        "the leader's speed went through zero and its direction of travel turned by more than a right angle, "
        "expected v1 >= v_eps: alpha1 is that of the new direction"
    )
    return {"cusp": text}
