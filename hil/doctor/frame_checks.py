"""Checks of motion capture: who is seen, how often, how evenly, and whether anybody stands frozen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from statistics import median, pstdev

from hil.doctor.check import Check, check
from hil.doctor.evidence import Evidence, Seen
from hil.nodes.frame_findings import bodies_text
from hil.nodes.frame_looks import quoted
from hil.wire import topics

_LEAST_HZ = 30.0
_MOST_JITTER_MS = 10.0
_MOST_LOSS = 0.05
_FROZEN_S = 0.5
_FEWEST = 10
_LEAST_SEEN = 0.9


def frame_checks(found: Evidence) -> Iterator[Check]:
    """Checks of the frames that came, in the order in which they are to be mended."""
    frames = found.frames
    unread = found.unread.get(topics.RIGID_BODIES, 0)
    seen = f"{len(frames)} frames" + (f", {unread} that cannot be read" if unread else "")
    advice = (
        "start the motion capture or its bridge, and see that [source] and [wire] name its topic and type"
    )
    yield check(
        "frames", len(frames) >= _FEWEST and not unread, seen, "mocap frames that can be read", advice
    )
    if len(frames) < _FEWEST:
        return
    yield _bodies(found)
    yield from (_always_seen(found, body) for body in _wanted(found))
    yield _rate(frames)
    yield _jitter(frames)
    yield _loss(frames)
    yield from (_frozen(frames, body) for body in _wanted(found))


def _wanted(found: Evidence) -> tuple[str, ...]:
    return tuple(robot.body for robot in found.robots)


def _bodies(found: Evidence) -> Check:
    names = sorted({name for frame in found.frames for name in frame.names})
    twice = next((frame.names for frame in found.frames if len(set(frame.names)) < len(frame.names)), ())
    wrong = bodies_text(_wanted(found), twice or names)
    advice = "give the bodies the names that leader.body and follower.body say, or set those to what is seen"
    return check("bodies", not wrong, wrong or quoted(names), quoted(_wanted(found)), advice)


def _always_seen(found: Evidence, body: str) -> Check:
    share = sum(body in frame.poses for frame in found.frames) / len(found.frames)
    advice = "see that its markers are not hidden and that it stands upright; look at axes and unit first"
    seen = f"{body}: in {100 * share:.0f} % of the frames"
    return check("tracked", share >= _LEAST_SEEN, seen, f"at least {100 * _LEAST_SEEN:.0f} %", advice)


def _rate(frames: Sequence[Seen]) -> Check:
    span_s = (frames[-1].at_ns - frames[0].at_ns) * 1e-9
    rate = (len(frames) - 1) / span_s if span_s > 0.0 else 0.0
    advice = "raise the frame rate of the motion capture, or look for what holds the network up"
    return check("rate", rate >= _LEAST_HZ, f"{rate:.1f} frames a second", f"at least {_LEAST_HZ:g}", advice)


def _jitter(frames: Sequence[Seen]) -> Check:
    delays_ms = [(frame.at_ns - frame.stamp_ns) * 1e-6 for frame in frames if frame.stamp_ns > 0]
    jitter = pstdev(delays_ms) if len(delays_ms) > 1 else 0.0
    advice = "use a cable, or 5 GHz with power saving off; end what else takes this machine's time"
    return check(
        "jitter", jitter <= _MOST_JITTER_MS, f"{jitter:.1f} ms", f"at most {_MOST_JITTER_MS:g} ms", advice
    )


def _loss(frames: Sequence[Seen]) -> Check:
    numbers = [frame.number for frame in frames]
    steps = [after - before for before, after in pairwise(numbers) if 0 < after - before < 1000]
    usual = median(steps) if steps else 0
    lost = sum(round(step / usual) - 1 for step in steps) if usual else 0
    share = lost / (lost + len(frames))
    advice = "use a cable, or unicast in the place of multicast over Wi-Fi"
    seen = f"{lost} frames lost ({100 * share:.1f} %)"
    return check("loss", share <= _MOST_LOSS, seen, f"at most {100 * _MOST_LOSS:g} %", advice)


def _frozen(frames: Sequence[Seen], body: str) -> Check:
    """Whether a body is shown in one and the same pose, to the last bit, though noise never does that."""
    poses = [(frame.at_ns, frame.poses[body]) for frame in frames if body in frame.poses]
    longest = since_ns = 0
    for (_, before), (at_ns, after) in pairwise(poses):
        since_ns = (since_ns or at_ns) if before == after else 0
        longest = max(longest, at_ns - since_ns if since_ns else 0)
    ok = longest < _FROZEN_S * 1e9
    seen = f"{body}: the same pose for {longest * 1e-9:.1f} s" if not ok else f"{body}: moves or is noisy"
    advice = "have the capture leave out bodies that it does not track, in the place of their last pose"
    return check("frozen", ok, seen, "never the same pose for half a second", advice)
