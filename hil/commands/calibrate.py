"""``abreast calibrate``: the offsets of a range and bearing sensor, from a log that mocap has watched."""

from __future__ import annotations

from pathlib import Path

import click

from hil.errors import UsageError
from hil.report_json import print_json


@click.command("calibrate")
@click.argument("log", type=click.Path(path_type=Path))
@click.option("--from", "from_s", type=float, metavar="S", help="Use sightings from here on.")
@click.option("--to", "to_s", type=float, metavar="S", help="Use sightings up to here.")
@click.option("--json", "as_json", is_flag=True, help="Print the offsets as one JSON object on stdout.")
def command(log: Path, from_s: float | None, to_s: float | None, as_json: bool) -> None:
    """Compare the sightings in LOG with the mocap poses beside them, and say by how much they are off.

    --from and --to are seconds since the first sighting, for imported recordings the source's own time.
    """
    from hil.log.metadata import scenario_of
    from hil.log.reader import read_log
    from hil.replay.calibration import calibrate

    if from_s is not None and to_s is not None and to_s <= from_s:
        raise UsageError(f"--to {to_s:g}: expected more than --from {from_s:g}")
    given = read_log(log)
    scenario = scenario_of(given)
    if scenario is None:
        raise UsageError(f"log {log}: was not made by abreast; turn it into one with: abreast import")
    found = calibrate(given, scenario, from_s, to_s)
    offsets = {"range_bias": found.range, "bearing_bias": found.bearing}
    for (name, offset), unit in zip(offsets.items(), ("m", "rad"), strict=True):
        click.echo(
            f"{name:12} {offset.value:+.4f} {unit} give or take {offset.sd:.4f}; "
            f"single ones scatter by {offset.spread:.4f}",
            err=True,
        )
    settings = " ".join(f"--set estimator.{name}={offset.value:.4f}" for name, offset in offsets.items())
    click.echo(
        f"from {found.samples} sightings, {found.outliers} of them outliers; go on with: "
        f"abreast replay {log} {settings}",
        err=True,
    )
    if as_json:
        result: dict[str, object] = {"samples": found.samples, "outliers": found.outliers}
        for name, offset in offsets.items():
            result |= {name: offset.value, f"{name}_sd": offset.sd, f"{name}_spread": offset.spread}
        print_json(result)
