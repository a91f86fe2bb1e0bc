"""The estimator's step: compiled as plain, in whatever order messages come, and with little room."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import product
from typing import Any, NamedTuple, cast

import numpy as np
import pytest

from estimation.consistency.noise_estimate import NoiseLearning
from estimation.consistency.process_estimate import ProcessLearning
from estimation.filters.belief import Model
from estimation.filters.estimators import settling
from estimation.filters.filter import Kind, filter_of
from estimation.models.coordinated_turn import LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, PairSeen, PoseNoise
from estimation.own_motion.odometry_check import OdometrySample
from estimation.own_motion.odometry_history import InputTrust, MotionSample
from estimation.own_motion.own_track import OwnNoise, OwnPoint
from estimation.tracking.follower_check import Cause
from estimation.tracking.track_point import TrackPoint, Verdict
from estimation.tracking.track_settings import TrackSettings
from formation.kernel import compiles
from formation.lending import lent
from formation.pose import Pose, advance
from formation.records import Rows, columns_of, load, rows_of, store
from formation.ring import Ring
from hil.nodes import estimator_inputs as inputs
from hil.nodes.estimator_desk import Desk, NodeRules, Notes, SensorRules, TimedFrame
from hil.nodes.estimator_entries import COMPILED, PLAIN
from hil.nodes.estimator_memory import EstimatorMemory
from hil.nodes.estimator_records import AUTO, FUSED, MOCAP, ODOMETRY, Known, Rules, Told
from hil.nodes.estimator_step import estimate
from hil.nodes.frame_time import TimeRules
from hil.nodes.status_reasons import ALL_REASONS
from hil.scenario.files import load_scenario
from hil.wire.assumed_errors import AssumedErrors
from hil.wire.cdr import packed_texts
from hil.wire.reading import frame_reader
from hil.wire.records import Sighting
from hil.wire.templates import estimate_template
from tests.bits import same_bits

FRAME_NS, ODOMETRY_NS = 8_333_333, 33_333_333
EPOCH_NS = 1_000_000_000_000
LIMITS = LeaderLimits(v_eps=0.04, k_v=0.1, k_u=0.7)
NOISE = PoseNoise(3e-4, 3.5e-3)
SOURCES = {ODOMETRY: "odometry", MOCAP: "mocap", FUSED: "fused", AUTO: "auto"}
SETUPS = list(product(Kind, FrontEnd, SOURCES))
SETUP_IDS = [f"{kind.name.lower()}-{front_end.value}-{SOURCES[source]}" for kind, front_end, source in SETUPS]
REASONS = packed_texts(ALL_REASONS)
ASSUMED = AssumedErrors.of(load_scenario("turtlebot3"))

Message = TimedFrame | Sighting | OdometrySample


class Sent(NamedTuple):
    """A message, and when it arrives."""

    arrives_ns: float
    message: Message


def rules(kind: Kind, front_end: FrontEnd, source: int) -> Rules:
    """As the node has them for a scenario."""
    settled, noise = settling(kind.name.lower()), ProcessNoise.by_rule(LIMITS, 0.5)
    learns = kind is not Kind.DIFFERENCE
    return Rules(
        TrackSettings(**settled._asdict(), notices_manoeuvres=learns),
        filter_of(kind, Model(front_end, LIMITS, noise)),
        source,
        kind is not Kind.DIFFERENCE and source != MOCAP,
        2.0,
        NOISE,
        InputTrust(5e-3, 3e-2, delay=0.004, lag=0.03, v_max=0.2, u_max=0.6),
        OwnNoise(NOISE, 0.2, 0.6),
        ProcessLearning(learns, noise, LIMITS.k_v * LIMITS.k_v, LIMITS.k_u * LIMITS.k_u),
        noise_learning=NoiseLearning(kind is not Kind.DIFFERENCE, NOISE, 0.04),
    )


def with_noise_given(fixed: Rules) -> Rules:
    return fixed._replace(
        noise_learning=fixed.noise_learning._replace(learns=False),
        process_learning=fixed.process_learning._replace(on=False),
    )


class Outcome(NamedTuple):
    """What became of a frame or sighting."""

    verdict: int
    cause: int
    late: bool


class Estimator:
    """An estimator's desk, and the entries that work at it, or the plain functions behind them."""

    def __init__(self, fixed: Rules, *, plain: bool = False, room: int = 256, samples: int = 0) -> None:
        template = estimate_template("follower", 8)
        sensor = SensorRules(True, 0.0, 0.0, 0.0, 0.0, 1e-3, 2e-3)
        rules = NodeRules(fixed, TimeRules(True, 0, 0), sensor, ASSUMED, template.numbers_at)
        reader = frame_reader(frozenset({"leader", "follower"}))
        memory = EstimatorMemory(rules, reader, reader.pair("leader", "follower"), template)
        self.desk = memory.desk._replace(
            points=rows_of(TrackPoint, room),
            own=rows_of(OwnPoint, room),
            history=rows_of(MotionSample, max(room, samples)),
        )
        self._steps = PLAIN if plain else COMPILED
        self._lent = cast("Rows[Desk]", [self.desk]) if plain or not compiles() else lent(self.desk)

    def take(self, message: Message, now_ns: int) -> Outcome | None:
        if isinstance(message, OdometrySample):
            store(self.desk.sample, 0, message)
            self._steps.take(self._lent, inputs.ODOMETRY, REASONS, now_ns)
            return None
        if isinstance(message, TimedFrame):
            store(self.desk.frame, 0, message)
            self._steps.take(self._lent, inputs.FRAME, REASONS, now_ns)
        else:
            store(self.desk.sighting, 0, message)
            self._steps.take(self._lent, inputs.SIGHTING, REASONS, now_ns)
        notes = load(Notes, self.desk.notes, 0)
        return Outcome(notes.verdict, notes.cause, notes.late)

    def told(self, now_ns: int) -> Told:
        return estimate(self.rings(), self.desk.points, load(NodeRules, self.desk.rules, 0).step, now_ns)

    def rings(self) -> Known:
        return load(Known, self.desk.known, 0)

    def track(self) -> list[TrackPoint]:
        return held(TrackPoint, self.desk.points, self.rings().track)

    def own_track(self) -> list[OwnPoint]:
        return held(OwnPoint, self.desk.own, self.rings().own)

    def odometry(self) -> list[MotionSample]:
        return held(MotionSample, self.desk.history, self.rings().odometry)

    def bytes(self) -> tuple[bytes, ...]:
        desk = self.desk
        every: tuple[Rows[Any], ...] = (
            desk.points,
            desk.own,
            desk.history,
            desk.ways,
            desk.bank,
            desk.known,
            desk.newest,
            desk.notes,
        )
        return (*(columns_of(rows).tobytes() for rows in every), desk.buffer.tobytes())


