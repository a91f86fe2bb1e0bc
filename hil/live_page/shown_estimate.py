"""An estimate as the page shows it: numbers with deviations and bounds, and the leader that it tells of."""

from __future__ import annotations

import math
from typing import Any

from estimation.tracking.tracker import Status
from formation.pose import Pose
from hil.live_page.believed_leader import believed_pose, motion_ellipse
from hil.live_page.shown_numbers import clipped, deviation, shown
from hil.wire import message_types as msg

_V1, _ALPHA1, _U1 = 2, 3, 4
"""Places in the covariance of an estimate, of five rows."""

_KNOWN = {status.value: status.name.lower() for status in Status}


def shown_estimate(seen: msg.LeaderEstimate, follower: Pose | None) -> dict[str, Any]:
    """The plain data of an estimate; with the follower's pose, where the leader is believed to be."""
    variance = [float(seen.covariance[6 * row]) for row in (_V1, _ALPHA1, _U1)]
    return {
        "status": _KNOWN.get(seen.status, "unknown"),
        "reason": clipped(seen.reason),
        "shape": [shown(seen.rho), shown(seen.alpha1), shown(seen.alpha2)],
        "v1": [shown(seen.v1), deviation(variance[0]), shown(seen.bound_v1)],
        "alpha1": [shown(seen.alpha1), deviation(variance[1]), shown(seen.bound_alpha1)],
        "u1": [shown(seen.u1), deviation(variance[2]), None],
        "leader": _believed(seen, follower, variance) if follower is not None else None,
    }


def _believed(seen: msg.LeaderEstimate, follower: Pose, variance: list[float]) -> dict[str, Any] | None:
    if not all(map(math.isfinite, (seen.rho, seen.alpha1, seen.alpha2))):
        return None
    pose = believed_pose(follower, seen.rho, seen.alpha1, seen.alpha2)
    both = float(seen.covariance[5 * _V1 + _ALPHA1])
    ellipse = motion_ellipse(pose.theta, seen.v1, variance[0], both, variance[1])
    return {"pose": [*map(shown, pose)], "ellipse": [*map(shown, ellipse)] if ellipse else None}
