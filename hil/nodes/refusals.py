"""What becomes of an estimator's inputs, in numbers that kernels count by and words that people read."""

from __future__ import annotations

from estimation.tracking.follower_check import Cause as FollowerCause
from estimation.tracking.track_point import Verdict
from formation.kernel import kernel
from hil.wire import message_checks
from hil.wire.message_checks import Cause

_WORDS = [cause.word for cause in sorted(Cause)]


def _numbered(*words: str) -> int:
    """Number of the first of some more words."""
    _WORDS.extend(words)
    return len(_WORDS) - len(words)


NOT_REFUSED = message_checks.ACCEPTED
UNKNOWN_BODY, BAD_STAMP = message_checks.UNKNOWN_BODY, message_checks.BAD_STAMP
BAD_RANGE, NOT_FINITE = message_checks.BAD_RANGE, message_checks.NOT_FINITE
CLOCK_UNKNOWN, CLOCK_JUMP = _numbered("clock_unknown"), _numbered("clock_jump")
SAME_PLACE = _numbered("same_place")
NO_BODY_FRONT_END = _numbered("sighting_without_body_front_end")
ODOMETRY_NOT_FINITE = _numbered("odometry_not_finite")
_BY_VERDICT = _numbered(*(verdict.word for verdict in sorted(Verdict)))
_BY_FOLLOWER = _numbered(*(cause.word for cause in sorted(FollowerCause)))
REFUSALS = tuple(_WORDS)
"""What an input that is not used is counted by; :class:`hil.wire.message_checks.Cause` comes first."""

TAKEN = ("frames", "used", "odometry", "late")
TAKEN_FRAME, TAKEN_USED, TAKEN_ODOMETRY, TAKEN_LATE = range(len(REFUSALS), len(REFUSALS) + len(TAKEN))

COUNTED = len(REFUSALS) + len(TAKEN)
"""How many counts there are."""


@kernel
def refusal_of(verdict: int, cause: int) -> int:
    """Number of what a measurement is not used for: the cause that is known, else the verdict."""
    return _BY_FOLLOWER + cause if cause != 0 else _BY_VERDICT + verdict
