"""A track told again, since more has become known of how the follower moved meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from estimation.models.motion import FollowerMotion
from estimation.tracking.tracker import Track, Tracker

MotionAt = Callable[[int], FollowerMotion | None]
"""Motion of the follower at a capture time; None where nothing better is known than before."""


def retold(tracker: Tracker, track: Track, since_ns: int, motion_at: MotionAt) -> Track:
    """Track whose measurements from ``since_ns`` on have the motion that is now known of their moment.

    What odometry that came late tells is taken in where it belongs, so that the track is the one of delivery
    in order. The oldest point keeps its belief: what that rests on is gone.
    """
    place = sum(point.measurement.capture_ns < since_ns for point in track)
    if place == len(track):
        return track
    told = [point.measurement for point in track[place:]]
    motions = [motion_at(each.capture_ns) or each.motion for each in told]
    if motions == [each.motion for each in told]:
        return track
    due = [replace(each, motion=motion) for each, motion in zip(told, motions, strict=True)]
    points = list(track[:place])
    if not points:
        points, due = [replace(track[0], measurement=due[0])], due[1:]
    for measurement in due:
        points.append(tracker.follow(points[-1], measurement))
    return tuple(points)
