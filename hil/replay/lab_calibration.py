"""All that a log tells of the lab that it was made in: its timing, and the offsets of its sensor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from estimation.calibration.sensor_bias import SensorBias
from estimation.own_motion.input_alignment import Known
from hil.errors import UsageError
from hil.log.metadata import scenario_of
from hil.log.reader import Log
from hil.log.report_json import known
from hil.replay.calibration import calibrate
from hil.replay.foreign_log import foreign_events
from hil.replay.mount_calibration import Mounts, mounts_of_events, mounts_of_log
from hil.replay.noise_calibration import noise_of_log
from hil.replay.odometry_alignment import odometry_response
from hil.replay.timing import VAGUE, Timing, timing_of
from hil.replay.topic_map import TopicMap
from hil.scenario.files import with_overrides
from hil.scenario.links import link_of, refuse_chain
from hil.scenario.schema import Scenario
from hil.wire.topics import topics_of


@dataclass(frozen=True, slots=True)
class Calibration:
    """What a log tells of its lab.

    ``timing``: times by name, each with ``value`` and ``sd`` [s]: ``lag_s``, ``transport_s``, their sum
    ``delay_s``, and the correction of stamps, ``stamp_offset_s`` or ``transport_latency_s``. ``unknown``: why
    something of it is not known, a line each. ``uncertain``: that the correction is too uncertain to be set.
    ``settings``: scenario keys that put it right. ``offsets``: of a range and bearing sensor, ``range`` [m]
    and ``bearing`` [rad], each with ``offset``, ``sd`` and ``spread``; None without sightings.
    ``odometry``: what the motion makes of odometry, by the estimator's keys, None for what is not told.
    ``mounts``: where the bodies of leader and follower sit on their robots. ``noise``: standard deviations of
    measurements by the estimator's keys for them.

    >>> import abreast
    >>> scenario = abreast.load_scenario("turtlebot3", {"run.duration_s": 12.0})
    >>> run = abreast.run_lockstep(scenario, log="lab.mcap")
    >>> found = abreast.calibrate("lab.mcap")
    >>> print(f"{found.timing['delay_s'].value:.2f} s")
    0.10 s
    """

    timing: Mapping[str, Known]
    unknown: tuple[str, ...]
    uncertain: bool
    settings: Mapping[str, float]
    offsets: SensorBias | None
    mounts: Mounts
    noise: Mapping[str, float]
    odometry: Mapping[str, Known | None]

    def as_dict(self) -> dict[str, Any]:
        """The JSON of ``abreast calibrate``."""
        result: dict[str, Any] = {}
        for name, found in self.timing.items():
            result |= {name: found.value, f"{name}_sd": found.sd}
        if self.settings:
            result["settings"] = dict(self.settings)
        if (bias := self.offsets) is not None:
            result |= {"samples": bias.samples, "outliers": bias.outliers}
            for name, offset in (("range_bias", bias.range), ("bearing_bias", bias.bearing)):
                result |= {name: offset.value, f"{name}_sd": offset.sd, f"{name}_spread": offset.spread}
        if self.noise:
            result["noise"] = dict(self.noise)
        cleaned: dict[str, Any] = known(result)
        # In these null stands for what the motion does not tell.
        if any(self.odometry.values()):
            told = {key: found and found.value for key, found in self.odometry.items()}
            cleaned["odometry"] = told | {"sd": [found and found.sd for found in self.odometry.values()]}
        return cleaned | {"mounts": self.mounts.as_dict()}


def calibration_of(
    log: Log, follower: str | None = None, from_s: float | None = None, to_s: float | None = None
) -> Calibration:
    """Calibration by a log, or by its span from ``from_s`` to ``to_s`` [s]; ``follower``: whose, in a chain.

    Raises :class:`UsageError` for a log that is not ours, and for one that tells nothing.
    """
    scenario = _scenario_of(log, follower)
    mounts = mounts_of_log(log, scenario, from_s, to_s)
    # All else rests on where the robots are, not on where their bodies seem to be.
    scenario = with_overrides(scenario, mounts.overrides)
    timing = timing_of(log, scenario, from_s, to_s)
    sighting = topics_of(scenario).sighting
    sighted = sighting in log.topics
    if not (timing.known or sighted or mounts.known):
        raise UsageError(
            f"log {log.path}: has no sightings to calibrate (no topic {sighting!r}); "
            f"{'; '.join(timing.unknown)}"
        )
    offsets = calibrate(log, scenario, from_s, to_s) if sighted else None
    return Calibration(
        timing=timing.keys(scenario),
        unknown=timing.unknown,
        uncertain=_uncertain(timing),
        settings=timing.settings(scenario),
        offsets=offsets,
        mounts=mounts,
        noise=noise_of_log(log, scenario, offsets, from_s, to_s),
        odometry=odometry_response(timing.alignment),
    )


def calibration_of_foreign(
    log: Log, chart: TopicMap, from_s: float | None = None, to_s: float | None = None
) -> Calibration:
    """Calibration by a log of another lab whose topics a map names: of its mounts.

    Raises :class:`UsageError` as :func:`hil.replay.foreign_log.foreign_events`.
    """
    mounts = mounts_of_events(foreign_events(log, chart), chart.scenario, from_s, to_s)
    unknown = "timing and sensor offsets: looked for in logs of abreast only; turn this one into one"
    return Calibration({}, (unknown,), False, {}, None, mounts, {}, {})


def _scenario_of(log: Log, follower: str | None) -> Scenario:
    whole = scenario_of(log)
    if whole is None:
        raise UsageError(f"log {log.path}: was not made by abreast; turn it into one with: abreast import")
    if follower is not None:
        return link_of(whole, follower).scenario
    refuse_chain(whole, "name a follower of it with --follower")
    return whole


def _uncertain(timing: Timing) -> bool:
    return timing.lateness is not None and timing.lateness.sd >= VAGUE
