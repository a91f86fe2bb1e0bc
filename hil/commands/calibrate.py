"""``abreast calibrate``: how late a lab's robots and stamps are, and by how much its sensors are off."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.commands.progress import doing
from hil.commands.seconds import Seconds
from hil.errors import UsageError
from hil.log.report_json import print_with_nulls, say

if TYPE_CHECKING:
    from estimation.calibration.sensor_bias import SensorBias
    from estimation.own_motion.input_alignment import Known
    from hil.replay.lab_calibration import Calibration
    from hil.replay.mount_calibration import Mounts

_MEANINGS = {
    "lag_s": "first-order lag of the robot's actuators",
    "transport_s": "from a command to where its answer begins",
    "delay_s": "both together, which are better known than how they share it",
    "stamp_offset_s": "mocap stamps are this much later than the robot's clock was",
    "transport_latency_s": "a frame is at least this old when it comes",
}

_RESPONSES = {
    "input_delay_s": "the motion comes later than odometry tells it by this [s]",
    "input_time_constant_s": "of the first-order lag by which it answers odometry [s]",
    "input_scale_v": "true over told speed",
    "input_scale_u": "true over told turn rate",
}


@click.command("calibrate")
@click.argument("log", type=click.Path(path_type=Path))
@click.option("--follower", metavar="NAME", help="Of a chain: the follower to look at.")
@click.option("--map", "chart", metavar="FILE", help="Names the topics of a log that is not abreast's.")
@click.option("--from", "from_s", type=Seconds(), metavar="S", help="Use what was measured from here on.")
@click.option("--to", "to_s", type=Seconds(), metavar="S", help="Use what was measured up to here.")
@click.option("--json", "as_json", is_flag=True, help="Print what was found as one JSON object on stdout.")
def command(
    log: Path,
    follower: str | None,
    chart: str | None,
    from_s: float | None,
    to_s: float | None,
    as_json: bool,
) -> None:
    """Say what LOG tells of the lab that it was made in, and the settings that put it right.

    Commands and odometry tell the lag and delay of the robot, odometry and mocap frames how late the stamps
    of mocap are, sightings and mocap poses by how much a range and bearing sensor is off, and the poses
    alone where the rigid bodies sit on their robots and how noisy they are.

    --from and --to are seconds since the first sighting or, for the timing, the first odometry; for imported
    recordings the source's own time.
    """
    if from_s is not None and to_s is not None and to_s <= from_s:
        raise UsageError(f"--to {to_s:g}: expected more than --from {from_s:g}")
    with doing("calibrating"):
        found = _found(log, follower, chart, from_s, to_s)
    _say_timing(found)
    _say_odometry(found.odometry)
    if found.offsets is not None:
        _say_offsets(log, found.offsets)
    _say_mounts(found.mounts)
    _say_noise(found.noise)
    if as_json:
        print_with_nulls(found.as_dict())


def _found(
    log: Path, follower: str | None, chart: str | None, from_s: float | None, to_s: float | None
) -> Calibration:
    """What a log tells; ``chart``: topic map of one that is not abreast's."""
    from hil.log.opened import opened_log
    from hil.replay.lab_calibration import calibration_of, calibration_of_foreign
    from hil.replay.topic_map import load_topic_map

    if chart is None:
        return calibration_of(opened_log(log), follower, from_s, to_s)
    return calibration_of_foreign(opened_log(log), load_topic_map(chart, None, follower), from_s, to_s)


def _say_mounts(found: Mounts) -> None:
    """Print where bodies sit on their robots, and the lines of a scenario that say so."""
    from hil.replay.mount_calibration import said

    if not found.known:
        return
    say(said("leader", found))
    say(said("follower", found))
    if None in (found.follower.x, found.follower.y, found.follower.yaw):
        say(
            "what is not told takes half a minute with left and right turns; a follower that was stopped for "
            'its mount drives that with what is put in now, or with controller.mount_check = "warn"',
        )
    say("put into the scenario:")
    for key, mount in found.settings.items():
        section, _, name = key.partition(".")
        say(f"[{section}]\n{name} = [{', '.join(f'{value:g}' for value in mount)}]")


def _say_noise(found: Mapping[str, float]) -> None:
    """Print the lines of a scenario that tell the noise of the measurements."""
    from hil.replay.noise_calibration import said_noise

    if found:
        say(f"measurements scatter by, with which bounds and estimates begin:\n{said_noise(found)}")


def _say_timing(found: Calibration) -> None:
    """Print the timing, what is unknown of it, and its settings."""
    for name, known in found.timing.items():
        say(f"{name:19} {known.value:+.4f} s give or take {known.sd:.4f}: {_MEANINGS[name]}")
    for line in found.unknown:
        say(line)
    if found.uncertain:
        say("the offset of stamps is too uncertain to be set: drive for 30 s")
    if found.settings:
        options = " ".join(f"--set {key}={value:.4f}" for key, value in found.settings.items())
        say(f"run next with: {options}")


def _say_odometry(found: Mapping[str, Known | None]) -> None:
    """Print what the motion makes of odometry."""
    for name, known in found.items():
        if known is not None:
            say(f"{name:21} {known.value:+.4f} give or take {known.sd:.4f}: {_RESPONSES[name]}")


def _say_offsets(log: Path, found: SensorBias) -> None:
    """Print the offsets of a sensor and their settings."""
    offsets = {"range_bias": found.range, "bearing_bias": found.bearing}
    for (name, offset), unit in zip(offsets.items(), ("m", "rad"), strict=True):
        say(
            f"{name:12} {offset.value:+.4f} {unit} give or take {offset.sd:.4f}; "
            f"single ones scatter by {offset.spread:.4f}",
        )
    settings = " ".join(f"--set estimator.{name}={offset.value:.4f}" for name, offset in offsets.items())
    say(
        f"from {found.samples} sightings, {found.outliers} of them outliers; go on with: "
        f"abreast replay {log} {settings}",
    )
