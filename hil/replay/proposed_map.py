"""A topic map proposed for a log of another lab, by the types and names of what is in it."""

from __future__ import annotations

import itertools
import json
import math
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from hil.errors import UsageError
from hil.log.reader import Log
from hil.replay.foreign_samples import MOTIONS, OF_ALL, OLD_FRAMES
from hil.replay.pose_axes import axes_of
from hil.scenario.lab import SourceType
from hil.wire import message_types as msg
from hil.wire.messages import MalformedPayloadError, typename_of
from hil.wire.pose_sources import NamedPlace, places_in, source_type

_MESSAGES = 3000
_MOVES_M = 0.02
_PAIR_WITHIN_NS = 2_000_000
_COMMANDS_LAG_S = 0.3
_ONE_BODY: tuple[SourceType, ...] = (
    "PoseStamped",
    "PoseWithCovarianceStamped",
    "TransformStamped",
    "Odometry",
)
_STILL = ("tf_static",)
_SIGHTING = typename_of(msg.RangeBearing)
_ODOMETRY = typename_of(msg.Odometry)


@dataclass(frozen=True, slots=True)
class _Track:
    """Poses of a body, of some messages of the log, and the topic that they are on."""

    topic: str
    places: list[NamedPlace] = field(default_factory=list)
    times_ns: list[int] = field(default_factory=list)

    @property
    def moves(self) -> bool:
        """Whether the body goes anywhere, in metres or in millimetres."""
        at = np.array([(each.place.x, each.place.y, each.place.z) for each in self.places])
        return bool(np.any(np.ptp(np.quantile(at, [0.02, 0.98], axis=0), axis=0) > _MOVES_M))


@dataclass(slots=True)
class _Lines:
    """Lines of the map, and what to say above them."""

    topics: list[str] = field(default_factory=list)
    bodies: list[str] = field(default_factory=list)
    scenario: list[str] = field(default_factory=list)


def proposed_map(log: Log, leader: str | None = None, follower: str | None = None) -> str:
    """TOML of a topic map for a log; what could not be told is said in comments.

    ``leader``, ``follower``: bodies, where these are known. Raises :class:`UsageError` for a log in which
    nothing tells where two bodies are, nor where one sees the other.
    """
    lines = _Lines()
    tracks = _tracks(log)
    motions = {name: kind for name, kind in log.topics.items() if kind in MOTIONS}
    if len(tracks) > 1:
        pair = _pair(tracks, motions, leader, follower, lines)
        _add_poses(tracks, pair, lines)
        used = {tracks[body].topic for body in pair}
        _add_motion({n: k for n, k in motions.items() if n not in used or k == _ODOMETRY}, pair[1], lines)
    else:
        sightings = [name for name, kind in log.topics.items() if kind == _SIGHTING]
        if not sightings:
            there = ", ".join(f"{name} ({kind})" for name, kind in sorted(log.topics.items())) or "none"
            raise UsageError(
                f"log {log.path}: no map can be proposed, as nothing tells the poses of two bodies; expected "
                f"topics of motion capture; topics there: {there}"
            )
        lines.topics.append(f"sighting = {_text(sightings[0])}")
        _add_motion(motions, _owner(sightings[0]), lines)
    return _written(log, lines)


def _tracks(log: Log) -> dict[str, _Track]:
    """Tracks by body, of the kind of topic that tells most plainly; of that all bodies."""
    kinds = {name: _kind(typename) for name, typename in log.topics.items()}
    for wanted in OF_ALL:
        for name in sorted(name for name, kind in kinds.items() if kind == wanted):
            found: dict[str, _Track] = {}
            for place, log_ns in _places(log, name, kinds[name], ""):
                _add(found, place, name, log_ns)
            if name.removeprefix("/") not in _STILL and len(found) > 1:
                return found
    spare: dict[str, _Track] = {}
    for one in _ONE_BODY:
        # Topics of one kind have one ending; those of a robot's odometry are in frames of their own.
        names = sorted((name for name, kind in kinds.items() if kind == one), key=_ending)
        for _, group in itertools.groupby(names, key=_ending):
            found = {}
            for name in group:
                for place, log_ns in _places(log, name, kinds[name], _owner(name)):
                    _add(found, place, name, log_ns)
            if len(found) > 1 and _share_a_frame(found.values()):
                return found
            spare = spare or (found if len(found) > 1 else {})
    return spare


