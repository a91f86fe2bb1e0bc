"""What the estimator has found out about the follower's odometry, in words."""

from __future__ import annotations

from estimation.own_motion.odometry_check import POSE, TRACK, OdometryCheck, Sums
from hil.nodes.estimator_records import AUTO, Known, Rules
from hil.nodes.own_motion_step import source_now

FINDING = "finding."
"""What the names of findings begin with among the values of a node's diagnostics."""

_NS = 1e-9
_SILENT_S = 0.5  # the least; five periods of slower odometry
_PERIODS = 5.0
_NONE_YET_S = 1.0
_LATELY_S = 1.0
_REMEMBERED_S = 60.0  # for how long a reset is told
_NOTHING = 0.1  # share of the true motion below which a channel tells none
_NEAR_ONE, _EXPLAINS = 0.2, 0.3
_ALIKE = 0.9  # correlation above which a channel tells the motion by another scale
_OFF = 9.21  # misfit of a channel that contradicts, the chi-square quantile that a window must exceed


def odometry_findings(known: Known, rules: Rules, now_ns: int) -> dict[str, str]:
    """Findings by their names, as they hold at ``now_ns``: what was seen and what is used instead."""
    check, found = known.odometry_check, {}
    if check.bad_ns and (now_ns - check.bad_ns) * _NS < _LATELY_S:
        found["odometry_not_finite"] = "odometry with NaN or infinity comes in, which is not used"
    if rules.source != AUTO:
        return found
    age = (now_ns - check.last.stamp_ns) * _NS
    if not check.heard:
        if known.watched_ns and (now_ns - known.watched_ns) * _NS > _NONE_YET_S and not found:
            found["odometry_silent"] = (
                "no odometry has come; the follower's motion is that of its mocap track"
            )
        return found
    if age > max(_SILENT_S, _PERIODS * check.period):
        if not found:
            found["odometry_silent"] = f"newest odometry is {age:.1f} s old{_rate(check)}{_in_silence(known)}"
        return found
    if check.late != 0.0:
        way = "late" if check.late > 0.0 else "ahead of the motion, as commands are,"
        found["odometry_late"] = f"odometry is {way} by {abs(check.late):.2f} s{_instead(known, rules)}"
    elif not check.by_twist.trusted:
        found["odometry_contradicts"] = f"odometry tells {_contradiction(check)}{_instead(known, rules)}"
    if check.resets and (now_ns - check.reset_ns) * _NS < _REMEMBERED_S:
        found["odometry_reset"] = f"the pose of odometry has jumped {check.resets} times; its twist goes on"
    return found


def _rate(check: OdometryCheck) -> str:
    return f", {1.0 / check.period:.3g} a second before" if check.period > 0.0 else ""


def _instead(known: Known, rules: Rules) -> str:
    """What the motion is taken from instead."""
    source = source_now(known, rules)
    if source == POSE:
        return "; its pose is right and taken instead"
    if known.own.length == 0:
        return "; there is no mocap track to take instead"
    return "; the mocap track is taken instead" if source == TRACK else ""


def _in_silence(known: Known) -> str:
    if known.own.length == 0:
        return "; there is no mocap track to take instead, and its deviation grows"
    return "; the mocap track is taken instead"


def _contradiction(check: OdometryCheck) -> str:
    """What a refuted twist tells, channel by channel."""
    slip = _slip(check.u)
    if slip > 0.0:
        return f"what slips away by {slip:.2f} of the motion for every rad/s of turning"
    parts = [_off("speed", check.v), _off("turn rate", check.u)]
    return " and ".join(part for part in parts if part) or "another motion than the mocap track"


def _slip(sums: Sums) -> float:
    """Share of the turn that is told too much per rad/s, where that explains it; 0 where it does not.

    ``told = (a + b |u|) u`` by least squares, with a near 1, against ``told = a u``.
    """
    determinant = sums.shown * sums.slip - sums.by_slip * sums.by_slip
    if sums.misfit < _OFF or determinant <= 1e-6 * sums.shown * sums.slip:
        return 0.0
    a = (sums.both * sums.slip - sums.slipped * sums.by_slip) / determinant
    b = (sums.slipped * sums.shown - sums.both * sums.by_slip) / determinant
    scaled = sums.told - sums.both * sums.both / sums.shown
    left = sums.told - a * sums.both - b * sums.slipped
    return b if b > 0.0 and abs(a - 1.0) < _NEAR_ONE and left < _EXPLAINS * scaled else 0.0


def _off(channel: str, sums: Sums) -> str:
    """What is wrong with a channel; empty for one that is not."""
    if sums.misfit < _OFF or sums.shown <= 0.0:
        return ""
    factor = sums.both / sums.shown
    if sums.told < _NOTHING * _NOTHING * sums.shown:
        return f"a {channel} of zero though the robot moves"
    alike = abs(sums.both) / (sums.told * sums.shown) ** 0.5
    if alike < _ALIKE or abs(factor - 1.0) < _NOTHING:
        return f"a {channel} that does not fit the motion"
    if factor < 0.0:
        return f"a {channel} reversed" + (f", scaled by {-factor:.2f}" if abs(factor + 1.0) > 0.1 else "")
    return f"a {channel} scaled by {factor:.2f}"
