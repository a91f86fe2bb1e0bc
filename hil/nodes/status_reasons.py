"""Why an estimate must not move a robot, in words for the log."""

from __future__ import annotations

from estimation.tracking.screening import Cause
from estimation.tracking.tracker import Status, Track

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
}


def reason_for(status: Status, track: Track) -> str:
    """Why an estimate does not have the status TRACKING; empty if it has."""
    cause = track[-1].cause
    return REJECTIONS[cause] if status is Status.REJECTING and cause is not None else REASONS[status]
