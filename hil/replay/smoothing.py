"""The smoother over a log: every measurement that the estimator took up, estimated with all of the others."""

from __future__ import annotations

from collections.abc import Iterable

from msgspec.structs import replace

from estimation.estimate import estimate_of
from estimation.measurement import Measurement
from estimation.smoother import smooth
from hil.nodes.estimator import NAME, EstimatorNode, EstimatorState
from hil.nodes.leader_filter import refuse_bias_states
from hil.nodes.node import Event, Outgoing
from hil.nodes.status_reasons import REASONS
from hil.scenario.schema import Scenario
from hil.wire.estimate_message import to_message
from hil.wire.message_types import LeaderEstimate


class ListeningEstimator(EstimatorNode):
    """The EKF's node, which keeps the measurements of its whole life, by capture time, beside its state."""

    def __init__(self, scenario: Scenario, name: str = NAME, others: frozenset[str] = frozenset()) -> None:
        refuse_bias_states(scenario)
        ekf = replace(scenario, estimator=replace(scenario.estimator, kind="ekf"))
        super().__init__(ekf, name, others)
        self.measurements: dict[int, Measurement] = {}

    def step(
        self, state: EstimatorState, event: Event, now_ns: int
    ) -> tuple[EstimatorState, tuple[Outgoing, ...]]:
        """Step as ever, and keep what is new in the track."""
        after, sent = super().step(state, event, now_ns)
        if after.track is not state.track:
            self.measurements |= {point.measurement.capture_ns: point.measurement for point in after.track}
        return after, sent


def smoothed_estimates(node: ListeningEstimator) -> Iterable[LeaderEstimate]:
    """Estimates at all captures, in their order, each resting on the whole log.

    They are stamped as computed at their capture, as a smoother knows no delay.
    """
    for point in smooth(node.tracker, node.measurements.values()):
        measurement = point.measurement
        status = node.tracker.status((point,), measurement.capture_ns)
        estimate = estimate_of(point.belief, measurement, status, point.nis, point.used_ns)
        yield to_message(
            estimate, measurement.capture_ns, node.topics.follower, REASONS[status], node.assumed, ()
        )
