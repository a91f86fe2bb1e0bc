"""One step of the leader's filter in its track, with an eye on manoeuvres."""

from __future__ import annotations

from typing import NamedTuple

from estimation.filters.filter import Filter, Stepped
from estimation.filters.gaussian import nis_of
from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import Measurement
from estimation.tracking.manoeuvre import Manoeuvre, later, noticed, raised
from estimation.tracking.track_point import TrackPoint
from formation.kernel import kernel

_NS = 1e-9


class Followed(NamedTuple):
    """A step of the filter, and what it tells of the leader's manoeuvres."""

    stepped: Stepped
    manoeuvre: Manoeuvre


@kernel
def followed_leader(
    last: TrackPoint,
    measurement: Measurement,
    way: FollowerMotion,
    gate: float,
    notices: bool,
    estimator: Filter,
) -> Followed:
    """Belief of a point moved on to a measurement, and with that taken in unless its NIS is above ``gate``.

    ``way``: the follower's mean motion in between. ``notices``: whether process noise is raised for a leader
    that changes its motion at once. What a frame check has refused, by a negative gate, says nothing of
    manoeuvres.
    """
    dt = (measurement.capture_ns - last.measurement.capture_ns) * _NS
    if not notices:
        return Followed(estimator.step(last.belief, dt, way, measurement, gate), last.manoeuvre)
    manoeuvre = later(last.manoeuvre, dt, last.settled)
    noise = raised(estimator.noise, manoeuvre, estimator.limits)
    prior = estimator.driven_by(noise).predict(last.belief, dt, way)
    if gate > 0.0:
        seen = noticed(manoeuvre, prior, measurement, noise, estimator.limits)
        prior, manoeuvre = seen.belief, seen.manoeuvre
    nis = nis_of(prior, measurement.x, measurement.y, measurement.spread)
    if nis <= gate:
        return Followed(Stepped(estimator.update(prior, measurement), nis), manoeuvre)
    return Followed(Stepped(prior, nis), manoeuvre)
