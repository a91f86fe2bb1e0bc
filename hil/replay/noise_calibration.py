"""How noisy the measurements of a lab are, as its log tells: settings of the estimator that say so."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from estimation.calibration.measured_noise import odometry_scatter, pose_scatter
from estimation.calibration.sensor_bias import SensorBias
from estimation.own_motion.input_alignment import Alignment
from estimation.own_motion.lagged_signal import LaggedSignal, columns_of
from formation.angles import FloatArray
from hil.log.events import logged_events
from hil.log.metadata import IMPORT, mode_of
from hil.log.reader import Log
from hil.replay.mount_calibration import BodyTracks, body_tracks
from hil.replay.odometry_alignment import OwnRecord, own_alignment, own_record
from hil.scenario.schema import Scenario
from hil.wire import topics

_DIGITS = 3  # that are known of a deviation at the most


def noise_of_log(
    log: Log,
    scenario: Scenario,
    sensor: SensorBias | None,
    from_s: float | None = None,
    to_s: float | None = None,
) -> dict[str, float]:
    """Standard deviations by their keys of the estimator's section; what the log does not tell is not there.

    ``sensor``: what is known of a range and bearing sensor. Times [s] are the source's own in an imported
    log, else they count from the first odometry, in a log without any from the first frame.
    """
    found: dict[str, float | None] = {}
    if topics.RIGID_BODIES in log.topics:
        wanted = [topics.RIGID_BODIES]
        tracks = body_tracks(logged_events(log, wanted), scenario)
        record = own_record(log, scenario)
        zero_ns = 0 if mode_of(log) == IMPORT else min(record.motions or tracks.follower, default=0)
        begin_ns = -1 if from_s is None else zero_ns + round(from_s * 1e9)
        end_ns = 2**63 if to_s is None else zero_ns + round(to_s * 1e9)
        found |= _of_poses(tracks, (begin_ns, end_ns), scenario.leader.v_eps)
        found |= _of_odometry(record, (begin_ns, end_ns))
    if sensor is not None:
        found |= {"sigma_range": sensor.range.spread, "sigma_bearing": sensor.bearing.spread}
    return {key: float(f"{sd:.{_DIGITS}g}") for key, sd in found.items() if sd}


def said_noise(found: Mapping[str, float]) -> str:
    """The lines of a scenario that tell the noise."""
    return "\n".join(["[estimator]", *(f"{key} = {sd:g}" for key, sd in found.items())])


def _of_poses(tracks: BodyTracks, span_ns: tuple[int, int], least_speed: float) -> dict[str, float | None]:
    positions, headings = [], None
    for poses in (tracks.leader, tracks.follower):
        stamps = sorted(at_ns for at_ns in poses if span_ns[0] <= at_ns <= span_ns[1])
        track: FloatArray = np.array([poses[at_ns] for at_ns in stamps]).reshape(-1, 3)
        stamps_ns, places = np.array(stamps, dtype=np.int64), track[:, :2]
        positions.append(pose_scatter(stamps_ns, places, places, least_speed))
        turned = np.unwrap(track[:, 2:], axis=0)
        # The follower's comes last: it is the one that is measured with.
        headings = pose_scatter(stamps_ns, turned, places, least_speed)
    known = [sd for sd in positions if sd is not None]
    return {"sigma_position": max(known) if known else None, "sigma_heading": headings}


def _of_odometry(record: OwnRecord, span_ns: tuple[int, int]) -> dict[str, float | None]:
    found = own_alignment(record)
    shift_ns = 0 if found.delay is None else round(found.delay.value * 1e9)
    seen = sorted(at_ns for at_ns in record.poses if span_ns[0] <= at_ns <= span_ns[1])
    told = sorted(at_ns for at_ns in record.motions if span_ns[0] <= at_ns <= span_ns[1])
    scatter = odometry_scatter(
        np.array(seen, dtype=np.int64),
        np.array([record.poses[at_ns] for at_ns in seen]).reshape(-1, 3),
        np.array(told, dtype=np.int64) + shift_ns,
        _answers(np.array(told) * 1e-9, [record.motions[at_ns] for at_ns in told], found),
    )
    return {} if scatter is None else {"sigma_v2": scatter[0], "sigma_u2": scatter[1]}


def _answers(times: FloatArray, motions: list[tuple[float, float]], found: Alignment) -> FloatArray:
    """Odometry as the motion answers it, if with a lag."""
    told: FloatArray = np.array(motions).reshape(-1, 2)
    if found.lag is None or found.lag.value == 0.0 or len(told) < 2:
        return told
    signal = LaggedSignal(times - times[0], told[:, 0] + 1j * told[:, 1], held=False)
    return columns_of(signal.states(found.lag.value))
