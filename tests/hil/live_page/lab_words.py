"""A lab in words: all that its robots and nodes say once, whatever the numbers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from formation.pose import Motion, Pose
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.nodes.findings import named_findings
from hil.nodes.node import diagnostics
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.drive_message import drive_message
from hil.wire.messages import encode, header, to_time

NS = 1_000_000_000


def estimate(
    numbers: list[float], status: int = 1, reason: str = "", stamp_ns: int = 7 * NS
) -> msg.LeaderEstimate:
    """An estimate: rho, alpha1, alpha2, v1, u1, its bounds, and for its covariance all other numbers."""
    rho, alpha1, alpha2, v1, u1, bound_v1, bound_alpha1, *rest = numbers
    covariance = np.resize(np.array(rest, dtype=np.float64), 25)
    return msg.LeaderEstimate(
        header(stamp_ns, ""), to_time(stamp_ns), to_time(stamp_ns), rho, alpha2, 0.0, 0.0, v1, alpha1, u1,
        0.0, 0.0, covariance, 1.0, status, reason, bound_v1, bound_alpha1, 0.1, [],
    )  # fmt: skip


def command(v2: float, u2: float, stop: str = "", stamp_ns: int = 7 * NS) -> msg.Command:
    """A controller's decision on a measurement of 31 ms before."""
    return msg.Command(
        header(stamp_ns, ""), to_time(stamp_ns), to_time(stamp_ns - 31_000_000), v2, u2, v2, u2, False, stop,
        True, [],
    )  # fmt: skip


def lab_words(
    leader: Pose, follower: Pose, moves: Motion, numbers: list[float], text: str = ""
) -> Iterator[tuple[str, bytes]]:
    """Topics and payloads of a pair that is seen, driven and believed in."""
    frame = frame_message(7 * NS, 1, [("leader", leader), ("follower", follower)])
    yield topics.RIGID_BODIES, encode(frame)
    for name, pose in (("leader", leader), ("follower", follower)):
        yield f"{name}/odom", encode(odometry_message(7 * NS, name, pose, moves))
        yield f"{name}/cmd_vel", encode(drive_message(moves, 7 * NS, name, stamped=True))
    yield "follower/leader_estimate", encode(estimate(numbers, reason=text))
    yield "follower/command", encode(command(moves.v, moves.u, stop=text))
    found = named_findings({"axes": text or "y points up"})
    values = {"status": "tracking", "refused.tilted": 7, "refused.late": text, **found}
    yield topics.DIAGNOSTICS, encode(diagnostics("estimator", 5, text, values))
    told = {"side": "left", "side_change": "under way"}
    yield topics.DIAGNOSTICS, encode(diagnostics("controller", 5, "", told))
    yield topics.DIAGNOSTICS, encode(diagnostics("guard/follower", 5, "", {"latched": ""}))
    yield topics.STOP, encode(msg.String(data=text))
