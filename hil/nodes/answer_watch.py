"""Whether a robot answers its commands: what it was told against its own motion in the estimates."""

from __future__ import annotations

from typing import NamedTuple

from formation.pose import STANDSTILL, Motion
from hil.nodes.at_rest import stands
from hil.nodes.findings import Findings

_ASKED_V, _ASKED_U = 0.03, 0.2
_PATIENCE_NS = 1_000_000_000
"""Far longer than a robot's lag and the age of an estimate together."""


class AnswerWatch(NamedTuple):
    """Since when a robot has been told to move and stood, 0 if it has not; ``asked``: what it was told."""

    since_ns: int = 0
    asked: Motion = STANDSTILL


UNASKED = AnswerWatch()


def with_answer(watch: AnswerWatch, now_ns: int, asked: Motion, shown: Motion | None) -> AnswerWatch:
    """Watch with the newest command and the motion that the robot shows; None if nobody knows that.

    Speeds in m/s, turn rates in rad/s. What asks for hardly any motion asks for nothing here.
    """
    asks = abs(asked.v) >= _ASKED_V or abs(asked.u) >= _ASKED_U
    if not asks or shown is None or not stands(shown):
        return UNASKED
    # The clock may have been set back.
    since_ns = watch.since_ns if 0 < watch.since_ns <= now_ns else now_ns
    return AnswerWatch(since_ns, asked)


def answer_findings(watch: AnswerWatch, now_ns: int) -> Findings:
    """That a robot has not answered for a second and more."""
    if not watch.since_ns or now_ns - watch.since_ns < _PATIENCE_NS:
        return {}
    v, u = watch.asked
    text = (
        f"the robot is told v2 {v:+.3f} m/s and u2 {u:+.2f} rad/s, and stands; expected odometry and motion "
        "capture to show an answer"
    )
    return {"deaf_robot": text}
