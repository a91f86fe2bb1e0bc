"""What is wrong with mocap frames as such: their axes, unit, clock, frame of reference and names.

Each answer is one line in words, empty where all is well or too little was seen. Used frames and refused ones
are looked at alike; nothing of it reaches an estimate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from statistics import median
from typing import NamedTuple

from hil.nodes.findings import Findings
from hil.nodes.frame_looks import Look, quoted
from hil.scenario.schema import Scenario
from hil.wire.message_checks import FASTEST, has_orientation
from hil.wire.records import Placement

_NS = 1e-9
FEWEST = 4
"""Looks before anything is said."""

_AXES = "xyz"
_TILTED, _UPRIGHT = math.cos(math.radians(30.0)), 0.99
_ROSE, _KEPT = 0.2, 0.2  # [m] that no robot on the ground goes up and down; share of it that is a height
_ALIKE = 0.3  # share of its way along the ground that a height does not vary by
_FARTHEST, _HIGHEST = 30.0, 10.0  # [m] that are none of robots in one room
_AHEAD_S = 0.05
_STANDS_NS = 400_000_000


class ClockRule(NamedTuple):
    """What is expected of stamps: ``offset_s`` late on purpose, ``oldest_s`` at most where ``trusted``."""

    trusted: bool
    offset_s: float
    oldest_s: float


def clock_rule(scenario: Scenario) -> ClockRule:
    """What a scenario expects of stamps."""
    given = scenario.estimator
    return ClockRule(given.clock == "trusted", given.stamp_offset_s, scenario.controller.max_age_s)


def frame_findings(looks: Sequence[Look], rule: ClockRule) -> Findings:
    """Findings by their names, of a leader and a follower."""
    tracks = {
        "leader": [look.leader for look in looks if look.leader is not None],
        "follower": [look.follower for look in looks if look.follower is not None],
    }
    told = {
        "axes": "; ".join(filter(None, (axes_text(name, track) for name, track in tracks.items()))),
        "unit": unit_text(looks),
        "clock": clock_text(looks, rule),
        "frames_of_reference": reference_text([look.frame_id for look in looks]),
    }
    return {name: text for name, text in told.items() if text}


def axes_text(name: str, track: Sequence[Placement]) -> str:
    """Which axis points up along a body's track, if it is another one than z."""
    sound = [place for place in track if all(map(math.isfinite, place))]
    if len(sound) < FEWEST:
        return ""
    tilts = [uprightness(place) for place in sound if has_orientation(place)]
    if len(tilts) >= FEWEST and min(tilt[2] for tilt in tilts) < _TILTED:
        kept = [min(tilt[axis] for tilt in tilts) for axis in range(2)]
        axis = max(range(2), key=kept.__getitem__)
        if kept[axis] > _UPRIGHT:
            turned = math.degrees(math.acos(max(-1.0, min(tilt[2] for tilt in tilts))))
            return (
                f"{_AXES[axis]} is up: the {name} turns about it, and z leans {turned:.0f} deg; expected z up"
            )
    spans = [max(each) - min(each) for each in zip(*(place[:3] for place in sound), strict=True)]
    level = min(range(2), key=spans.__getitem__)
    if spans[2] > max(_ROSE, _ALIKE * spans[1 - level]) and spans[level] < _KEPT * spans[2]:
        return (
            f"{_AXES[level]} is up: the {name}'s z varies by {spans[2]:.2g} m and its {_AXES[level]} by "
            f"{spans[level]:.2g} m; expected z up"
        )
    return ""


def uprightness(place: Placement) -> tuple[float, float, float]:
    """How far each axis of a body is from that of the ground's frame: cosines, 1 where they are one."""
    norm = place.qx * place.qx + place.qy * place.qy + place.qz * place.qz + place.qw * place.qw
    xx, yy, zz = (2.0 * q * q / norm for q in (place.qx, place.qy, place.qz))
    return 1.0 - yy - zz, 1.0 - xx - zz, 1.0 - xx - yy


def unit_text(looks: Sequence[Look]) -> str:
    """Whether lengths are out of all proportion to robots in a room."""
    pairs = [look.pair for look in looks if look.pair is not None]
    if len(pairs) < FEWEST:
        return ""
    apart = median(math.dist(first[:3], second[:3]) for first, second in pairs)
    high = median(
        min(abs(coordinate) for coordinate in (place.z, place.y)) for pair in pairs for place in pair
    )
    fast = _speed(looks)
    if not (apart > _FARTHEST or high > _HIGHEST or fast > FASTEST):
        return ""
    moves = f" and move at {fast:.3g} m/s" if fast > 1.0 else ""
    return (
        f"the bodies are {apart:.3g} m apart{moves}: in millimetres that would be {apart * 1e-3:.3g} m; "
        "expected metres"
    )


def _speed(looks: Sequence[Look]) -> float:
    """Median speed of the faster body from look to look [m/s], by when they came."""
    speeds = [
        max(math.dist(a[:3], b[:3]) for a, b in zip(before.pair, after.pair, strict=True)) / seconds
        for before, after in pairwise(looks)
        if before.pair and after.pair and (seconds := (after.at_ns - before.at_ns) * _NS) > 0.01
    ]
    return median(speeds) if speeds else 0.0


def clock_text(looks: Sequence[Look], rule: ClockRule) -> str:
    """Whether stamps stand, or are ahead of the host's clock or behind it."""
    if len(looks) < FEWEST:
        return ""
    stamps = [look.stamp_ns for look in looks]
    if max(stamps) <= 0:
        return "the frames have no stamps; expected the capture's time"
    if len(set(stamps)) == 1 and looks[-1].at_ns - looks[0].at_ns > _STANDS_NS:
        return "the stamps of the frames stand still; expected the capture's time"
    if not rule.trusted:
        return ""
    ages = [(look.at_ns - look.stamp_ns) * _NS + rule.offset_s for look in looks if look.stamp_ns >= 0]
    if (usual := median(ages)) < -_AHEAD_S:
        return (
            f"stamps are {-usual:.3g} s ahead of this machine's clock; expected none by over {_AHEAD_S:g} s"
        )
    if (least := min(ages)) > rule.oldest_s:
        most = f"expected at most {rule.oldest_s:g} s"
        return f"frames are {least:.3g} s old by their stamps when they come, {most}"
    return ""


def reference_text(frame_ids: Sequence[str]) -> str:
    """Whether frames come in several frames of reference."""
    known = sorted(set(frame_ids))
    if len(known) < 2:
        return ""
    return f"poses are told in {len(known)} frames of reference, {quoted(known)}; expected one"


def bodies_text(wanted: Sequence[str], seen: Sequence[str]) -> str:
    """Which bodies are wanted and not seen, or seen more than once."""
    missing = [name for name in wanted if name not in seen]
    twice = [name for name in wanted if seen.count(name) > 1]
    if missing:
        return f"no body {quoted(missing)} among those seen: {quoted(sorted(seen))}"
    return f"{quoted(twice)} stands for more than one body" if twice else ""
