"""Why an estimate must not move a robot, in words for the log."""

from __future__ import annotations

from estimation.tracking.follower_check import Cause
from estimation.tracking.tracker import Status
from formation.kernel import kernel

REASONS = {
    Status.INITIALISING: "speed and bearing of the leader not yet known well enough",
    Status.TRACKING: "",
    Status.COASTING: "no measurement of late",
    Status.REJECTING: "newest measurement outside the gate",
    Status.LOST: "no usable measurement for too long",
}
REJECTIONS = {
    Cause.GATED: REASONS[Status.REJECTING],
    Cause.FOLLOWER: "follower not where its own motion took it",
    Cause.FLIPPED: "follower's heading turned round",
    Cause.SWAPPED: "leader and follower have changed places",
    Cause.FROZEN: "last pose of a moving body repeated",
    Cause.MOUNT: "follower's heading is not its direction of travel: calibrate its mount",
}


_CAUSES = len(Cause)


@kernel
def reason_number(status: int, cause: int) -> int:
    """Where the reason of :func:`reason_for` stands among :data:`ALL_REASONS`."""
    return status * _CAUSES + cause


def reason_for(status: Status, cause: Cause) -> str:
    """Why an estimate is not TRACKING, ``cause`` being that of its point; empty if it is."""
    return REJECTIONS.get(cause, REASONS[status]) if status is Status.REJECTING else REASONS[status]


ALL_REASONS = tuple(reason_for(status, Cause(cause)) for status in sorted(Status) for cause in range(_CAUSES))
"""The reason for every status and cause, in the order of :func:`reason_number`."""