def held(kind: type[Any], rows: Rows[Any], ring: Ring) -> list[Any]:
    room = len(rows)
    return [load(kind, rows, (ring.first + k) % room) for k in range(ring.length)]


class Pair:
    """Two robots in curves, as mocap, odometry and a sensor tell of them."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng([seed, 5])
        self.leader, self.follower = Pose(0.3, 0.0, 1.5), Pose(0.7, 0.1, 1.6)
        self.at_ns = EPOCH_NS

    def step(self) -> None:
        wave = math.sin(1.3e-9 * (self.at_ns - EPOCH_NS))
        self.v2, self.u2 = 0.1 + 0.03 * wave, 0.4 - 0.5 * wave
        self.leader = advance(self.leader, 0.08, 0.2 + 0.5 * wave, FRAME_NS * 1e-9)
        self.follower = advance(self.follower, self.v2, self.u2, FRAME_NS * 1e-9)
        self.at_ns += FRAME_NS

    def seen(self) -> PairSeen:
        shake = (self.random.standard_normal(5) * [3e-4, 3e-4, 3e-4, 3e-4, 3.5e-3]).tolist()
        own = self.follower
        turned = Pose(own.x + shake[2], own.y + shake[3], own.theta + shake[4])
        return PairSeen(self.leader.x + shake[0], self.leader.y + shake[1], turned)

    def sample(self) -> OdometrySample:
        v, u = (self.random.standard_normal(2) * [2e-3, 1e-2]).tolist()
        return OdometrySample(self.at_ns, self.v2 + v, self.u2 + u, True, self.follower)

    def sighting(self) -> Sighting:
        dx, dy = self.leader.x - self.follower.x, self.leader.y - self.follower.y
        bearing = math.atan2(dy, dx) - self.follower.theta
        return Sighting(0, self.at_ns, math.sqrt(dx * dx + dy * dy), bearing)


def smooth_drive(seed: int, frames: int) -> list[Sent]:
    """Frames and odometry without any fault, each at its time."""
    pair, sent = Pair(seed), list[Sent]()
    for k in range(frames):
        pair.step()
        sent.append(Sent(pair.at_ns, TimedFrame(pair.at_ns, pair.seen())))
        if k % 4 == 0:
            sent.append(Sent(pair.at_ns, pair.sample()))
    return sent


def rough_drive(seed: int, sightings: bool) -> list[Sent]:
    """All that can go wrong in four seconds: faults of mocap, gaps, and messages late, twice or too late."""
    pair, sent = Pair(seed), list[Sent]()
    random = pair.random
    frozen, freezing = pair.seen(), 0
    for k in range(470):
        pair.step()
        seen = pair.seen()
        if freezing > 0:
            freezing -= 1
            seen = (
                frozen if freezing > 4 else seen._replace(leader_x=frozen.leader_x, leader_y=frozen.leader_y)
            )
        elif k in (200, 450):
            frozen, freezing = seen, 12
        own = seen.follower
        fault = random.choice(["", "leader", "follower", "flip", "swap"], p=[0.92, 0.02, 0.02, 0.02, 0.02])
        if fault == "leader":
            seen = seen._replace(leader_x=seen.leader_x + 0.1)
        elif fault == "follower":
            seen = seen._replace(follower=own._replace(y=own.y - 0.1))
        elif fault == "flip":
            seen = seen._replace(follower=own._replace(theta=own.theta + math.pi))
        elif fault == "swap":
            seen = PairSeen(own.x, own.y, Pose(seen.leader_x, seen.leader_y, 1.0))
        if k >= 240:  # a step that stays
            seen = seen._replace(leader_x=seen.leader_x + 0.03)
        if k % 4 == 0 and not 100 <= k < 130:
            late = random.exponential(20e6) if random.random() < 0.5 else 0.0
            sent.append(Sent(pair.at_ns + late, pair.sample()))
        if 140 <= k < 160 or 300 <= k < 440:  # short of frames for a while, and then for too long
            continue
        message: Message = TimedFrame(pair.at_ns, seen)
        if sightings and random.random() < 0.2:
            message = pair.sighting()
        late = float(random.choice([0.0, 10e6, 60e6, 300e6], p=[0.6, 0.2, 0.18, 0.02]))
        sent.append(Sent(pair.at_ns + late, message))
        if random.random() < 0.03:
            sent.append(Sent(pair.at_ns + late + 5e6, message))
    return in_time(sent)


def in_time(sent: Iterable[Sent]) -> list[Sent]:
    return sorted(sent, key=lambda each: each.arrives_ns)


@pytest.mark.parametrize(("kind", "front_end", "source"), SETUPS, ids=SETUP_IDS)
def test_compiled_and_plain_give_the_same_bits_whatever_comes(
    kind: Kind, front_end: FrontEnd, source: int
) -> None:
    fixed = rules(kind, front_end, source)
    compiled, plain = Estimator(fixed), Estimator(fixed, plain=True)
    verdicts, causes, late = set[int](), set[int](), 0
    for number, sent in enumerate(rough_drive(len(SETUP_IDS), front_end is FrontEnd.BODY)):
        now_ns = round(sent.arrives_ns)
        outcome = compiled.take(sent.message, now_ns)
        assert plain.take(sent.message, now_ns) == outcome
        if outcome is not None:
            verdicts.add(outcome.verdict)
            causes.add(outcome.cause)
            late += outcome.late
            same_bits(compiled.told(now_ns), plain.told(now_ns))
        if number % 20 == 0:
            assert compiled.bytes() == plain.bytes()
    assert compiled.bytes() == plain.bytes()
    # The drive is as rough as it is meant to be.
    assert verdicts == set(Verdict)
    assert causes >= {Cause.NONE, Cause.GATED, Cause.FLIPPED, Cause.FROZEN}
    assert late > 30


def delivered(fixed: Rules, messages: Iterable[Sent], room: int = 256, samples: int = 0) -> Estimator:
    estimator = Estimator(fixed, room=room, samples=samples)
    for sent in messages:
        estimator.take(sent.message, round(sent.arrives_ns))
    return estimator


def shuffled(sent: list[Sent], seed: int, *, frames: bool, odometry: bool) -> list[Sent]:
    """The same messages, those of a kind up to 100 ms late; the first tenth of a second comes in order."""
    random = np.random.default_rng([seed, 6])
    delayed = list[Sent]()
    for each in sent:
        wanted = odometry if isinstance(each.message, OdometrySample) else frames
        late = random.uniform(0.0, 100e6) if wanted and each.arrives_ns > EPOCH_NS + 1e8 else 0.0
        delayed.append(Sent(each.arrives_ns + late, each.message))
    return in_time(delayed)


FOLDED = [
    (kind, front_end, source)
    for kind, front_end, source in SETUPS
    # Differences with odometry take it as it comes: that is what they are there to show.
    if kind is not Kind.DIFFERENCE or source == MOCAP
]
FOLDED_IDS = [
    f"{kind.name.lower()}-{front_end.value}-{SOURCES[source]}" for kind, front_end, source in FOLDED
]


@pytest.mark.parametrize(("frames", "odometry"), [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize(("kind", "front_end", "source"), FOLDED, ids=FOLDED_IDS)
def test_the_order_of_delivery_does_not_matter_to_the_last_bit(
    kind: Kind, front_end: FrontEnd, source: int, frames: bool, odometry: bool
) -> None:
    # What is learned of noise, of sensors or the leader, is learned from what comes in order.
    fixed, sent = with_noise_given(rules(kind, front_end, source)), smooth_drive(3, 240)
    straight = delivered(fixed, sent)
    other = delivered(fixed, shuffled(sent, 4, frames=frames, odometry=odometry))
    assert [point.measurement.capture_ns for point in other.track()] == [
        point.measurement.capture_ns for point in straight.track()
    ]
    assert other.odometry() == straight.odometry()
    same_bits(tuple(other.own_track()), tuple(straight.own_track()))
    same_bits(tuple(other.track()), tuple(straight.track()))
    now_ns = round(sent[-1].arrives_ns)
    same_bits(other.told(now_ns), straight.told(now_ns))


@pytest.mark.parametrize("room", [2, 4, 16])
@pytest.mark.parametrize(("kind", "front_end", "source"), SETUPS, ids=SETUP_IDS)
def test_more_than_there_is_room_for_shortens_the_window_and_nothing_else(
    kind: Kind, front_end: FrontEnd, source: int, room: int
) -> None:
    fixed, sent = rules(kind, front_end, source)._replace(reprocesses=False), smooth_drive(3, 120)
    # A way by odometry goes back by its lag: with two samples alone it would be another way.
    tight, roomy = delivered(fixed, sent, room, samples=4), delivered(fixed, sent)
    assert len(tight.track()) == room
    same_bits(tuple(tight.track()), tuple(roomy.track()[-room:]))
    if source != ODOMETRY:
        same_bits(tuple(tight.own_track()), tuple(roomy.own_track()[-room:]))


@pytest.mark.parametrize("room", [1, 2, 8, 16])
@pytest.mark.parametrize(("kind", "front_end", "source"), SETUPS, ids=SETUP_IDS)
def test_with_little_room_nothing_breaks_whatever_comes(
    kind: Kind, front_end: FrontEnd, source: int, room: int
) -> None:
    fixed = rules(kind, front_end, source)
    estimator = Estimator(fixed, room=room)
    for sent in rough_drive(room, front_end is FrontEnd.BODY):
        before = [point.measurement.capture_ns for point in estimator.track()]
        outcome = estimator.take(sent.message, round(sent.arrives_ns))
        after = [point.measurement.capture_ns for point in estimator.track()]
        if outcome is not None and outcome.verdict in (Verdict.LATE, Verdict.DUPLICATE):
            assert after == before
        own = [point.capture_ns for point in estimator.own_track()]
        for times in (after, own, [sample.stamp_ns for sample in estimator.odometry()]):
            assert len(times) <= room
            assert times == sorted(set(times))
        if outcome is not None:
            told, _ = estimator.told(round(sent.arrives_ns))
            assert all(map(math.isfinite, (*told[:11], *told.joint)))
