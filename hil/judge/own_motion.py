"""How the follower's odometry compares with its own mocap track, for the summary of a replay."""

from __future__ import annotations

from hil.judge.replay_verdict import Played
from hil.log.reader import Log
from hil.replay.kept import KeptReplay
from hil.replay.odometry_alignment import judge_kept_motion
from hil.replay.odometry_alignment import judge_own_motion as judge_logged_motion


def judge_own_motion(log: Log, played: Played) -> dict[str, float]:
    """The ``own_motion`` part of a summary, see :func:`hil.replay.odometry_alignment.judge_own_motion`."""
    if isinstance(played, KeptReplay):
        return judge_kept_motion(played.kept)
    return judge_logged_motion(log, played.scenario)