def _share_a_frame(tracks: Iterable[_Track]) -> bool:
    """Whether tracks are told in one frame of reference, as far as they say."""
    told = [{each.frame_id for each in track.places if each.frame_id} for track in tracks]
    return not all(told) or bool(set.intersection(*told))


def _ending(topic: str) -> str:
    return topic.rpartition("/")[2]


def _kind(typename: str) -> SourceType | None:
    return "RigidBodies" if typename == OLD_FRAMES else source_type(typename)


def _add(found: dict[str, _Track], place: NamedPlace, topic: str, log_ns: int) -> None:
    track = found.setdefault(place.body, _Track(topic))
    track.places.append(place)
    track.times_ns.append(place.stamp_ns or log_ns)


def _places(log: Log, name: str, kind: SourceType | None, body: str) -> Iterator[tuple[NamedPlace, int]]:
    """Poses of the first messages on a topic that hold numbers."""
    for record in itertools.islice(log.records([name]), _MESSAGES):
        try:
            places = places_in(kind or "RigidBodies", record.payload, "" if kind in OF_ALL else body)
        except MalformedPayloadError:
            continue
        for each in places:
            if all(map(math.isfinite, each.place[:3])):
                yield each, record.log_ns


def _pair(
    tracks: Mapping[str, _Track],
    motions: Mapping[str, str],
    leader: str | None,
    follower: str | None,
    lines: _Lines,
) -> tuple[str, str]:
    """Leader and follower. The follower is who has odometry or is commanded; the leader the other one."""
    told = [name for name in (leader, follower) if name is not None and name not in tracks]
    if told:
        raise UsageError(f"body {told[0]!r} is not in the log; expected one of: {', '.join(sorted(tracks))}")
    names = list(tracks)
    if follower is None:
        follower = _only(_driven(names, motions, leader))
    if follower is None:
        follower = _only([name for name in names if "follower" in name.lower()])
    if follower is None and leader is not None:
        follower = _only([name for name in names if name != leader])
    others = [name for name in names if name != follower]
    if leader is None and follower is not None:
        leader = _only(others) or _only([name for name in others if tracks[name].moves])
    if leader is None or follower is None:
        lines.bodies.append(
            f"# Who follows whom could not be told; bodies in the log: {', '.join(map(_text, names))}."
        )
        follower = follower or next(name for name in reversed(names) if name != leader)
        leader = leader or next(name for name in names if name != follower)
    lines.bodies += [f"leader = {_text(leader)}", f"follower = {_text(follower)}"]
    return leader, follower


def _driven(names: Iterable[str], motions: Mapping[str, str], leader: str | None) -> list[str]:
    """Bodies that may be the follower: those with commands or odometry, with both if there are such."""
    commanded = {_owner(topic) for topic, kind in motions.items() if kind != _ODOMETRY}
    measured = {_owner(topic) for topic, kind in motions.items() if kind == _ODOMETRY}
    for robots in (commanded & measured, commanded, measured):
        found = [name for name in names if name != leader and any(_is_same(name, robot) for robot in robots)]
        if found:
            return found
    return []


