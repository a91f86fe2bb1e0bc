"""The smoother over a log: every measurement that the estimator took up, estimated with all of the others."""

from __future__ import annotations

from dataclasses import dataclass

from msgspec.structs import replace

from estimation.bounds.certified import Certain, Failed
from estimation.models.coordinated_turn import ProcessNoise
from estimation.models.measurement import Measurement
from estimation.tracking.estimate import estimate_of, guessed_when_slow
from estimation.tracking.follower_check import Cause
from estimation.tracking.smoother import smooth
from estimation.tracking.track import Tracker
from estimation.tracking.track_point import NO_JUMP
from formation.records import row_of
from hil.nodes.estimator import NAME, EstimatorNode, EstimatorState
from hil.nodes.node import Outgoing
from hil.nodes.status_reasons import ALL_REASONS, reason_number
from hil.scenario.leader_model import refuse_bias_states, refuse_leader_lever
from hil.scenario.schema import Scenario
from hil.wire.certified_message import certified_message
from hil.wire.events import Event
from hil.wire.message_types import CertifiedEstimate, LeaderEstimate
from hil.wire.messages import decode_as
from hil.wire.writing import EstimateWriter


class ListeningEstimator(EstimatorNode):
    """The EKF's node, which keeps the measurements of its whole life, by capture time, beside its state.

    Of each it keeps the process noise that it was folded with, too, which may have been learned by then.
    Where estimates are certified it keeps what was certain at each as well.
    """

    def __init__(self, scenario: Scenario, name: str = NAME, others: frozenset[str] = frozenset()) -> None:
        refuse_bias_states(scenario)
        refuse_leader_lever(scenario)
        ekf = replace(scenario, estimator=replace(scenario.estimator, kind="ekf"))
        super().__init__(ekf, name, others)
        self.measurements: dict[int, Measurement] = {}
        self.noises: dict[int, ProcessNoise] = {}
        self.certain: dict[int, Certain | Failed] = {}

    def step(
        self, state: EstimatorState, event: Event, now_ns: int
    ) -> tuple[EstimatorState, tuple[Outgoing, ...]]:
        """Step as ever, and keep what is new in the track."""
        after, sent = super().step(state, event, now_ns)
        if event.topic and (track := after.memory.track):
            self.measurements |= {point.measurement.capture_ns: point.measurement for point in track}
            self.noises |= {point.measurement.capture_ns: point.noise for point in track}
            if self.certifying is not None:
                newest_ns = track[-1].measurement.capture_ns
                known = self.certifying.certain(after.believed, after.memory.history, newest_ns)
                self.certain[newest_ns] = known
        return after, sent


@dataclass(frozen=True, slots=True, eq=False)
class Smoothed:
    """Estimates at all captures, in their order, and the certified ones where they were asked for."""

    estimates: tuple[LeaderEstimate, ...]
    certified: tuple[CertifiedEstimate, ...]


def smoothed_estimates(node: ListeningEstimator) -> Smoothed:
    """Estimates that each rest on the whole log; what is certain of them, on what came before.

    They are stamped as computed at their capture, as a smoother knows no delay.
    """
    estimates, certified = [], []
    writer = EstimateWriter(node.topics.follower, node.rules.assumed, ALL_REASONS)
    tracker = Tracker(node.rules.step.filter, node.rules.step.settings)
    for point in smooth(tracker, node.measurements.values(), node.noises):
        measurement = point.measurement
        capture_ns, frame_id = measurement.capture_ns, node.topics.follower
        status = tracker.status((point,), capture_ns)
        told = estimate_of(point.belief, measurement, status, point.nis, point.used_ns, NO_JUMP)
        estimate = guessed_when_slow(told, tracker.estimator.limits.v_eps)
        reason = reason_number(status, Cause.NONE)
        payload = writer.write(row_of(estimate), reason, capture_ns, ())
        estimates.append(decode_as(payload, LeaderEstimate))
        if node.certifying is not None:
            certain = node.certain.get(capture_ns, Failed.UNSEEN)
            certified.append(certified_message(estimate, certain, capture_ns, frame_id))
    return Smoothed(tuple(estimates), tuple(certified))