def _add_poses(tracks: Mapping[str, _Track], pair: tuple[str, str], lines: _Lines) -> None:
    leader, follower = (tracks[body] for body in pair)
    if leader.topic == follower.topic:
        lines.topics.append(f"rigid_bodies = {_text(leader.topic)}")
    else:
        lines.topics.append(f"leader_pose = {_text(leader.topic)}")
        lines.topics.append(f"follower_pose = {_text(follower.topic)}")
    if not any(place.stamp_ns for place in (*leader.places, *follower.places)):
        lines.topics.append("# all stamps of the poses are 0: the log's time is taken")
    _add_frames_of_reference(leader, follower, lines)
    axes = axes_of([leader.places, follower.places])
    if axes.up == "y":
        lines.topics.append('up = "y" # the bodies keep their y, and move along x and z')
    elif axes.up != "z":
        lines.topics.append('# up = "y" # which axis is up could not be told by the way of the bodies')
    if axes.scale != 1.0:
        lines.topics.append(f"scale = {axes.scale:g} # lengths seem to be in millimetres")
    if (apart_ns := _apart_ns(leader.times_ns, follower.times_ns)) > _PAIR_WITHIN_NS:
        within_s = math.ceil(apart_ns * 1.1e-6) * 1e-3
        lines.topics.append(f"pair_within_s = {within_s:.3f} # the poses of the two are so far apart")


def _add_frames_of_reference(leader: _Track, follower: _Track, lines: _Lines) -> None:
    if not _share_a_frame((leader, follower)):
        told = [{each.frame_id for each in track.places} for track in (leader, follower)]
        of_leader, of_follower = (", ".join(map(_text, sorted(each))) for each in told)
        lines.topics.append(
            f"# not of use as they are: the leader's poses are in frame {of_leader}, "
            f"the follower's in {of_follower}"
        )


def _apart_ns(some: Sequence[int], others: Sequence[int]) -> int:
    """How far apart in time the poses of two bodies are, for nineteen in twenty."""
    ordered = sorted(others)
    gaps = []
    for at_ns in some:
        place = bisect_left(ordered, at_ns)
        gaps.append(min(abs(other - at_ns) for other in ordered[max(0, place - 1) : place + 1]))
    return int(np.quantile(gaps, 0.95)) if gaps else 0


def _add_motion(motions: Mapping[str, str], follower: str, lines: _Lines) -> None:
    """The follower's odometry, twists or commands; of several that may be it the rest in comments."""
    own = [name for name in motions if _is_same(follower, _owner(name))]
    rooted = [name for name in motions if not _owner(name)]
    alone = list(motions) if len(motions) == 1 else []
    candidates = sorted(own or rooted or alone, key=lambda name: (MOTIONS.index(motions[name]), name))
    if not candidates:
        lines.topics.append("# odometry: none of the follower was found; its own poses tell its motion")
        others = [f"# odometry = {_text(name)}" for name in sorted(motions)]
        lines.topics += others
        return
    chosen, *rest = candidates
    lines.topics.append(f"odometry = {_text(chosen)}")
    lines.topics += [f"# odometry = {_text(name)} # {motions[name]}" for name in rest]
    if motions[chosen] != _ODOMETRY:
        lines.scenario += [
            "",
            "[scenario.estimator]",
            f"input_lag_s = {_COMMANDS_LAG_S} # commands seem to stand in for odometry: how late they act",
        ]


def _owner(topic: str) -> str:
    """The robot or body that a topic is of: what is in front of its last part; empty for one at the root."""
    *front, last = topic.strip("/").split("/")
    return front[-1] if front else "" if last in ("odom", "cmd_vel", "odometry") else last


def _is_same(body: str, robot: str) -> bool:
    """Whether a body's name and a robot's are one, but for what a lab writes differently."""
    one, other = ("".join(filter(str.isalnum, name)).lower() for name in (body, robot))
    return bool(one) and one == other


def _only(names: Sequence[str]) -> str | None:
    return names[0] if len(names) == 1 else None


def _text(name: str) -> str:
    """A string of TOML."""
    return json.dumps(name, ensure_ascii=False)


def _written(log: Log, lines: _Lines) -> str:
    head = [
        f"# Proposed for {log.path.name} by what is in it. Correct it, and: abreast replay LOG --map FILE",
        "[topics]",
        *lines.topics,
    ]
    bodies = ["", "[bodies]", *lines.bodies] if lines.bodies else []
    scenario = [
        "",
        "[scenario]",
        'base = "turtlebot3" # limits of the leader, noise and rates: set what is otherwise',
        *lines.scenario,
    ]
    return "\n".join([*head, *bodies, *scenario]) + "\n"
